"""The work of the impulses of collisions in a step, which is zero if the shapes touch with the chosen elements.

An impulse acts along the normal at the end of a step. Where shapes that were apart have passed through one another, or
an element was chosen that is none there, that normal points where the bodies came from, and the step gives them energy
that they never had. So no solution is accepted whose impulses do both, over all active collisions j, P: where they act,

    sum f.(u + u')/2 > allowed,    sum f.u' > allowed,    u, u' the relative velocities at P before and after

Of the two the first is the kinetic energy that the impulses add. The second omits the work of other forces: they may
press bodies together that were moving apart. Impacts with restitution are looked at by contact/restitution.py.
Taut strings pass through nothing.

    allowed = share (T + T') + sum of (2 kappa + f_n (overlap where the step began + tolerance at its end))/h
"""

from __future__ import annotations

from sim.contact.contact_law import contact_impulse
from sim.contact.pairs.limited_reach import end_of
from sim.contact.pairs.pair_contact import is_absent, pair_arm, pair_force
from sim.contact.pairs.previous_features import overlapped, rounding_of_rims
from sim.contact.pairs.taut_string import is_taut
from sim.contact.restitution import impulse_work
from sim.dynamics.energy import twice_kinetic
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import StepOptions
from sim.model.record_columns import Bounce, Cone
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.rotation import Vec3, cross
from solvers.types import Vector

_SHARE = 0.01  # of the kinetic energies before and after: the work of turning normals, of first order in the time step
_LEFT = 2e-4  # part of the smallest size: more than steps end with, but for late attempts (active_features.py)
_THROWN = 2e-2  # the same of shapes that are thrown out, not pushed: they overlapped more where the step began


@kernel
def velocity_after(data: Data, h: float, i: int, x: float, y: float, z: float) -> Vec3:
    """Velocity over the interval 2-3 of the point (x, y, z) of body i at configuration 2; 0 for the world."""
    if i < 0:
        return 0.0, 0.0, 0.0
    m, w, o = data.move[i], data.turn[i], data.pos2[i]
    vx, vy, vz = cross(w[1], w[2], w[3], x - o[0], y - o[1], z - o[2])
    return (m[0] + 2.0 * vx) / h, (m[1] + 2.0 * vy) / h, (m[2] + 2.0 * vz) / h


@kernel
def power_after(model: Model, data: Data, h: float, j: int) -> float:
    """f.u' of pair j [J]."""
    a = model.coupling_body[model.pair_coupling[j], 0]
    b = model.coupling_body[model.pair_coupling[j], 1]
    fn, f1, f2 = contact_impulse(model, data, model.contact_height.shape[0] + j)
    o = data.origin
    x, y, z = pair_arm(model, data, j)
    ux, uy, uz = velocity_after(data, h, a, o[0] + x, o[1] + y, o[2] + z)
    vx, vy, vz = velocity_after(data, h, b, o[0] + x, o[1] + y, o[2] + z)
    f = pair_force(data, j, fn, f1, f2)
    return f[0] * (ux - vx) + f[1] * (uy - vy) + f[2] * (uz - vz)


@optional(Slot.PAIR_SLACK, default=0.0)
def pair_slack(model: Model, data: Data) -> float:
    """Sum of the normal impulses times the overlaps where the step began, which they may take away [N s m].

    Inactive collisions began apart, and have none.
    """
    total = 0.0
    for m in range(data.near_collision_count[0]):
        first = data.near_collisions[m]
        if data.pair_activation[first] != 0.0:
            continue
        overlap = overlapped(model, data, first) + _LEFT * model.pair_least[first] + rounding_of_rims(model, first)
        for j in range(first, end_of(model, first)):
            if not is_absent(data, j):
                total += data.cone[model.contact_height.shape[0] + j, Cone.IMPULSE] * overlap
    return total


@optional(Slot.PAIRS_GAINED, default=False, seldom=True)
def pairs_gained(model: Model, data: Data, options: StepOptions, v: Vector) -> bool:
    """Whether the impulses of collisions gave energy in the solved step, of shapes that were apart where it began."""
    h = options.h
    ground = model.contact_height.shape[0]
    gain, power, allowed = 0.0, 0.0, 0.0
    for m in range(data.near_collision_count[0]):
        first = data.near_collisions[m]
        size = model.pair_least[first]
        overlap = overlapped(model, data, first)
        slack = overlap + _LEFT * size + rounding_of_rims(model, first) + options.tolerance
        if data.pair_activation[first] != 0.0 or not overlap < _THROWN * size:
            continue
        for j in range(first, end_of(model, first)):
            if is_absent(data, j) or is_taut(model, data, j) or data.bounce[ground + j, Bounce.RESTITUTION] > 0.0:
                continue
            gain += impulse_work(model, data, h, ground + j)
            power += power_after(model, data, h, j)
            allowed += (2.0 * options.kappa + data.cone[ground + j, Cone.IMPULSE] * slack) / h
    least = min(gain, power)
    return least > allowed and least > allowed + 0.5 * _SHARE * twice_kinetic(model, data, h, v)
