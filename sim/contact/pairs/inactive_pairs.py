"""The active set of collisions: the law of an inactive one is evaluated, not solved for; the matrix omits it.

As for contacts with the ground (contact/inactive.py): on the central path a contact is an explicit force law, gamma =
kappa/gap and friction with it. At a large gap it changes little while a step is solved, so it is a given impulse. It is
evaluated again wherever the motion of the bodies may have changed it by more than the tolerance of the step. No force
is omitted.

A collision is inactive when its stiffness, relative to the inertia behind it, does not slow Newton's method down:

    e = n kappa ((mu^2 + h (1 + mu)) M/a^2 + h (1 + mu) T/a) d <= 1e-2

for its n points at the activation gap a, half the gap ahead; M and T as in inactive.py, of both bodies; d: the
collisions that one of its bodies has, so that the sum over them holds. A gap below a at the solution activates the
collision, and the step is solved again. Derivatives take all collisions as active (`all_near`): they are exact.
One beyond its reach has no force at all: it is placed at the solution only, to see whether it has come within it.

Columns of model.pair_bound: PairBound of sim/model/record_columns.py.
"""

from __future__ import annotations

from sim.contact.collision.collide import apart_at_least
from sim.contact.collision.edge_axes import OPEN
from sim.contact.contact_law import contact_impulse, start_contact
from sim.contact.inactive_bounds import ANGLE
from sim.contact.moments.inactive_moments import add_inactive_moment, moment_slope, place_moment
from sim.contact.pairs.active_features import choose_shapes, distance, open_pairs
from sim.contact.pairs.cylinder_pairs import cylinder_apart, on_cylinder
from sim.contact.pairs.limited_reach import (
    FAR,
    STEEPEST,
    end_of,
    enlist_near,
    follow_step,
    follow_ways,
    is_beyond,
    keep_distance,
    leave_beyond,
    sort_pairs,
    stay_beyond,
)
from sim.contact.pairs.pair_contact import acts, add_pair_wrench, point_kinematics
from sim.contact.pairs.pair_pose import balls_apart, place_shapes
from sim.contact.pairs.previous_features import overlapped
from sim.dynamics.displacements import third_quaternion
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import StepOptions
from sim.model.record_columns import PairBound, RelativePose, Witness
from sim.model.slots import Slot
from solvers.compiler import kernel, optional

COUPLED = 1e-2  # largest sum of e over the inactive collisions of a body


@optional(Slot.ENLIST_PAIRS)
def enlist_pairs(model: Model, data: Data) -> None:
    """Append the pairs of active collisions to the active contacts; coupling_live, the bodies that they couple."""
    ground = model.contact_height.shape[0]
    n = data.active_ground_count[0]
    for k in range(model.coupling_body.shape[0]):
        data.coupling_live[k] = 0
    for m in range(data.near_collision_count[0]):
        first = data.near_collisions[m]
        if data.pair_activation[first] == 0.0:
            data.coupling_live[model.pair_coupling[first]] = 1
            for j in range(first, end_of(model, first)):
                data.active[n] = ground + j
                n += 1
    data.active_count[0] = n


@optional(Slot.BEGIN_PAIRS, seldom=True)
def begin_pairs(model: Model, data: Data, options: StepOptions) -> None:
    """Which collisions are active, and the poses of their shapes at configuration 2, where the step begins."""
    change = 0.0
    follow_ways(model, data)
    if not stay_beyond(data):
        sort_pairs(model, data)
    for m in range(data.near_collision_count[0]):
        j = data.near_collisions[m]
        a = FAR if is_beyond(model, data, j) else _begin_pair(model, data, options, j)
        data.pair_activation[j] = a
        data.pair_before[j, RelativePose.LEFT] = options.left * overlapped(model, data, j) if a == 0.0 else 0.0
        if 0.0 < a < model.pair_bound[j, PairBound.REACH]:
            change += _change(model, data, options, j, a)
    leave_beyond(model, data)
    data.pair_travel[0] = options.tolerance / change if change > 0.0 else 1e300
    data.pair_evaluated[0] = 0.0
    data.pair_change[0] = change


@kernel
def _begin_pair(model: Model, data: Data, options: StepOptions, j: int) -> float:
    """pair_activation of the collision that begins at pair j."""
    place_shapes(model, data, j, data.pos2, data.rot2)
    travel = _travel(model, data, j)
    apart = balls_apart(model, data, j)
    keep_distance(model, data, j, apart)
    if is_beyond(model, data, j):
        return FAR
    if model.pair_bound[j, PairBound.REACH] < 1e300:  # the distance itself takes as long as a step
        apart = max(apart, _bound(model, data, j))
        keep_distance(model, data, j, apart)
        if is_beyond(model, data, j):
            return FAR
    a = _far_enough(model, options, j, 0.5 * (apart - travel))
    if a > 0.0:
        data.pair_sides[j] = OPEN
        data.pair_before[j, RelativePose.GAP] = -1e300
        return a
    apart = open_pairs(model, data, j)
    keep_distance(model, data, j, apart)
    return FAR if is_beyond(model, data, j) else _far_enough(model, options, j, 0.5 * (apart - travel))


@kernel
def _bound(model: Model, data: Data, j: int) -> float:
    """`apart_at_least` of the collision that begins at pair j, at pair_relative."""
    pose = data.pair_relative[j]
    if on_cylinder(model.pair_kind[j]):
        return cylinder_apart(model, data, j)
    return apart_at_least(model, model.pair_kind[j], model.pair_sizes[j], pose[:9], pose[9:])


@kernel
def _travel(model: Model, data: Data, j: int) -> float:
    """How far the shapes of a collision have come towards one another in the step before, at most."""
    d = 0.0
    for side in range(2):
        i = model.coupling_body[model.pair_coupling[j], side]
        if i >= 0:
            for k in range(3):
                d += abs(data.move_in[i, k])
                d += 2.0 * model.pair_bound[j, PairBound.DISTANCE + side] * abs(data.turn_in[i, 1 + k])
    return d


@kernel
def _far_enough(model: Model, options: StepOptions, j: int, a: float) -> float:
    """a where a collision with this half gap is inactive, its reach where it has no force, 0 where it is active."""
    f = model.pair_bound[j]
    if 2.0 * a >= f[PairBound.REACH]:
        return f[PairBound.REACH]
    mu, h = model.contact_friction[model.contact_height.shape[0] + j], options.h
    if not a > 0.0:
        return 0.0
    e = (mu * mu + h * (1.0 + mu)) * f[PairBound.MOBILITY] / a + h * (1.0 + mu) * f[PairBound.TURNING]
    e += h * (1.0 + mu) * f[PairBound.MOBILITY] * STEEPEST / f[PairBound.REACH]
    e += (f[PairBound.SPIN] + 2.0 * h * f[PairBound.SPIN_GROWTH]) / a + h * f[PairBound.SPIN_TURNING]
    e += h * f[PairBound.SPIN_GROWTH] * STEEPEST / f[PairBound.REACH]
    return a if f[PairBound.POINTS] * f[PairBound.COLLISIONS] * options.kappa * e <= COUPLED * a else 0.0


@kernel
def _change(model: Model, data: Data, options: StepOptions, j: int, a: float) -> float:
    """Bound of the change of an inactive collision's wrench per displacement d of its bodies; slips change by 2 d/h."""
    f = model.pair_bound[j]
    mu = model.contact_friction[model.contact_height.shape[0] + j]
    lever = 1.0
    for side in range(2):
        i = model.coupling_body[model.pair_coupling[j], side]
        if i >= 0:
            lever += f[PairBound.DISTANCE + side]
            for k in range(3):
                lever += abs(data.pos2[i, k] - data.origin[k])
    push = f[PairBound.POINTS] * options.kappa / a
    change = 2.0 * lever * push * (1.0 + (1.0 + mu + 2.0 * mu * mu / options.h) / a + STEEPEST / f[PairBound.REACH])
    return change + push * moment_slope(model, data, options.h, j, a)


@optional(Slot.INACTIVE_PAIR_IMPULSES, seldom=True)
def inactive_pair_impulses(model: Model, data: Data, h: float, kappa: float) -> None:
    """Wrenches of the inactive collisions at configuration 3, evaluated again where they may have changed."""
    if data.pair_change[0] == 0.0 or not _moved(model, data):
        return
    data.pair_evaluated[0] = 1.0
    for i in range(data.inactive_wrench.shape[0]):
        q = third_quaternion(data, i)
        for k in range(3):
            data.inactive_pose[i, k] = data.pos3[i, k]
        for k in range(4):
            data.inactive_pose[i, 3 + k] = q[k]
        for k in range(6):
            data.inactive_wrench[i, k] = 0.0
    for k in range(data.near_collision_count[0]):
        j = data.near_collisions[k]
        a = data.pair_activation[j]
        if 0.0 < a < model.pair_bound[j, PairBound.REACH]:
            _place_inactive(model, data, h, j, kappa)
            for m in range(j, end_of(model, j)):
                _apply_inactive(model, data, m)


@kernel
def _place_inactive(model: Model, data: Data, h: float, j: int, kappa: float) -> None:
    """Cone variables of the points of an inactive collision at configuration 3, on the central path."""
    place_shapes(model, data, j, data.pos3, data.rot3)
    choose_shapes(model, data, j)
    for m in range(j, end_of(model, j)):
        point_kinematics(model, data, h, m)
        start_contact(model, data, model.contact_height.shape[0] + m, kappa, data.pair_activation[j])
        place_moment(model, data, h, model.contact_height.shape[0] + m, kappa)


@kernel
def _apply_inactive(model: Model, data: Data, j: int) -> None:
    """inactive_wrench -= impulse of one point of an inactive collision."""
    if acts(data, j):
        n, t1, t2 = contact_impulse(model, data, model.contact_height.shape[0] + j)
        add_pair_wrench(model, data, j, n, t1, t2, data.inactive_wrench)
        add_inactive_moment(model, data, model.contact_height.shape[0] + j, data.inactive_wrench)


@kernel
def _moved(model: Model, data: Data) -> bool:
    """Whether some body has moved so far that the inactive wrenches may have changed by more than the tolerance."""
    if data.pair_evaluated[0] == 0.0:
        return True
    for i in range(data.inactive_pose.shape[0]):
        reach = model.body_reach[i]
        if reach == 0.0:
            continue
        d = 0.0
        turn = 0.0
        for k in range(3):
            d += abs(data.pos3[i, k] - data.inactive_pose[i, k])
        q = third_quaternion(data, i)
        for k in range(4):
            turn += abs(q[k] - data.inactive_pose[i, 3 + k])
        if not d + reach * ANGLE * turn <= data.pair_travel[0]:
            return True
    return False


@kernel
def add_inactive_pairs(data: Data) -> None:
    """wrench += those of the inactive collisions."""
    if data.pair_change[0] == 0.0:
        return
    for i in range(data.wrench.shape[0]):
        for k in range(6):
            data.wrench[i, k] += data.inactive_wrench[i, k]


@optional(Slot.PAIRS_ACTIVATED, default=False, seldom=True)
def pairs_activated(model: Model, data: Data, options: StepOptions) -> bool:
    """Whether an inactive collision has become active at configuration 3; it is active from now on."""
    found = False
    for m in range(data.near_collision_count[0]):
        j = data.near_collisions[m]
        if data.pair_activation[j] == model.pair_bound[j, PairBound.REACH]:
            _place_inactive(model, data, options.h, j, options.kappa)
        least = 1e300
        for k in range(j, end_of(model, j)):
            least = min(least, data.pair_out[k, Witness.GAP])
        if data.pair_activation[j] > 0.0 and least < data.pair_activation[j]:
            found = True
            _activate(model, data, j)
    return _came_within_reach(model, data) or found


@kernel
def _activate(model: Model, data: Data, j: int) -> None:
    """The collision that begins at pair j is active from now on."""
    data.pair_activation[j] = 0.0
    data.pair_before[j, RelativePose.LEFT] = 0.0
    place_shapes(model, data, j, data.pos2, data.rot2)
    open_pairs(model, data, j)


@kernel
def _came_within_reach(model: Model, data: Data) -> bool:
    """Whether a collision that was beyond its reach is within it at configuration 3; it is active from now on."""
    found = False
    follow_step(model, data)
    if stay_beyond(data):
        return False
    j = 0
    while j < model.pair_kind.shape[0]:
        if data.pair_activation[j] == FAR and not is_beyond(model, data, j):
            place_shapes(model, data, j, data.pos3, data.rot3)
            reach = model.pair_bound[j, PairBound.REACH]
            if _bound(model, data, j) < reach and distance(model, data, j) < reach:
                found = True
                _activate(model, data, j)
        j = end_of(model, j)
    if found:
        enlist_near(model, data)
    return found


@optional(Slot.ALL_NEAR)
def all_near(model: Model, data: Data) -> None:
    """All collisions within their reach taken as active, for the derivatives of a step that has been solved."""
    for m in range(data.near_collision_count[0]):
        j = data.near_collisions[m]
        if data.pair_activation[j] < model.pair_bound[j, PairBound.REACH]:
            data.pair_activation[j] = 0.0
    enlist_pairs(model, data)
