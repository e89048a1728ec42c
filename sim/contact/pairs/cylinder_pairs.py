"""Collisions of cylinders with polytopes and cylinders (cylinder_contacts.py), as active_features.py
and pair_contact.py for the others. Scenes without such collisions do not compile these kernels.
"""

from __future__ import annotations

from sim.contact.collision.cylinder_contacts import (
    apart_from_cylinder,
    choose_on_cylinder,
    collide_with_cylinder,
    instead_on_cylinder,
    separation_of_cylinder,
)
from sim.contact.pairs.previous_features import keep, last_point, left_behind
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import FeatureChoice
from sim.model.record_columns import RelativePose, Witness
from sim.model.shape_kinds import SWAPPED, Pair
from sim.model.slots import Slot
from solvers.compiler import inner_kernel, optional


@inner_kernel
def on_cylinder(kind: int) -> bool:
    """Whether a kind of pair is one of these."""
    return kind % SWAPPED >= Pair.POLYTOPE_CYLINDER


@optional(Slot.CYLINDER_DISTANCE, default=0.0)
def cylinder_distance(model: Model, data: Data, first: int) -> float:
    """Distance of the shapes of a collision at pair_relative."""
    pose = data.pair_relative[first]
    return separation_of_cylinder(
        model.pair_kind[first],
        model.pair_sizes[first],
        model.hull,
        pose[:9],
        pose[9:],
        data.pair_scratch[:12],
        data.pair_code,
        data.pair_trial[0],
    )


@optional(Slot.CYLINDER_APART, default=-1e300)
def cylinder_apart(model: Model, data: Data, first: int) -> float:
    """A bound of `cylinder_distance`."""
    pose = data.pair_relative[first]
    return apart_from_cylinder(model.pair_kind[first], model.pair_sizes[first], model.hull, pose[:9], pose[9:])


@inner_kernel
def put_all(model: Model, data: Data, first: int) -> None:
    """pair_out of all points of a collision at pair_relative, with the elements that were chosen."""
    kind, sizes, pose = model.pair_kind[first], model.pair_sizes[first], data.pair_relative[first]
    turned = data.pair_scratch[:12]
    for j in range(first, last_point(model, first)):
        code = data.pair_code[j]
        collide_with_cylinder(kind, j - first, code, sizes, model.hull, (pose[:9], pose[9:]), turned, data.pair_out[j])


@optional(Slot.COLLIDE_CYLINDERS)
def collide_cylinders(model: Model, data: Data, first: int) -> None:
    """`put_all`"""
    put_all(model, data, first)


@optional(Slot.CHOOSE_CYLINDERS)
def choose_cylinders(model: Model, data: Data, first: int) -> None:
    """pair_code, pair_out: elements of all points of a collision, chosen at pair_relative; none that overlapped when
    the step began; where that leaves a point without, those of the beginning.
    """
    kind, sizes, pose = model.pair_kind[first], model.pair_sizes[first], data.pair_relative[first]
    before, turned, g = data.pair_before[first], data.pair_scratch[:12], data.pair_trial[0]
    R, r = before[:9], before[9 : RelativePose.GAP]
    missing = False
    choose_on_cylinder(kind, sizes, model.hull, (pose[:9], pose[9:]), turned, data.pair_code, first, g)
    for j in range(first, last_point(model, first)):
        k = j - first
        code = data.pair_code[j]
        collide_with_cylinder(kind, k, code, sizes, model.hull, (R, r), turned, g)
        lost = g[Witness.GAP] < before[RelativePose.GAP]
        if lost:
            collide_with_cylinder(kind, k, code, sizes, model.hull, (pose[:9], pose[9:]), turned, g)
            lost = left_behind(data, kind, g, pose, before, before[RelativePose.GAP])
        if lost:
            data.pair_code[j] = instead_on_cylinder(kind, k, sizes, model.hull, R, r)
            collide_with_cylinder(kind, k, data.pair_code[j], sizes, model.hull, (R, r), turned, g)
            if g[Witness.GAP] < before[RelativePose.GAP]:
                data.pair_code[j] = 0
            missing = missing or data.pair_code[j] == 0
    if missing:
        choose_on_cylinder(kind, sizes, model.hull, (R, r), turned, data.pair_code, first, g)
    if data.feature_choice[0] == FeatureChoice.WITH_PREVIOUS:
        keep(model, data, first)
    put_all(model, data, first)


@optional(Slot.CYLINDER_BEFORE)
def cylinder_before(model: Model, data: Data, first: int, j: int) -> None:
    """pair_trial: the elements of point j where the step began."""
    before = data.pair_before[first]
    collide_with_cylinder(
        model.pair_kind[first],
        j - first,
        data.pair_code[j],
        model.pair_sizes[first],
        model.hull,
        (before[:9], before[9 : RelativePose.GAP]),
        data.pair_scratch[:12],
        data.pair_trial[0],
    )
