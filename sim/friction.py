"""The contact laws on the central path: residuals, condensation to W d(gap, slip) + w, recovery of the cone steps.

Columns of `cone` (and of its steps):

    0 s, 1 gamma                                     gap slack and normal impulse,        s gamma = kappa
    NONLINEAR   2:4 beta                             mu gamma v_t + psi beta = 0,
                                                     psi = a + sqrt(a^2 + |v_t|^2), a = kappa / (2 mu gamma)
    LINEAR      2 psi, 3 s_psi, 4:8 beta, 8:12 s     psi s_psi = kappa, s_psi = mu gamma - sum beta,
                                                     beta_i s_i = kappa, s_i = d_i.v_t + psi, d = (t1, -t1, t2, -t2)

The law of the exact cone is what (mu gamma, beta) o (psi, v_t) = kappa e says once psi is eliminated: |beta| < mu gamma
follows from it, so the cone is no constraint of the iteration and cannot jam it.

A contact without friction has the first line only: the cone would be degenerate, and costs nothing when left out.
"""

from __future__ import annotations

from math import sqrt

from sim.contact import contact_rate
from sim.model import Goal, Law, Model, Work
from solvers.cones import orthant_step
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
def cone_slip(b0: float, x: float, y: float, kappa: float) -> tuple[float, float]:
    """psi = a + r and r = sqrt(a^2 + |v_t|^2), a = kappa/(2 b0): the smoothed slip speed of the central path."""
    a = 0.5 * kappa / b0
    r = sqrt(a * a + x * x + y * y)
    return a + r, r


@kernel
def start_contact(model: Model, work: Work, c: int, kappa: float, floor: float) -> None:
    """Variables of contact c on the central path of kappa at its gap (at least `floor`) and slip: gamma = kappa / s."""
    z = work.cone[c]
    k = work.contact_kin[c]
    s = max(k[0], floor)
    gamma = kappa / s
    z[0] = s
    z[1] = gamma
    law = law_of(model, c)
    mu = model.contact_friction[c]
    if law == _NONLINEAR:
        psi, _ = cone_slip(mu * gamma, k[1], k[2], kappa)
        z[2] = -mu * gamma * k[1] / psi
        z[3] = -mu * gamma * k[2] / psi
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
    if law == _LINEAR:
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
        return z[1], z[2], z[3]
    if law == _LINEAR:
        return z[1], z[4] - z[5], z[6] - z[7]
    return z[1], 0.0, 0.0


@kernel
def contact_products(model: Model, work: Work, c: int) -> tuple[float, float, float, float]:
    """(sum, count, low, high) of the complementarity products of contact c; all equal kappa on the central path."""
    z = work.cone[c]
    p = z[0] * z[1]
    law = law_of(model, c)
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
def slip_violation(model: Model, work: Work, c: int, kappa: float) -> float:
    """|mu gamma v_t + psi beta| of the exact cone, in units of kappa."""
    if law_of(model, c) != _NONLINEAR:
        return 0.0
    z = work.cone[c]
    k = work.contact_kin[c]
    b0 = model.contact_friction[c] * z[1]
    psi, _ = cone_slip(b0, k[1], k[2], kappa)
    return max(abs(b0 * k[1] + psi * z[2]), abs(b0 * k[2] + psi * z[3]))


@kernel
def contact_products_ahead(model: Model, work: Work, c: int, alpha: float) -> tuple[float, float]:
    """(sum, count) of the complementarity products after a step of length alpha."""
    z = work.cone[c]
    d = work.cone_step[c]
    total = (z[0] + alpha * d[0]) * (z[1] + alpha * d[1])
    count = 1.0
    if law_of(model, c) == _LINEAR:
        count = 6.0
        total += (z[2] + alpha * d[2]) * (z[3] + alpha * d[3])
        for e in range(4):
            total += (z[4 + e] + alpha * d[4 + e]) * (z[8 + e] + alpha * d[8 + e])
    return total, count


@kernel
def keep_in_cone(model: Model, work: Work, c: int) -> None:
    """Shorten the friction of the exact cone to mu gamma: after a shortened Newton step it may stick out."""
    if law_of(model, c) != _NONLINEAR:
        return
    z = work.cone[c]
    b0 = model.contact_friction[c] * z[1]
    n = sqrt(z[2] * z[2] + z[3] * z[3])
    if n > b0:
        z[2] *= b0 / n
        z[3] *= b0 / n


@kernel
def contact_boundary(model: Model, work: Work, c: int) -> float:
    """Largest step that keeps the cone variables of contact c in their cones, or 1e30."""
    z = work.cone[c]
    d = work.cone_step[c]
    a = min(orthant_step(z[0], d[0]), orthant_step(z[1], d[1]))
    law = law_of(model, c)
    if law == _LINEAR:
        for e in range(2, 12):
            a = min(a, orthant_step(z[e], d[e]))
    return a


@kernel
def condense_contact(model: Model, work: Work, c: int, kappa: float) -> None:
    """W = d(impulse)/d(gap, slip) by the law linearised at kappa; fills contact_W and contact_scale.

    normal       W_nn = -gamma/s
    NONLINEAR    b = mu gamma, r = psi - a:  psi dbeta = -(b I + beta v_t^T/r) dv_t - (v_t + beta dpsi/db) db - residual
    LINEAR       K = diag(k1 + k2, k3 + k4), k_i = beta_i/s_i, e = sum k_i d_i, g = psi/(s_psi + psi sum k_i)
                 W_tt = -(K - g e e^T),  W_tn = -mu (gamma/s) g e
    """
    z = work.cone[c]
    k = work.contact_kin[c]
    W = work.contact_W[c]
    q = work.contact_scale[c]
    for e in range(9):
        W[e] = 0.0
    W[0] = -z[1] / z[0]
    law = law_of(model, c)
    mu = model.contact_friction[c]
    if law == _NONLINEAR:
        b0 = mu * z[1]
        psi, r = cone_slip(b0, k[1], k[2], kappa)
        a = psi - r
        b1, b2 = z[2], z[3]
        n = sqrt(b1 * b1 + b2 * b2)
        if n > b0:
            b1 *= b0 / n
            b2 *= b0 / n
        i = 1.0 / psi
        W[4] = -i * (b0 + b1 * k[1] / r)
        W[5] = -i * b1 * k[2] / r
        W[7] = -i * b2 * k[1] / r
        W[8] = -i * (b0 + b2 * k[2] / r)
        g = -(a / b0) * (1.0 + a / r)  # dpsi/db0
        q[0] = -i * (k[1] + b1 * g)  # dbeta/db0
        q[1] = -i * (k[2] + b2 * g)
        q[2] = i * (b0 * k[1] + psi * z[2])
        q[3] = i * (b0 * k[2] + psi * z[3])
        W[3] = mu * W[0] * q[0]
        W[6] = mu * W[0] * q[1]
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
def contact_constant(model: Model, work: Work, c: int, goal: Goal) -> None:
    """contact_w: the constant part of d(impulse) = W d(gap, slip) + w for the goal.

    `goal.corrected` subtracts the second-order term of the affine step now in cone_step (Mehrotra).
    """
    z = work.cone[c]
    d = work.cone_step[c]
    k = work.contact_kin[c]
    w = work.contact_w[c]
    q = work.contact_scale[c]
    mu = model.contact_friction[c]
    kappa = goal.kappa
    share = goal.share
    r = kappa - z[0] * z[1]
    if goal.corrected:
        r -= d[0] * d[1]
    g0 = (r - z[1] * share * (k[0] - z[0])) / z[0]
    w[0] = g0
    w[1] = 0.0
    w[2] = 0.0
    law = law_of(model, c)
    if law == _NONLINEAR:
        w[1] = mu * g0 * q[0] - q[2]
        w[2] = mu * g0 * q[1] - q[3]
    elif law == _LINEAR:
        total = 0.0
        for e in range(4):
            r = kappa - z[4 + e] * z[8 + e]
            if goal.corrected:
                r -= d[4 + e] * d[8 + e]
            q[8 + e] = (r - z[4 + e] * share * (direction(e, k[1], k[2]) + z[2] - z[8 + e])) / z[8 + e]
            total += q[8 + e]
        r = kappa - z[2] * z[3]
        if goal.corrected:
            r -= d[2] * d[3]
        q[7] = (r + z[2] * (total - share * _cap_error(model, work, c))) * q[6]
        p = q[7] - z[2] * q[6] * mu * g0
        w[1] = q[8] - q[9] - q[4] * p
        w[2] = q[10] - q[11] - q[5] * p


@kernel
def recover_contact(model: Model, work: Work, h: float, c: int, share: float) -> None:
    """cone_step of contact c from the body twists of the last solve."""
    z = work.cone[c]
    d = work.cone_step[c]
    k = work.contact_kin[c]
    W = work.contact_W[c]
    w = work.contact_w[c]
    q = work.contact_scale[c]
    a, x, y = contact_rate(model, work, h, c)
    d[0] = a + share * (k[0] - z[0])
    d[1] = W[0] * a + w[0]
    law = law_of(model, c)
    mu = model.contact_friction[c]
    if law == _NONLINEAR:
        d[2] = W[3] * a + W[4] * x + W[5] * y + w[1]
        d[3] = W[6] * a + W[7] * x + W[8] * y + w[2]
    elif law == _LINEAR:
        p = q[7] - z[2] * q[6] * (mu * d[1] + q[4] * x + q[5] * y)
        total = 0.0
        d[2] = p
        for e in range(4):
            t = direction(e, x, y) + p
            d[4 + e] = q[8 + e] - q[e] * t
            d[8 + e] = t + share * (direction(e, k[1], k[2]) + z[2] - z[8 + e])
            total += d[4 + e]
        d[3] = mu * d[1] - total + share * _cap_error(model, work, c)
