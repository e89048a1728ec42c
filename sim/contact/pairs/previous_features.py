"""Features at the beginning of a step: their gaps, the overlap allowed, and those that pressed.

The latter stay active beside new ones if a solution with either set overlaps in the other. Collisions of polytopes and
of cylinders have room for them (sim/contact/collision/feature_code.py).
"""

from __future__ import annotations

from math import sqrt

from sim.contact.collision.box import to_a, to_b
from sim.contact.collision.feature_code import substitute_code
from sim.contact.collision.polytope_table import touching_corners
from sim.contact.collision.rim import LEVEL
from sim.contact.collision.witness import dot
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import Cone, Hull, PairSize, RelativePose, Witness
from sim.model.shape_kinds import RIM_POINTS, SWAPPED, Pair
from sim.model.slots import Slot
from solvers.compiler import inner_kernel, kernel, optional
from solvers.rotation import Vec3, three
from solvers.types import Matrix, Vector

NEAR = 1e-3  # part of the smallest size of two shapes below which a gap is one that presses


@inner_kernel
def last_point(model: Model, first: int) -> int:
    """End of the points of the collision whose first pair this is."""
    end = first + 1
    while end < model.pair_kind.shape[0] and model.pair_feature[end] > 0:
        end += 1
    return end


@kernel
def rounding_of_rims(model: Model, j: int) -> float:
    """How much deeper than their contact points say the shapes of pair j may overlap: the point of a rim that is
    farthest along a normal is rounded by LEVEL of its radius (sim/contact/collision/rim.py). 0 without cylinders.
    """
    kind, sizes = model.pair_kind[j] % SWAPPED, model.pair_sizes[j]
    if kind == Pair.CYLINDER_CYLINDER:
        return LEVEL * max(sizes[PairSize.A], sizes[PairSize.B])
    return LEVEL * sizes[PairSize.B] if kind == Pair.POLYTOPE_CYLINDER else 0.0


@kernel
def overlap_before(model: Model, j: int) -> float:
    """By how much elements of pair j may overlap where a step begins, and still be chosen [m]."""
    return NEAR * model.pair_least[j] + rounding_of_rims(model, j)


@kernel
def overlapped(model: Model, data: Data, j: int) -> float:
    """Overlap of the shapes of pair j, the first of a collision, where the step began, beyond rounding [m]."""
    return max(0.0, -(data.pair_before[j, RelativePose.GAP] + overlap_before(model, j)))


@inner_kernel
def has_no_room(kind: int) -> bool:
    """Whether a kind of pair is none of polytopes or cylinders: points of the others have sides that stay open."""
    return kind % SWAPPED < Pair.POLYTOPE_POLYTOPE


@inner_kernel
def room(kind: int, sizes: Vector, hull: Matrix) -> int:
    """First of the points of a collision that may be made of any elements; very many where there is none."""
    kind %= SWAPPED
    if kind == Pair.CYLINDER_CYLINDER:
        return 2 * RIM_POINTS
    if kind == Pair.POLYTOPE_CYLINDER:
        a = int(sizes[0])
        return int(hull[a, Hull.CORNERS]) + (RIM_POINTS if hull[a, Hull.FACES] > 0.0 else 0)
    if kind == Pair.POLYTOPE_POLYTOPE:
        na, nb = touching_corners(hull, int(sizes[0]), int(sizes[PairSize.B]))
        return na + nb
    return 1 << 40


@inner_kernel
def moved_since(kind: int, out: Vector, pose: Vector, before: Vector) -> Vec3:
    """How far the two points of a contact at `pose` have moved past each other since the pose `before`.

    p' = R' R^T (p - r) + r' of a point p of shape a, in the frame of b; of one of b in the frame of a, where the two
    have changed places, p' = R'^T (R p + r - r').
    """
    R, r, s = pose[:9], three(pose, RelativePose.CENTER), three(before, RelativePose.CENTER)
    p = three(out, Witness.POINT)
    if kind < SWAPPED:
        q = to_b(before[:9], to_a(R, (p[0] - r[0], p[1] - r[1], p[2] - r[2])))
        return p[0] - q[0] - s[0], p[1] - q[1] - s[1], p[2] - q[2] - s[2]
    q = to_b(R, p)
    q = to_a(before[:9], (q[0] + r[0] - s[0], q[1] + r[1] - s[1], q[2] + r[2] - s[2]))
    return p[0] - q[0], p[1] - q[1], p[2] - q[2]


@kernel
def left_behind(data: Data, kind: int, out: Vector, pose: Vector, before: Vector, least: float) -> bool:
    """Whether the two points of a contact at `pose` were closer than `least` at the pose `before`, along the normal at
    `pose`: they have moved apart since then, whatever the normal was on the way.

    Otherwise the normal of separated shapes may have turned by the angle between the two poses, which makes the
    points appear closer than they were, by that angle times their motion.
    """
    moved = moved_since(kind, out, pose, before)
    if data.overlap_allowed[0] == 1:
        turn = 0.0
        for k in range(9):
            turn += (pose[k] - before[k]) ** 2
        least -= sqrt(0.5 * turn * dot(moved, moved))
    return out[Witness.GAP] - dot(three(out, Witness.NORMAL), moved) < least


@optional(Slot.REMEMBER_ELEMENTS, seldom=True)
def remember(model: Model, data: Data, first: int) -> None:
    """pair_previous: the features of the points of a collision that press; 0 for the others."""
    close = NEAR * model.pair_least[first]
    ground = model.contact_height.shape[0]
    for j in range(first, last_point(model, first)):
        pressing = data.pair_code[j] != 0 and data.cone[ground + j, Cone.SLACK] < close
        data.pair_previous[j] = data.pair_code[j] if pressing else 0


@kernel
def keep(model: Model, data: Data, first: int) -> None:
    """Features of pair_previous that were not chosen again take the places of points that there are not now."""
    end = last_point(model, first)
    begin = first + room(model.pair_kind[first], model.pair_sizes[first], model.hull)
    free = begin
    for j in range(first, end):
        kept = data.pair_previous[j]
        if kept == 0 or kept == data.pair_code[j]:
            continue
        if j < begin:
            kept = substitute_code(j - first, kept)
        for k in range(begin, end):
            if data.pair_code[k] == kept:
                kept = 0
        while free < end and data.pair_code[free] != 0:
            free += 1
        if kept != 0 and free < end:
            data.pair_code[free] = kept
