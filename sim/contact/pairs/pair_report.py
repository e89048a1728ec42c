"""The report of a step about bodies in contact with each other."""

from __future__ import annotations

from sim.contact.contact_law import report_contact
from sim.contact.pairs.pair_contact import is_absent
from sim.model.columns import Witness
from sim.model.data import Data
from sim.model.model import Model
from sim.model.slots import Slot
from solvers.compiler import optional
from solvers.types import Matrix


@optional(Slot.REPORT_PAIRS)
def report_pairs(model: Model, data: Data, out: Matrix) -> None:
    """The rows of the pairs: impulse on the first body."""
    for j in range(model.pair_kind.shape[0]):
        c = model.contact_height.shape[0] + j
        report_contact(model, data, c, data.pair_frame[j], out[c])
        if is_absent(data, j):
            out[c, 6] = data.pair_out[j, Witness.GAP]
            for e in range(3):
                out[c, e] = 0.0
