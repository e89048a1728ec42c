"""The second-order cone in three dimensions: step to the boundary, Nesterov-Todd scaling, distance from the central path.

    Q = { (x0, x1, x2): x0 >= |(x1, x2)| },   det x = x0^2 - x1^2 - x2^2,   x o y = (x.y, x0 y1 + y0 x1, x0 y2 + y0 x2)

Formulas: Vandenberghe, The CVXOPT linear and quadratic cone program solvers, sections 4 and 5.
"""

from __future__ import annotations

from math import sqrt

from solvers.jit import kernel

_FAR = 1e30
Vec3 = tuple[float, float, float]


@kernel
def orthant_step(x: float, d: float) -> float:
    """Largest a with x + a d >= 0, or 1e30."""
    return -x / d if d < 0.0 else _FAR


@kernel
def cone_det(x0: float, x1: float, x2: float) -> float:
    """det x, in the form that cancels least."""
    r = sqrt(x1 * x1 + x2 * x2)
    return (x0 - r) * (x0 + r)


@kernel
def cone_step(x0: float, x1: float, x2: float, d0: float, d1: float, d2: float) -> float:
    """Largest a with x + a d in Q, or 1e30: the smaller positive root of det(x + a d) = 0."""
    c = max(cone_det(x0, x1, x2), 0.0)
    b = x0 * d0 - x1 * d1 - x2 * d2
    a = d0 * d0 - d1 * d1 - d2 * d2
    disc = b * b - a * c
    if disc < 0.0:
        return _FAR
    den = sqrt(disc) - b
    if den <= 0.0:
        return _FAR
    return c / den


@kernel
def cone_spread(z0: float, z1: float, z2: float, y0: float, y1: float, y2: float) -> tuple[float, float]:
    """The two eigenvalues (low, high) of the scaled product lambda o lambda; both equal kappa on the central path.

    lambda0^2 + |lambda1|^2 = z.y  and  det lambda = sqrt(det z det y).
    """
    dot = z0 * y0 + z1 * y1 + z2 * y2
    det = sqrt(max(cone_det(z0, z1, z2), 0.0) * max(cone_det(y0, y1, y2), 0.0))
    a = sqrt(max(0.5 * (dot + det), 0.0))
    b = sqrt(max(0.5 * (dot - det), 0.0))
    return (a - b) * (a - b), (a + b) * (a + b)


@kernel
def cone_scaling(
    z0: float, z1: float, z2: float, y0: float, y1: float, y2: float
) -> tuple[float, float, float, float]:
    """Nesterov-Todd point of z and y: (w0, w1, w2, e) with y = Q z,  Q = e (2 w w^T - J),  w in Q, det w = 1."""
    dz = sqrt(cone_det(z0, z1, z2))
    dy = sqrt(cone_det(y0, y1, y2))
    iz = 1.0 / dz
    iy = 1.0 / dy
    g = 0.5 / sqrt(0.5 * (1.0 + (z0 * y0 + z1 * y1 + z2 * y2) * iz * iy))
    return g * (y0 * iy + z0 * iz), g * (y1 * iy - z1 * iz), g * (y2 * iy - z2 * iz), dy * iz


@kernel
def scale(w0: float, w1: float, w2: float, r: float, x0: float, x1: float, x2: float) -> Vec3:
    """W x with W^2 = Q and r = sqrt(e): r (w0 x0 + w.x,  x + w (x0 + w.x / (1 + w0)))."""
    p = w1 * x1 + w2 * x2
    q = x0 + p / (1.0 + w0)
    return r * (w0 * x0 + p), r * (x1 + w1 * q), r * (x2 + w2 * q)


@kernel
def jordan_divide(l0: float, l1: float, l2: float, r0: float, r1: float, r2: float) -> Vec3:
    """x with l o x = r."""
    x0 = (l0 * r0 - l1 * r1 - l2 * r2) / cone_det(l0, l1, l2)
    return x0, (r1 - x0 * l1) / l0, (r2 - x0 * l2) / l0
