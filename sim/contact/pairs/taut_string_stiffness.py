"""Derivatives of the wrenches of taut strings (taut_string.py) by the twists of their bodies."""

from __future__ import annotations

from sim.contact.contact_law import contact_impulse
from sim.contact.pairs.pair_contact import pair_force
from sim.contact.pairs.taut_string import end_before, string_arm, string_turn
from sim.contact.pairs.wrench_columns import add_wrench_column, point_shift
from sim.model.data import Data
from sim.model.model import Model
from sim.model.slots import Slot
from solvers.compiler import optional
from solvers.types import Matrix


@optional(Slot.ADD_STRING_STIFFNESS)
def add_string_stiffness(model: Model, data: Data, j: int) -> None:
    """coupling_K += taut string j, condensed: its point and direction are given at configuration 2."""
    c = model.contact_height.shape[0] + j
    zero = (0.0, 0.0, 0.0)
    P = string_arm(model, data, j)
    for side in range(2):
        K = data.coupling_K[2 * model.pair_coupling[j] + side]
        C = data.pair_Ca[j] if side == 0 else data.pair_Cb[j]
        for k in range(6):
            df = pair_force(data, j, data.contact_W[c, 0] * C[k], 0.0, 0.0)
            add_wrench_column(K, k, zero, df, P, zero)


@optional(Slot.ADD_STRING_TURN)
def add_string_turn(model: Model, data: Data, j: int, K2: Matrix) -> None:
    """K2 (2, 36) += dF by the twists of a and b at configuration 2, of taut string j: df = gamma dn2, dP = de_a."""
    fn, _, _ = contact_impulse(model, data, model.contact_height.shape[0] + j)
    f = pair_force(data, j, fn, 0.0, 0.0)
    P = string_arm(model, data, j)
    o = data.origin
    for side in range(2):
        e = end_before(model, data, j, side)
        g = -fn if side == 0 else fn
        for k in range(6):
            u = point_shift(k, e[0] - o[0], e[1] - o[1], e[2] - o[2])
            n = string_turn(model, data, j, u)
            dP = u if side == 0 else (0.0, 0.0, 0.0)
            add_wrench_column(K2[side], k, f, (g * n[0], g * n[1], g * n[2]), P, dP)
