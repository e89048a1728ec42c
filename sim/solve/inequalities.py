"""All active contacts, limits and dry friction of a step at once: the operations of the interior point, one per kernel.

Those of contacts are in sim/contact/active_contacts.py and sim/contact/pairs/, those of limits in
sim/dynamics/joints/limits.py; the complementarity products are in complementarity.py.
"""

from __future__ import annotations

from sim.contact.active_contacts import (
    add_slip_jacobians,
    apply_contacts,
    condense_contacts,
    contact_constants,
    contacts_kinematics,
    contacts_overlap,
    keep_contacts,
    move_contacts,
    normal_impulses,
    recover_contacts,
    resume_contacts,
    return_contacts,
    start_contacts,
)
from sim.contact.inactive import choose_active, has_activated
from sim.contact.moments.contact_moments import (
    add_moment_rates,
    apply_moments,
    condense_moments,
    keep_moments,
    moment_rates,
    move_moments,
    recover_moments,
    resume_moments,
    start_moments,
)
from sim.contact.pairs.inactive_pairs import begin_pairs, enlist_pairs, inactive_pair_impulses, pairs_activated
from sim.contact.pairs.pair_contact import pair_kinematics
from sim.contact.pairs.pair_stiffness import apply_pairs, condense_pairs
from sim.contact.restitution import subtract_floors
from sim.dynamics.joints.dry_friction import (
    add_dry_blocks,
    apply_dry,
    dry_constants,
    dry_error,
    dry_kinematics,
    dry_load,
    keep_dry,
    move_dry,
    recover_dry,
    resume_dry,
    return_dry,
    start_dry,
)
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
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import LawForm, NewtonTarget, StepOptions
from sim.model.record_columns import Bound
from sim.model.slots import Slot
from solvers.compiler import kernel, optional

_KAPPA_START = 1e-2  # [N s m]; from 1e-3 landings on jammed legs fail at kappa below 1e-7
_LIMIT_INERTIA = 0.01  # [kg m^2] stands for the inertia behind a joint limit where no solution depends on it


@kernel
def choose_inequalities(model: Model, data: Data, options: StepOptions) -> None:
    """Sort contacts into active and inactive ones, where a step begins."""
    begin_pairs(model, data, options)
    choose_active(model, data, options)
    data.carry.inactive_kappa[0] = options.kappa
    enlist_pairs(model, data)


@kernel
def inequalities_activated(model: Model, data: Data, options: StepOptions) -> bool:
    """Whether inactive contacts have become active at configuration 3; they are from now on."""
    pairs = pairs_activated(model, data, options)
    ground = has_activated(model, data, options)
    if pairs or ground:
        enlist_pairs(model, data)
    return pairs or ground


@kernel
def inequality_kinematics(model: Model, data: Data, h: float) -> None:
    """Gaps and slips of active contacts, impulses of inactive ones, gaps of limits, at configuration 3."""
    contacts_kinematics(model, data, h)
    pair_kinematics(model, data, h)
    moment_rates(model, data, h)
    inactive_pair_impulses(model, data, h, data.carry.inactive_kappa[0])
    subtract_floors(model, data)
    limit_gaps(model, data, h)
    dry_kinematics(model, data, h)


@kernel
def start_inequalities(model: Model, data: Data, h: float, kappa: float, growth: float) -> float:
    """All cone variables on the central path of one kappa0, at the present gaps and slips; returns kappa0.

    growth = 0 stands for kappa itself. Otherwise kappa0 is the action of the largest predicted overlap d, 0.3 m d^2/h
    (the impulse m d/h that stops it, over the distance), at least 0.01 N s m and kappa; slacks start at the gaps, at
    least d/2 and sqrt(kappa0)/10.
    """
    k0 = max(kappa, _KAPPA_START * growth)
    floor = 0.1 * k0**0.5 if growth > 0.0 else 0.0
    action, depth = contacts_overlap(model, data, h, growth)
    k0, floor = max(k0, action), max(floor, depth)
    for j in range(model.limit_dof.shape[0]):
        d = -data.bound_gap[j]
        if d > 0.0:
            k0 = max(k0, growth * _LIMIT_INERTIA * d * d / h)
            floor = max(floor, 0.5 * d)
    start_contacts(model, data, k0, floor)
    start_moments(model, data, k0)
    for j in range(model.limit_dof.shape[0]):
        s = max(data.bound_gap[j], floor)
        data.bound[j, Bound.SLACK] = s
        data.bound[j, Bound.IMPULSE] = k0 / s
    start_dry(model, data, k0)
    return k0


@kernel
def resume_inequalities(model: Model, data: Data, h: float, kappa: float, predicted: bool) -> None:
    """All cone variables on the central path of kappa, near the present gaps and the impulses kept, or predicted."""
    resume_contacts(model, data, h, kappa, predicted)
    resume_moments(model, data, kappa, predicted)
    resume_limits(model, data, h / _LIMIT_INERTIA, kappa, predicted)
    resume_dry(model, data, kappa, predicted)


@kernel
def return_inequalities(model: Model, data: Data, h: float, kappa: float) -> None:
    """Put every pair that the last move took out of its cone back onto the central path of kappa."""
    return_contacts(model, data, h, kappa)
    return_limits(model, data, h / _LIMIT_INERTIA, kappa)
    return_dry(model, data, kappa)


@kernel
def total_impulse(model: Model, data: Data) -> float:
    """Sum of the normal impulses of active contacts and limits: an estimate of the load that they balance."""
    total = normal_impulses(model, data) + dry_load(model, data)
    for k in range(model.limit_dof.shape[0]):
        total += data.bound[k, Bound.IMPULSE]
    return total


@kernel
def apply_inequalities(model: Model, data: Data) -> float:
    """wrench -= contact impulses, residual is left to the caller; returns the largest equality residual."""
    r = max(apply_contacts(model, data), apply_pairs(model, data), dry_error(model, data))
    apply_moments(model, data)
    for k in range(model.limit_dof.shape[0]):
        r = max(r, abs(data.bound_gap[k] - data.bound[k, Bound.SLACK]))
    return r


@kernel
def apply_limits(model: Model, data: Data) -> None:
    """residual -= impulses of joint limits (sign gamma), of cones (p gamma), and of dry friction."""
    for k in range(model.limit_dof.shape[0]):
        add_limit_impulse(model, data, k, -data.bound[k, Bound.IMPULSE], data.residual)
    apply_dry(model, data, data.residual)


@kernel
def condense_inequalities(model: Model, data: Data, h: float, kappa: float, indefinite: float, form: int) -> None:
    """A += contacts, joint_block += limits: their slacks and impulses eliminated.  See `condense_contacts`."""
    condense_contacts(model, data, h, kappa, indefinite, form, data.A)
    condense_pairs(model, data, h, kappa, indefinite, form)
    condense_moments(model, data, h, kappa, indefinite, form, data.A)
    add_limit_blocks(model, data, h)
    add_dry_blocks(model, data, h)


@optional(Slot.ADD_STIFFNESS)
def add_stiffness(model: Model, data: Data, h: float, kappa: float) -> None:
    """A3, A2 and joint_block += contacts and limits at the solution of a step, for its derivatives."""
    data.contact_hard[0] = 0.0
    condense_contacts(model, data, h, kappa, 1.0, LawForm.SOFT, data.A3)
    condense_pairs(model, data, h, kappa, 1.0, LawForm.SOFT)
    condense_moments(model, data, h, kappa, 1.0, LawForm.SOFT, data.A3)
    add_slip_jacobians(model, data, h)
    add_moment_rates(model, data, h)
    add_limit_blocks(model, data, h)
    add_dry_blocks(model, data, h)


@kernel
def inequality_rhs(model: Model, data: Data, target: NewtonTarget) -> None:
    """dnu += S2^T B^T w + limits, for the target of this Newton step."""
    contact_constants(model, data, target)
    limit_constants(model, data, target)
    dry_constants(model, data, target)


@kernel
def recover_inequalities(model: Model, data: Data, h: float, gap_fraction: float) -> None:
    """Steps of all cone variables from the twists and rates of the last solve."""
    recover_contacts(model, data, gap_fraction)
    recover_moments(model, data)
    recover_limits(model, data, h, gap_fraction)
    recover_dry(model, data, h)


@kernel
def keep_inequalities(model: Model, data: Data) -> None:
    """Remember the cone variables from which the line search starts."""
    keep_contacts(model, data)
    keep_moments(model, data)
    for k in range(model.limit_dof.shape[0]):
        data.bound_trial[k, Bound.SLACK] = data.bound[k, Bound.SLACK]
        data.bound_trial[k, Bound.IMPULSE] = data.bound[k, Bound.IMPULSE]
    keep_dry(model, data)
    keep_loops(model, data)


@kernel
def move_inequalities(model: Model, data: Data, alpha: float) -> None:
    """cone = kept + alpha step."""
    move_contacts(model, data, alpha)
    move_moments(model, data, alpha)
    step = data.carry.bound_step
    for k in range(model.limit_dof.shape[0]):
        data.bound[k, Bound.SLACK] = data.bound_trial[k, Bound.SLACK] + alpha * step[k, Bound.SLACK]
        data.bound[k, Bound.IMPULSE] = data.bound_trial[k, Bound.IMPULSE] + alpha * step[k, Bound.IMPULSE]
    move_dry(model, data, alpha)
    move_loops(model, data, alpha)
