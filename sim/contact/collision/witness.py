"""Contact of two elements, given by their closest points: distance, normal, point and derivatives by the twist of a.

Elements are vertices, lines, circles and faces, each with a radius around it. x is the closest point of the element
of a, y that of b, both without the radii ra, rb; n is the unit normal from b to a, d the signed distance along it:

    x = y + d n,   phi = d - ra - rb,   p = (x - ra n + y + rb n)/2 = (x + y + (rb - ra) n)/2

All in the frame of b. The twist (v, w) of a is about the origin of that frame: a point of a moves by v + w x x. Because
p lies on the line through x and y, d phi = n.(v + w x p).

    out (43,)    0 phi, 1:4 n, 4:7 p, 7:25 dn/d(v, w) (3 x 6, row-major), 25:43 dp/d(v, w)
"""

from __future__ import annotations

from math import sqrt

from sim.model.record_columns import Witness
from solvers.compiler import inner_kernel
from solvers.rotation import Vec3, cross, put_three
from solvers.types import Vector

ABSENT = 1e9  # distance of a contact point that does not exist in this configuration [m]
TIE = 1e-9  # a point this far beyond the end of an element still belongs to it (relative)
NOWHERE = (0.0, 0.0, 0.0)  # no direction; no curvature; a point that stays; the origin
Z = (0.0, 0.0, 1.0)
LINE = (0.0, 0.0, 1.0)  # slip along a line: dy = u u^T delta
FACE = (1.0, -1.0, 0.0)  # slip on a face: dy = (I - n n^T) delta
_SAME = 1e-12  # distance below which two points are one, and the direction between them is a choice [m]


@inner_kernel
def dot(a: Vec3, b: Vec3) -> float:
    """a.b"""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner_kernel
def along(x: Vec3, t: float, u: Vec3) -> Vec3:
    """x + t u"""
    return x[0] + t * u[0], x[1] + t * u[1], x[2] + t * u[2]


@inner_kernel
def axis(i: int, s: float) -> Vec3:
    """s e_i"""
    return (s if i == 0 else 0.0), (s if i == 1 else 0.0), (s if i == 2 else 0.0)


@inner_kernel
def absent(out: Vector) -> None:
    """No such contact point now: phi = 1e9, with a normal and zero derivatives, so that nothing that reads it fails."""
    for i in range(43):
        out[i] = 0.0
    out[Witness.GAP] = ABSENT
    out[Witness.NORMAL + 2] = 1.0


@inner_kernel
def put(phi: float, n: Vec3, p: Vec3, out: Vector) -> None:
    """phi, n and p."""
    out[Witness.GAP] = phi
    put_three(n, Witness.NORMAL, out)
    put_three(p, Witness.POINT, out)


@inner_kernel
def direction(x: Vec3, y: Vec3, u: Vec3) -> tuple[Vec3, float]:
    """Unit vector from y to x, and their distance; where the two are one, a fixed direction across u (z for u = 0)."""
    e = (x[0] - y[0], x[1] - y[1], x[2] - y[2])
    d = sqrt(dot(e, e))
    if d > _SAME:
        return (e[0] / d, e[1] / d, e[2] / d), d
    c = sqrt(u[0] * u[0] + u[2] * u[2])
    if c > 0.5:
        return (-u[2] / c, 0.0, u[0] / c), 0.0
    c = sqrt(u[1] * u[1] + u[2] * u[2])
    if c > 0.5:
        return (0.0, -u[2] / c, u[1] / c), 0.0
    return (0.0, 0.0, 1.0), 0.0


@inner_kernel
def put_rows(i: int, K: Vec3, Kw: Vec3, G: Vec3, Gw: Vec3, out: Vector) -> None:
    """Row i of dn = K v + Kw w and of dp = G v + Gw w."""
    k = 7 + 6 * i
    out[k], out[k + 1], out[k + 2] = K
    out[k + 3], out[k + 4], out[k + 5] = Kw
    out[k + 18], out[k + 19], out[k + 20] = G
    out[k + 21], out[k + 22], out[k + 23] = Gw


@inner_kernel
def row(i: int, c: Vec3, n: Vec3, u: Vec3) -> Vec3:
    """Row i of c0 I + c1 n n^T + c2 u u^T."""
    return along(along(axis(i, c[0]), c[1] * n[i], n), c[2] * u[i], u)


@inner_kernel
def moment(x: Vec3, f: Vec3) -> Vec3:
    """x x f: f.(w x x) = (x x f).w"""
    return cross(x[0], x[1], x[2], f[0], f[1], f[2])


@inner_kernel
def vertex_a(
    x: Vec3, n: Vec3, u: Vec3, d: float, radii: tuple[float, float], bend: Vec3, slip: Vec3, out: Vector
) -> None:
    """Vertex x of a against an element of b, by its curvature: with delta = v + w x x

    dn = K delta,   K = bend0 I + bend1 n n^T + bend2 u u^T
    dy = T delta,   T = slip0 I + slip1 n n^T + slip2 u u^T
    dp = (I + T + rho K) delta/2,   rho = rb - ra
    """
    rho = radii[1] - radii[0]
    put(d - radii[0] - radii[1], n, along(x, 0.5 * (rho - d), n), out)
    g = (0.5 * (1.0 + slip[0] + rho * bend[0]), 0.5 * (slip[1] + rho * bend[1]), 0.5 * (slip[2] + rho * bend[2]))
    for i in range(3):
        K, G = row(i, bend, n, u), row(i, g, n, u)
        put_rows(i, K, moment(x, K), G, moment(x, G), out)


@inner_kernel
def vertex_b(
    y: Vec3, n: Vec3, u: Vec3, d: float, radii: tuple[float, float], bend: Vec3, slip: Vec3, out: Vector
) -> None:
    """Vertex y of b against an element of a: `vertex_a` seen from a, with delta = v + w x y

    dn = w x n + K delta,   dx = delta + d w x n - T delta
    dp = (I - T + rho K) delta/2 + (d + rho) (w x n)/2
    """
    rho = radii[1] - radii[0]
    put(d - radii[0] - radii[1], n, along(y, 0.5 * (d + rho), n), out)
    g = (0.5 * (1.0 - slip[0] + rho * bend[0]), 0.5 * (rho * bend[1] - slip[1]), 0.5 * (rho * bend[2] - slip[2]))
    for i in range(3):
        K, G = row(i, bend, n, u), row(i, g, n, u)
        turn = moment(n, axis(i, 1.0))  # (w x n)_i = (n x e_i).w
        put_rows(i, K, along(moment(y, K), 1.0, turn), G, along(moment(y, G), 0.5 * (d + rho), turn), out)


@inner_kernel
def bend_point(d: float) -> Vec3:
    """K = (I - n n^T)/d around a point; flat where the direction is a choice."""
    k = 1.0 / d if d > _SAME else 0.0
    return k, -k, 0.0


@inner_kernel
def bend_line(d: float) -> Vec3:
    """K = (I - n n^T - u u^T)/d around a line along u."""
    k = 1.0 / d if d > _SAME else 0.0
    return k, -k, -k


@inner_kernel
def edges(x: Vec3, ua: Vec3, y: Vec3, ub: Vec3, n: Vec3, radii: tuple[float, float], out: Vector) -> None:
    """Line through x along ua of a against line through y along ub of b; n is the normal of both.

    With c = ua.ub, s^2 = 1 - c^2, g = (ua - c ub)/s^2, f = (ub - c ua)/s^2, delta = v + w x (closest point of a):

    dn = -g q.w,   q = ua x n,   dx = delta + ua (d g.dn - g.delta),   dy = ub (f.delta - d f.dn)
    dp = (I - ua g^T + ub f^T) delta/2 - (rho g + d (ua + c ub)/s^2) q.w/2
    """
    rho = radii[1] - radii[0]
    c = dot(ua, ub)
    s2 = 1.0 - c * c
    ga, fb = along(ua, -c, ub), along(ub, -c, ua)
    g = (ga[0] / s2, ga[1] / s2, ga[2] / s2)
    f = (fb[0] / s2, fb[1] / s2, fb[2] / s2)
    e = (x[0] - y[0], x[1] - y[1], x[2] - y[2])
    d = dot(n, e)
    near = along(x, -dot(g, e), ua)
    q = moment(ua, n)
    put(d - radii[0] - radii[1], n, along(near, 0.5 * (rho - d), n), out)
    for i in range(3):
        G = along(along(axis(i, 0.5), -0.5 * ua[i], g), 0.5 * ub[i], f)
        turn = -0.5 * (rho * g[i] + d * (ua[i] + c * ub[i]) / s2)
        Kw = (-g[i] * q[0], -g[i] * q[1], -g[i] * q[2])
        put_rows(i, NOWHERE, Kw, G, along(moment(near, G), turn, q), out)
