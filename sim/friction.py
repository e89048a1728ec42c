"""The contact laws on the central path: residuals, condensation to W d(gap, slip) + w, recovery of the cone steps.

Columns of `cone` (and of its steps):

    0 s, 1 gamma                                     gap slack and normal impulse,        s gamma = kappa
    NONLINEAR   2 psi, 3:5 eta, 5:7 beta             (mu gamma, beta) o (psi, eta) = kappa e,  eta = v_t
    LINEAR      2 psi, 3 s_psi, 4:8 beta, 8:12 s     psi s_psi = kappa, s_psi = mu gamma - sum beta,
                                                     beta_i s_i = kappa, s_i = d_i.v_t + psi, d = (t1, -t1, t2, -t2)

A contact without friction has the first line only: the cone would be degenerate, and costs nothing when left out.
"""

from __future__ import annotations

from math import sqrt

from sim.contact import contact_rate
from sim.model import Law, Model, Work
from solvers.cones import cone_scaling, cone_spread, cone_step, jordan_divide, orthant_step, scale
from solvers.jit import kernel

_IMPACT = int(Law.IMPACT)
_LINEAR = int(Law.LINEAR)
_NONLINEAR = int(Law.NONLINEAR)


@kernel
def law_of(model: Model, c: int) -> int:
    """Law of contact c: without friction it is an impact law."""
    return model.contact_law[c] if model.contact_friction[c] > 0.0 else _IMPACT


@kernel
def direction(k: int, x: float, y: float) -> float:
    """d_k . (x, y) for the four directions t1, -t1, t2, -t2."""
    a = x if k < 2 else y
    return a if k % 2 == 0 else -a


@kernel
def start_contact(model: Model, work: Work, c: int, kappa: float, floor: float) -> None:
    """Cone variables on the central path of kappa at the present gap (at least `floor`) and slip.

    There the law is an explicit smooth force law: gamma = kappa / s, and for the exact cone
    beta = -mu gamma v_t / psi,  psi = a + sqrt(a^2 + |v_t|^2),  a = s / (2 mu).
    """
    z = work.cone[c]
    k = work.contact_kin[c]
    s = max(k[0], floor)
    gamma = kappa / s
    z[0] = s
    z[1] = gamma
    law = law_of(model, c)
    mu = model.contact_friction[c]
    if law == _NONLINEAR:
        a = 0.5 * s / mu
        psi = a + sqrt(a * a + k[1] * k[1] + k[2] * k[2])
        z[2] = psi
        z[3] = k[1]
        z[4] = k[2]
        z[5] = -mu * gamma * k[1] / psi
        z[6] = -mu * gamma * k[2] / psi
    elif law == _LINEAR:
        psi = _pyramid_slip(k[1], k[2], s / mu)
        z[2] = psi
        z[3] = kappa / psi
        for e in range(4):
            z[8 + e] = direction(e, k[1], k[2]) + psi
            z[4 + e] = kappa / z[8 + e]


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
            r = 1.0 / (psi + direction(e, x, y))
            f += r
            g += r * r
        step = f / g
        psi += step
        if abs(step) < 1e-14 * psi:
            break
    return psi


@kernel
def contact_error(model: Model, work: Work, c: int) -> float:
    """Largest equality residual of contact c: |gap - s|, |v_t - eta| and the like."""
    z = work.cone[c]
    k = work.contact_kin[c]
    r = abs(k[0] - z[0])
    law = law_of(model, c)
    if law == _NONLINEAR:
        r = max(r, abs(k[1] - z[3]), abs(k[2] - z[4]))
    elif law == _LINEAR:
        r = max(r, abs(_cap_error(model, work, c)))
        for e in range(4):
            r = max(r, abs(direction(e, k[1], k[2]) + z[2] - z[8 + e]))
    return r


@kernel
def _cap_error(model: Model, work: Work, c: int) -> float:
    """mu gamma - sum beta - s_psi of the pyramid."""
    z = work.cone[c]
    return model.contact_friction[c] * z[1] - z[4] - z[5] - z[6] - z[7] - z[3]


@kernel
def contact_impulse(model: Model, work: Work, c: int) -> tuple[float, float, float]:
    """Impulse (normal, t1, t2) of the present cone variables."""
    z = work.cone[c]
    law = law_of(model, c)
    if law == _NONLINEAR:
        return z[1], z[5], z[6]
    if law == _LINEAR:
        return z[1], z[4] - z[5], z[6] - z[7]
    return z[1], 0.0, 0.0


@kernel
def contact_products(model: Model, work: Work, c: int) -> tuple[float, float, float, float]:
    """(sum, count, low, high) of the complementarity products of contact c; all equal kappa on the central path."""
    z = work.cone[c]
    p = z[0] * z[1]
    law = law_of(model, c)
    if law == _NONLINEAR:
        b0 = model.contact_friction[c] * z[1]
        lo, hi = cone_spread(b0, z[5], z[6], z[2], z[3], z[4])
        return p + 0.5 * (lo + hi), 2.0, min(p, lo), max(p, hi)
    if law == _LINEAR:
        t = z[2] * z[3]
        total = p + t
        lo = min(p, t)
        hi = max(p, t)
        for e in range(4):
            t = z[4 + e] * z[8 + e]
            total += t
            lo = min(lo, t)
            hi = max(hi, t)
        return total, 6.0, lo, hi
    return p, 1.0, p, p


@kernel
def contact_products_ahead(model: Model, work: Work, c: int, alpha: float) -> float:
    """Sum of the complementarity products after a step of length alpha."""
    z = work.cone[c]
    d = work.cone_step[c]
    total = (z[0] + alpha * d[0]) * (z[1] + alpha * d[1])
    law = law_of(model, c)
    if law == _NONLINEAR:
        mu = model.contact_friction[c]
        total += mu * (z[1] + alpha * d[1]) * (z[2] + alpha * d[2])
        total += (z[3] + alpha * d[3]) * (z[5] + alpha * d[5]) + (z[4] + alpha * d[4]) * (z[6] + alpha * d[6])
    elif law == _LINEAR:
        total += (z[2] + alpha * d[2]) * (z[3] + alpha * d[3])
        for e in range(4):
            total += (z[4 + e] + alpha * d[4 + e]) * (z[8 + e] + alpha * d[8 + e])
    return total


@kernel
def contact_boundary(model: Model, work: Work, c: int) -> float:
    """Largest step that keeps the cone variables of contact c in their cones, or 1e30."""
    z = work.cone[c]
    d = work.cone_step[c]
    a = min(orthant_step(z[0], d[0]), orthant_step(z[1], d[1]))
    law = law_of(model, c)
    if law == _NONLINEAR:
        mu = model.contact_friction[c]
        a = min(a, cone_step(z[2], z[3], z[4], d[2], d[3], d[4]))
        a = min(a, cone_step(mu * z[1], z[5], z[6], mu * d[1], d[5], d[6]))
    elif law == _LINEAR:
        for e in range(2, 12):
            a = min(a, orthant_step(z[e], d[e]))
    return a


@kernel
def condense_contact(model: Model, work: Work, c: int) -> None:
    """W = d(impulse)/d(gap, slip) by the linearised law; fills contact_W and contact_scale.

    normal       W_nn = -gamma/s
    NONLINEAR    dy + Q dz = t with the Nesterov-Todd scaling Q of z = (mu gamma, beta), y = (psi, eta), so
                 W_tt = -Q_bb^-1,  W_tn = mu (gamma/s) Q_bb^-1 Q_b0
    LINEAR       K = diag(k1 + k2, k3 + k4), k_i = beta_i/s_i, e = sum k_i d_i, g = psi/(s_psi + psi sum k_i)
                 W_tt = -(K - g e e^T),  W_tn = -mu (gamma/s) g e
    """
    z = work.cone[c]
    W = work.contact_W[c]
    q = work.contact_scale[c]
    for k in range(9):
        W[k] = 0.0
    W[0] = -z[1] / z[0]
    law = law_of(model, c)
    mu = model.contact_friction[c]
    if law == _NONLINEAR:
        w0, w1, w2, e = cone_scaling(mu * z[1], z[5], z[6], z[2], z[3], z[4])
        q[0], q[1], q[2] = e * (2 * w0 * w0 - 1), 2 * e * w0 * w1, 2 * e * w0 * w2
        q[6], q[7], q[8], q[9] = w0, w1, w2, sqrt(e)
        # Q_bb = e (I + 2 w w^T): inverse by Sherman-Morrison, free of cancellation
        g = 2.0 / (1.0 + 2.0 * (w1 * w1 + w2 * w2))
        q[10], q[11], q[12] = (1.0 - g * w1 * w1) / e, -g * w1 * w2 / e, (1.0 - g * w2 * w2) / e
        W[4], W[5], W[7], W[8] = -q[10], -q[11], -q[11], -q[12]
        W[3] = -mu * W[0] * (q[10] * q[1] + q[11] * q[2])
        W[6] = -mu * W[0] * (q[11] * q[1] + q[12] * q[2])
    elif law == _LINEAR:
        total = 0.0
        for e in range(4):
            q[e] = z[4 + e] / z[8 + e]
            total += q[e]
        q[4] = q[0] - q[1]
        q[5] = q[2] - q[3]
        q[6] = 1.0 / (z[3] + z[2] * total)
        g = z[2] * q[6]
        W[4] = -(q[0] + q[1] - g * q[4] * q[4])
        W[5] = g * q[4] * q[5]
        W[7] = W[5]
        W[8] = -(q[2] + q[3] - g * q[5] * q[5])
        W[3] = mu * W[0] * g * q[4]
        W[6] = mu * W[0] * g * q[5]


@kernel
def contact_constant(model: Model, work: Work, c: int, kappa: float, corrected: bool) -> None:
    """contact_w: the constant part of d(impulse) = W d(gap, slip) + w for the target kappa.

    `corrected` subtracts the second-order term of the affine step now in cone_step (Mehrotra).
    """
    z = work.cone[c]
    d = work.cone_step[c]
    k = work.contact_kin[c]
    w = work.contact_w[c]
    q = work.contact_scale[c]
    mu = model.contact_friction[c]
    r = kappa - z[0] * z[1]
    if corrected:
        r -= d[0] * d[1]
    g0 = (r - z[1] * (k[0] - z[0])) / z[0]
    w[0] = g0
    w[1] = 0.0
    w[2] = 0.0
    law = law_of(model, c)
    if law == _NONLINEAR:
        t0, t1, t2 = _cone_target(model, work, c, kappa, corrected)
        q[13] = t0
        x = t1 - (k[1] - z[3]) - q[1] * mu * g0
        y = t2 - (k[2] - z[4]) - q[2] * mu * g0
        w[1] = q[10] * x + q[11] * y
        w[2] = q[11] * x + q[12] * y
    elif law == _LINEAR:
        total = 0.0
        for e in range(4):
            r = kappa - z[4 + e] * z[8 + e]
            if corrected:
                r -= d[4 + e] * d[8 + e]
            q[8 + e] = (r - z[4 + e] * (direction(e, k[1], k[2]) + z[2] - z[8 + e])) / z[8 + e]
            total += q[8 + e]
        r = kappa - z[2] * z[3]
        if corrected:
            r -= d[2] * d[3]
        q[7] = (r + z[2] * (total - _cap_error(model, work, c))) * q[6]
        p = q[7] - z[2] * q[6] * mu * g0
        w[1] = q[8] - q[9] - q[4] * p
        w[2] = q[10] - q[11] - q[5] * p


@kernel
def _cone_target(model: Model, work: Work, c: int, kappa: float, corrected: bool) -> tuple[float, float, float]:
    """t = kappa J z / det z - y - W (lambda \\ ((W^-1 dy) o (W dz))),  lambda = W z."""
    z = work.cone[c]
    q = work.contact_scale[c]
    mu = model.contact_friction[c]
    b0, b1, b2 = mu * z[1], z[5], z[6]
    r = sqrt(b1 * b1 + b2 * b2)
    f = kappa / ((b0 - r) * (b0 + r))
    t0, t1, t2 = f * b0 - z[2], -f * b1 - z[3], -f * b2 - z[4]
    if corrected:
        d = work.cone_step[c]
        w0, w1, w2, e = q[6], q[7], q[8], q[9]
        y0, y1, y2 = scale(w0, -w1, -w2, 1.0 / e, d[2], d[3], d[4])
        x0, x1, x2 = scale(w0, w1, w2, e, mu * d[1], d[5], d[6])
        l0, l1, l2 = scale(w0, w1, w2, e, b0, b1, b2)
        p0, p1, p2 = x0 * y0 + x1 * y1 + x2 * y2, x0 * y1 + y0 * x1, x0 * y2 + y0 * x2
        p0, p1, p2 = jordan_divide(l0, l1, l2, p0, p1, p2)
        p0, p1, p2 = scale(w0, w1, w2, e, p0, p1, p2)
        t0 -= p0
        t1 -= p1
        t2 -= p2
    return t0, t1, t2


@kernel
def recover_contact(model: Model, work: Work, h: float, c: int) -> None:
    """cone_step of contact c from the body twists of the last solve."""
    z = work.cone[c]
    d = work.cone_step[c]
    k = work.contact_kin[c]
    W = work.contact_W[c]
    w = work.contact_w[c]
    q = work.contact_scale[c]
    a, x, y = contact_rate(model, work, h, c)
    d[0] = a + k[0] - z[0]
    d[1] = W[0] * a + w[0]
    law = law_of(model, c)
    mu = model.contact_friction[c]
    if law == _NONLINEAR:
        d[3] = x + k[1] - z[3]
        d[4] = y + k[2] - z[4]
        d[5] = W[3] * a + W[4] * x + W[5] * y + w[1]
        d[6] = W[6] * a + W[7] * x + W[8] * y + w[2]
        d[2] = q[13] - q[0] * mu * d[1] - q[1] * d[5] - q[2] * d[6]
    elif law == _LINEAR:
        p = q[7] - z[2] * q[6] * (mu * d[1] + q[4] * x + q[5] * y)
        total = 0.0
        d[2] = p
        for e in range(4):
            t = direction(e, x, y) + p
            d[4 + e] = q[8 + e] - q[e] * t
            d[8 + e] = t + direction(e, k[1], k[2]) + z[2] - z[8 + e]
            total += d[4 + e]
        d[3] = mu * d[1] - total + _cap_error(model, work, c)
