"""Friction in a four-sided pyramid on the central path.

    psi s_psi = kappa,    s_psi = mu gamma - sum beta        psi: Pyramid.SPEED, s_psi: Pyramid.CAP
    beta_i s_i = kappa,   s_i = d_i.v_t + psi                beta: Pyramid.FRICTION, s: Pyramid.SLIP

with the directions d = (t1, -t1, t2, -t2).  Condensed, with k_i = beta_i/s_i, e = sum k_i d_i along t1 and t2, and
g = 1/(s_psi + psi sum k_i), in contact_scale: PyramidScale.
"""

from __future__ import annotations

from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import NewtonTarget
from sim.model.record_columns import Kin, Pyramid, PyramidScale
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.cones import orthant_step, return_pair


@kernel
def side(k: int, x: float, y: float) -> float:
    """d_k . (x, y) for the four directions t1, -t1, t2, -t2."""
    a = x if k < 2 else y
    return a if k % 2 == 0 else -a


@kernel
def _pyramid_slip(x: float, y: float, a: float) -> float:
    """psi > max(|x|, |y|) with 1/psi + sum_i 1/(psi + d_i) = 1/a: on the central path mu gamma = s_psi + sum beta.

    Newton on the convex decreasing function from the left end of the bracket (m + a/5 .. m + 5 a), monotone.
    """
    m = max(abs(x), abs(y))
    psi = m + 0.2 * a
    for _ in range(60):
        f = 1.0 / psi - 1.0 / a
        g = 1.0 / (psi * psi)
        for e in range(4):
            r = 1.0 / (psi + side(e, x, y))
            f += r
            g += r * r
        step = f / g
        psi += step
        if abs(step) < 1e-14 * psi:
            break
    return psi


@optional(Slot.START_PYRAMID)
def start_pyramid(model: Model, data: Data, c: int, kappa: float) -> None:
    """Variables on the central path of kappa at the present slip and gap slack."""
    z = data.cone[c]
    k = data.contact_kin[c]
    psi = _pyramid_slip(k[Kin.SLIP1], k[Kin.SLIP2], z[Pyramid.SLACK] / model.contact_friction[c])
    z[Pyramid.SPEED] = psi
    z[Pyramid.CAP] = kappa / psi
    for e in range(4):
        z[Pyramid.SLIP + e] = side(e, k[Kin.SLIP1], k[Kin.SLIP2]) + psi
        z[Pyramid.FRICTION + e] = kappa / z[Pyramid.SLIP + e]


@kernel
def cap_error(model: Model, data: Data, c: int) -> float:
    """mu gamma - sum beta - s_psi of the pyramid."""
    z = data.cone[c]
    return (
        model.contact_friction[c] * z[Pyramid.IMPULSE]
        - z[Pyramid.FRICTION]
        - z[Pyramid.FRICTION + 1]
        - z[Pyramid.FRICTION + 2]
        - z[Pyramid.FRICTION + 3]
        - z[Pyramid.CAP]
    )


@optional(Slot.PYRAMID_ERROR, default=0.0)
def pyramid_error(model: Model, data: Data, c: int) -> float:
    """Largest of |s_psi - (mu gamma - sum beta)| and |s_i - (d_i.v_t + psi)|."""
    z = data.cone[c]
    k = data.contact_kin[c]
    r = abs(cap_error(model, data, c))
    for e in range(4):
        r = max(r, abs(side(e, k[Kin.SLIP1], k[Kin.SLIP2]) + z[Pyramid.SPEED] - z[Pyramid.SLIP + e]))
    return r


@optional(Slot.PYRAMID_PRODUCTS, default=(0.0, 0.0, 0.0))
def pyramid_products(model: Model, data: Data, c: int) -> tuple[float, float, float]:
    """(sum, low, high) of the five products."""
    z = data.cone[c]
    total = z[Pyramid.SPEED] * z[Pyramid.CAP]
    lo = total
    hi = total
    for e in range(4):
        t = z[Pyramid.FRICTION + e] * z[Pyramid.SLIP + e]
        total += t
        lo = min(lo, t)
        hi = max(hi, t)
    return total, lo, hi


@optional(Slot.PYRAMID_PRODUCTS_AHEAD, default=0.0)
def pyramid_products_ahead(model: Model, data: Data, c: int, alpha: float) -> float:
    """Sum of the five products after a step of length alpha."""
    z = data.cone[c]
    d = data.carry.cone_step[c]
    total = (z[Pyramid.SPEED] + alpha * d[Pyramid.SPEED]) * (z[Pyramid.CAP] + alpha * d[Pyramid.CAP])
    for e in range(4):
        total += (z[Pyramid.FRICTION + e] + alpha * d[Pyramid.FRICTION + e]) * (
            z[Pyramid.SLIP + e] + alpha * d[Pyramid.SLIP + e]
        )
    return total


@optional(Slot.PYRAMID_BOUNDARY, default=1e30)
def pyramid_boundary(model: Model, data: Data, c: int) -> float:
    """Largest step that keeps all ten variables positive, or 1e30."""
    a = 1e30
    for e in range(2, 12):
        a = min(a, orthant_step(data.cone[c, e], data.carry.cone_step[c, e]))
    return a


@optional(Slot.RETURN_PYRAMID)
def return_pyramid(model: Model, data: Data, c: int, weight: float, kappa: float) -> None:
    """The five pairs put back onto the central path of kappa where they left their cones."""
    cone, before = data.cone[c], data.cone_trial[c]
    return_pair(cone, before, Pyramid.SPEED.value, Pyramid.CAP.value, weight, kappa)
    for e in range(4):
        return_pair(cone, before, Pyramid.SLIP + e, Pyramid.FRICTION + e, weight, kappa)


@optional(Slot.CONDENSE_PYRAMID)
def condense_pyramid(model: Model, data: Data, c: int) -> None:
    """d(beta)/d(gap, slip):  W_tt = -(K - psi g e e^T),  W_tn = -mu (gamma/s) psi g e,  K = diag(k1 + k2, k3 + k4).

    On the diagonal K and psi g e^2 nearly cancel where the contact slides, but not as sums of positive terms:

        (k1 + k2) (s_psi + psi (k3 + k4)) g + 4 psi k1 k2 g
    """
    z = data.cone[c]
    W = data.contact_W[c]
    q = data.contact_scale[c]
    mu = model.contact_friction[c]
    total = 0.0
    for e in range(4):
        q[e] = z[Pyramid.FRICTION + e] / z[Pyramid.SLIP + e]
        total += q[e]
    q[PyramidScale.SUM] = q[PyramidScale.RATIO] - q[PyramidScale.RATIO + 1]
    q[PyramidScale.SUM + 1] = q[PyramidScale.RATIO + 2] - q[PyramidScale.RATIO + 3]
    q[PyramidScale.INVERSE] = 1.0 / (z[Pyramid.CAP] + z[Pyramid.SPEED] * total)
    g = z[Pyramid.SPEED] * q[PyramidScale.INVERSE]
    r = PyramidScale.RATIO
    k1, k2, k3, k4 = q[r], q[r + 1], q[r + 2], q[r + 3]
    psi, cap = z[Pyramid.SPEED], z[Pyramid.CAP]
    x, y = k1 + k2, k3 + k4
    W[4] = -q[PyramidScale.INVERSE] * (x * (cap + psi * y) + 4.0 * psi * k1 * k2)
    W[5] = g * q[PyramidScale.SUM] * q[PyramidScale.SUM + 1]
    W[7] = W[5]
    W[8] = -q[PyramidScale.INVERSE] * (y * (cap + psi * x) + 4.0 * psi * k3 * k4)
    W[3] = mu * W[0] * g * q[PyramidScale.SUM]
    W[6] = mu * W[0] * g * q[PyramidScale.SUM + 1]


@optional(Slot.PYRAMID_CONSTANT)
def pyramid_constant(model: Model, data: Data, c: int, target: NewtonTarget) -> None:
    """Friction part of contact_w, after its normal part."""
    z = data.cone[c]
    d = data.carry.cone_step[c]
    k = data.contact_kin[c]
    w = data.contact_w[c]
    q = data.contact_scale[c]
    total = 0.0
    for e in range(4):
        r = target.kappa - z[Pyramid.FRICTION + e] * z[Pyramid.SLIP + e]
        if target.corrected > 0.0:
            r -= target.corrected * d[Pyramid.FRICTION + e] * d[Pyramid.SLIP + e]
        error = side(e, k[Kin.SLIP1], k[Kin.SLIP2]) + z[Pyramid.SPEED] - z[Pyramid.SLIP + e]
        q[PyramidScale.FRICTION + e] = (r - z[Pyramid.FRICTION + e] * target.gap_fraction * error) / z[Pyramid.SLIP + e]
        total += q[PyramidScale.FRICTION + e]
    r = target.kappa - z[Pyramid.SPEED] * z[Pyramid.CAP]
    if target.corrected > 0.0:
        r -= target.corrected * d[Pyramid.SPEED] * d[Pyramid.CAP]
    total -= target.gap_fraction * cap_error(model, data, c)
    q[PyramidScale.SPEED] = (r + z[Pyramid.SPEED] * total) * q[PyramidScale.INVERSE]
    p = q[PyramidScale.SPEED] - z[Pyramid.SPEED] * q[PyramidScale.INVERSE] * model.contact_friction[c] * w[0]
    w[1] = q[PyramidScale.FRICTION] - q[PyramidScale.FRICTION + 1] - q[PyramidScale.SUM] * p
    w[2] = q[PyramidScale.FRICTION + 2] - q[PyramidScale.FRICTION + 3] - q[PyramidScale.SUM + 1] * p


@optional(Slot.RECOVER_PYRAMID)
def recover_pyramid(model: Model, data: Data, c: int, x: float, y: float, gap_fraction: float) -> None:
    """Steps of the ten variables from the rates (x, y) of the slip, after the step of gamma."""
    z = data.cone[c]
    d = data.carry.cone_step[c]
    k = data.contact_kin[c]
    q = data.contact_scale[c]
    mu = model.contact_friction[c]
    p = q[PyramidScale.SPEED] - z[Pyramid.SPEED] * q[PyramidScale.INVERSE] * (
        mu * d[Pyramid.IMPULSE] + q[PyramidScale.SUM] * x + q[PyramidScale.SUM + 1] * y
    )
    total = 0.0
    d[Pyramid.SPEED] = p
    for e in range(4):
        t = side(e, x, y) + p
        d[Pyramid.FRICTION + e] = q[PyramidScale.FRICTION + e] - q[e] * t
        d[Pyramid.SLIP + e] = t + gap_fraction * (
            side(e, k[Kin.SLIP1], k[Kin.SLIP2]) + z[Pyramid.SPEED] - z[Pyramid.SLIP + e]
        )
        total += d[Pyramid.FRICTION + e]
    d[Pyramid.CAP] = mu * d[Pyramid.IMPULSE] - total + gap_fraction * cap_error(model, data, c)
