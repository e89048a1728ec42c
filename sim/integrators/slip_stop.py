"""Errors at the end of sliding, which the comparison of a step with its two halves does not show.

parts    (3, ncontact, 11) contacts of both halves and of the whole step, as in rollout.py
slips    (ncontact,) at the node where the step begins; UNKNOWN, or BEGINS where nothing went before
"""

from __future__ import annotations

from math import sqrt

from sim.integrators.contact_events import BEGINS
from sim.model.model import Model
from sim.model.record_columns import ContactRow
from solvers.compiler import kernel
from solvers.types import Cube, Vector

_TURN = 1e-4  # least change of the friction over the normal impulse
_SLIPS = 1e-3  # [m/s]


@kernel
def _normal_impulse(row: Vector) -> float:
    """Impulse of a contact [N s], from its row (11,)."""
    p, n = row[ContactRow.IMPULSE : ContactRow.POINT], row[ContactRow.NORMAL :]
    return p[0] * n[0] + p[1] * n[1] + p[2] * n[2]


@kernel
def _first_stop(model: Model, parts: Cube, c: int, h: float) -> float:
    """Error where contact c stops sliding at once [m]: s^2/(2 a) of the slip s that its friction f took away beyond
    the friction that holds it in the second half, in the ratio of the normal impulses n, at the deceleration
    a = mu n'/(m h/2).
    """
    f, n = (0.0, 0.0), (0.0, 0.0)
    for half in range(2):
        p, normal = parts[half, c, ContactRow.IMPULSE : ContactRow.POINT], _normal_impulse(parts[half, c])
        size = p[0] * p[0] + p[1] * p[1] + p[2] * p[2] - normal * normal
        f, n = (f[1], sqrt(max(size, 0.0))), (n[1], normal)
    mass, mu = model.body_mass[model.contact_body[c]], model.contact_friction[c]
    if not (0.0 < n[0] < 10.0 * n[1]) or mass == 0.0 or mu == 0.0:
        return 0.0
    stop = f[0] - f[1] * n[0] / n[1]
    return 0.25 * h * stop * stop / (mu * n[1] * mass)


@kernel
def stopping_error(model: Model, parts: Cube, slips: Vector, h: float) -> float:
    """Error where contacts stop sliding in a step, or between two steps, which neither of its halves sees [m].

    s, s': mean slips of both halves; 1.5 s - .5 s' and 1.5 s' - .5 s are those at the beginning and in the end.
    In the end, s < 0 at the deceleration a: s^2/(2 a); in the beginning, another than in the end of the step before.
    """
    error = 0.0
    for c in range(slips.shape[0]):
        one, other, before = parts[0, c, ContactRow.SLIP], parts[1, c, ContactRow.SLIP], slips[c]
        slip = 1.5 * other - 0.5 * one
        if slip < 0.0:
            error = max(error, 0.25 * h * slip * slip / (one - other))
        if before >= 0.0:
            error = max(error, 0.125 * h * abs(before - max(0.0, 1.5 * one - 0.5 * other)))
        elif before == BEGINS:
            error = max(error, _first_stop(model, parts, c, h))
    return error


@kernel
def friction_turn(parts: Cube, accuracy: float) -> float:
    """Largest change of the friction of a contact that slides, over its normal impulse, from one half to the other,
    over the accuracy [m/s, rad/s] in 1 m/s.

    It acts along the slip in the end of a step. Where that turns, the error is of order 1, and alike in a step and its
    halves.
    """
    most, largest = max(accuracy, _TURN), 0.0
    for c in range(parts.shape[1]):
        one, other = parts[0, c], parts[1, c]
        before, after = _normal_impulse(one), _normal_impulse(other)
        if before <= 0.0 or after <= 0.0 or min(one[ContactRow.SLIP], other[ContactRow.SLIP]) < _SLIPS:
            continue
        turned = 0.0
        for k in range(3):
            n1, n2 = one[ContactRow.NORMAL + k], other[ContactRow.NORMAL + k]
            change = other[ContactRow.IMPULSE + k] / after - n2 - one[ContactRow.IMPULSE + k] / before + n1
            turned += change * change
        largest = max(largest, turned)
    return sqrt(largest) / most
