"""Directions in which two convex solids are farthest apart, for an ellipsoid b about the origin of its frame.

Along a unit vector n from b to a they are apart by s(n) = min_a n.x - max_b n.y; the largest s is their distance, and
inside the least depth. Of an ellipsoid with the semi-axes d, as a diagonal matrix D:

    max n.y = sigma = |D n| at y = D^2 n/sigma,   dy = H dn,   H = (D^2 - y y^T)/sigma

A point is an ellipsoid without extent, a circle about z one without extent along z. Where x - y, the vector between the
two points, is along n, s is stationary; on the sphere of directions its second derivative is -(H_a + H_b + s).
"""

from __future__ import annotations

from math import sqrt

from sim.contact.collision.box import column, to_a, to_b
from sim.contact.collision.witness import along, axis, dot
from solvers.compiler import inner_kernel
from solvers.rotation import Vec3, cross
from solvers.types import Vector

_STEPS = 60  # of Newton's method
_HALVINGS = 30
_STRIDE = 0.5  # [rad] longest step
_CONVERGED = 1e-10  # [rad] a step of Newton's method after which the next one would be rounding
_CONVERGED_LINEARLY = 1e-15  # [rad] the same of steps with another matrix
_ROUNDING = 1e-15  # of s, relative to the sizes
_TILT = 0.01  # [rad] from the axis of a circle where a search begins, and more by factors of two
_TILTS = 8
_NOTHING = 1e-300


@inner_kernel
def farthest(n: Vec3, d: Vec3) -> tuple[float, Vec3]:
    """sigma and y of an ellipsoid with the semi-axes d."""
    a, b, c = d[0] * n[0], d[1] * n[1], d[2] * n[2]
    sigma = sqrt(a * a + b * b + c * c)
    k = 1.0 / max(sigma, _NOTHING)
    return sigma, (k * d[0] * a, k * d[1] * b, k * d[2] * c)


@inner_kernel
def bent(n: Vec3, d: Vec3, w: Vec3) -> Vec3:
    """H w; zero of a point."""
    sigma, y = farthest(n, d)
    f, k = dot(y, w), 1.0 / max(sigma, _NOTHING)
    return (
        k * (d[0] * d[0] * w[0] - f * y[0]),
        k * (d[1] * d[1] * w[1] - f * y[1]),
        k * (d[2] * d[2] * w[2] - f * y[2]),
    )


@inner_kernel
def bent_turned(n: Vec3, d: Vec3, R: Vector, w: Vec3) -> Vec3:
    """H w of an ellipsoid that is turned by R."""
    return to_b(R, bent(to_a(R, n), d, to_a(R, w)))


@inner_kernel
def unit(x: Vec3, otherwise: Vec3) -> Vec3:
    """x/|x|; another direction where that is none."""
    size = sqrt(dot(x, x))
    return (x[0] / size, x[1] / size, x[2] / size) if size > _NOTHING else otherwise


@inner_kernel
def basis(n: Vec3) -> tuple[Vec3, Vec3]:
    """Two unit vectors across n and across one another."""
    i = 0 if abs(n[0]) <= abs(n[1]) and abs(n[0]) <= abs(n[2]) else (1 if abs(n[1]) <= abs(n[2]) else 2)
    e = axis(i, 1.0)
    t = unit(along(e, -n[i], n), e)
    return t, cross(n[0], n[1], n[2], t[0], t[1], t[2])


@inner_kernel
def apart(n: Vec3, c: Vec3, da: Vec3, R: Vector, db: Vec3) -> float:
    """s of an ellipsoid a at c, turned by R."""
    return dot(n, c) - farthest(to_a(R, n), da)[0] - farthest(n, db)[0]


@inner_kernel
def between(n: Vec3, c: Vec3, da: Vec3, R: Vector, db: Vec3) -> Vec3:
    """x - y of an ellipsoid a at c, turned by R."""
    x, y = to_b(R, farthest(to_a(R, n), da)[1]), farthest(n, db)[1]
    return c[0] - x[0] - y[0], c[1] - x[1] - y[1], c[2] - x[2] - y[2]


@inner_kernel
def stiffness(n: Vec3, s: float, da: Vec3, R: Vector, db: Vec3) -> tuple[float, float, float]:
    """H_a + H_b + s in the plane of `basis`: (11, 12, 22)."""
    t, u = basis(n)
    ht, hu = bent(n, db, t), bent(n, db, u)
    gt, gu = bent_turned(n, da, R, t), bent_turned(n, da, R, u)
    return s + dot(t, ht) + dot(t, gt), dot(u, ht) + dot(u, gt), s + dot(u, hu) + dot(u, gu)


@inner_kernel
def solved(M: tuple[float, float, float], n: Vec3, w: Vec3) -> Vec3:
    """M^-1 w in the plane of `basis`; zero where M is not positive: the direction is a choice."""
    t, u = basis(n)
    det = M[0] * M[2] - M[1] * M[1]
    if not (det > 1e-24 * (M[0] * M[0] + M[2] * M[2]) and M[0] + M[2] > 0.0):
        return 0.0, 0.0, 0.0
    a, b = dot(t, w), dot(u, w)
    x, y = (M[2] * a - M[1] * b) / det, (M[0] * b - M[1] * a) / det
    return x * t[0] + y * u[0], x * t[1] + y * u[1], x * t[2] + y * u[2]


@inner_kernel
def better(n: Vec3, other: Vec3, c: Vec3, da: Vec3, R: Vector, db: Vec3) -> Vec3:
    """Of two directions the one with the larger s."""
    m = unit(other, n)
    return m if apart(m, c, da, R, db) > apart(n, c, da, R, db) else n


@inner_kernel
def towards(c: Vec3, da: Vec3, R: Vector, db: Vec3) -> Vec3:
    """A direction to begin with: from centre to centre, normals of the ellipsoids on that line, their axes."""
    n = unit(c, (0.0, 0.0, 1.0))
    n = better(n, (c[0] / (db[0] * db[0]), c[1] / (db[1] * db[1]), c[2] / (db[2] * db[2])), c, da, R, db)
    x = to_a(R, c)
    if min(da[0], da[1]) > 0.0:
        z = x[2] / (da[2] * da[2]) if da[2] > 0.0 else 0.0
        n = better(n, to_b(R, (x[0] / (da[0] * da[0]), x[1] / (da[1] * da[1]), z)), c, da, R, db)
    for i in range(3):
        n = better(n, axis(i, 1.0 if c[i] >= 0.0 else -1.0), c, da, R, db)
        if da[i] > 0.0:
            e = column(R, i)
            n = better(n, e if x[i] >= 0.0 else (-e[0], -e[1], -e[2]), c, da, R, db)
    return n


@inner_kernel
def ascended(n: Vec3, step: Vec3, c: Vec3, da: Vec3, R: Vector, db: Vec3) -> Vec3:
    """n turned by a step, or by a part of it, so that s does not fall by more than rounding."""
    size = sqrt(dot(step, step))
    k = min(1.0, _STRIDE / max(size, _NOTHING))
    least = apart(n, c, da, R, db) - _ROUNDING * (abs(dot(n, c)) + farthest(n, db)[0])
    for _ in range(_HALVINGS):
        m = unit(along(n, k, step), n)
        if apart(m, c, da, R, db) >= least:
            return m
        k *= 0.5
    return n


@inner_kernel
def climbed(n: Vec3, c: Vec3, da: Vec3, R: Vector, db: Vec3) -> Vec3:
    """The n of the largest s of an ellipsoid a, a point or a circle, at c: Newton's method on the sphere, from n.

    Where s > 0 it is concave there, and there is one. Inside, H_a + H_b takes the place of a matrix that is not
    positive.
    """
    for _ in range(_STEPS):
        w = between(n, c, da, R, db)
        M = stiffness(n, dot(n, w), da, R, db)
        small = _CONVERGED
        if not (M[0] * M[2] - M[1] * M[1] > 0.0 and M[0] + M[2] > 0.0):
            M, small = stiffness(n, 0.0, da, R, db), _CONVERGED_LINEARLY
        step = solved(M, n, w)
        n = ascended(n, step, c, da, R, db)
        if dot(step, step) < small * small:
            break
    return n


@inner_kernel
def farthest_apart(c: Vec3, da: Vec3, R: Vector, db: Vec3) -> Vec3:
    """`climbed` of an ellipsoid or a point, from `towards`."""
    return climbed(towards(c, da, R, db), c, da, R, db)


@inner_kernel
def farthest_from_point(c: Vec3, R: Vector, d: Vec3) -> Vec3:
    """`farthest_apart` of a point at c. Outside, n is along c_i/(t + d_i^2), where the surface has its point y:

        y_i = d_i^2 c_i/(t + d_i^2),   1/|p| = 1 with p_i = y_i/d_i

    1/|p| is concave in t, and nearly a line: Newton's method climbs from t = 0 to its root, and does not pass it.
    """
    a, b, e = d[0] * d[0], d[1] * d[1], d[2] * d[2]
    if not c[0] * c[0] / a + c[1] * c[1] / b + c[2] * c[2] / e > 1.0:
        return farthest_apart(c, (0.0, 0.0, 0.0), R, d)
    t, least = 0.0, _CONVERGED_LINEARLY * min(a, b, e)
    n = c
    for _ in range(_STEPS):
        n = (c[0] / (t + a), c[1] / (t + b), c[2] / (t + e))
        x, y, z = a * n[0] * n[0], b * n[1] * n[1], e * n[2] * n[2]
        square = x + y + z
        step = (sqrt(square) - 1.0) * square / (x / (t + a) + y / (t + b) + z / (t + e))
        if not step > _CONVERGED_LINEARLY * t + least:
            break
        t += step
    return unit(n, (0.0, 0.0, 1.0))


@inner_kernel
def farthest_from_circle(c: Vec3, axis: Vec3, rho: float, R: Vector, db: Vec3) -> Vec3:
    """`climbed` of a circle at the end of a cylinder. Along the axis s has a peak like that of a cone: not from there,
    but from the side where the plane touches b.
    """
    da = (rho, rho, 0.0)
    n = (-axis[0], -axis[1], -axis[2])
    y = farthest(n, db)[1]
    e = (y[0] - c[0], y[1] - c[1], y[2] - c[2])
    e = unit(along(e, -dot(e, axis), axis), column(R, 0))
    x = along(c, rho, e)
    tilted = unit(along(n, -_TILT, e), n)
    for m in (x, (x[0] / (db[0] * db[0]), x[1] / (db[1] * db[1]), x[2] / (db[2] * db[2]))):
        tilted = better(tilted, m, c, da, R, db)
    k = 2.0 * _TILT
    for _ in range(_TILTS):
        tilted = better(tilted, along(n, -k, e), c, da, R, db)
        k *= 2.0
    return climbed(tilted, c, da, R, db)


@inner_kernel
def farthest_across(x: Vec3, u: Vec3, R: Vector, db: Vec3) -> Vec3:
    """The n of the largest s of a line through x along u; the same for directions across u."""
    none = (0.0, 0.0, 0.0)
    x = along(x, -dot(x, u), u)
    n = unit(x, basis(u)[0])
    y = (x[0] / (db[0] * db[0]), x[1] / (db[1] * db[1]), x[2] / (db[2] * db[2]))
    n = better(n, along(y, -dot(y, u), u), x, none, R, db)
    for i in range(3):
        n = better(n, along(axis(i, 1.0 if x[i] >= 0.0 else -1.0), -u[i] if x[i] >= 0.0 else u[i], u), x, none, R, db)
    for _ in range(_STEPS):
        t = cross(u[0], u[1], u[2], n[0], n[1], n[2])
        w = between(n, x, none, R, db)
        h = dot(t, bent(n, db, t))
        s = dot(n, w)
        newton = h + s > 0.0
        step = dot(t, w) / (h + s if newton else h)
        m = ascended(n, (step * t[0], step * t[1], step * t[2]), x, none, R, db)
        n = unit(along(m, -dot(m, u), u), n)
        if abs(step) < (_CONVERGED if newton else _CONVERGED_LINEARLY):
            break
    return n
