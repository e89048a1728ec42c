"""All active contacts, and all limits, of a step at once: what the interior point asks of them, one verb per kernel.

Their complementarity products are in complementarity.py. Inactive contacts (inactive.py) have no part in its variables
and its matrix.
"""

from __future__ import annotations

from sim.contact.contact_law import (
    condense_contact,
    contact_constant,
    contact_error,
    contact_impulse,
    keep_in_cone,
    recover_contact,
    resume_contact,
    return_contact,
    start_contact,
)
from sim.contact.ground_contact import (
    add_contact_law,
    add_contact_turn,
    add_contact_wrench,
    contact_jacobian,
    contact_kinematics,
    contact_rate,
)
from sim.contact.inactive_impulses import add_inactive_wrenches, update_inactive
from sim.contact.pairs.inactive_pairs import far_pair_impulses
from sim.contact.pairs.pair_contact import pair_kinematics
from sim.contact.pairs.pair_jacobian import pair_rate
from sim.contact.pairs.pair_stiffness import apply_pairs, condense_pairs, pair_constants
from sim.contact.restitution import subtract_floors
from sim.contact.terrain_contact import add_frame_matrix
from sim.dynamics.elimination import dot_six, subtree_sums
from sim.dynamics.joints.limits import (
    add_limit_blocks,
    add_limit_impulse,
    limit_constants,
    limit_gaps,
    recover_limits,
    resume_limits,
    return_limits,
)
from sim.dynamics.loops.closure import keep_loops, move_loops
from sim.dynamics.pose_jacobians import add_slip_jacobian
from sim.model.columns import Bounce, Bound, Cone, Kin
from sim.model.data import Work
from sim.model.model import Model
from sim.model.options import LawForm, NewtonTarget
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.types import Matrix

_KAPPA_START = 1e-2  # [N s m]; from 1e-3 landings on jammed legs fail at kappa below 1e-7
_LIMIT_INERTIA = 0.01  # [kg m^2] stands for the inertia behind a joint limit where no solution depends on it


@kernel
def inequality_kinematics(model: Model, work: Work, h: float) -> None:
    """Gaps and slips of active contacts, impulses of inactive ones, gaps of limits, at configuration 3."""
    for m in range(work.active_ground_count[0]):
        contact_kinematics(model, work, h, work.active[m])
    update_inactive(model, work, h)
    pair_kinematics(model, work, h)
    far_pair_impulses(model, work, h, work.inactive_kappa[0])
    subtract_floors(model, work)
    limit_gaps(model, work, h)


@kernel
def start_inequalities(model: Model, work: Work, h: float, kappa: float, growth: float) -> float:
    """All cone variables on the central path of one kappa0, at the present gaps and slips; returns kappa0.

    growth = 0 stands for kappa itself. Otherwise kappa0 is the action of the largest predicted overlap d, 0.3 m d^2/h
    (the impulse m d/h that stops it, over the distance), at least 0.01 N s m and kappa; slacks start at the gaps, at
    least d/2 and sqrt(kappa0)/10.
    """
    k0 = max(kappa, _KAPPA_START * growth)
    floor = 0.1 * k0**0.5 if growth > 0.0 else 0.0
    for m in range(work.active_count[0]):
        c = work.active[m]
        d = -work.contact_kin[c, Kin.GAP]
        if d > 0.0:
            k0 = max(k0, growth * 0.3 * model.body_mass[model.contact_body[c]] * d * d / h)
            floor = max(floor, 0.5 * d)
    for j in range(model.limit_dof.shape[0]):
        d = -work.bound_gap[j]
        if d > 0.0:
            k0 = max(k0, growth * _LIMIT_INERTIA * d * d / h)
            floor = max(floor, 0.5 * d)
    for m in range(work.active_count[0]):
        c = work.active[m]
        start_contact(model, work, c, k0, floor)
    for j in range(model.limit_dof.shape[0]):
        s = max(work.bound_gap[j], floor)
        work.bound[j, Bound.SLACK] = s
        work.bound[j, Bound.IMPULSE] = k0 / s
    return k0


@kernel
def resume_inequalities(model: Model, work: Work, h: float, kappa: float, predicted: bool) -> None:
    """All cone variables on the central path of kappa, near the present gaps and the impulses kept, or predicted."""
    for m in range(work.active_count[0]):
        c = work.active[m]
        resume_contact(model, work, h, c, kappa, predicted)
    resume_limits(model, work, h / _LIMIT_INERTIA, kappa, predicted)


@kernel
def return_inequalities(model: Model, work: Work, h: float, kappa: float) -> None:
    """Every pair that the last move took out of its cone put back onto the central path of kappa."""
    for m in range(work.active_count[0]):
        c = work.active[m]
        return_contact(model, work, h, c, kappa)
    return_limits(model, work, h / _LIMIT_INERTIA, kappa)


@kernel
def total_impulse(model: Model, work: Work) -> float:
    """Sum of the normal impulses of active contacts and limits: of what they balance, an estimate."""
    total = 0.0
    for m in range(work.active_count[0]):
        c = work.active[m]
        total += work.cone[c, Cone.IMPULSE]
    for k in range(model.limit_dof.shape[0]):
        total += work.bound[k, Bound.IMPULSE]
    return total


@kernel
def apply_inequalities(model: Model, work: Work) -> float:
    """wrench -= contact impulses, residual is left to the caller; returns the largest equality residual."""
    r = 0.0
    for m in range(work.active_ground_count[0]):
        c = work.active[m]
        fn, f1, f2 = contact_impulse(model, work, c)
        add_contact_wrench(model, work, c, fn, f1, f2, work.wrench)
        r = max(r, contact_error(model, work, c))
    add_inactive_wrenches(model, work)
    r = max(r, apply_pairs(model, work))
    for k in range(model.limit_dof.shape[0]):
        r = max(r, abs(work.bound_gap[k] - work.bound[k, Bound.SLACK]))
    return r


@kernel
def apply_limits(model: Model, work: Work) -> None:
    """residual -= sign gamma, and p gamma of a cone."""
    for k in range(model.limit_dof.shape[0]):
        add_limit_impulse(model, work, k, -work.bound[k, Bound.IMPULSE], work.residual)


@kernel
def condense_inequalities(model: Model, work: Work, h: float, kappa: float, share: float, form: int) -> None:
    """A += contacts, joint_block += limits: their slacks and impulses eliminated.  See `condense_into`."""
    condense_into(model, work, h, kappa, share, form, work.A)
    add_limit_blocks(model, work, h)


@kernel
def condense_into(model: Model, work: Work, h: float, kappa: float, share: float, form: int, out: Matrix) -> None:
    """out += contacts, condensed at kappa.  (nbody, 36)

    share: of the terms that can make the matrix indefinite, the growth of the friction with the normal impulse and the
    turning of the arms of the impulses; 1 for the derivative.
    form: LawForm.PLAIN, LawForm.LINEAR or LawForm.SOFT, see `condense_contact`.
    """
    for m in range(work.active_ground_count[0]):
        c = work.active[m]
        contact_jacobian(model, work, h, c)
        condense_contact(model, work, h, c, kappa, share, form)
        fn, f1, f2 = contact_impulse(model, work, c)
        if form != LawForm.SOFT or work.bounce[c, Bounce.RESTITUTION] == 0.0:  # for impacts see restitution_gradient.py
            add_contact_law(model, work, c, out)
        add_contact_turn(model, work, c, share * fn, share * f1, share * f2, out)
        if model.contact_terrain[c] > 0:
            add_frame_matrix(model, work, c, share * fn, share * f1, share * f2, out)
    condense_pairs(model, work, h, kappa, share, form)


@optional(Slot.ADD_STIFFNESS)
def add_stiffness(model: Model, work: Work, h: float, kappa: float) -> None:
    """A3, A2 and joint_block += contacts and limits at the solution of a step, for its derivatives."""
    work.contact_hard[0] = 0.0
    condense_into(model, work, h, kappa, 1.0, LawForm.SOFT, work.A3)
    add_slip_jacobians(model, work, h)
    add_limit_blocks(model, work, h)


@kernel
def add_slip_jacobians(model: Model, work: Work, h: float) -> None:
    """A2 -= contacts: slips depend on pose 2."""
    for m in range(work.active_ground_count[0]):
        c = work.active[m]
        if work.bounce[c, Bounce.RESTITUTION] == 0.0:
            add_slip_jacobian(model, work, h, c)


@kernel
def inequality_rhs(model: Model, work: Work, target: NewtonTarget) -> None:
    """dnu += S2^T B^T w + limits, for the target of this Newton step."""
    for i in range(work.wrench.shape[0]):
        for k in range(6):
            work.wrench[i, k] = 0.0
    for m in range(work.active_ground_count[0]):
        c = work.active[m]
        contact_constant(model, work, c, target)
        w = work.contact_w[c]
        add_contact_wrench(model, work, c, w[0], w[1], w[2], work.wrench)
    pair_constants(model, work, target)
    subtree_sums(model, work.wrench, work.subtree)
    for d in range(work.dnu.shape[0]):
        work.dnu[d] -= dot_six(work.S2[d], work.subtree[model.dof_body[d]])
    limit_constants(model, work, target)


@kernel
def recover_inequalities(model: Model, work: Work, h: float, share: float) -> None:
    """Steps of all cone variables from the twists and rates of the last solve."""
    ground = model.contact_height.shape[0]
    for m in range(work.active_count[0]):
        c = work.active[m]
        rate = contact_rate(model, work, c) if c < ground else pair_rate(model, work, c)
        recover_contact(model, work, c, rate, share)
    recover_limits(model, work, h, share)


@kernel
def keep_inequalities(model: Model, work: Work) -> None:
    """Remember the cone variables from which the line search starts."""
    for m in range(work.active_count[0]):
        c = work.active[m]
        for k in range(12):
            work.cone_trial[c, k] = work.cone[c, k]
    for k in range(model.limit_dof.shape[0]):
        work.bound_trial[k, Bound.SLACK] = work.bound[k, Bound.SLACK]
        work.bound_trial[k, Bound.IMPULSE] = work.bound[k, Bound.IMPULSE]
    keep_loops(model, work)


@kernel
def move_inequalities(model: Model, work: Work, alpha: float) -> None:
    """cone = kept + alpha step."""
    for m in range(work.active_count[0]):
        c = work.active[m]
        for k in range(12):
            work.cone[c, k] = work.cone_trial[c, k] + alpha * work.cone_step[c, k]
        keep_in_cone(model, work, c)
    for k in range(model.limit_dof.shape[0]):
        work.bound[k, Bound.SLACK] = work.bound_trial[k, Bound.SLACK] + alpha * work.bound_step[k, Bound.SLACK]
        work.bound[k, Bound.IMPULSE] = work.bound_trial[k, Bound.IMPULSE] + alpha * work.bound_step[k, Bound.IMPULSE]
    move_loops(model, work, alpha)
