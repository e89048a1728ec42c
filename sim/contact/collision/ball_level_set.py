"""Balls and capsules a against the level set of a field b (level_set.py), with a radius around it.

With delta = v + w x c:

    ball at c             dn = (I + d S)^-1 S delta
    capsule, c = r + s u  where n.u = 0:  (u.K u) ds = -(u.K delta + n.(w x u)),   dn = K (delta + u ds)
    and of both           d phi = n.delta,   p = c - (ra + phi/2) n,   K = (I + d S)^-1 S

A capsule touches with the balls at its ends, and at a place between them that is nearer to the level set than its
neighbours. On a flat face, and above a hollow, both ends touch, and there is no such place.
"""

from __future__ import annotations

from sim.contact.collision.box import column
from sim.contact.collision.level_set import Bend, lost, nearest, turned
from sim.contact.collision.rim import across, put_column
from sim.contact.collision.witness import NOWHERE, along, axis, dot, put
from sim.model.record_columns import PairSize
from solvers.compiler import inner_kernel, kernel
from solvers.rotation import Vec3
from solvers.types import Matrix, Vector

_STEPS = 60  # of Newton's method along a capsule
_CONVERGED = 1e-13  # of its half length: a step that is rounding
_FLAT = 1e-3  # curvature along a capsule over its half length, below which the ends are enough
INSIDE = 2  # the point of a capsule that is between its ends


@inner_kernel
def put_ball(c: Vec3, found: tuple[float, Vec3, Bend, bool], radii: tuple[float, float], out: Vector) -> None:
    """The ball of a at c."""
    d, n, S, known = found
    if not known:
        lost(out)
        return
    phi = d - radii[0] - radii[1]
    back = -radii[0] - 0.5 * phi
    put(phi, n, along(c, back, n), out)
    for k in range(6):
        delta = across(axis(k - 3, 1.0), c) if k > 2 else axis(k, 1.0)
        dn = turned(n, d, S, delta)
        put_column(k, dn, along(along(delta, back, dn), -0.5 * dot(n, delta), n), out)


@inner_kernel
def put_between(
    c: Vec3, u: Vec3, found: tuple[float, Vec3, Bend, bool], radii: tuple[float, float], out: Vector
) -> None:
    """The place c between the ends of a capsule along u, where n.u = 0."""
    d, n, S, _ = found
    phi = d - radii[0] - radii[1]
    back = -radii[0] - 0.5 * phi
    put(phi, n, along(c, back, n), out)
    rate = dot(u, turned(n, d, S, u))
    for k in range(6):
        turn = axis(k - 3, 1.0) if k > 2 else NOWHERE
        delta = across(turn, c) if k > 2 else axis(k, 1.0)
        ds = -(dot(u, turned(n, d, S, delta)) + dot(n, across(turn, u))) / rate
        dc = along(delta, ds, u)
        dn = turned(n, d, S, dc)
        put_column(k, dn, along(along(dc, back, dn), -0.5 * dot(n, delta), n), out)


@inner_kernel
def sphere_field(sizes: Vector, hull: Matrix, r: Vector, out: Vector) -> None:
    """phi = d - ra - rb"""
    c = (r[0], r[1], r[2])
    put_ball(c, nearest(hull, int(sizes[PairSize.B]), c), (sizes[0], sizes[PairSize.B + 1]), out)


@kernel
def slope(hull: Matrix, o: int, c: Vec3, u: Vec3) -> tuple[float, float, tuple[float, Vec3, Bend, bool]]:
    """n.u and u.K u at the place c of a line along u: derivatives of the distance along it; with those of `nearest`."""
    found = nearest(hull, o, c)
    d, n, S, _ = found
    return dot(n, u), dot(u, turned(n, d, S, u)), found


@kernel
def between(hull: Matrix, o: int, c: Vec3, u: Vec3, half: float) -> tuple[float, bool]:
    """The place along a segment, |s| <= half, that is nearest to the level set, and whether it lies between the ends:
    Newton's method within bounds that close in. An end where there is none between them.
    """
    low, high = -half, half
    if slope(hull, o, along(c, low, u), u)[0] >= 0.0:
        return low, False
    if slope(hull, o, along(c, high, u), u)[0] <= 0.0:
        return high, False
    s = 0.0
    for _ in range(_STEPS):
        f, rate, _ = slope(hull, o, along(c, s, u), u)
        if f < 0.0:
            low = s
        else:
            high = s
        step = -f / rate if rate > 0.0 else 2.0 * half
        after = s + step
        if not (low < after < high):
            after = 0.5 * (low + high)
        step = abs(after - s)
        s = after
        if step < _CONVERGED * half:
            break
    return s, True


@inner_kernel
def capsule_field(feature: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector, out: Vector) -> None:
    """An end, or the place between the ends, which may coincide with an end."""
    o, c, u, half, radii = (
        int(sizes[PairSize.B]),
        (r[0], r[1], r[2]),
        column(R, 2),
        sizes[1],
        (sizes[0], sizes[PairSize.B + 1]),
    )
    s, inner = half if feature == 1 else -half, False
    if feature == INSIDE:
        s, inner = between(hull, o, c, u, half)
    c = along(c, s, u)
    _, rate, found = slope(hull, o, c, u)
    if inner and found[3] and rate * half > _FLAT:
        put_between(c, u, found, radii, out)
    else:
        put_ball(c, found, radii, out)


@inner_kernel
def choose_end(feature: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector) -> int:
    """1 for the ends, and for a place between them; 0 where there is none, or only a flat one."""
    if feature != INSIDE:
        return 1
    o, c, u, half = int(sizes[PairSize.B]), (r[0], r[1], r[2]), column(R, 2), sizes[1]
    s, inner = between(hull, o, c, u, half)
    return 1 if inner and slope(hull, o, along(c, s, u), u)[1] * half > _FLAT else 0
