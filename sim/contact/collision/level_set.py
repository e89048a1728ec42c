"""The surface phi = 0 of a field on a grid, inside of which phi < 0: the nearest point of it, and its curvature there.

The field is a uniform cubic B-spline along x, y and z, twice continuously differentiable. Its table in `Model.hull`:

    row o                   number of coefficients along x, y, z; grid lines per metre
    row o + 1               (x, y, z, 0) of the first grid point, frame of the shape
    rows from o + 2         coefficients, four in a row, z fastest; one lies outside of the grid at every end

The level set only is a surface: the scale of phi has no effect on distances. The nearest point x of a point c has

    c - x = d n,   n = grad phi/|grad phi|,   S = (I - n n^T) Hess phi (I - n n^T)/|grad phi|

and I + d S is positive on the plane across n. Newton's method steps within that plane, x + z - (z.S z) n/2, and back to
the level set along the gradient; it never goes away from c. As c moves by delta, (I + d S) dn = S delta.
"""

from __future__ import annotations

from math import floor, nan, sqrt

from sim.contact.collision.polytope_table import row
from sim.contact.collision.support import basis
from sim.contact.collision.witness import along, dot
from sim.model.record_columns import DistanceGrid
from solvers.compiler import inner_kernel, kernel
from solvers.rotation import Vec3
from solvers.types import Matrix, Vector

_STEPS = 60  # of Newton's method
_HALVINGS = 30
_RETURNS = 40  # steps along the gradient to the level set
_STRIDE = 4.0  # [cells] longest step
_CONVERGED = 1e-8  # [cells] a step of Newton's method after which the next one would be rounding
_CONVERGED_LINEARLY = 1e-13  # [cells] the same of steps with another matrix
_STUCK = 1e-5  # [cells] a step that may come to nothing for rounding, at a cell from the level set
_ROUNDING = 1e-13  # of squared distances, relative
_NOTHING = 1e-300

Vec4 = tuple[float, float, float, float]
Bend = tuple[float, float, float]  # a symmetric matrix in the plane of `basis`: (11, 12, 22)
Jet = tuple[float, Vec3, Vec3, Vec3]  # phi, gradient, (xx, yy, zz), (yz, xz, xy)
Place = tuple[Vec3, Vec3, Bend, bool]  # x, n, S, and whether it is one of the level set


@inner_kernel
def weights(t: float) -> tuple[Vec4, Vec4, Vec4]:
    """Weights of four coefficients at the fraction t of a cell, and their first and second derivatives."""
    u = 1.0 - t
    return (
        (
            u * u * u / 6.0,
            (4.0 + t * t * (3.0 * t - 6.0)) / 6.0,
            (4.0 + u * u * (3.0 * u - 6.0)) / 6.0,
            t * t * t / 6.0,
        ),
        (-0.5 * u * u, t * (1.5 * t - 2.0), -u * (1.5 * u - 2.0), 0.5 * t * t),
        (u, 3.0 * t - 2.0, 3.0 * u - 2.0, t),
    )


@inner_kernel
def inside(hull: Matrix, o: int, x: Vec3) -> Vec3:
    """x in the box of the grid, or the point of the box that is nearest to it."""
    k = 1.0 / hull[o, DistanceGrid.DENSITY]
    a, b, c = row(hull, o + 1)
    return (
        min(max(x[0], a), a + k * (hull[o, DistanceGrid.NX] - 3.0)),
        min(max(x[1], b), b + k * (hull[o, DistanceGrid.NY] - 3.0)),
        min(max(x[2], c), c + k * (hull[o, DistanceGrid.NZ] - 3.0)),
    )


@inner_kernel
def cell(s: float, count: int) -> tuple[int, float]:
    """First coefficient of four, and the fraction of the cell, at the grid coordinate s."""
    i = min(max(int(floor(s)), 0), count - 4)  # of whole numbers: one of NaN, too, is within the grid
    return i, s - i


@kernel
def jet(hull: Matrix, o: int, x: Vec3) -> Jet:
    """phi and its derivatives at a place within the grid; beyond, the polynomial of the cell at the edge."""
    k = hull[o, DistanceGrid.DENSITY]
    nx, ny, nz = int(hull[o, DistanceGrid.NX]), int(hull[o, DistanceGrid.NY]), int(hull[o, DistanceGrid.NZ])
    first = row(hull, o + 1)
    i, r = cell(k * (x[0] - first[0]), nx)
    j, s = cell(k * (x[1] - first[1]), ny)
    m, t = cell(k * (x[2] - first[2]), nz)
    (w, dw, ddw), (v, dv, ddv), (u, du, ddu) = weights(r), weights(s), weights(t)
    f, fx, fy, fz = 0.0, 0.0, 0.0, 0.0
    fxx, fyy, fzz, fyz, fxz, fxy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for a in range(4):
        q, qy, qz, qyy, qyz, qzz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for b in range(4):
            p, pz, pzz = 0.0, 0.0, 0.0
            start = 4 * (o + 2) + ((i + a) * ny + j + b) * nz + m
            for c in range(4):
                z = hull[(start + c) >> 2, (start + c) & 3]
                p, pz, pzz = p + u[c] * z, pz + du[c] * z, pzz + ddu[c] * z
            q, qz, qzz = q + v[b] * p, qz + v[b] * pz, qzz + v[b] * pzz
            qy, qyz, qyy = qy + dv[b] * p, qyz + dv[b] * pz, qyy + ddv[b] * p
        f, fy, fz = f + w[a] * q, fy + w[a] * qy, fz + w[a] * qz
        fyy, fyz, fzz = fyy + w[a] * qyy, fyz + w[a] * qyz, fzz + w[a] * qzz
        fx, fxy, fxz, fxx = fx + dw[a] * q, fxy + dw[a] * qy, fxz + dw[a] * qz, fxx + ddw[a] * q
    k2 = k * k
    return f, (k * fx, k * fy, k * fz), (k2 * fxx, k2 * fyy, k2 * fzz), (k2 * fyz, k2 * fxz, k2 * fxy)


@inner_kernel
def product(F: Jet, x: Vec3) -> Vec3:
    """(Hess phi) x"""
    (a, b, c), (d, e, f) = F[2], F[3]
    return a * x[0] + f * x[1] + e * x[2], f * x[0] + b * x[1] + d * x[2], e * x[0] + d * x[1] + c * x[2]


@kernel
def settled(hull: Matrix, o: int, x: Vec3) -> Place:
    """The level set from x along the gradient, in the box of the grid."""
    cell_size = 1.0 / hull[o, DistanceGrid.DENSITY]
    F = jet(hull, o, x)
    done = False
    for _ in range(_RETURNS):
        g2 = dot(F[1], F[1])
        step = -F[0] / max(g2, _NOTHING)
        size = abs(F[0]) / sqrt(max(g2, _NOTHING))
        if size > _STRIDE * cell_size:
            step *= _STRIDE * cell_size / size
        x = inside(hull, o, along(x, step, F[1]))
        F = jet(hull, o, x)
        if size < _CONVERGED * cell_size:  # the next step would be rounding
            done = True
            break
    g = sqrt(max(dot(F[1], F[1]), _NOTHING))
    n = (F[1][0] / g, F[1][1] / g, F[1][2] / g)
    t, u = basis(n)
    a, b = product(F, t), product(F, u)
    return x, n, (dot(t, a) / g, dot(u, a) / g, dot(u, b) / g), done


@inner_kernel
def solved(d: float, S: Bend, a: float, b: float) -> tuple[float, float, bool]:
    """(I + d S)^-1 (a, b), and whether the matrix is positive; (a, b) where it is not."""
    m, k, q = 1.0 + d * S[0], d * S[1], 1.0 + d * S[2]
    det = m * q - k * k
    if not (det > 1e-12 and m + q > 0.0):
        return a, b, False
    return (q * a - k * b) / det, (m * b - k * a) / det, True


@inner_kernel
def stepped(hull: Matrix, o: int, c: Vec3, at: Place, z: tuple[float, float]) -> tuple[Place, bool]:
    """The level set at the tangential step z from a place of it, or at a part of that, no farther from c; whether there
    is one.
    """
    x, n, S, _ = at
    t, u = basis(n)
    e = (c[0] - x[0], c[1] - x[1], c[2] - x[2])
    most = dot(e, e) * (1.0 + _ROUNDING)
    size = sqrt(z[0] * z[0] + z[1] * z[1])
    k = min(1.0, _STRIDE / (hull[o, DistanceGrid.DENSITY] * max(size, _NOTHING)))
    for _ in range(_HALVINGS):
        a, b = k * z[0], k * z[1]
        bow = -0.5 * (a * a * S[0] + 2.0 * a * b * S[1] + b * b * S[2])
        there = settled(hull, o, inside(hull, o, along(along(along(x, a, t), b, u), bow, n)))
        y = there[0]
        e = (c[0] - y[0], c[1] - y[1], c[2] - y[2])
        if there[3] and dot(e, e) <= most:
            return there, True
        k *= 0.5
    return at, False


@kernel
def nearest(hull: Matrix, o: int, c: Vec3) -> tuple[float, Vec3, Bend, bool]:
    """d, n and S at the point of the level set nearest to c, and whether it was found: from where the gradient leads.

    Of several points that are nearer than those around them it is the one that phi points to from c.
    """
    at = settled(hull, o, inside(hull, o, c))
    found = False
    d = 0.0
    for _ in range(_STEPS):
        x, n, S, done = at
        e = (c[0] - x[0], c[1] - x[1], c[2] - x[2])
        d = dot(n, e)
        if not done or found:
            break
        t, u = basis(n)
        a, b, positive = solved(d, S, dot(t, e), dot(u, e))
        size = sqrt(a * a + b * b) * hull[o, DistanceGrid.DENSITY]
        at, moved = stepped(hull, o, c, at, (a, b))
        found = size < (_CONVERGED if positive else _CONVERGED_LINEARLY)
        if not moved:
            return d, n, S, found or size < _STUCK * (1.0 + abs(d) * hull[o, DistanceGrid.DENSITY])
    return d, at[1], at[2], found


@inner_kernel
def turned(n: Vec3, d: float, S: Bend, delta: Vec3) -> Vec3:
    """dn as c moves by delta; of the centre of a curvature the direction is a choice, and stays."""
    t, u = basis(n)
    a, b = dot(t, delta), dot(u, delta)
    a, b, regular = solved(d, S, S[0] * a + S[1] * b, S[1] * a + S[2] * b)
    if not regular:
        return 0.0, 0.0, 0.0
    return a * t[0] + b * u[0], a * t[1] + b * u[1], a * t[2] + b * u[2]


@inner_kernel
def lost(out: Vector) -> None:
    """No nearest point was found: the step fails, with a status."""
    for i in range(43):
        out[i] = nan
