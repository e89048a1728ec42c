"""Pairs of shapes in special positions: stacked, parallel, concentric, standing; and seen from either side."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull, HalfspaceIntersection
from scipy.spatial.transform import Rotation

from sim.model.shape_kinds import SIZES, Pair
from support.shape_pairs import features

Array = np.ndarray
EYE = np.eye(3)
UP = np.array([0.0, 0.0, 1.0])


def contacts(kind: Pair, a: list[float], b: list[float], R: Array, r: Array) -> Array:
    """(n, 43): the contact points that exist."""
    sizes = np.zeros(2 * SIZES)
    sizes[: len(a)], sizes[SIZES : SIZES + len(b)] = a, b
    return np.array(features(kind, sizes, R, np.asarray(r, dtype=np.float64)))


def about(axis: str, degrees: float) -> Array:
    return Rotation.from_euler(axis, degrees, degrees=True).as_matrix()


def sorted_points(outs: Array) -> Array:
    return np.array(sorted(np.round(outs[:, 4:7], 9).tolist()))


# -- boxes on boxes ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("gap", [0.1, 0.0, -0.01])
def test_equal_boxes_exactly_on_top_of_each_other_touch_at_four_corners(gap: float) -> None:
    h = [0.2, 0.3, 0.1]
    outs = contacts(Pair.BOX_BOX, h, h, EYE, [0.0, 0.0, 0.2 + gap])
    np.testing.assert_allclose(outs[:, 0], gap, atol=1e-15)
    np.testing.assert_allclose(outs[:, 1:4], np.tile(UP, (4, 1)), atol=0.0)
    z = 0.1 + 0.5 * gap
    np.testing.assert_allclose(sorted_points(outs), [[-0.2, -0.3, z], [-0.2, 0.3, z], [0.2, -0.3, z], [0.2, 0.3, z]])


def test_rounding_changes_nothing_about_stacked_boxes(rng: np.random.Generator) -> None:
    h = [0.2, 0.3, 0.1]
    for _ in range(50):
        R = Rotation.from_rotvec(1e-9 * rng.normal(size=3)).as_matrix()
        outs = contacts(Pair.BOX_BOX, h, h, R, [0.0, 0.0, 0.2] + 1e-9 * rng.normal(size=3))
        assert len(outs) == 4
        np.testing.assert_allclose(outs[:, 1:4], np.tile(UP, (4, 1)), atol=1e-8)


def test_every_face_of_a_box_can_carry(rng: np.random.Generator) -> None:
    """Every pair of faces, above and below: the four vertices of the smaller face, and the normal of the faces."""
    a, b = np.array([0.1, 0.15, 0.2]), np.array([0.3, 0.35, 0.4])
    for turn in Rotation.create_group("O"):
        R = turn.as_matrix()
        for axis in range(3):
            for side in (-1.0, 1.0):
                n = side * EYE[axis]
                r = n * (b[axis] + np.abs(R[axis]) @ a - 1e-3)
                outs = contacts(Pair.BOX_BOX, list(a), list(b), R, r)
                assert len(outs) == 4
                np.testing.assert_allclose(outs[:, 0], -1e-3, atol=1e-12)
                np.testing.assert_allclose(outs[:, 1:4], np.tile(n, (4, 1)), atol=1e-12)


def test_crossed_boards_touch_where_their_edges_cross() -> None:
    outs = contacts(Pair.BOX_BOX, [1.0, 0.1, 0.05], [0.2, 1.0, 0.05], EYE, [0.0, 0.0, 0.1 - 1e-4])
    np.testing.assert_allclose(outs[:, 0], -1e-4, atol=1e-12)
    np.testing.assert_allclose(outs[:, 1:4], np.tile(UP, (4, 1)), atol=1e-12)
    np.testing.assert_allclose(np.abs(outs[:, 4:6]), np.tile([0.2, 0.1], (4, 1)), atol=1e-12)


def test_contact_points_of_parallel_faces_span_their_overlap(rng: np.random.Generator) -> None:
    """The convex hull of the points is the overlap of the two rectangles, by intersection of half-planes."""
    for _ in range(60):
        a, b = rng.uniform(0.1, 0.5, 3), rng.uniform(0.1, 0.5, 3)
        R, offset = about("z", rng.uniform(3, 87)), rng.uniform(-0.2, 0.2, 2)
        r = np.append(offset, a[2] + b[2] - 1e-6)
        planes = [[s * e[0], s * e[1], -b[i]] for i, e in enumerate(EYE[:2]) for s in (-1, 1)]
        planes += [[s * R[0, j], s * R[1, j], -a[j] - s * R[:2, j] @ offset] for j in range(2) for s in (-1, 1)]
        planes = np.array(planes)
        inner = 0.5 * offset
        if (planes[:, :2] @ inner + planes[:, 2] > -1e-3).any():
            continue
        expected = ConvexHull(HalfspaceIntersection(planes, inner).intersections)
        outs = contacts(Pair.BOX_BOX, list(a), list(b), R, r)
        np.testing.assert_allclose(outs[:, 1:4], np.tile(UP, (len(outs), 1)), atol=1e-12)
        np.testing.assert_allclose(outs[:, 0], -1e-6, atol=1e-12)
        np.testing.assert_allclose(ConvexHull(outs[:, 4:6]).volume, expected.volume, rtol=1e-6)
        assert len(outs) == len(expected.vertices)


def test_boxes_at_the_same_place_part_along_the_first_axis() -> None:
    outs = contacts(Pair.BOX_BOX, [0.1] * 3, [0.1] * 3, EYE, [0.0, 0.0, 0.0])
    np.testing.assert_allclose(outs[:, 0], -0.2, atol=1e-15)
    np.testing.assert_allclose(outs[:, 1:4], np.tile(EYE[0], (4, 1)), atol=0.0)


def test_the_least_distance_does_not_jump(rng: np.random.Generator) -> None:
    """Boxes in light contact, moved by 1e-8."""
    for trial in range(60):
        a, b = list(rng.uniform(0.1, 0.5, 3)), list(rng.uniform(0.1, 0.5, 3))
        R = Rotation.random(random_state=rng) if trial % 2 else Rotation.from_rotvec(1e-3 * rng.normal(size=3))
        R, direction = R.as_matrix(), rng.normal(size=3)
        low, high = 0.0, 2.0
        while high - low > 1e-12:
            r = 0.5 * (low + high) * direction
            inside = contacts(Pair.BOX_BOX, a, b, R, r)[:, 0].min() < -1e-3
            low, high = (0.5 * (low + high), high) if inside else (low, 0.5 * (low + high))
        for _ in range(4):
            moved = contacts(Pair.BOX_BOX, a, b, R, low * direction + 1e-8 * rng.normal(size=3))[:, 0].min()
            np.testing.assert_allclose(moved, -1e-3, atol=2e-7)


# -- capsules ----------------------------------------------------------------------------------------------------------


def test_parallel_capsules_touch_at_the_ends_of_their_overlap() -> None:
    for turn in (EYE, about("x", 180.0)):
        outs = contacts(Pair.CAPSULE_CAPSULE, [0.1, 0.5], [0.2, 0.4], turn, [0.3, 0.0, 0.3])
        np.testing.assert_allclose(outs[:, 0], 0.0, atol=1e-15)
        np.testing.assert_allclose(outs[:, 1:4], np.tile(EYE[0], (2, 1)), atol=1e-12)
        np.testing.assert_allclose(sorted_points(outs), [[0.2, 0.0, -0.2], [0.2, 0.0, 0.4]], atol=1e-9)
        # the ends slide along the other capsule: moving along z does not turn the normals
        np.testing.assert_allclose(outs[:, [9, 15, 21]], 0.0, atol=1e-12)


def test_equal_parallel_capsules_touch_at_both_ends() -> None:
    outs = contacts(Pair.CAPSULE_CAPSULE, [0.1, 0.5], [0.1, 0.5], EYE, [0.2, 0.0, 0.0])
    np.testing.assert_allclose(sorted_points(outs), [[0.1, 0.0, -0.5], [0.1, 0.0, 0.5]], atol=1e-9)
    np.testing.assert_allclose(outs[:, [9, 15, 21]], 0.0, atol=1e-12)


def test_crossed_capsules_touch_where_they_cross() -> None:
    outs = contacts(Pair.CAPSULE_CAPSULE, [0.1, 0.5], [0.1, 0.5], about("y", 90.0), [0.2, 0.19, -0.1])
    best = outs[np.argmin(outs[:, 0])]
    np.testing.assert_allclose(best[0], -0.01, atol=1e-15)
    np.testing.assert_allclose(best[1:7], [0.0, 1.0, 0.0, 0.0, 0.095, -0.1], atol=1e-15)


def test_a_capsule_lies_on_a_box_at_two_points() -> None:
    """Inside the face: at its ends. Longer than the face: where it crosses the edges."""
    for half, ends in ((0.2, 0.2), (0.6, 0.4)):
        outs = contacts(Pair.CAPSULE_BOX, [0.1, half], [0.4, 0.3, 0.2], about("y", 90.0), [0.0, 0.05, 0.299])
        outs = outs[outs[:, 0] < 0.05]
        np.testing.assert_allclose(outs[:, 0], -1e-3, atol=1e-12)
        np.testing.assert_allclose(outs[:, 1:4], np.tile(UP, (2, 1)), atol=1e-12)
        np.testing.assert_allclose(sorted_points(outs)[:, 0], [-ends, ends], atol=1e-9)


def test_a_capsule_across_the_edge_of_a_box_touches_it_at_one_point() -> None:
    n = np.array([0.0, 1.0, 1.0]) / np.sqrt(2.0)
    edge = np.array([0.1, 0.3, 0.2])
    outs = contacts(Pair.CAPSULE_BOX, [0.1, 0.2], [0.5, 0.3, 0.2], about("x", 45.0), edge + 0.099 * n)
    (touching,) = outs[outs[:, 0] < 0.05]
    np.testing.assert_allclose(touching[0], -1e-3, atol=1e-12)
    np.testing.assert_allclose(touching[1:4], n, atol=1e-12)
    np.testing.assert_allclose(touching[4:7], edge - 5e-4 * n, atol=1e-12)


# -- one centre in the other -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "b", "normal", "depth"),
    [
        (Pair.SPHERE_SPHERE, [0.2], UP, 0.3),
        (Pair.SPHERE_CAPSULE, [0.2, 0.5], -EYE[0], 0.3),
        (Pair.SPHERE_BOX, [0.2, 0.2, 0.2], EYE[0], 0.3),
        (Pair.SPHERE_BOX, [0.4, 0.3, 0.2], UP, 0.3),
        (Pair.SPHERE_CYLINDER, [0.4, 0.2], UP, 0.3),
        (Pair.SPHERE_CYLINDER, [0.2, 0.4], -EYE[0], 0.3),
    ],
)
def test_a_sphere_at_the_center_has_a_stated_way_out(kind: Pair, b: list[float], normal: Array, depth: float) -> None:
    (out,) = contacts(kind, [0.1], b, EYE, [0.0, 0.0, 0.0])
    np.testing.assert_allclose(out[0], -depth, atol=1e-15)
    np.testing.assert_array_equal(out[1:4], normal)


def test_a_string_pulls_when_it_is_longer_than_it_may_be() -> None:
    (out,) = contacts(Pair.STRING, [0.5], [], EYE, [0.0, 0.0, 0.8])
    np.testing.assert_allclose(out[:7], [-0.3, 0.0, 0.0, -1.0, 0.0, 0.0, 0.4], atol=1e-15)


# -- wheels and cylinders ----------------------------------------------------------------------------------------------


def test_a_standing_cylinder_stands_on_three_points_and_the_middle() -> None:
    outs = contacts(Pair.CYLINDER_HALFSPACE, [0.3, 0.2], [], EYE, [0.0, 0.0, 0.2])
    below = outs[outs[:, 0] < 0.1]
    np.testing.assert_allclose(below[:, 0], 0.0, atol=1e-15)
    radii = np.linalg.norm(below[:, 4:6], axis=1)
    np.testing.assert_allclose(np.sort(radii), [0.0, 0.3, 0.3, 0.3], atol=1e-15)
    np.testing.assert_allclose(below[:, 4:6].sum(axis=0), 0.0, atol=1e-15)
    assert np.isfinite(outs).all()


def test_a_wheel_rolls_on_the_lowest_points_of_its_rims() -> None:
    for degrees in (0.0, 30.0, 77.0):
        R = about("x", 90.0) @ about("z", degrees)
        outs = contacts(Pair.CYLINDER_HALFSPACE, [0.3, 0.1], [], R, [1.0, 2.0, 0.3])
        assert len(outs) == 2
        np.testing.assert_allclose(outs[:, 0], 0.0, atol=3e-5)
        np.testing.assert_allclose(sorted_points(outs)[:, :2], [[1.0, 1.9], [1.0, 2.1]], atol=1e-9)
        # rolling about the axle (y) moves no contact point beyond the translation of the wheel
        np.testing.assert_allclose(outs[:, 7:25], 0.0, atol=0.0)


# pairs whose elements are chosen once per pose, by `arrange`, have tests of their own: test_polytope_steps.py, test_cylinders.py
_ARRANGED = (Pair.POLYTOPE_POLYTOPE, Pair.POLYTOPE_CYLINDER, Pair.CYLINDER_CYLINDER)


@pytest.mark.parametrize("kind", [p for p in Pair if p not in _ARRANGED and not p.name.endswith("FIELD")])
def test_aligned_shapes_on_a_grid_have_a_point_and_finite_numbers(kind: Pair) -> None:
    """Every tie at once: centres on a grid of half sizes, axes along axes."""
    for turn in list(Rotation.create_group("O"))[::5]:
        for i in range(0, 125, 3):
            r = 0.2 * (np.array([i % 5, i // 5 % 5, i // 25]) - 2.0)
            outs = contacts(kind, [0.2] * 3, [0.2] * 3, turn.as_matrix(), r)
            assert len(outs) >= 1
            assert np.isfinite(outs).all()
            np.testing.assert_allclose(np.linalg.norm(outs[:, 1:4], axis=1), 1.0, atol=1e-14)


# -- exchange of a and b -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [Pair.SPHERE_SPHERE, Pair.CAPSULE_CAPSULE, Pair.BOX_BOX, Pair.STRING])
def test_the_deepest_point_is_the_same_from_either_side(kind: Pair, rng: np.random.Generator) -> None:
    checked = 0
    for _ in range(60):
        a, b = list(rng.uniform(0.1, 0.4, 3)), list(rng.uniform(0.1, 0.4, 3))
        if kind == Pair.STRING:
            a = b
        R, r = Rotation.random(random_state=rng).as_matrix(), 0.5 * rng.normal(size=3)
        one = min(contacts(kind, a, b, R, r), key=lambda out: out[0])
        other = min(contacts(kind, b, a, R.T, -R.T @ r), key=lambda out: out[0])
        if kind == Pair.BOX_BOX and one[0] < -0.02:
            continue  # inside, a depth below a face need not equal the depth of the other box
        checked += 1
        np.testing.assert_allclose(other[0], one[0], atol=2e-5)
        np.testing.assert_allclose(-R @ other[1:4], one[1:4], atol=1e-3)
        np.testing.assert_allclose(R @ other[4:7] + r, one[4:7], atol=1e-3)
    assert checked > 20
