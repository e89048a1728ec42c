"""The contact laws on the central path: residuals, condensation to W d(gap, slip) + w, recovery of the cone steps.

Columns of `cone` (and of its steps): Cone or Pyramid; the slack s of the gap and the normal impulse gamma, s gamma =
kappa, then those of the friction law (cone.py, pyramid.py). A contact without friction has the first
two only: its cone would be degenerate, and costs nothing when omitted.
"""

from __future__ import annotations

from sim.contact.cone import condense_cone, cone_constant, cone_violation, recover_cone, start_cone, within_cone
from sim.contact.pyramid import (
    condense_pyramid,
    pyramid_boundary,
    pyramid_constant,
    pyramid_error,
    pyramid_products,
    pyramid_products_ahead,
    recover_pyramid,
    return_pyramid,
    start_pyramid,
)
from sim.contact.softening import soften
from sim.model.data import Data
from sim.model.model import Law, Model
from sim.model.options import LawForm, NewtonTarget
from sim.model.record_columns import Bounce, Cone, ContactRow, Kin, Moment, MomentRow, Pyramid
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.cones import onto_path, orthant_step, return_pair
from solvers.rotation import Vec3
from solvers.types import Vector


@kernel
def law_of(model: Model, c: int) -> int:
    """Law of contact c: without friction it is an impact law."""
    return model.contact_law[c] if model.contact_friction[c] > 0.0 else Law.IMPACT.value


@kernel
def start_contact(model: Model, data: Data, c: int, kappa: float, floor: float) -> None:
    """Variables of contact c on the central path of kappa at its gap (at least `floor`) and slip: gamma = kappa / s."""
    z = data.cone[c]
    z[Cone.SLACK] = max(data.contact_kin[c, Kin.GAP], floor)
    z[Cone.IMPULSE] = kappa / z[Cone.SLACK]
    _start_friction(model, data, c, kappa)


@kernel
def resume_contact(model: Model, data: Data, h: float, c: int, kappa: float, predicted: bool) -> None:
    """Variables of contact c on the central path of kappa, near its gap and the impulse that it had (in cone_trial).

    predicted: near the impulse that it has now; where that presses, it stays, with its friction, and gives the slack.
    """
    z = data.cone[c]
    weight = h * _response(model, c)
    impulse = z[Cone.IMPULSE] if predicted else data.cone_trial[c, Cone.IMPULSE]
    if predicted and weight * impulse * impulse > kappa:
        z[Cone.SLACK] = kappa / impulse
    else:
        z[Cone.SLACK], z[Cone.IMPULSE] = onto_path(data.contact_kin[c, Kin.GAP], impulse, weight, kappa)
        _start_friction(model, data, c, kappa)


@kernel
def _start_friction(model: Model, data: Data, c: int, kappa: float) -> None:
    """Friction of contact c on the central path of kappa at its slip."""
    law = law_of(model, c)
    if law == Law.NONLINEAR:
        start_cone(model, data, c, kappa)
    elif law == Law.LINEAR:
        start_pyramid(model, data, c, kappa)


@kernel
def _response(model: Model, c: int) -> float:
    """1/m, m the mass of the body of contact c (1 kg where it has none): the change of speed that an impulse makes to a
    free body.
    """
    m = model.body_mass[model.contact_body[c]]
    return 1.0 / m if m > 0.0 else 1.0


@kernel
def contact_error(model: Model, data: Data, c: int) -> float:
    """Largest equality residual of contact c: |gap - s|, and those of the pyramid."""
    r = abs(data.contact_kin[c, Kin.GAP] - data.cone[c, Cone.SLACK])
    if law_of(model, c) == Law.LINEAR:
        r = max(r, pyramid_error(model, data, c))
    return r


@kernel
def contact_impulse(model: Model, data: Data, c: int) -> tuple[float, float, float]:
    """Impulse (normal, t1, t2) of the present cone variables."""
    z = data.cone[c]
    law = law_of(model, c)
    if law == Law.NONLINEAR:
        return z[Cone.IMPULSE], z[Cone.FRICTION1], z[Cone.FRICTION2]
    if law == Law.LINEAR:
        return (
            z[Cone.IMPULSE],
            z[Pyramid.FRICTION] - z[Pyramid.FRICTION + 1],
            z[Pyramid.FRICTION + 2] - z[Pyramid.FRICTION + 3],
        )
    return z[Cone.IMPULSE], 0.0, 0.0


@kernel
def contact_products(model: Model, data: Data, c: int) -> tuple[float, float, float, float]:
    """(sum, count, low, high) of the complementarity products of contact c; all equal kappa on the central path."""
    p = data.cone[c, Cone.SLACK] * data.cone[c, Cone.IMPULSE]
    if law_of(model, c) == Law.LINEAR:
        total, lo, hi = pyramid_products(model, data, c)
        return p + total, 6.0, min(p, lo), max(p, hi)
    return p, 1.0, p, p


@kernel
def slip_violation(model: Model, data: Data, c: int, kappa: float) -> float:
    """Violation of the law of the exact cone, in units of kappa; 0 for the others."""
    return cone_violation(model, data, c, kappa) if law_of(model, c) == Law.NONLINEAR else 0.0


@optional(Slot.SLIP_NOISE, default=0.0)
def slip_noise(model: Model, data: Data, h: float) -> float:
    """Rounding of the friction laws: mu gamma times that of the slips, which are differences of positions over h; and
    of angular velocities.
    """
    e = 0.0
    for m in range(data.active_count[0]):
        c = data.active[m]
        i = model.contact_body[c]
        k = data.contact_kin[c]
        length = abs(data.pos3[i, 0]) + abs(data.pos3[i, 1]) + abs(data.pos3[i, 2])
        length += abs(k[Kin.ARM]) + abs(k[Kin.ARM + 1]) + abs(k[Kin.ARM + 2])
        speed = length / h + abs(k[Kin.SLIP1]) + abs(k[Kin.SLIP2])
        e = max(e, 4e-16 * model.contact_friction[c] * data.cone[c, Cone.IMPULSE] * speed)
        if model.moment_friction.shape[0] > 0:
            most = max(model.moment_friction[c, MomentRow.SPIN], model.moment_friction[c, MomentRow.ROLL])
            e = max(e, 4e-16 * most * data.cone[c, Cone.IMPULSE] * 2.0 / h)
    return e


@kernel
def contact_products_ahead(model: Model, data: Data, c: int, alpha: float) -> tuple[float, float]:
    """(sum, count) of the complementarity products after a step of length alpha."""
    z = data.cone[c]
    d = data.carry.cone_step[c]
    p = (z[Cone.SLACK] + alpha * d[Cone.SLACK]) * (z[Cone.IMPULSE] + alpha * d[Cone.IMPULSE])
    if law_of(model, c) == Law.LINEAR:
        return p + pyramid_products_ahead(model, data, c, alpha), 6.0
    return p, 1.0


@kernel
def keep_in_cone(model: Model, data: Data, c: int) -> None:
    """Shorten the friction of the exact cone to mu gamma."""
    if law_of(model, c) == Law.NONLINEAR:
        z = data.cone[c]
        z[Cone.FRICTION1], z[Cone.FRICTION2] = within_cone(
            model.contact_friction[c] * z[Cone.IMPULSE], z[Cone.FRICTION1], z[Cone.FRICTION2]
        )


@kernel
def scale_contact(model: Model, data: Data, c: int, ratio: float) -> None:
    """Impulses of contact c, normal and along the ground, and its moments times a ratio."""
    z = data.cone[c]
    z[Cone.IMPULSE] *= ratio
    if law_of(model, c) == Law.LINEAR:
        for k in range(Pyramid.CAP, Pyramid.SLIP):
            z[k] *= ratio
    else:
        z[Cone.FRICTION1] *= ratio
        z[Cone.FRICTION2] *= ratio
    for k in range(Moment.SPIN, z.shape[0]):
        z[k] *= ratio


@kernel
def contact_boundary(model: Model, data: Data, c: int) -> float:
    """Largest step that keeps the cone variables of contact c in their cones, or 1e30."""
    z = data.cone[c]
    d = data.carry.cone_step[c]
    a = min(orthant_step(z[Cone.SLACK], d[Cone.SLACK]), orthant_step(z[Cone.IMPULSE], d[Cone.IMPULSE]))
    if law_of(model, c) == Law.LINEAR:
        a = min(a, pyramid_boundary(model, data, c))
    return a


@kernel
def return_contact(model: Model, data: Data, h: float, c: int, kappa: float) -> None:
    """The pairs of contact c that left their cones put back onto the central path of kappa.

    Gaps weigh against impulses as h/m, slips as 1/m.
    """
    weight = _response(model, c)
    return_pair(data.cone[c], data.cone_trial[c], Cone.SLACK.value, Cone.IMPULSE.value, h * weight, kappa)
    if law_of(model, c) == Law.LINEAR:
        return_pyramid(model, data, c, weight, kappa)


@kernel
def condense_contact(model: Model, data: Data, h: float, c: int, kappa: float, indefinite: float, form: int) -> None:
    """W = d(impulse)/d(gap, slip) by the law linearised at kappa, W_nn = -gamma/s; fills contact_W, contact_scale.

    indefinite: factor of the growth of the friction with the normal impulse, 1 for the derivative of the exact cone.
    form: in the STICKING one a contact that sticks takes the form of its law that is linear in the slip; SOFT: of
    derivatives (softening.py).
    """
    W = data.contact_W[c]
    for e in range(9):
        W[e] = 0.0
    W[0] = -data.cone[c, Cone.IMPULSE] / data.cone[c, Cone.SLACK]
    law = law_of(model, c)
    if law == Law.NONLINEAR:
        condense_cone(model, data, c, kappa, indefinite, form == LawForm.STICKING)
    elif law == Law.LINEAR:
        condense_pyramid(model, data, c)
    if form == LawForm.SOFT:
        soften(model, data, h, c)


@kernel
def contact_constant(model: Model, data: Data, c: int, target: NewtonTarget) -> None:
    """contact_w: the constant part of d(impulse) = W d(gap, slip) + w for the target.

    `target.corrected`: how much of the second-order term of the affine step now in cone_step is subtracted (Mehrotra).
    """
    z = data.cone[c]
    d = data.carry.cone_step[c]
    w = data.contact_w[c]
    r = target.kappa - z[Cone.SLACK] * z[Cone.IMPULSE]
    if target.corrected > 0.0:
        r -= target.corrected * d[Cone.SLACK] * d[Cone.IMPULSE]
    w[0] = (r - z[Cone.IMPULSE] * target.gap_fraction * (data.contact_kin[c, Kin.GAP] - z[Cone.SLACK])) / z[Cone.SLACK]
    w[1] = 0.0
    w[2] = 0.0
    law = law_of(model, c)
    if law == Law.NONLINEAR:
        cone_constant(model, data, c)
    elif law == Law.LINEAR:
        pyramid_constant(model, data, c, target)


@kernel
def recover_contact(model: Model, data: Data, c: int, rate: Vec3, gap_fraction: float) -> None:
    """cone_step of contact c, where its gap and slip change by `rate`: contact_rate, or pair_rate between bodies."""
    z = data.cone[c]
    d = data.carry.cone_step[c]
    a, x, y = rate
    d[Cone.SLACK] = a + gap_fraction * (data.contact_kin[c, Kin.GAP] - z[Cone.SLACK])
    d[Cone.IMPULSE] = data.contact_W[c, 0] * a + data.contact_w[c, 0]
    law = law_of(model, c)
    if law == Law.NONLINEAR:
        recover_cone(data, c, a, x, y)
    elif law == Law.LINEAR:
        recover_pyramid(model, data, c, x, y, gap_fraction)


@kernel
def report_contact(model: Model, data: Data, c: int, F: Vector, out: Vector) -> None:
    """One row, with the frame F of its normal and tangents."""
    i = model.contact_body[c]
    k = data.contact_kin[c]
    fn, f1, f2 = contact_impulse(model, data, c)
    for e in range(3):
        out[ContactRow.IMPULSE + e] = F[e] * fn + F[3 + e] * f1 + F[6 + e] * f2
        out[ContactRow.POINT + e] = data.pos3[i, e] + k[Kin.ARM + e]
        out[ContactRow.NORMAL + e] = F[e]
    out[ContactRow.GAP] = k[Kin.GAP] + data.bounce[c, Bounce.FLOOR]
    out[ContactRow.SLIP] = (k[Kin.SLIP1] * k[Kin.SLIP1] + k[Kin.SLIP2] * k[Kin.SLIP2]) ** 0.5
