"""Inactive contacts with the ground that derivatives take as active (inactive.py), each with its own law."""

from __future__ import annotations

from sim.contact.contact_law import condense_contact
from sim.contact.ground_contact import contact_jacobian, contact_kinematics
from sim.contact.inactive import enlist_all
from sim.contact.moments.inactive_moments import place_moment
from sim.contact.pairs.inactive_pairs import enlist_pairs
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import LawForm
from sim.model.record_columns import Inactive
from sim.model.slots import Slot
from solvers.compiler import optional


@optional(Slot.ALL_STIFF)
def all_stiff(model: Model, data: Data, h: float) -> None:
    """All contacts with the ground whose stiffness counts taken as active, for the derivatives of a step that has been
    solved.
    """
    found = False
    for m in range(data.inactive_count[0]):
        c = data.inactive_first[m]
        if data.inactive[c, Inactive.STIFF] > 0.0 and data.inactive[c, Inactive.CORNERS] == 0.0:
            found = True
            data.inactive[c, Inactive.ACTIVATION] = 0.0
            for k in range(c, model.cluster_end[c]):
                if data.contact_out[k] == 1:
                    data.contact_out[k] = 0
                    contact_kinematics(model, data, h, k)
                    place_moment(model, data, h, k, data.carry.inactive_kappa[0])
    if found:
        enlist_all(model, data)
        enlist_pairs(model, data)


@optional(Slot.TAKE_CORNERS)
def take_corners(model: Model, data: Data, h: float) -> None:
    """All corners whose laws the derivatives have in sum taken as active: parameters of contacts need each law."""
    found = False
    for m in range(data.inactive_count[0]):
        c = data.inactive_first[m]
        if data.inactive[c, Inactive.CORNERS] > 0.0:
            found = True
            data.inactive[c, Inactive.ACTIVATION] = data.inactive[c, Inactive.CORNERS] = 0.0
            for k in range(c, model.cluster_end[c]):
                if data.contact_out[k] == 1:
                    data.contact_out[k] = 0
                    contact_kinematics(model, data, h, k)
                    contact_jacobian(model, data, h, k)
                    condense_contact(model, data, h, k, data.carry.inactive_kappa[0], 1.0, LawForm.SOFT)
    if found:
        enlist_all(model, data)
        enlist_pairs(model, data)
