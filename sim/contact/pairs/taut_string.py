"""Taut strings: one that is taut where a step begins pulls along where it lies there, at configuration 2.

    f = n2 gamma,   n2 = (e_b - e_a)/|e_b - e_a|,   P = e_a,   e_a, e_b its ends at 2;   the gap is that at 3

So do the forces of joints (closure.py): a motion that stays taut is that of a rod between two ball joints,
and keeps its energy to second order in the time step. A string that is slack there pulls along where it lies at the end
of the step, as contacts do, which always has a solution, and loses the energy of the jerk. So does one that turns, or
whose bodies turn, by more than 0.2 rad in the step before: steps of the other kind have no solution then, or gain.

Rows of the pair's frame: n2, and in place of a tangent, which strings have no use for, the normal n3 of the gap.
"""

from __future__ import annotations

from math import sqrt

from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import PairSize
from sim.model.shape_kinds import SWAPPED, Pair
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.rotation import Vec3, cross, rotate

_TAUT = 1e-3  # of the length: less slack than this
_TURN = 0.2  # [rad] of the string and of its bodies in the step before: more is too fast to follow


@kernel
def end_before(model: Model, data: Data, j: int, side: int) -> Vec3:
    """The end of string j on body a (side 0) or b at configuration 2, world axes."""
    i = model.coupling_body[model.pair_coupling[j], side]
    c = model.pair_place[2 * j + side]
    if i < 0:
        return c[0], c[1], c[2]
    x, y, z = rotate(data.rot2, i, c[0], c[1], c[2])
    o = data.pos2[i]
    return o[0] + x, o[1] + y, o[2] + z


@kernel
def string_before(model: Model, data: Data, j: int) -> tuple[float, Vec3]:
    """Distance of the ends of string j at configuration 2, and the direction from a to b there."""
    a, b = end_before(model, data, j, 0), end_before(model, data, j, 1)
    x, y, z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    d = sqrt(x * x + y * y + z * z)
    if d == 0.0:
        return 0.0, (0.0, 0.0, 0.0)
    return d, (x / d, y / d, z / d)


@optional(Slot.IS_TAUT, default=False)
def is_taut(model: Model, data: Data, j: int) -> bool:
    """Whether pair j is a string that is taut at configuration 2, and turns slowly enough to pull as joints do."""
    if model.pair_kind[j] % SWAPPED != Pair.STRING:
        return False
    d, _ = string_before(model, data, j)
    length = model.pair_sizes[j, PairSize.A]
    if not length - d < _TAUT * length:
        return False
    x, y, z = 0.0, 0.0, 0.0
    for side in range(2):
        i = model.coupling_body[model.pair_coupling[j], side]
        if i < 0:
            continue
        turn, o, m = data.turn_in[i], data.pos2[i], data.move_in[i]
        if turn[1] * turn[1] + turn[2] * turn[2] + turn[3] * turn[3] > 0.25 * _TURN * _TURN:
            return False
        e = end_before(model, data, j, side)
        u, v, w = cross(2.0 * turn[1], 2.0 * turn[2], 2.0 * turn[3], e[0] - o[0], e[1] - o[1], e[2] - o[2])
        sign = 1.0 if side == 0 else -1.0
        x, y, z = x + sign * (m[0] + u), y + sign * (m[1] + v), z + sign * (m[2] + w)
    return x * x + y * y + z * z < _TURN * _TURN * d * d


@optional(Slot.PULL_FROM_BEFORE)
def pull_from_before(model: Model, data: Data, j: int) -> None:
    """The rows of the frame of a taut string, from that of its gap."""
    F = data.pair_frame[j]
    _, n = string_before(model, data, j)
    for k in range(3):
        F[3 + k] = F[k]
        F[k] = n[k]


@optional(Slot.STRING_ARM, default=(0.0, 0.0, 0.0))
def string_arm(model: Model, data: Data, j: int) -> Vec3:
    """P - O of a taut string."""
    e = end_before(model, data, j, 0)
    return e[0] - data.origin[0], e[1] - data.origin[1], e[2] - data.origin[2]


@kernel
def string_turn(model: Model, data: Data, j: int, u: Vec3) -> Vec3:
    """dn2 where the end on b moves by u at configuration 2, that on a by none: (u - n2 (n2.u))/|e_b - e_a|."""
    d, n = string_before(model, data, j)
    s = n[0] * u[0] + n[1] * u[1] + n[2] * u[2]
    return (u[0] - s * n[0]) / d, (u[1] - s * n[1]) / d, (u[2] - s * n[2]) / d
