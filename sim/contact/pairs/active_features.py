"""The active features of two shapes: the faces, edges and corners in contact. A discrete choice, made once per attempt.

They are chosen where an attempt starts, and kept. A solution at which the shapes overlap in other features is refused;
these become active, and the step is solved again; both sets, if each solution overlaps in the other set. Only features
that did not overlap when the step began are chosen. A small overlap of a feature that is reached within the step is
left to the next step (`overlap_allowed`, `left_behind`). Reasons: docs/theory/active_features.md.
"""

from __future__ import annotations

from sim.contact.collision.collide import arrange, choose, collide_chosen, instead, open_sides
from sim.contact.collision.edge_axes import OPEN
from sim.contact.pairs.cylinder_pairs import choose_cylinders, cylinder_before, cylinder_distance, on_cylinder
from sim.contact.pairs.pair_pose import place_shapes
from sim.contact.pairs.previous_features import (
    NEAR,
    has_no_room,
    keep,
    last_point,
    left_behind,
    overlap_before,
    remember,
    rounding_of_rims,
)
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import FeatureChoice, Verdict
from sim.model.record_columns import Cone, RelativePose, Witness
from sim.model.slots import Slot
from solvers.compiler import kernel, optional

_OVERLAP = 1e-4  # part of the smallest size by which shapes may overlap at the end of a step
_LAST_RESORT = 1e-2  # the same, where elements are chosen at every pose, and where other attempts found no less


@optional(Slot.OPEN_PAIRS, seldom=True)
def open_pairs(model: Model, data: Data, j: int) -> float:
    """Where a collision begins: pair_before, the pose at configuration 2 now in pair_relative, and pair_sides, the axes
    that separate the shapes; returns their distance.
    """
    for k in range(12):
        data.pair_before[j, k] = data.pair_relative[j, k]
    pose = data.pair_before[j]
    data.pair_sides[j] = open_sides(
        model, model.pair_kind[j], model.pair_sizes[j], pose[:9], pose[9 : RelativePose.GAP]
    )
    apart = distance(model, data, j)
    data.pair_before[j, RelativePose.GAP] = min(apart, 0.0) - overlap_before(model, j)
    return apart


@kernel
def distance(model: Model, data: Data, first: int) -> float:
    """Distance of the shapes of a collision at pair_relative, whatever elements are chosen."""
    kind = model.pair_kind[first]
    if on_cylinder(kind):
        return cylinder_distance(model, data, first)
    pose = data.pair_relative[first]
    faces = arrange(model, kind, model.pair_sizes[first], pose[:9], pose[9:], OPEN)
    g = data.pair_trial[0]
    least = 1e300
    j = first
    while j < model.pair_kind.shape[0] and (j == first or model.pair_feature[j] > 0):
        choose(model, kind, j - first, faces, model.pair_sizes[j], pose[:9], pose[9:], g)
        least = min(least, g[Witness.GAP])
        j += 1
    return least


@optional(Slot.CHOOSE_SHAPES, seldom=True)
def choose_shapes(model: Model, data: Data, first: int) -> None:
    """pair_code, pair_out: the elements of all points of a collision, chosen at pair_relative."""
    kind = model.pair_kind[first]
    if data.feature_choice[0] == FeatureChoice.WITH_PREVIOUS:
        remember(model, data, first)
    if on_cylinder(kind):
        choose_cylinders(model, data, first)
        return
    pose = data.pair_relative[first]
    faces = arrange(model, kind, model.pair_sizes[first], pose[:9], pose[9:], data.pair_sides[first])
    j = first
    while j < model.pair_kind.shape[0] and (j == first or model.pair_feature[j] > 0):
        sizes = model.pair_sizes[j]
        code = choose(model, kind, j - first, faces, sizes, pose[:9], pose[9:], data.pair_out[j])
        if code > 1 or code < 0:  # a choice
            code = substitute_elements(model, data, first, j, code)
        data.pair_code[j] = code
        j += 1
    if data.feature_choice[0] == FeatureChoice.WITH_PREVIOUS:
        keep_elements(model, data, first)


@optional(Slot.SUBSTITUTE_ELEMENTS, seldom=True)
def substitute_elements(model: Model, data: Data, first: int, j: int, code: int) -> int:
    """The elements of point j and its pair_out, chosen at pair_relative: others, or none, instead of those that
    overlapped when the step began.
    """
    kind, sizes, g = model.pair_kind[first], model.pair_sizes[j], data.pair_trial[0]
    pose, before = data.pair_relative[first], data.pair_before[first]
    collide_chosen(model, kind, j - first, code, sizes, before[:9], before[9 : RelativePose.GAP], g)
    if g[Witness.GAP] < before[RelativePose.GAP] and left_behind(
        data, kind, data.pair_out[j], pose, before, before[RelativePose.GAP]
    ):
        code = instead(model, kind, j - first, sizes, before[:9], before[9 : RelativePose.GAP])
        collide_chosen(model, kind, j - first, code, sizes, before[:9], before[9 : RelativePose.GAP], g)
        code = code if g[Witness.GAP] >= before[RelativePose.GAP] else 0
        collide_chosen(model, kind, j - first, code, sizes, pose[:9], pose[9:], data.pair_out[j])
    return code


@optional(Slot.KEEP_ELEMENTS, seldom=True)
def keep_elements(model: Model, data: Data, first: int) -> None:
    """`keep`, and pair_out of all points of the collision."""
    kind, pose = model.pair_kind[first], data.pair_relative[first]
    keep(model, data, first)
    for k in range(first, last_point(model, first)):
        sizes = model.pair_sizes[k]
        collide_chosen(model, kind, k - first, data.pair_code[k], sizes, pose[:9], pose[9:], data.pair_out[k])


@optional(Slot.CHOOSE_PAIRS)
def choose_pairs(model: Model, data: Data) -> None:
    """`choose_shapes` of the active collisions, at configuration 3."""
    for m in range(data.near_collision_count[0]):
        j = data.near_collisions[m]
        if data.pair_activation[j] == 0.0:
            place_shapes(model, data, j, data.pos3, data.rot3)
            choose_shapes(model, data, j)


@kernel
def passed_through(model: Model, data: Data, first: int) -> bool:
    """Whether a point of a collision presses at configuration 3 though its elements, as they are there, have moved
    apart since the step began: beyond a line or a corner, whose distance has no sign, or far from where they were
    chosen.
    """
    kind = model.pair_kind[first]
    before = data.pair_before[first]
    g = data.pair_trial[0]
    close = NEAR * model.pair_least[first]
    least = before[RelativePose.GAP] - _LAST_RESORT * model.pair_least[first]
    ground = model.contact_height.shape[0]
    j = first
    while j < model.pair_kind.shape[0] and (j == first or model.pair_feature[j] > 0):
        code = data.pair_code[j]
        if code != 0 and data.cone[ground + j, Cone.SLACK] < close:
            if on_cylinder(kind):
                cylinder_before(model, data, first, j)
            else:
                sizes = model.pair_sizes[first]
                collide_chosen(model, kind, j - first, code, sizes, before[:9], before[9 : RelativePose.GAP], g)
            now = data.pair_out[j]
            turned = (
                now[Witness.NORMAL] * g[Witness.NORMAL]
                + now[Witness.NORMAL + 1] * g[Witness.NORMAL + 1]
                + now[Witness.NORMAL + 2] * g[Witness.NORMAL + 2]
                < 0.0
            )
            doubtful = turned or g[Witness.GAP] < least
            if doubtful and left_behind(data, kind, now, data.pair_relative[first], before, least):
                return True
        j += 1
    return False


@optional(Slot.OVERLAPPING, default=Verdict.VALID)
def overlapping(model: Model, data: Data) -> int:
    """The Verdict on the solution at configuration 3: OVERLAPPING in features that were not active, TUNNELLED where a
    point has passed through the other shape, or VALID.
    """
    found = Verdict.VALID.value
    for m in range(data.near_collision_count[0]):
        j = data.near_collisions[m]
        if data.pair_activation[j] == 0.0:
            signed = has_no_room(model.pair_kind[j])
            if signed and data.feature_choice[0] == FeatureChoice.EVERY_POSE:
                continue
            place_shapes(model, data, j, data.pos3, data.rot3)
            if not signed and passed_through(model, data, j):
                return Verdict.TUNNELED.value
            lenient = data.feature_choice[0] == FeatureChoice.EVERY_POSE or data.overlap_allowed[0] == 1
            part = _LAST_RESORT if lenient else _OVERLAP
            left = data.pair_before[j, RelativePose.LEFT]
            if distance(model, data, j) < -part * model.pair_least[j] - rounding_of_rims(model, j) - left:
                found = Verdict.OVERLAPPING.value
    return found
