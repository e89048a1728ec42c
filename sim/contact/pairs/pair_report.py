"""The report of a step about bodies in contact with each other."""

from __future__ import annotations

from sim.contact.contact_law import report_contact
from sim.contact.pairs.limited_reach import BEYOND, end_of
from sim.contact.pairs.pair_contact import is_absent
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import ContactRow, PairFade, RelativePose, Witness
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.dense import is_finite
from solvers.types import Matrix


@optional(Slot.PAIRS_FINITE, default=True)
def pairs_finite(model: Model, data: Data, rows: Matrix) -> bool:
    """Whether all numbers of the rows of the pairs are; those beyond their reach are constants."""
    ground = model.contact_height.shape[0]
    for m in range(data.near_collision_count[0]):
        first = data.near_collisions[m]
        for j in range(first, end_of(model, first)):
            if not is_finite(rows[ground + j]):
                return False
    return True


@optional(Slot.REPORT_PAIRS)
def report_pairs(model: Model, data: Data, out: Matrix) -> None:
    """The rows of the pairs: impulse on the first body. Rows are new and zero; those of collisions beyond their reach
    stay so, but for a gap BEYOND in the first of all, which says that there is a report: to write, or read, as many as
    a robot has takes longer than a step.
    """
    ground = model.contact_height.shape[0]
    for m in range(data.near_collision_count[0]):
        first = data.near_collisions[m]
        _report(model, data, first, end_of(model, first), out)
    if data.near_collision_count[0] == 0 or data.near_collisions[0] > 0:
        out[ground, ContactRow.GAP] = BEYOND


@kernel
def _report(model: Model, data: Data, first: int, end: int, out: Matrix) -> None:
    """The rows of the pairs first to end."""
    for j in range(first, end):
        c = model.contact_height.shape[0] + j
        report_contact(model, data, c, data.pair_frame[j], out[c])
        w = data.pair_fade[j, PairFade.PART]
        for e in range(3):
            out[c, e] *= w
        out[c, ContactRow.GAP] -= data.pair_before[first, RelativePose.LEFT]
        if is_absent(data, j):
            out[c, ContactRow.GAP] = data.pair_out[j, Witness.GAP]
            for e in range(3):
                out[c, e] = 0.0
