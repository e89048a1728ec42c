"""Contacts and limits that a step of order 2 reaches midway, before which it may have to end.

Columns of `bounce`: Bounce of sim/model/record_columns.py; `look_back` fills them with gaps at configurations 1 and 2.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from sim.contact.contact_law import contact_impulse
from sim.contact.restitution import look_back
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import StepOptions
from sim.model.record_columns import Bounce
from solvers.compiler import kernel
from solvers.types import Vector

NEVER = 1e300  # [s]
UNKNOWN, BEGINS = -1.0, -2.0  # in place of a slip
_ACCELERATION = 1e3  # [m/s^2] of impacts at least that forget the slip
_LANDED, _CLOSE = 0.05, 2.5e-7  # error of a contact at its node before it lands, in accuracies; at least [m, rad]
_HIT, _GENTLE = 1e2, 5e-3  # [m/s^2, rad/s^2] and [m/s, rad/s] of impacts at least


class Landing(NamedTuple):
    """The first contact or limit that a step reaches."""

    error: float  # [m, rad] that it makes
    ahead: float  # [s] until the first contact or limit is reached
    longest: float  # [s] length of a step with an impact with restitution, at most
    depth: float  # [m, rad] of the deepest overlap at its beginning
    hits: bool  # whether a velocity jumps


@kernel
def _limit_reached(model: Model, data: Data, k: int, mean: Vector) -> tuple[float, float]:
    """(gap of limit k where the step began, time until it is reached); those of cones are not looked at."""
    d = model.limit_dof[k]
    gap = model.limit_sign[k] * (mean[model.dof_qadr[d]] - model.limit_bound[k])
    if model.limit_cone[k]:
        return 0.0, NEVER
    speed = -model.limit_sign[k] * mean[data.theta1.shape[0] + d]
    return gap, gap / speed if speed > 0.0 and gap > 0.0 else NEVER


@kernel
def _longest_rebound(model: Model, data: Data, h: float, accuracy: float, c: int) -> float:
    """w/(20 g) for an impact with restitution at the speed of approach w [s].

    Impacts that are back on the ground before they have risen by a quarter of the accuracy count as none.
    """
    if model.contact_restitution[c] == 0.0:
        return NEVER
    g, b = model.gravity, data.bounce[c]
    fall = sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2])
    speed = (b[Bounce.GAP1] - b[Bounce.GAP2]) / h + 0.5 * fall * h
    high = speed * speed > 0.5 * fall * accuracy and b[Bounce.GAP2] < accuracy
    impulse = contact_impulse(model, data, c)[0]
    if fall > 0.0 and speed > 0.0 and high and impulse > 0.5 * model.body_mass[model.contact_body[c]] * speed:
        return 0.05 * speed / fall
    return NEVER


@kernel
def _time_to_land(model: Model, data: Data, h: float, c: int, on_ground: bool) -> float:
    """Time until contact c is reached, on a parabola to the ground, at its speed to another body, from its gaps at
    configurations 1 and 2; NEVER where it recedes from that [s].
    """
    g, gap = model.gravity, data.bounce[c, Bounce.GAP2]
    fall = sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]) if on_ground else 0.0
    speed = (data.bounce[c, Bounce.GAP1] - gap) / h + 0.5 * fall * h
    closing = speed + sqrt(speed * speed + 2.0 * fall * gap)
    return 2.0 * gap / closing if closing > 0.0 else NEVER


@kernel
def landed_error(accuracy: float) -> float:
    """Largest error of a contact in a step that it begins before it lands [m, rad]."""
    return max(_LANDED * accuracy, _CLOSE)


@kernel
def _jumps(h: float, accuracy: float, push: float, gap: float) -> bool:
    """Whether a velocity jumps: by more than _HIT, or, in a step that closes a gap, by more than the accuracy and
    _GENTLE, as a foot lands in the midst of a long step.   push: way of the jump in the time of the step [m, rad].
    """
    return push > h * h * _HIT or min(2.0 * gap, push) > h * max(accuracy, _GENTLE)


@kernel
def landing(
    model: Model, data: Data, options: StepOptions, accuracy: float, mean: Vector, slips: Vector
) -> Landing:  # fmt: skip
    """The Landing of the step just solved, which began at mean = (q, v15); configuration 3 is used up.

    Its error is twice the gap at the beginning, or the way of the velocity's jump in the time of the step: the jump by
    more than twice the impulse kappa/gap of the step before. Contacts that land have no slip before. Those that are
    closed and feel the impact of others land at once: they count where no other lands.
    """
    h, nq = options.h, data.theta1.shape[0]
    error, ahead, longest, depth, hits = 0.0, NEVER, NEVER, 0.0, False
    least, apart = landed_error(accuracy), NEVER
    for k in range(model.limit_dof.shape[0]):
        gap, time = _limit_reached(model, data, k, mean)
        depth = max(depth, -gap)
        if gap > 8.0 * data.bound_gap[k]:  # it is touched in the end
            jump = h * abs(data.nu[model.limit_dof[k]] - mean[nq + model.limit_dof[k]])
            error, ahead = max(error, min(2.0 * gap, jump)), min(ahead, time)
            apart = min(apart, time if min(2.0 * gap, jump) > least else NEVER)
            hits = hits or _jumps(h, accuracy, jump, gap)
    if data.active_count[0] == 0:
        return Landing(error, apart if apart < NEVER else ahead, longest, depth, hits)
    look_back(model, data, h, 1)
    look_back(model, data, h, 2)
    for m in range(data.active_count[0]):
        c = data.active[m]
        impulse, mass = contact_impulse(model, data, c)[0], model.body_mass[model.contact_body[c]]
        gap, before = data.bounce[c, Bounce.GAP2], data.bounce[c, Bounce.GAP1]
        depth = max(depth, -gap) if before < 1e6 else depth
        longest = min(longest, _longest_rebound(model, data, h, accuracy, c))
        jump = impulse - 2.0 * options.kappa / gap if gap > 0.0 else 0.0
        if jump > 0.0:
            push = h * jump / mass if mass > 0.0 else NEVER
            error = max(error, min(2.0 * gap, push))
            time = _time_to_land(model, data, h, c, m < data.active_ground_count[0])
            ahead, apart = min(ahead, time), min(apart, time if min(2.0 * gap, push) > least else NEVER)
            if push > h * h * _ACCELERATION:
                slips[c] = UNKNOWN
            hits = hits or _jumps(h, accuracy, push, gap)
    return Landing(error, apart if apart < NEVER else ahead, longest, depth, hits)
