"""The report of a step about its contacts, active and inactive."""

from __future__ import annotations

from sim.contact.contact_law import contact_error, report_contact, slip_violation
from sim.contact.corners import report_corners
from sim.contact.far_contacts import FAR
from sim.contact.ground_contact import contact_kinematics
from sim.contact.inactive import sunk_contact
from sim.contact.moments.contact_moments import report_moments
from sim.contact.moments.moment_law import moment_violation
from sim.contact.pairs.pair_report import report_pairs
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import Bound, Cluster
from sim.model.slots import Slot
from solvers.compiler import inlined, optional
from solvers.types import Matrix


@optional(Slot.WORST_CONTACT, default=-1.0)
def worst_contact(model: Model, data: Data, kappa: float) -> float:
    """Index of the contact that cannot leave the ground, or of the one furthest from its law; -1 when a limit is worse
    or there is none.
    """
    sunk = sunk_contact(model)
    if sunk >= 0:
        return float(sunk)
    worst = -1.0
    error = 0.0
    for k in range(model.limit_dof.shape[0]):
        error = max(error, abs(data.bound_gap[k] - data.bound[k, Bound.SLACK]))
    for m in range(data.active_count[0]):
        c = data.active[m]
        e = contact_error(model, data, c) + slip_violation(model, data, c, kappa)
        e += moment_violation(model, data, c, kappa)
        if e > error:
            error = e
            worst = float(c)
    return worst


@inlined
def report_contacts(model: Model, data: Data, h: float, out: Matrix) -> None:
    """out[c] = impulse in world axes (3), point where it acts (3), gap, slip speed, normal (3), after a step.

    (ncontact, 11)
    """
    report_ground(model, data, h, out)
    report_pairs(model, data, out)
    report_moments(model, data, out)


@optional(Slot.REPORT_CONTACTS)
def report_ground(model: Model, data: Data, h: float, out: Matrix) -> None:
    """The rows of contacts with the ground."""
    for m in range(data.inactive_count[0]):
        first = data.inactive_first[m]
        for c in range(first, model.cluster_end[first]):
            if data.contact_out[c] == 1 and model.cluster[first, Cluster.CORNERS] == 0.0:
                contact_kinematics(model, data, h, c)
    first = 0
    for c in range(model.contact_height.shape[0]):
        if model.cluster_end[c] > 0:
            first = c
            report_corners(model, data, h, c, out)
        if model.contact_hold[c] != 0 or data.contact_out[c] == FAR:
            contact_kinematics(model, data, h, c)
        elif data.contact_out[c] == 1 and model.cluster[first, Cluster.CORNERS] > 0.0:
            continue
        report_contact(model, data, c, data.contact_frame[c], out[c])
