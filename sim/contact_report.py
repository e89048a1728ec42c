"""What a step has to say about its contacts, near and far."""

from __future__ import annotations

from sim.contact import contact_kinematics
from sim.friction import contact_error, contact_impulse, slip_violation
from sim.model import Matrix, Model, Work
from solvers.jit import kernel


@kernel
def worst_contact(model: Model, work: Work, kappa: float) -> float:
    """Index of the contact furthest from its law, -1 when a limit is worse or there is none."""
    worst = -1.0
    error = 0.0
    for k in range(model.limit_dof.shape[0]):
        error = max(error, abs(work.bound_gap[k] - work.bound[k, 0]))
    for m in range(work.counts[0]):
        for c in range(work.near[m, 0], work.near[m, 1]):
            e = contact_error(model, work, c) + slip_violation(model, work, c, kappa)
            if e > error:
                error = e
                worst = float(c)
    return worst


@kernel
def report_contacts(model: Model, work: Work, h: float, out: Matrix) -> None:
    """out[c] = impulse in world axes (3), point where it acts (3), gap, slip speed, after a step.  (ncontact, 8)"""
    for m in range(work.counts[1]):
        first = work.far_first[m]
        contact_kinematics(model, work, h, first, model.cluster_end[first])
    for c in range(model.contact_body.shape[0]):
        i = model.contact_body[c]
        k = work.contact_kin[c]
        F = model.contact_frame[c]
        fn, f1, f2 = contact_impulse(model, work, c)
        for e in range(3):
            out[c, e] = F[e] * fn + F[3 + e] * f1 + F[6 + e] * f2
            out[c, 3 + e] = work.pos3[i, e] + k[3 + e]
        out[c, 6] = k[0]
        out[c, 7] = (k[1] * k[1] + k[2] * k[2]) ** 0.5
