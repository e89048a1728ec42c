"""All active contacts, and all limits, of a step at once: the operations of the interior point on them, one per kernel.

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
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import LawForm, NewtonTarget
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.types import Matrix

_KAPPA_START = 1e-2  # [N s m]; from 1e-3 landings on jammed legs fail at kappa below 1e-7
_LIMIT_INERTIA = 0.01  # [kg m^2] stands for the inertia behind a joint limit where no solution depends on it


@kernel
def inequality_kinematics(model: Model, data: Data, h: float) -> None:
    """Gaps and slips of active contacts, impulses of inactive ones, gaps of limits, at configuration 3."""
    for m in range(data.active_ground_count[0]):
        contact_kinematics(model, data, h, data.active[m])
    update_inactive(model, data, h)
    pair_kinematics(model, data, h)
    far_pair_impulses(model, data, h, data.inactive_kappa[0])
    subtract_floors(model, data)
    limit_gaps(model, data, h)


@kernel
def start_inequalities(model: Model, data: Data, h: float, kappa: float, growth: float) -> float:
    """All cone variables on the central path of one kappa0, at the present gaps and slips; returns kappa0.

    growth = 0 stands for kappa itself. Otherwise kappa0 is the action of the largest predicted overlap d, 0.3 m d^2/h
    (the impulse m d/h that stops it, over the distance), at least 0.01 N s m and kappa; slacks start at the gaps, at
    least d/2 and sqrt(kappa0)/10.
    """
    k0 = max(kappa, _KAPPA_START * growth)
    floor = 0.1 * k0**0.5 if growth > 0.0 else 0.0
    for m in range(data.active_count[0]):
        c = data.active[m]
        d = -data.contact_kin[c, Kin.GAP]
        if d > 0.0:
            k0 = max(k0, growth * 0.3 * model.body_mass[model.contact_body[c]] * d * d / h)
            floor = max(floor, 0.5 * d)
    for j in range(model.limit_dof.shape[0]):
        d = -data.bound_gap[j]
        if d > 0.0:
            k0 = max(k0, growth * _LIMIT_INERTIA * d * d / h)
            floor = max(floor, 0.5 * d)
    for m in range(data.active_count[0]):
        c = data.active[m]
        start_contact(model, data, c, k0, floor)
    for j in range(model.limit_dof.shape[0]):
        s = max(data.bound_gap[j], floor)
        data.bound[j, Bound.SLACK] = s
        data.bound[j, Bound.IMPULSE] = k0 / s
    return k0


@kernel
def resume_inequalities(model: Model, data: Data, h: float, kappa: float, predicted: bool) -> None:
    """All cone variables on the central path of kappa, near the present gaps and the impulses kept, or predicted."""
    for m in range(data.active_count[0]):
        c = data.active[m]
        resume_contact(model, data, h, c, kappa, predicted)
    resume_limits(model, data, h / _LIMIT_INERTIA, kappa, predicted)


@kernel
def return_inequalities(model: Model, data: Data, h: float, kappa: float) -> None:
    """Every pair that the last move took out of its cone put back onto the central path of kappa."""
    for m in range(data.active_count[0]):
        c = data.active[m]
        return_contact(model, data, h, c, kappa)
    return_limits(model, data, h / _LIMIT_INERTIA, kappa)


@kernel
def total_impulse(model: Model, data: Data) -> float:
    """Sum of the normal impulses of active contacts and limits: an estimate of the load that they balance."""
    total = 0.0
    for m in range(data.active_count[0]):
        c = data.active[m]
        total += data.cone[c, Cone.IMPULSE]
    for k in range(model.limit_dof.shape[0]):
        total += data.bound[k, Bound.IMPULSE]
    return total


@kernel
def apply_inequalities(model: Model, data: Data) -> float:
    """wrench -= contact impulses, residual is left to the caller; returns the largest equality residual."""
    r = 0.0
    for m in range(data.active_ground_count[0]):
        c = data.active[m]
        fn, f1, f2 = contact_impulse(model, data, c)
        add_contact_wrench(model, data, c, fn, f1, f2, data.wrench)
        r = max(r, contact_error(model, data, c))
    add_inactive_wrenches(model, data)
    r = max(r, apply_pairs(model, data))
    for k in range(model.limit_dof.shape[0]):
        r = max(r, abs(data.bound_gap[k] - data.bound[k, Bound.SLACK]))
    return r


@kernel
def apply_limits(model: Model, data: Data) -> None:
    """residual -= sign gamma, and p gamma of a cone."""
    for k in range(model.limit_dof.shape[0]):
        add_limit_impulse(model, data, k, -data.bound[k, Bound.IMPULSE], data.residual)


@kernel
def condense_inequalities(model: Model, data: Data, h: float, kappa: float, share: float, form: int) -> None:
    """A += contacts, joint_block += limits: their slacks and impulses eliminated.  See `condense_into`."""
    condense_into(model, data, h, kappa, share, form, data.A)
    add_limit_blocks(model, data, h)


@kernel
def condense_into(model: Model, data: Data, h: float, kappa: float, share: float, form: int, out: Matrix) -> None:
    """out += contacts, condensed at kappa.  (nbody, 36)

    share: of the terms that can make the matrix indefinite, the growth of the friction with the normal impulse and the
    turning of the arms of the impulses; 1 for the derivative.
    form: LawForm.PLAIN, LawForm.LINEAR or LawForm.SOFT, see `condense_contact`.
    """
    for m in range(data.active_ground_count[0]):
        c = data.active[m]
        contact_jacobian(model, data, h, c)
        condense_contact(model, data, h, c, kappa, share, form)
        fn, f1, f2 = contact_impulse(model, data, c)
        if form != LawForm.SOFT or data.bounce[c, Bounce.RESTITUTION] == 0.0:  # for impacts see restitution_gradient.py
            add_contact_law(model, data, c, out)
        add_contact_turn(model, data, c, share * fn, share * f1, share * f2, out)
        if model.contact_terrain[c] > 0:
            add_frame_matrix(model, data, c, share * fn, share * f1, share * f2, out)
    condense_pairs(model, data, h, kappa, share, form)


@optional(Slot.ADD_STIFFNESS)
def add_stiffness(model: Model, data: Data, h: float, kappa: float) -> None:
    """A3, A2 and joint_block += contacts and limits at the solution of a step, for its derivatives."""
    data.contact_hard[0] = 0.0
    condense_into(model, data, h, kappa, 1.0, LawForm.SOFT, data.A3)
    add_slip_jacobians(model, data, h)
    add_limit_blocks(model, data, h)


@kernel
def add_slip_jacobians(model: Model, data: Data, h: float) -> None:
    """A2 -= contacts: slips depend on pose 2."""
    for m in range(data.active_ground_count[0]):
        c = data.active[m]
        if data.bounce[c, Bounce.RESTITUTION] == 0.0:
            add_slip_jacobian(model, data, h, c)


@kernel
def inequality_rhs(model: Model, data: Data, target: NewtonTarget) -> None:
    """dnu += S2^T B^T w + limits, for the target of this Newton step."""
    for i in range(data.wrench.shape[0]):
        for k in range(6):
            data.wrench[i, k] = 0.0
    for m in range(data.active_ground_count[0]):
        c = data.active[m]
        contact_constant(model, data, c, target)
        w = data.contact_w[c]
        add_contact_wrench(model, data, c, w[0], w[1], w[2], data.wrench)
    pair_constants(model, data, target)
    subtree_sums(model, data.wrench, data.subtree)
    for d in range(data.dnu.shape[0]):
        data.dnu[d] -= dot_six(data.S2[d], data.subtree[model.dof_body[d]])
    limit_constants(model, data, target)


@kernel
def recover_inequalities(model: Model, data: Data, h: float, share: float) -> None:
    """Steps of all cone variables from the twists and rates of the last solve."""
    ground = model.contact_height.shape[0]
    for m in range(data.active_count[0]):
        c = data.active[m]
        rate = contact_rate(model, data, c) if c < ground else pair_rate(model, data, c)
        recover_contact(model, data, c, rate, share)
    recover_limits(model, data, h, share)


@kernel
def keep_inequalities(model: Model, data: Data) -> None:
    """Remember the cone variables from which the line search starts."""
    for m in range(data.active_count[0]):
        c = data.active[m]
        for k in range(12):
            data.cone_trial[c, k] = data.cone[c, k]
    for k in range(model.limit_dof.shape[0]):
        data.bound_trial[k, Bound.SLACK] = data.bound[k, Bound.SLACK]
        data.bound_trial[k, Bound.IMPULSE] = data.bound[k, Bound.IMPULSE]
    keep_loops(model, data)


@kernel
def move_inequalities(model: Model, data: Data, alpha: float) -> None:
    """cone = kept + alpha step."""
    for m in range(data.active_count[0]):
        c = data.active[m]
        for k in range(12):
            data.cone[c, k] = data.cone_trial[c, k] + alpha * data.cone_step[c, k]
        keep_in_cone(model, data, c)
    for k in range(model.limit_dof.shape[0]):
        data.bound[k, Bound.SLACK] = data.bound_trial[k, Bound.SLACK] + alpha * data.bound_step[k, Bound.SLACK]
        data.bound[k, Bound.IMPULSE] = data.bound_trial[k, Bound.IMPULSE] + alpha * data.bound_step[k, Bound.IMPULSE]
    move_loops(model, data, alpha)
