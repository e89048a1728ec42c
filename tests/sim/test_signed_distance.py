"""SignedDistance: against spheres and ellipsoids of the library, boxes in closed form, and differences."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import dojo_opt as dojo
from sim.mechanism import signed_distance
from sim.model.shape_kinds import Pair
from support.collide import collide_rows
from support.jacobians import differences

Array = np.ndarray
RADIUS = 0.3
BOUNDS = [[-0.45] * 3, [0.45] * 3]


def ball(x: Array) -> Array:
    return np.linalg.norm(x, axis=1) - RADIUS


def box(x: Array) -> Array:
    q = np.abs(x) - (0.2, 0.3, 0.25)
    return np.linalg.norm(np.maximum(q, 0.0), axis=1) + np.minimum(q.max(axis=1), 0.0)


def egg(x: Array) -> Array:
    """Not a distance: gaps are."""
    return 2.0 * (np.linalg.norm(x / (0.3, 0.2, 0.25), axis=1) - 1.0)


@pytest.mark.slow
def test_moments_are_those_of_a_sphere_and_a_box() -> None:
    sphere = dojo.SignedDistance.from_function(ball, BOUNDS, 0.03)
    assert sphere.volume() == pytest.approx(dojo.Sphere(RADIUS).volume(), rel=1e-3)
    np.testing.assert_allclose(sphere.inertia(2.0), dojo.Sphere(RADIUS).inertia(2.0), rtol=2e-3, atol=1e-9)
    cuboid = dojo.SignedDistance.from_function(box, np.array(BOUNDS) + (0.0, -0.05, 0.0) * np.array([[1], [-1]]), 0.025)
    solid = dojo.Box(0.4, 0.6, 0.5)
    assert cuboid.volume() == pytest.approx(solid.volume(), rel=6e-3)
    np.testing.assert_allclose(cuboid.inertia(2.0), solid.inertia(2.0), rtol=1e-2, atol=1e-6)
    moved = dojo.SignedDistance(sphere.values, np.array(sphere.origin) + (0.1, 0.0, 0.0), 0.03)
    with pytest.raises(ValueError, match="about_centroid"):
        moved.inertia(1.0)
    np.testing.assert_allclose(moved.about_centroid().inertia(2.0), sphere.inertia(2.0), rtol=1e-9, atol=1e-12)


@pytest.mark.slow
def test_a_density_becomes_distances_to_its_level() -> None:
    level = float(np.exp(-0.5 * (RADIUS / 0.2) ** 2))
    blob = dojo.SignedDistance.from_density(
        lambda x: np.exp(-0.5 * (x / 0.2) ** 2).prod(axis=1), level, 0.03, bounds=BOUNDS
    )
    exact = dojo.SignedDistance.from_function(ball, BOUNDS, 0.03)
    near = np.abs(np.asarray(exact.values)) < 0.08
    assert np.abs(np.asarray(blob.values) - exact.values)[near].max() < 1e-5
    assert np.abs(np.linalg.norm(blob.level_set.surface[0], axis=1) - RADIUS).max() < 2e-5


def test_a_mesh_of_a_box_is_a_box() -> None:
    corners = np.array([[x, y, z] for x in (-0.2, 0.2) for y in (-0.3, 0.3) for z in (-0.25, 0.25)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))]
    shape = dojo.SignedDistance.from_mesh((corners, np.array(faces)), 0.05)
    axes = [o + 0.05 * np.arange(n) for o, n in zip(shape.origin, np.shape(shape.values), strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    np.testing.assert_allclose(np.ravel(shape.values), box(grid), atol=1e-9)
    with pytest.raises(ValueError, match="not closed"):
        dojo.SignedDistance.from_mesh((corners, np.array(faces[1:])), 0.05)


def test_a_spacing_is_chosen_by_the_distance_from_the_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first one is as long as the ball; the second one keeps to a fortieth of it, and to its volume."""
    monkeypatch.setattr(signed_distance, "_PARTS_OF_LONGEST", (1, 8))
    vertices, faces = dojo.SignedDistance.from_function(ball, BOUNDS, 0.1).level_set.surface
    longest = np.ptp(vertices, axis=0).max()
    chosen = dojo.SignedDistance.from_mesh((vertices, faces))
    off = np.linalg.norm(chosen.level_set.settled(vertices)[0] - vertices, axis=1).max()
    assert chosen.spacing == longest / 8 and off <= longest / 40
    monkeypatch.setattr(signed_distance, "_PARTS_OF_LONGEST", (1,))
    with pytest.raises(ValueError, match="too thin for a spacing of 0.6"):
        dojo.SignedDistance.from_mesh((vertices, faces))


def test_a_mass_needs_a_grid_around_the_offset() -> None:
    """Volumes were counted inside the grid only, which an offset may leave; contacts may, too."""

    def sphere(offset: float) -> dojo.SignedDistance:
        return dojo.SignedDistance.from_function(
            lambda p: np.linalg.norm(p, axis=1) - 0.05, [[-0.08] * 3, [0.08] * 3], 0.02, offset=offset
        )

    assert sphere(0.025).volume() == pytest.approx(4.0 / 3.0 * np.pi * 0.075**3, rel=1e-2)
    assert dojo.Body("ball", inertia=(0.01, 0.01, 0.01), shape=sphere(0.1)).mass == 1.0
    with pytest.raises(
        ValueError, match=r"offset of 0.1 m the solid reaches beyond its grid, whose edge is 0.0325 m away"
    ):
        dojo.Body("ball", shape=sphere(0.1))


@pytest.mark.parametrize("kind", [Pair.SPHERE_FIELD, Pair.CAPSULE_FIELD], ids=["ball", "capsule"])
def test_distances_and_derivatives(kind: Pair, rng: np.random.Generator) -> None:
    """Near, deep and far off the grid; the gap to the egg against points of its surface."""
    shape = dojo.SignedDistance.from_function(egg, BOUNDS, 0.03, offset=0.01)
    sizes = np.array([0.1, 0.15, 0.0, 0.0, 0.0, shape.offset, 0.4, 0.0])
    surface = rng.normal(size=(200_000, 3))
    surface *= np.array([0.3, 0.2, 0.25]) / np.linalg.norm(surface, axis=1)[:, None]
    seen = set()
    for trial in range(8):
        R = Rotation.random(random_state=rng).as_matrix()
        r = rng.normal(size=3)
        r *= (0.2, 0.3, 0.4, 3.0)[trial % 4] / np.linalg.norm(r)
        for feature in range(3 if kind == Pair.CAPSULE_FIELD else 1):

            def at(twists: Array, feature: int = feature, R: Array = R, r: Array = r) -> Array:
                turns = Rotation.from_rotvec(twists[:, 3:]).as_matrix()
                places = turns @ r + twists[:, :3]
                out = collide_rows(int(kind), feature, sizes, shape.level_set.table, (turns @ R).reshape(-1, 9), places)
                return out[:, :7]

            here = np.zeros((1, 6))
            out = collide_rows(int(kind), feature, sizes, shape.level_set.table, R.reshape(1, 9), r[None])[0]
            if out[0] > 1e8:
                continue
            seen.add(feature)
            phi, n, p = out[0], out[1:4], out[4:7]
            center = p + n * (0.1 + 0.5 * phi)
            if np.linalg.norm(center / (0.3, 0.2, 0.25)) > 1.0:
                away = np.linalg.norm(surface - center, axis=1).min()
                assert phi + 0.11 == pytest.approx(away, abs=5e-4)
            np.testing.assert_allclose(at(here)[0], out[:7], atol=1e-14)
            expected, _ = differences(at, 6, rows=True)
            J = np.vstack([np.append(n, np.cross(p, n)), out[7:].reshape(6, 6)])
            assert np.abs(J - expected).max() <= 1e-6 * max(1.0, np.abs(expected).max())
    assert seen == ({0, 1, 2} if kind == Pair.CAPSULE_FIELD else {0})


def scene(obstacle: object, shape: object) -> dojo.Simulator:
    mech = dojo.Mechanism(
        [dojo.Body("a", 1.0, shape=shape)],
        [dojo.Joint("floating", None, "a")],
        collisions=[dojo.Collision("a", shape_b=obstacle, friction=0.5)],
    )
    return dojo.Simulator(mech, time_step=0.01)


def test_a_ball_rolls_off_as_off_a_sphere() -> None:
    """Onto the field and down its side, beside the same sphere as an ellipsoid; the derivatives too."""
    field = dojo.SignedDistance.from_function(ball, BOUNDS, 0.03)
    sims = [scene(s, dojo.Sphere(0.1)) for s in (dojo.Ellipsoid(*[RADIUS] * 3), field)]
    x = np.r_[0.03, 0.0, 0.45, 1.0, np.zeros(9)]
    exact, found = (sim.rollout(x, steps=60, throw=True) for sim in sims)
    assert np.ptp(exact.x[:, 0]) > 0.1  # it rolls
    np.testing.assert_allclose(found.x, exact.x, atol=3e-3)
    jacobians = [sim.linearize(exact.x[40]).A for sim in sims]
    np.testing.assert_allclose(jacobians[1], jacobians[0], atol=2e-2)


def test_bodies_stand_on_planes_with_points() -> None:
    cuboid = dojo.SignedDistance.from_function(box, [[-0.4, -0.5, -0.45], [0.4, 0.5, 0.45]], 0.05, offset=0.01)
    sim = scene(dojo.HalfSpace(), cuboid)
    run = sim.rollout(np.r_[0.0, 0.0, 0.35, 1.0, np.zeros(9)], steps=80, throw=True)
    assert run.x[-1, 2] == pytest.approx(0.26, abs=0.01)  # a fifth of a cell: its edges are as round as that
    assert np.abs(run.x[-1, 7:]).max() < 1e-3


def test_round_bodies_roll_on_planes() -> None:
    """A sphere stands on one ball, and keeps 5/7 of its speed."""
    field = dojo.SignedDistance.from_function(ball, BOUNDS, 0.03)
    sim = scene(dojo.HalfSpace(), field)
    assert len(field.stance().points) == 1
    run = sim.rollout(np.r_[0.0, 0.0, RADIUS, 1.0, np.zeros(3), 1.0, np.zeros(5)], steps=60, throw=True)
    assert run.x[-1, 7] == pytest.approx(5.0 / 7.0, rel=2e-2)
    assert run.x[-1, 2] == pytest.approx(RADIUS, abs=2e-3)  # balls within a twentieth of a cell are one


def test_what_is_refused() -> None:
    with pytest.raises(ValueError, match="there is no solid"):
        dojo.SignedDistance(np.ones((5, 5, 5)), (0, 0, 0), 0.1)
    with pytest.raises(ValueError, match="reaches the edge of the grid"):
        dojo.SignedDistance(-np.ones((5, 5, 5)), (0, 0, 0), 0.1)
    field = dojo.SignedDistance.from_function(ball, BOUNDS, 0.1)
    with pytest.raises(ValueError, match="a signed distance collides with spheres, capsules and half-spaces"):
        scene(field, dojo.Box(0.1, 0.1, 0.1))
