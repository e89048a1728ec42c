"""What a step has to say about its contacts, near and far."""

from __future__ import annotations

from sim import late
from sim.contacts.contact import contact_kinematics
from sim.contacts.far import sunk_contact
from sim.contacts.friction import contact_error, contact_impulse, slip_violation
from sim.late import report_pairs
from sim.model import Matrix, Model, Vector
from sim.work import Work
from solvers.compiler import kernel


@late.worst_contact.defined(otherwise=-1.0)
def worst_contact(model: Model, work: Work, kappa: float) -> float:
    """Index of the contact that cannot leave the ground, or of the one furthest from its law; -1 when a limit is worse
    or there is none.
    """
    sunk = sunk_contact(model)
    if sunk >= 0:
        return float(sunk)
    worst = -1.0
    error = 0.0
    for k in range(model.limit_dof.shape[0]):
        error = max(error, abs(work.bound_gap[k] - work.bound[k, 0]))
    for m in range(work.counts[2]):
        for c in range(work.near[m, 0], work.near[m, 1]):
            e = contact_error(model, work, c) + slip_violation(model, work, c, kappa)
            if e > error:
                error = e
                worst = float(c)
    return worst


@late.report_contacts.defined()
def report_contacts(model: Model, work: Work, h: float, out: Matrix) -> None:
    """out[c] = impulse in world axes (3), point where it acts (3), gap, slip speed, normal (3), after a step.

    (ncontact, 11)
    """
    for m in range(work.counts[1]):
        first = work.far_first[m]
        contact_kinematics(model, work, h, first, model.cluster_end[first])
    for c in range(model.contact_height.shape[0]):
        if model.contact_hold[c] != 0:
            contact_kinematics(model, work, h, c, c + 1)
        report_contact(model, work, c, work.contact_frame[c], out[c])
    report_pairs(model, work, out)


@kernel
def report_contact(model: Model, work: Work, c: int, F: Vector, out: Vector) -> None:
    """One row, with the frame F of its normal and tangents."""
    i = model.contact_body[c]
    k = work.contact_kin[c]
    fn, f1, f2 = contact_impulse(model, work, c)
    for e in range(3):
        out[e] = F[e] * fn + F[3 + e] * f1 + F[6 + e] * f2
        out[3 + e] = work.pos3[i, e] + k[3 + e]
        out[8 + e] = F[e]
    out[6] = k[0] + work.bounce[c, 0]
    out[7] = (k[1] * k[1] + k[2] * k[2]) ** 0.5
