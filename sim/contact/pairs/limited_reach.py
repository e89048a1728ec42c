"""Collisions with a reach: no force at larger gaps, so that shapes that are farther apart have no part in a step.

On the central path contacts push at every distance, gamma = kappa/gap. Within a reach rho only a part of the impulse
acts, that of pairs alone, at configuration 3:

    w(gap) (gamma, beta),    w = 1 up to rho/2, 0 from rho on, between them 1 - t^3 (10 - 15 t + 6 t^2)

which has two continuous derivatives. Slacks, impulses and friction keep their law; w multiplies the wrench, and its
derivative is in that of the wrench.

The broad phase knows of every collision how far its shapes were apart once, and how far points of both bodies have
moved since, at most. From twice the reach on, all gaps are beyond it: separations along the axes of boxes are at least
the distance over sqrt(3). Those of polytopes are at least the distance, so that they are beyond from the reach on.
Collisions that this excludes are neither placed nor measured; and while no two bodies have moved by more than the least
margin of all (pair_margin), only those within their reach are evaluated.
"""

from __future__ import annotations

from math import sqrt

from sim.contact.inactive_bounds import ANGLE
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import PairBound, PairFade, Travel, Witness
from sim.model.shape_kinds import SWAPPED, Pair
from solvers.compiler import inner_kernel, kernel
from solvers.rotation import Vec3, rotate

BEYOND = 2e9  # gap in the row of the first pair where it is beyond its reach, see pair_report.py
FAR = -1.0  # pair_activation of a collision beyond its reach
STEEPEST = 3.75  # reaches times the largest rate of the part that acts
_APART = 2.0  # reaches from where on no gap is within one, but for polytopes
_HALF_ANGLE = 3.2  # an angle is at most so many times the sine of its half


@kernel
def fit_fade(model: Model, data: Data, j: int) -> None:
    """pair_fade of pair j at its present gap."""
    reach = model.pair_bound[j - model.pair_feature[j], PairBound.REACH]
    fade = data.pair_fade[j]
    fade[PairFade.PART], fade[PairFade.RATE] = 1.0, 0.0
    t = 2.0 * data.pair_out[j, Witness.GAP] / reach - 1.0
    if t >= 1.0:
        fade[PairFade.PART] = 0.0
    elif t > 0.0:
        w = 1.0 - t * t * t * (10.0 + t * (6.0 * t - 15.0))
        fade[PairFade.PART] = w
        if w > 1e-12:  # below, it is rounding
            fade[PairFade.RATE] = -60.0 * t * t * (1.0 - t) * (1.0 - t) / (reach * w)


@kernel
def with_fade(data: Data, j: int, gap: float, rate: Vec3, p: Vec3) -> Vec3:
    """d(w p)/w of the impulse p of pair j: `rate` by its law, and that of the part which acts, as its gap changes."""
    s = data.pair_fade[j, PairFade.RATE] * gap
    return rate[0] + s * p[0], rate[1] + s * p[1], rate[2] + s * p[2]


@kernel
def follow_ways(model: Model, data: Data) -> None:
    """body_travel at configuration 2, where a step begins; a new motion forgets the distances of its collisions."""
    if data.carry.travel_known[0] == 0:
        data.carry.travel_known[0] = 1
        data.pair_margin[0] = -1.0
        for j in range(model.pair_kind.shape[0]):
            data.pair_clear[j] = 0.0
        for i in range(data.body_travel.shape[0]):
            data.body_travel[i, Travel.BEFORE] = 0.0
            _keep_pose(data, i)
    for i in range(data.body_travel.shape[0]):
        way, ahead, turn, turning = 0.0, 0.0, 0.0, 0.0
        for k in range(3):
            way += abs(data.pos2[i, k] - data.body_travel[i, Travel.POSE + k])
            ahead += abs(data.move_in[i, k])
            turning += abs(data.turn_in[i, 1 + k])
        for k in range(4):
            turn += abs(data.quat2[i, k] - data.body_travel[i, Travel.POSE + 3 + k])
        data.body_travel[i, Travel.BEFORE] += way + model.body_reach[i] * ANGLE * turn
        data.body_travel[i, Travel.AHEAD] = ahead + model.body_reach[i] * _HALF_ANGLE * turning
        _keep_pose(data, i)


@kernel
def _keep_pose(data: Data, i: int) -> None:
    for k in range(3):
        data.body_travel[i, Travel.POSE + k] = data.pos2[i, k]
    for k in range(4):
        data.body_travel[i, Travel.POSE + 3 + k] = data.quat2[i, k]


@kernel
def follow_step(model: Model, data: Data) -> None:
    """Travel.AHEAD of the solution, configuration 3."""
    for i in range(data.body_travel.shape[0]):
        ahead, turning = 0.0, 0.0
        for k in range(3):
            ahead += abs(data.move[i, k])
            turning += abs(data.turn[i, 1 + k])
        data.body_travel[i, Travel.AHEAD] = ahead + model.body_reach[i] * _HALF_ANGLE * turning


@kernel
def _ways(model: Model, data: Data, j: int, column: int) -> float:
    """Sum of those of the two bodies of pair j."""
    total = 0.0
    for side in range(2):
        i = model.coupling_body[model.pair_coupling[j], side]
        if i >= 0:
            total += data.body_travel[i, column]
    return total


@kernel
def keep_distance(model: Model, data: Data, j: int, apart: float) -> None:
    """The shapes of the collision that begins at pair j are so far apart at configuration 2, at least."""
    data.pair_clear[j] = max(data.pair_clear[j], apart + _ways(model, data, j, Travel.BEFORE.value))


@inner_kernel
def _least_clear(model: Model, j: int) -> float:
    """Distance from which on no gap of the collision that begins at pair j is within its reach."""
    reach = model.pair_bound[j, PairBound.REACH]
    return reach if model.pair_kind[j] % SWAPPED == Pair.POLYTOPE_POLYTOPE else _APART * reach


@kernel
def is_beyond(model: Model, data: Data, j: int) -> bool:
    """Whether the collision that begins at pair j stays beyond its reach on the ways ahead, by the last measurement."""
    ways = _ways(model, data, j, Travel.BEFORE.value) + _ways(model, data, j, Travel.AHEAD.value)
    return data.pair_clear[j] - ways > _least_clear(model, j)


@kernel
def stay_beyond(data: Data) -> bool:
    """Whether all collisions that are beyond their reach stay there, as no two bodies have moved by their margin."""
    first, second = 0.0, 0.0
    for i in range(data.body_travel.shape[0]):
        way = data.body_travel[i, Travel.BEFORE] + data.body_travel[i, Travel.AHEAD]
        if not way <= first:
            first, second = way, first
        elif way > second:
            second = way
    return first + second < data.pair_margin[0]


@kernel
def _unplaced_balls_apart(model: Model, data: Data, j: int) -> float:
    """`balls_apart` of the collision that begins at pair j at configuration 2, whose shapes are not placed."""
    k = model.pair_coupling[j]
    a, b = model.coupling_body[k, 0], model.coupling_body[k, 1]
    p, q = model.pair_place[2 * j], model.pair_place[2 * j + 1]
    x, y, z = rotate(data.rot2, a, p[0], p[1], p[2])
    x, y, z = x + data.pos2[a, 0], y + data.pos2[a, 1], z + data.pos2[a, 2]
    u, v, w = q[0], q[1], q[2]
    if b >= 0:
        u, v, w = rotate(data.rot2, b, q[0], q[1], q[2])
        u, v, w = u + data.pos2[b, 0], v + data.pos2[b, 1], w + data.pos2[b, 2]
    x, y, z = x - u, y - v, z - w
    return sqrt(x * x + y * y + z * z) - model.pair_bound[j, PairBound.RADII]


@kernel
def sort_pairs(model: Model, data: Data) -> None:
    """near_collisions: those that may be within their reach; pair_activation FAR and pair_margin of the others."""
    n = 0
    j = 0
    data.pair_margin[0] = 1e300
    while j < model.pair_kind.shape[0]:
        beyond = is_beyond(model, data, j)
        if not beyond and model.pair_bound[j, PairBound.REACH] < 1e300:
            keep_distance(model, data, j, _unplaced_balls_apart(model, data, j))
            beyond = is_beyond(model, data, j)
        if beyond:
            _leave(model, data, j)
        else:
            data.near_collisions[n] = j
            n += 1
        j = end_of(model, j)
    data.near_collision_count[0] = n


@kernel
def _leave(model: Model, data: Data, j: int) -> None:
    """The collision that begins at pair j is beyond its reach."""
    data.pair_activation[j] = FAR
    data.pair_margin[0] = min(data.pair_margin[0], data.pair_clear[j] - _least_clear(model, j))


@kernel
def leave_beyond(model: Model, data: Data) -> None:
    """near_collisions without the collisions that turned out to be beyond their reach."""
    n = 0
    for m in range(data.near_collision_count[0]):
        j = data.near_collisions[m]
        if data.pair_activation[j] == FAR:
            _leave(model, data, j)
        else:
            data.near_collisions[n] = j
            n += 1
    data.near_collision_count[0] = n


@kernel
def enlist_near(model: Model, data: Data) -> None:
    """near_collisions: the first pairs of the collisions within their reach."""
    n = 0
    j = 0
    while j < model.pair_kind.shape[0]:
        if data.pair_activation[j] != FAR:
            data.near_collisions[n] = j
            n += 1
        j += int(model.pair_bound[j, PairBound.POINTS])
    data.near_collision_count[0] = n


@kernel
def end_of(model: Model, j: int) -> int:
    """End of the points of the collision that begins at pair j."""
    return j + int(model.pair_bound[j, PairBound.POINTS])
