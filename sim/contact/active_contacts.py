"""All active contacts of a step at once: one kernel per operation of the interior point.

Every kernel here is optional: a scene with joint limits alone compiles none of them, nor anything below them. An empty
slot returns the sum over no contact. Those up to `add_slip_jacobians` are of contacts with the ground alone; their
counterparts for pairs of bodies are in pairs/, and sim/solve/inequalities.py calls both, so that a scene compiles what
it has. The others are of both. Inactive contacts (inactive.py) have no part in the variables and the
matrix of the interior point; they only add their impulses.
"""

from __future__ import annotations

from sim.contact.contact_law import (
    condense_contact,
    contact_boundary,
    contact_constant,
    contact_error,
    contact_impulse,
    contact_products,
    contact_products_ahead,
    keep_in_cone,
    law_of,
    recover_contact,
    resume_contact,
    return_contact,
    slip_violation,
    start_contact,
)
from sim.contact.corner_laws import add_corner_laws, add_corner_slips
from sim.contact.far_contacts import add_far_wrenches
from sim.contact.ground_contact import (
    add_contact_law,
    add_contact_turn,
    add_contact_wrench,
    contact_jacobian,
    contact_kinematics,
    contact_rate,
)
from sim.contact.inactive_impulses import add_inactive_wrenches, update_inactive
from sim.contact.moments.contact_moments import moment_constants, moment_error
from sim.contact.pairs.pair_jacobian import pair_rate
from sim.contact.pairs.pair_stiffness import pair_constants
from sim.contact.terrain_contact import add_frame_matrix
from sim.dynamics.elimination import dot_six, subtree_sums
from sim.dynamics.pose_jacobians import add_slip_jacobian
from sim.model.data import Data
from sim.model.model import Law, Model
from sim.model.options import LawForm, NewtonTarget
from sim.model.record_columns import Bounce, Cone, Kin
from sim.model.slots import Slot
from solvers.compiler import optional
from solvers.types import Matrix


@optional(Slot.HAS_PYRAMIDS, default=False)
def has_pyramids(model: Model, data: Data) -> bool:
    """Whether an active contact with the ground has a friction pyramid."""
    for m in range(data.active_ground_count[0]):
        if law_of(model, data.active[m]) == Law.LINEAR:
            return True
    return False


@optional(Slot.CONTACTS_KINEMATICS)
def contacts_kinematics(model: Model, data: Data, h: float) -> None:
    """Gaps and slips of active contacts with the ground, impulses of inactive ones, at configuration 3."""
    for m in range(data.active_ground_count[0]):
        contact_kinematics(model, data, h, data.active[m])
    update_inactive(model, data, h)


@optional(Slot.APPLY_CONTACTS, default=0.0)
def apply_contacts(model: Model, data: Data) -> float:
    """wrench -= impulses of all contacts with the ground; returns the largest equality residual."""
    r = 0.0
    for m in range(data.active_ground_count[0]):
        c = data.active[m]
        fn, f1, f2 = contact_impulse(model, data, c)
        add_contact_wrench(model, data, c, fn, f1, f2, data.wrench)
        r = max(r, contact_error(model, data, c))
    add_inactive_wrenches(model, data)
    add_far_wrenches(model, data)
    return r


@optional(Slot.CONDENSE_CONTACTS)
def condense_contacts(
    model: Model, data: Data, h: float, kappa: float, indefinite: float, form: int, out: Matrix
) -> None:
    """out += contacts with the ground, condensed at kappa.  (nbody, 36)

    indefinite: factor of the terms that can make the matrix indefinite, the growth of the friction with the normal
    impulse and the turning of the arms of the impulses; 1 for the derivative.
    form: LawForm.PLAIN, LawForm.STICKING or LawForm.SOFT, see `condense_contact`.
    """
    for m in range(data.active_ground_count[0]):
        c = data.active[m]
        contact_jacobian(model, data, h, c)
        condense_contact(model, data, h, c, kappa, indefinite, form)
        fn, f1, f2 = contact_impulse(model, data, c)
        if form != LawForm.SOFT or data.bounce[c, Bounce.RESTITUTION] == 0.0:  # for impacts see restitution_gradient.py
            add_contact_law(model, data, c, out)
        add_contact_turn(model, data, c, indefinite * fn, indefinite * f1, indefinite * f2, out)
        if model.contact_terrain[c] > 0:
            add_frame_matrix(model, data, c, indefinite * fn, indefinite * f1, indefinite * f2, out)
    add_corner_laws(model, data, h, indefinite, form == LawForm.SOFT, out)


@optional(Slot.ADD_SLIP_JACOBIANS)
def add_slip_jacobians(model: Model, data: Data, h: float) -> None:
    """A2 -= contacts: slips depend on pose 2."""
    for m in range(data.active_ground_count[0]):
        c = data.active[m]
        if data.bounce[c, Bounce.RESTITUTION] == 0.0:
            add_slip_jacobian(model, data, h, c)
    add_corner_slips(model, data, h)


@optional(Slot.CONTACTS_OVERLAP, default=(0.0, 0.0))
def contacts_overlap(model: Model, data: Data, h: float, growth: float) -> tuple[float, float]:
    """(action, depth) of the largest overlaps d: .3 growth m d^2/h, the impulse m d/h that stops it over d, and d/2."""
    action = 0.0
    depth = 0.0
    for m in range(data.active_count[0]):
        c = data.active[m]
        d = -data.contact_kin[c, Kin.GAP]
        if d > 0.0:
            action = max(action, growth * 0.3 * model.body_mass[model.contact_body[c]] * d * d / h)
            depth = max(depth, 0.5 * d)
    return action, depth


@optional(Slot.START_CONTACTS)
def start_contacts(model: Model, data: Data, kappa: float, floor: float) -> None:
    """Cone variables on the central path of kappa, at the present gaps and slips; slacks are at least floor."""
    for m in range(data.active_count[0]):
        start_contact(model, data, data.active[m], kappa, floor)


@optional(Slot.RESUME_CONTACTS)
def resume_contacts(model: Model, data: Data, h: float, kappa: float, predicted: bool) -> None:
    """Cone variables on the central path of kappa, near the present gaps and the impulses kept, or predicted."""
    for m in range(data.active_count[0]):
        resume_contact(model, data, h, data.active[m], kappa, predicted)


@optional(Slot.RETURN_CONTACTS)
def return_contacts(model: Model, data: Data, h: float, kappa: float) -> None:
    """Pairs that the last move took out of their cones, put back onto the central path of kappa."""
    for m in range(data.active_count[0]):
        return_contact(model, data, h, data.active[m], kappa)


@optional(Slot.NORMAL_IMPULSES, default=0.0)
def normal_impulses(model: Model, data: Data) -> float:
    """Sum of the normal impulses [N s]."""
    total = 0.0
    for m in range(data.active_count[0]):
        total += data.cone[data.active[m], Cone.IMPULSE]
    return total


@optional(Slot.CONTACT_CONSTANTS)
def contact_constants(model: Model, data: Data, target: NewtonTarget) -> None:
    """dnu += S2^T B^T w, for the target of this Newton step."""
    for i in range(data.wrench.shape[0]):
        for k in range(6):
            data.wrench[i, k] = 0.0
    for m in range(data.active_ground_count[0]):
        c = data.active[m]
        contact_constant(model, data, c, target)
        w = data.contact_w[c]
        add_contact_wrench(model, data, c, w[0], w[1], w[2], data.wrench)
    pair_constants(model, data, target)
    moment_constants(model, data)
    subtree_sums(model, data.wrench, data.subtree)
    for d in range(data.dnu.shape[0]):
        data.dnu[d] -= dot_six(data.S2[d], data.subtree[model.dof_body[d]])


@optional(Slot.RECOVER_CONTACTS)
def recover_contacts(model: Model, data: Data, gap_fraction: float) -> None:
    """Steps of the cone variables from the twists and rates of the last solve."""
    ground = model.contact_height.shape[0]
    for m in range(data.active_count[0]):
        c = data.active[m]
        rate = contact_rate(model, data, c) if c < ground else pair_rate(model, data, c)
        recover_contact(model, data, c, rate, gap_fraction)


@optional(Slot.LANDS, default=False)
def lands(model: Model, data: Data) -> bool:
    """Whether a contact that does not press yet has reached the ground at the trial velocity."""
    for m in range(data.active_ground_count[0]):
        c = data.active[m]
        z = data.cone[c]
        if data.contact_kin[c, Kin.GAP] < 0.0 and z[Cone.IMPULSE] < z[Cone.SLACK]:
            return True
    return False


@optional(Slot.KEEP_CONTACTS)
def keep_contacts(model: Model, data: Data) -> None:
    """Remember the cone variables from which the line search starts."""
    for m in range(data.active_count[0]):
        c = data.active[m]
        for k in range(12):
            data.cone_trial[c, k] = data.cone[c, k]


@optional(Slot.MOVE_CONTACTS)
def move_contacts(model: Model, data: Data, alpha: float) -> None:
    """cone = kept + alpha step."""
    for m in range(data.active_count[0]):
        c = data.active[m]
        for k in range(12):
            data.cone[c, k] = data.cone_trial[c, k] + alpha * data.carry.cone_step[c, k]
        keep_in_cone(model, data, c)


@optional(Slot.CONTACTS_PRODUCTS, default=(0.0, 0.0, 0.0))
def contacts_products(model: Model, data: Data, kappa: float) -> tuple[float, float, float]:
    """Sum, number and largest distance from kappa of the complementarity products."""
    total = 0.0
    count = 0.0
    violation = 0.0
    for m in range(data.active_count[0]):
        t, n, low, high = contact_products(model, data, data.active[m])
        total += t
        count += n
        violation = max(violation, high - kappa, kappa - low)
    return total, count, violation


@optional(Slot.CONTACTS_PRODUCTS_AHEAD, default=(0.0, 0.0))
def contacts_products_ahead(model: Model, data: Data, alpha: float) -> tuple[float, float]:
    """Sum and number of the complementarity products after a step of length alpha."""
    total = 0.0
    count = 0.0
    for m in range(data.active_count[0]):
        t, n = contact_products_ahead(model, data, data.active[m], alpha)
        total += t
        count += n
    return total, count


@optional(Slot.CONTACTS_BOUNDARY, default=1e30)
def contacts_boundary(model: Model, data: Data) -> float:
    """Largest step that keeps every cone variable in its cone, or 1e30."""
    a = 1e30
    for m in range(data.active_count[0]):
        a = min(a, contact_boundary(model, data, data.active[m]))
    return a


@optional(Slot.SLIP_ERROR, default=0.0)
def slip_error(model: Model, data: Data, kappa: float) -> float:
    """Largest violation of the friction laws of the central path of kappa, in units of kappa."""
    e = 0.0
    for m in range(data.active_count[0]):
        e = max(e, slip_violation(model, data, data.active[m], kappa))
    return max(e, moment_error(model, data, kappa))
