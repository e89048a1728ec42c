"""Pairs of shapes: distances against independent ones, derivatives against differences, bounds."""

from __future__ import annotations

from math import inf

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.spatial.transform import Rotation

from sim.contact.collision.edge_axes import OPEN
from sim.mechanism.shapes import Box, Capsule, HalfSpace, Solid, Sphere, String
from sim.model.shape_kinds import OUT, SIZES, SWAPPED, Pair, Shape, count, pair
from support.collide import arrange, choose, collide_chosen, open_sides
from support.jacobians import differences
from support.shape_pairs import CORE, NAMES, NO_HULL, SIMPLE, contacts_at, deepest, random_pose, shapes, touch

Array = np.ndarray
SOLIDS: dict[Shape, type[Solid]] = {Shape.SPHERE: Sphere, Shape.CAPSULE: Capsule, Shape.BOX: Box}
ROUND = {Shape.SPHERE: 1, Shape.CAPSULE: 1, Shape.BOX: 0}  # how many sizes are a radius around the core


def solid(shape: Shape, sizes: Array) -> Solid:
    """The shape with sizes as kernels have them."""
    make = SOLIDS[shape]
    return make(*(size / unit for size, (_, unit) in zip(sizes, make.surface.values(), strict=False)))


# -- derivatives -------------------------------------------------------------------------------------------------------


@pytest.mark.sweep(5)
@pytest.mark.parametrize("depth", [-0.1, -1e-9, 0.05], ids=["near", "touching", "deep"])
@pytest.mark.parametrize("kind", SIMPLE, ids=NAMES.get)
def test_derivatives_are_central_differences(kind: Pair, depth: float, rng: np.random.Generator) -> None:
    """d phi = n.(v + w x p), dn and dp, of every feature."""
    seen = set()
    for trial in range(10):
        sizes = rng.uniform(0.15, 0.5, 2 * SIZES)
        if kind == Pair.CAPSULE_CAPSULE:
            sizes[[1, 5]] += 1.0  # long enough to cross
        R, r = random_pose(rng, kind, sizes, depth, aligned=trial % 2 == 1)
        for feature in range(count(kind)):
            out = touch(kind, feature, sizes, R, r)
            if out[0] > 1e8:
                continue

            def moved(twists: Array, feature: int = feature, sizes: Array = sizes, R: Array = R, r: Array = r) -> Array:
                turns = Rotation.from_rotvec(twists[:, 3:]).as_matrix()
                return contacts_at(kind, feature, sizes, turns @ R, turns @ r + twists[:, :3])

            expected, doubt = differences(moved, 6, rows=True)
            n, p = out[1:4], out[4:7]
            J = np.vstack([np.append(n, np.cross(p, n)), out[7:].reshape(6, 6)])
            np.testing.assert_allclose(np.linalg.norm(n), 1.0, atol=1e-14)
            assert np.abs(J - expected).max() <= 1e-6 * max(1.0, np.abs(expected).max()), (feature, doubt)
            seen.add(feature)
    assert len(seen) >= (8 if count(kind) >= 8 else min(3, count(kind)))


@pytest.mark.parametrize("kind", [p for p in SIMPLE if p != Pair.STRING], ids=NAMES.get)
def test_pairs_that_have_changed_places(kind: Pair, rng: np.random.Generator) -> None:
    """The same contact from the other side, with derivatives by the motion of b in the frame of a."""
    found = 0
    for trial in range(4):
        sizes = rng.uniform(0.15, 0.5, 2 * SIZES)
        R, r = random_pose(rng, kind, sizes, 0.02, aligned=trial % 2 == 1)
        for feature in range(count(kind)):
            swapped = int(kind) + SWAPPED

            def moved(
                twists: Array,
                pair: int = swapped,
                feature: int = feature,
                sizes: Array = sizes,
                R: Array = R,
                r: Array = r,
            ) -> Array:
                """b turned and shifted in the frame of a: seen from b, a moves the other way."""
                turns = Rotation.from_rotvec(twists[:, 3:]).as_matrix() @ R.T
                back = turns.transpose(0, 2, 1)
                return contacts_at(pair, feature, sizes, back, r - np.einsum("nij,nj->ni", back, twists[:, :3]))

            out, before = touch(swapped, feature, sizes, R, r), touch(kind, feature, sizes, R, r)
            if out[0] > 1e8:
                continue
            np.testing.assert_allclose(
                out[:7], [before[0], *(-R.T @ before[1:4]), *(R.T @ (before[4:7] - r))], atol=1e-12
            )
            expected, _ = differences(moved, 6, rows=True)
            n, p = out[1:4], out[4:7]
            J = np.vstack([np.append(n, np.cross(p, n)), out[7:].reshape(6, 6)])
            assert np.abs(J - expected).max() <= 1e-6 * max(1.0, np.abs(expected).max()), feature
            found += 1
    assert found >= 4


# -- distances ---------------------------------------------------------------------------------------------------------


def core(shape: Shape, sizes: Array) -> tuple[Array, Array, float]:
    """Shape as {B y : |y| <= h} with a radius around it."""
    if shape == Shape.BOX:
        return np.eye(3), sizes[:3], 0.0
    if shape == Shape.CAPSULE:
        return np.eye(3)[:, 2:], sizes[1:2], sizes[0]
    return np.zeros((3, 0)), sizes[:0], sizes[0]


def least_squares_distance(kind: Pair, sizes: Array, R: Array, r: Array) -> float:
    """min |r + R A x - B y| over the two cores, less the radii."""
    (A, ha, ra), (B, hb, rb) = (core(s, v) for s, v in zip(shapes(kind), (sizes[:4], sizes[4:]), strict=True))
    M, h = np.hstack([R @ A, -B]), np.append(ha, hb)
    x = lsq_linear(M, -r, (-h, h), method="bvls", tol=1e-15, max_iter=300).x if h.size else h
    return float(np.linalg.norm(r + M @ x)) - ra - rb


@pytest.mark.parametrize("kind", CORE, ids=NAMES.get)
def test_least_distance_agrees_with_bounded_least_squares(kind: Pair, rng: np.random.Generator) -> None:
    """Outside of the cores, also with faces and edges that are almost parallel."""
    checked = 0
    for trial in range(150):
        sizes = rng.uniform(0.1, 0.5, 2 * SIZES)
        R, r = Rotation.random(random_state=rng).as_matrix(), 0.7 * rng.normal(size=3)
        if trial % 3 == 0:
            R = Rotation.from_rotvec(rng.normal(size=3) * 10.0 ** rng.uniform(-9, -1)).as_matrix()
        expected = least_squares_distance(kind, sizes, R, r)
        if expected + sum(core(s, v)[2] for s, v in zip(shapes(kind), (sizes[:4], sizes[4:]), strict=True)) < 1e-3:
            continue
        checked += 1
        # borders of faces are widened by 1e-4: a vertex within this distance of a border counts as above the face
        np.testing.assert_allclose(deepest(kind, sizes, R, r)[0], expected, atol=2e-5)
    assert checked > 75


MUJOCO = {
    Shape.SPHERE: ("sphere", 1),
    Shape.CAPSULE: ("capsule", 2),
    Shape.BOX: ("box", 3),
    Shape.CYLINDER: ("cylinder", 2),
    Shape.ELLIPSOID: ("ellipsoid", 3),
}


@pytest.mark.parametrize("kind", [p for p in SIMPLE if p != Pair.STRING], ids=NAMES.get)
def test_distance_and_normal_agree_with_mujoco(kind: Pair, rng: np.random.Generator) -> None:
    mujoco = pytest.importorskip("mujoco")
    a, b = shapes(kind)

    def geom(name: str, shape: Shape, sizes: Array) -> str:
        if shape == Shape.HALFSPACE:
            return '<geom name="b" type="plane" size="10 10 1"/>'
        form, n = MUJOCO[shape]
        return f'<geom name="{name}" type="{form}" size="{" ".join(map(repr, sizes[:n].tolist()))}"/>'

    for _ in range(8):
        sizes = rng.uniform(0.15, 0.5, 2 * SIZES)
        R, r = random_pose(rng, kind, sizes, -rng.uniform(0.02, 0.3))
        bodies = f'<body mocap="true" name="a">{geom("a", a, sizes)}</body>{geom("b", b, sizes[4:])}'
        model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
        data = mujoco.MjData(model)
        data.mocap_pos[0] = r
        data.mocap_quat[0] = Rotation.from_matrix(R).as_quat(scalar_first=True)
        mujoco.mj_forward(model, data)
        segment = np.empty(6)
        distance = mujoco.mj_geomDistance(model, data, model.geom("b").id, model.geom("a").id, 10.0, segment)
        out = deepest(kind, sizes, R, r)
        # MuJoCo iterates to 1e-6; the lowest point of a rim of radius 0.5 is rounded by 5e-5
        np.testing.assert_allclose(out[0], distance, atol=6e-5)
        np.testing.assert_allclose(out[1:4], (segment[3:] - segment[:3]) / distance, atol=5e-3)
        if kind != Pair.CYLINDER_HALFSPACE:
            np.testing.assert_allclose(out[4:7], 0.5 * (segment[3:] + segment[:3]), atol=5e-3)


# -- arrangements, bounds, order ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", SIMPLE, ids=NAMES.get)
def test_the_elements_chosen_at_a_pose_make_the_contact_there(kind: Pair, rng: np.random.Generator) -> None:
    for trial in range(10):
        sizes = rng.uniform(0.15, 0.5, 2 * SIZES)
        R, r = random_pose(rng, kind, sizes, 0.04 * rng.normal(), aligned=trial % 2 == 0)
        arrangement = arrange(int(kind), sizes, NO_HULL, R.ravel(), r, OPEN)
        for feature in range(count(kind)):
            one, other = np.empty(OUT), np.empty(OUT)
            code = choose(int(kind), feature, arrangement, sizes, NO_HULL, R.ravel(), r, one)
            collide_chosen(int(kind), feature, code, sizes, NO_HULL, R.ravel(), r, other)
            np.testing.assert_array_equal(one, touch(kind, feature, sizes, R, r))
            np.testing.assert_array_equal(other, one)
            assert (code == 0) == (one[0] == 1e9)


@pytest.mark.parametrize("kind", [Pair.CAPSULE_BOX, Pair.BOX_BOX], ids=NAMES.get)
def test_the_side_that_separates_stays_open_and_the_others_are_closed(kind: Pair, rng: np.random.Generator) -> None:
    """Shapes apart: the same arrangement as without sides. Then a moved through b to its other side: they overlap."""
    for _ in range(50):
        sizes = rng.uniform(0.15, 0.5, 2 * SIZES)
        R, r = random_pose(rng, kind, sizes, -0.05)
        sides = open_sides(int(kind), sizes, NO_HULL, R.ravel(), r)
        assert arrange(int(kind), sizes, NO_HULL, R.ravel(), r, sides) == arrange(
            int(kind), sizes, NO_HULL, R.ravel(), r, OPEN
        )
        assert arrange(int(kind), sizes, NO_HULL, R.ravel(), -r, OPEN)[2] > 0.0
        if kind == Pair.BOX_BOX:
            assert arrange(int(kind), sizes, NO_HULL, R.ravel(), -r, sides)[2] < 0.0


@pytest.mark.parametrize("kind", [p for p in CORE if p != Pair.SPHERE_SPHERE], ids=NAMES.get)
def test_shapes_are_at_least_as_far_apart_as_the_balls_around_them(kind: Pair, rng: np.random.Generator) -> None:
    a, b = shapes(kind)
    outcomes = set()
    for _ in range(100):
        sizes = rng.uniform(0.1, 0.5, 2 * SIZES)
        R, r = Rotation.random(random_state=rng).as_matrix(), rng.normal(size=3)
        bound = float(np.linalg.norm(r)) - solid(a, sizes[:4]).bounding_radius() - solid(b, sizes[4:]).bounding_radius()
        if bound > 0.0:
            assert deepest(kind, sizes, R, r)[0] >= bound - 1e-12
        outcomes.add(bound > 0.0)
    assert outcomes == {True, False}


def test_nothing_is_around_a_half_space_or_a_string() -> None:
    assert HalfSpace().bounding_radius() == String(1.0).bounding_radius() == inf


def test_pairs_have_one_order() -> None:
    for kind in Pair:
        a, b = shapes(kind)
        assert pair(b, a) == (kind, a != b)
    assert pair(Shape.HALFSPACE, Shape.HALFSPACE) is None
    assert pair(Shape.CYLINDER, Shape.STRING) is None
