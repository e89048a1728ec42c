"""Parameters of taut strings: where their ends sit in the bodies, and their lengths; columns[:, col] -= w dR."""

from __future__ import annotations

from sim.contact.collision.witness import dot
from sim.contact.contact_law import contact_impulse
from sim.contact.pairs.taut_string import string_turn
from sim.derivatives.parameters.contact_columns import add_pair, impulse_change
from sim.model.data import Data
from sim.model.model import Model
from sim.model.slots import Slot
from solvers.compiler import optional
from solvers.rotation import Vec3


@optional(Slot.ADD_MOVED_END)
def add_moved_end(
    model: Model, data: Data, end: tuple[int, int], e2: Vec3, e3: Vec3, floor: float, w: float, col: int
) -> None:
    """The end (j, side) of taut string j on a (side 0) or b moves by e2 at configuration 2, by e3 at 3.

    dn2, de_a, gap n3.e3
    """
    j, side = end
    c = model.contact_height.shape[0] + j
    F = data.pair_frame[j]
    sign = 1.0 if side == 0 else -1.0
    fn, _, _ = contact_impulse(model, data, c)
    p, _, _ = impulse_change(data, c, sign * dot((F[3], F[4], F[5]), e3) - floor, 0.0, 0.0)
    n = string_turn(model, data, j, e2)
    g = -sign * fn
    df = (p * F[0] + g * n[0], p * F[1] + g * n[1], p * F[2] + g * n[2])
    add_pair(model, data, j, df, e2 if side == 0 else (0.0, 0.0, 0.0), w, col)
