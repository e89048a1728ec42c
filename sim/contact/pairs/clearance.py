"""Clearance of the shapes of collisions during a step of higher order, in which no collision acts.

As for contacts with the ground (sim/integrators/phases.py): a gap that is g0 where a step begins and g1 where it ends
is nowhere less than (g0 + g1 - d)/2, where d is the distance by which points of the two shapes move relative to each
other in between. The balls around the shapes give a lower bound of a gap; only where they are near each other are the
shapes themselves measured.

Columns of pair_apart, at the first pair of a collision: Apart of sim/model/record_columns.py.
"""

from __future__ import annotations

from math import sqrt

from sim.contact.pairs.active_features import choose_shapes, open_pairs
from sim.contact.pairs.limited_reach import end_of
from sim.contact.pairs.pair_contact import point_kinematics
from sim.contact.pairs.pair_pose import balls_apart, place_shapes
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import Apart, PairBound
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.rotation import cross


@kernel
def least_gap(gap: float, speed: float, before: float, speed_before: float, travel: float) -> float:
    """Least gap over a step: (g0 + g1 - travel times the larger speed)/2; with travel < 0, that of a node alone [m]."""
    return gap if travel < 0.0 else 0.5 * (before + gap - travel * max(speed, speed_before))


@kernel
def largest_speed(data: Data, i: int, arm: float) -> float:
    """|v| + arm |w| of body i at configuration 2: no point within `arm` of its centre of mass is faster [m/s]."""
    V, o = data.twist[i], data.origin
    x, y, z = cross(V[3], V[4], V[5], data.pos2[i, 0] - o[0], data.pos2[i, 1] - o[1], data.pos2[i, 2] - o[2])
    x, y, z = x + V[0], y + V[1], z + V[2]
    return sqrt(x * x + y * y + z * z) + arm * sqrt(V[3] * V[3] + V[4] * V[4] + V[5] * V[5])


@kernel
def _pair_gap(model: Model, data: Data, j: int) -> float:
    """Lower bound of the gaps of the collision that begins at pair j, at configuration 2 [m]."""
    place_shapes(model, data, j, data.pos2, data.rot2)
    apart = balls_apart(model, data, j)
    return apart if apart > model.pair_bound[j, PairBound.RADII] else open_pairs(model, data, j)


@kernel
def _pair_speed(model: Model, data: Data, j: int) -> float:
    """Largest speed of a point of one shape relative to the other: the sum of both bodies' [m/s]."""
    speed = 0.0
    for side in range(2):
        i = model.coupling_body[model.pair_coupling[j], side]
        if i >= 0:
            speed += largest_speed(data, i, model.pair_bound[j, PairBound.DISTANCE + side])
    return speed


@optional(Slot.OMITTED_PAIRS, default=0.0)
def omitted_pairs(model: Model, data: Data, kappa: float, h: float) -> float:
    """Sum of the impulses kappa/gap of collisions over a step of length h to the node in `data`; of the node itself
    with h < 0. 1e300 where shapes are not apart. Gaps and speeds of the node are kept for the step that begins there.
    """
    total = 0.0
    j = 0
    while j < model.pair_kind.shape[0]:
        gap, speed, row = _pair_gap(model, data, j), _pair_speed(model, data, j), data.pair_apart[j]
        g = least_gap(gap, speed, row[Apart.GAP], row[Apart.SPEED], h)
        row[Apart.GAP], row[Apart.SPEED] = gap, speed
        total = total + model.pair_bound[j, PairBound.POINTS] * kappa / g if g > 0.0 else 1e300
        j = end_of(model, j)
    return total


@optional(Slot.PAIRS_REACHED, default=1e300)
def pairs_reached(model: Model, data: Data) -> float:
    """Time after the node in `data` before which no shapes touch, by the gaps and speeds kept [s]."""
    time = 1e300
    j = 0
    while j < model.pair_kind.shape[0]:
        gap, speed = data.pair_apart[j, Apart.GAP], data.pair_apart[j, Apart.SPEED]
        if speed > 0.0:
            time = min(time, gap / speed)
        j = end_of(model, j)
    return time


@optional(Slot.MEASURE_PAIRS)
def measure_pairs(model: Model, data: Data, h: float) -> None:
    """Gaps, slips and frames of all collisions after a step from configuration 2 to 3 in which none of them acted."""
    n = 0
    j = 0
    while j < model.pair_kind.shape[0]:
        data.near_collisions[n] = j
        n += 1
        place_shapes(model, data, j, data.pos2, data.rot2)
        open_pairs(model, data, j)
        place_shapes(model, data, j, data.pos3, data.rot3)
        choose_shapes(model, data, j)
        for m in range(j, end_of(model, j)):
            point_kinematics(model, data, h, m)
        j = end_of(model, j)
    data.near_collision_count[0] = n
