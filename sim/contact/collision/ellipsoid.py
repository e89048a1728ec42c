"""Ellipsoid against half-space, ellipsoid, cylinder, and polytopes: spheres, capsules and boxes too. One contact point.

Semi-axes d, as a diagonal matrix D, along the axes of its frame; sigma, H and s of a direction n are those of
support.py. The point of a plane that an ellipsoid touches moves over its surface as it turns: dy = H dn.

Against others, the ellipsoid is b. The elements of a are corners, edges and faces of a polytope, the side, the ends and
the rims of a cylinder, or an ellipsoid; of all elements the one that is farthest away in the direction that its own
normal has. With x of a and y of b, x - y = d n, delta = v + w x x:

    corner, rim, ellipsoid   (d + H_a + H_b) dn = (I - n n^T) delta + H_a (w x n)
    edge along u, t = u x n  dn = alpha t - (w.t) u,   (d + t.H_b t) alpha = t.delta + (w.t) t.H_b u
    face                     dn = w x n
    and of all               dy = H_b dn,   d phi = n.delta,   p = y + phi n/2
"""

from __future__ import annotations

from sim.contact.collision.box import column, to_a, to_b
from sim.contact.collision.cylinder import reach
from sim.contact.collision.polytope_table import above, edge, highest_face, nearest_element, row
from sim.contact.collision.rim import across, put_column
from sim.contact.collision.support import (
    bent,
    bent_turned,
    between,
    farthest,
    farthest_across,
    farthest_apart,
    farthest_from_circle,
    farthest_from_point,
    solved,
    stiffness,
)
from sim.contact.collision.witness import NOWHERE, Z, along, axis, dot, put
from sim.model.record_columns import Hull, HullFace, PairSize
from solvers.compiler import inner_kernel
from solvers.rotation import Vec3, three
from solvers.types import Matrix, Vector

_TIE = 1e-12  # by which an element that is as near as another may seem farther, relative to the sizes
_CIRCLE, _LINE, _END = 1, 2, 3  # of a cylinder

Found = tuple[float, int, Vec3]  # s, without the rounding of a; the element; n


# -- derivatives -------------------------------------------------------------------------------------------------------


@inner_kernel
def put_motion(k: int, n: Vec3, phi: float, dphi: float, dn: Vec3, db: Vec3, out: Vector) -> None:
    """Column k: dn, and dp = H_b dn + (dphi n + phi dn)/2."""
    dp = along(bent(n, db, dn), 0.5 * dphi, n)
    put_column(k, dn, along(dp, 0.5 * phi, dn), out)


@inner_kernel
def put_round(n: Vec3, c: Vec3, da: Vec3, R: Vector, radius: float, db: Vec3, out: Vector) -> None:
    """An ellipsoid a at c, a circle, or a point, with a radius around it."""
    w = between(n, c, da, R, db)
    d = dot(n, w)
    phi = d - radius
    y = farthest(n, db)[1]
    x = along(y, d, n)
    put(phi, n, along(y, 0.5 * phi, n), out)
    M = stiffness(n, d, da, R, db)
    for k in range(6):
        turn = axis(k - 3, 1.0) if k > 2 else NOWHERE
        delta = across(turn, x) if k > 2 else axis(k, 1.0)
        rhs = along(delta, 1.0, bent_turned(n, da, R, across(turn, n)))
        put_motion(k, n, phi, dot(n, delta), solved(M, n, rhs), db, out)


@inner_kernel
def put_line(n: Vec3, x: Vec3, u: Vec3, radius: float, db: Vec3, out: Vector) -> None:
    """A line through x along u, with a radius around it."""
    y = farthest(n, db)[1]
    d = dot(n, x) - dot(n, y)
    phi = d - radius
    x = along(y, d, n)
    put(phi, n, along(y, 0.5 * phi, n), out)
    t = across(u, n)
    h = bent(n, db, t)
    rate, twist = d + dot(t, h), dot(u, h)
    for k in range(6):
        turn = axis(k - 3, 1.0) if k > 2 else NOWHERE
        delta = across(turn, x) if k > 2 else axis(k, 1.0)
        beta = -dot(turn, t)
        alpha = (dot(t, delta) - beta * twist) / rate if rate > 0.0 else 0.0
        dn = (alpha * t[0] + beta * u[0], alpha * t[1] + beta * u[1], alpha * t[2] + beta * u[2])
        put_motion(k, n, phi, dot(n, delta), dn, db, out)


@inner_kernel
def put_plane(n: Vec3, phi: float, db: Vec3, out: Vector) -> None:
    """A face of a, whose outward normal is -n."""
    p = along(farthest(n, db)[1], 0.5 * phi, n)
    put(phi, n, p, out)
    for k in range(6):
        turn = axis(k - 3, 1.0) if k > 2 else NOWHERE
        delta = across(turn, p) if k > 2 else axis(k, 1.0)
        put_motion(k, n, phi, dot(n, delta), across(turn, n), db, out)


# -- half-space and ellipsoid ------------------------------------------------------------------------------------------


@inner_kernel
def ellipsoid_halfspace(sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    """Lowest point of a: phi = r_z - sigma,   x = r - y,   dx = delta + H (w x z),   p = x - phi z/2."""
    d = three(sizes, PairSize.A)
    sigma, y = farthest(to_a(R, Z), d)
    y = to_b(R, y)
    x = (r[0] - y[0], r[1] - y[1], r[2] - y[2])
    phi = r[2] - sigma
    put(phi, Z, (x[0], x[1], 0.5 * phi), out)
    for k in range(6):
        turn = axis(k - 3, 1.0) if k > 2 else NOWHERE
        delta = across(turn, x) if k > 2 else axis(k, 1.0)
        dx = along(delta, 1.0, bent_turned(Z, d, R, across(turn, Z)))
        put_column(k, NOWHERE, (dx[0], dx[1], 0.5 * delta[2]), out)


@inner_kernel
def ellipsoid_ellipsoid(sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    """The largest s on the sphere."""
    c, da, db = (r[0], r[1], r[2]), three(sizes, PairSize.A), three(sizes, PairSize.B)
    put_round(farthest_apart(c, da, R, db), c, da, R, 0.0, db, out)


# -- cylinder ----------------------------------------------------------------------------------------------------------


@inner_kernel
def _apart(n: Vec3, sizes: Vector, R: Vector, r: Vector) -> float:
    """s of a cylinder a."""
    db = three(sizes, PairSize.B)
    return dot(n, (r[0], r[1], r[2])) - reach(to_a(R, n), sizes[0], sizes[1]) - farthest(n, db)[0]


@inner_kernel
def best_end(sizes: Vector, R: Vector, r: Vector) -> tuple[float, Vec3, bool]:
    """The end of a cylinder a with the larger s, its n, and whether b is outside of that end and above it."""
    u = column(R, 2)
    n, best = u, _apart(u, sizes, R, r)
    m = (-u[0], -u[1], -u[2])
    s = _apart(m, sizes, R, r)
    if s > best:
        n, best = m, s
    y = farthest(n, three(sizes, PairSize.B))[1]
    y = to_a(R, (y[0] - r[0], y[1] - r[1], y[2] - r[2]))
    above_it = y[0] * y[0] + y[1] * y[1] <= sizes[0] * sizes[0]
    return best, n, above_it and dot(n, (r[0], r[1], r[2])) > sizes[1]


@inner_kernel
def cylinder_ellipsoid(sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    """The element of a with the largest s: an end, the side or a rim."""
    c, u, db = (r[0], r[1], r[2]), column(R, 2), three(sizes, PairSize.B)
    tie = _TIE * (sizes[0] + sizes[1])
    best, n, above_it = best_end(sizes, R, r)
    if above_it:
        put_plane(n, best, db, out)
        return
    m = farthest_across(c, u, R, db)
    s = _apart(m, sizes, R, r)
    side, end, kind = m, c, _END
    if s > best + tie:
        best, kind = s, _LINE
    rim = n
    for k in range(2):
        v = u if k == 1 else (-u[0], -u[1], -u[2])
        e = along(c, sizes[1], v)
        m = farthest_from_circle(e, v, sizes[0], R, db)
        s = _apart(m, sizes, R, r)
        if dot(m, v) <= 0.0 and s > best + tie:  # the other rim is nearer to b otherwise
            rim, best, kind, end = m, s, _CIRCLE, e
    if kind == _CIRCLE:
        put_round(rim, end, (sizes[0], sizes[0], 0.0), R, 0.0, db, out)
    elif kind == _LINE:
        put_line(side, c, u, sizes[0], db, out)
    else:
        put_plane(n, best, db, out)


# -- polytope ----------------------------------------------------------------------------------------------------------


@inner_kernel
def separation(n: Vec3, sizes: Vector, hull: Matrix, R: Vector, r: Vector) -> float:
    """s of a polytope a, without its radius."""
    o, m, least = int(sizes[0]), to_a(R, n), 1e300
    for k in range(int(hull[o, Hull.CORNERS])):
        least = min(least, dot(m, row(hull, o + 1 + k)))
    return least + dot(n, (r[0], r[1], r[2])) - farthest(n, three(sizes, PairSize.B))[0]


@inner_kernel
def placed(x: Vec3, R: Vector, r: Vector) -> Vec3:
    """A point of a in the frame of b."""
    x = to_b(R, x)
    return x[0] + r[0], x[1] + r[1], x[2] + r[2]


@inner_kernel
def best_face(sizes: Vector, hull: Matrix, R: Vector, r: Vector) -> Found:
    """The face of a with the largest s; element 0 where there are none."""
    o = int(sizes[0])
    best, element, n = -1e300, 0, Z
    first = 1 + int(hull[o, Hull.CORNERS] + hull[o, Hull.EDGES])
    for k in range(first, first + int(hull[o, Hull.FACES])):
        m = to_b(R, row(hull, o + k))
        m = (-m[0], -m[1], -m[2])
        s = dot(m, (r[0], r[1], r[2])) - hull[o + k, HullFace.OFFSET] - farthest(m, three(sizes, PairSize.B))[0]
        if s > best:
            best, element, n = s, k, m
    return best, element, n


@inner_kernel
def along_element(k: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector) -> tuple[Found, bool]:
    """s, along the direction that corner or edge k has the largest one of its own; whether it is the nearest element:
    no corner is nearer, and the point of an edge is on it.
    """
    o, db = int(sizes[0]), three(sizes, PairSize.B)
    if k <= int(hull[o, Hull.CORNERS]):
        x = placed(row(hull, o + k), R, r)
        n = farthest_from_point(x, R, db)
        inside = True
    else:
        z, v, length = edge(hull, o, k - 1 - int(hull[o, Hull.CORNERS]))
        x, u = placed(z, R, r), to_b(R, v)
        n = farthest_across(x, u, R, db)
        t = dot(u, farthest(n, db)[1]) - dot(u, x)
        inside = 0.0 <= t <= length
    s, own = separation(n, sizes, hull, R, r), dot(n, x) - farthest(n, db)[0]
    nearest = s >= own - _TIE * (abs(own) + db[0] + db[1] + db[2])
    return (s if nearest else -1e300, k, n), nearest and inside


@inner_kernel
def farthest_element(sizes: Vector, hull: Matrix, R: Vector, r: Vector) -> Found:
    """The element of a with the largest s. Outside of a face that the ellipsoid is above, it is that one; apart, the
    first that is the nearest one.
    """
    o, db = int(sizes[0]), three(sizes, PairSize.B)
    found = best_face(sizes, hull, R, r)
    y = farthest(found[2], db)[1] if found[1] > 0 else NOWHERE
    y = to_a(R, (y[0] - r[0], y[1] - r[1], y[2] - r[2]))
    over = to_a(R, (-r[0], -r[1], -r[2]))
    if found[1] > 0 and above(hull, o, o + found[1], y) and highest_face(hull, o, over)[1] > 0.0:
        return found
    guess = nearest_element(hull, o, y)
    first = 1 + int(hull[o, Hull.CORNERS] + hull[o, Hull.EDGES])
    if guess < first:
        other, nearest = along_element(guess, sizes, hull, R, r)
        if nearest and other[0] > 0.0:
            return other
    for k in range(1, first):
        other, nearest = along_element(k, sizes, hull, R, r)
        if nearest and other[0] > 0.0:
            return other
        if other[0] > found[0] + _TIE * sizes[PairSize.B + 2]:
            found = other
    return found


@inner_kernel
def polytope_ellipsoid(sizes: Vector, hull: Matrix, R: Vector, r: Vector, out: Vector) -> None:
    """The element of a polytope a, with a radius around it, of the largest s."""
    o, db, radius = int(sizes[0]), three(sizes, PairSize.B), sizes[1]
    s, k, n = farthest_element(sizes, hull, R, r)
    if k > int(hull[o, Hull.CORNERS] + hull[o, Hull.EDGES]):
        put_plane(n, s - radius, db, out)
    elif k > int(hull[o, Hull.CORNERS]):
        x, u, _ = edge(hull, o, k - 1 - int(hull[o, Hull.CORNERS]))
        put_line(n, placed(x, R, r), to_b(R, u), radius, db, out)
    else:
        put_round(n, placed(row(hull, o + k), R, r), NOWHERE, R, radius, db, out)
