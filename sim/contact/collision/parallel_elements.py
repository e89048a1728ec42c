"""Distance of cylinders from polytopes and cylinders whose closest elements are parallel.

Lines and rims that cross have a normal of their own, across both. Elements that are parallel at
their closest points x and y have a fan of normals. If they are apart, the normal is the direction from y to x. If they
overlap, n.x >= n.y, the normals are the borders of the fan: the radial directions there, and the normals of ends and
faces, which are tried anyway. Each gives a lower bound of the distance by the reach of the two shapes.
"""

from __future__ import annotations

from math import cos, sin, sqrt

from sim.contact.collision import cylinder_crossings as cylinders
from sim.contact.collision import polytope_cylinder_crossings as polytopes
from sim.contact.collision.box import column, to_b
from sim.contact.collision.rim import line_minimum
from sim.contact.collision.rim_rim import opposite, point_of, rim_minimum
from sim.contact.collision.witness import along, dot
from sim.model.record_columns import Hull, PairSize
from solvers.compiler import inner_kernel
from solvers.rotation import Vec3, three
from solvers.types import Matrix, Vector

_APART = 1e-9  # [m] between points that say a direction


@inner_kernel
def unit_between(x: Vec3, y: Vec3, e: Vec3) -> Vec3:
    """Direction from y to x; e where they are one point."""
    d = (x[0] - y[0], x[1] - y[1], x[2] - y[2])
    size = sqrt(dot(d, d))
    return (d[0] / size, d[1] / size, d[2] / size) if size > _APART else e


@inner_kernel
def line_and_rim(k: int, x: Vec3, u: Vec3, rho: float, z: float) -> tuple[bool, Vec3, Vec3]:
    """Whether there is a k-th place where a line is nearest to a rim; the direction between the two there, and e."""
    angle = line_minimum(k, x, u, rho, z)
    e = (cos(angle), sin(angle), 0.0)
    y = (rho * e[0], rho * e[1], z)
    x = along(x, dot(u, y) - dot(u, x), u)
    return angle >= 0.0, unit_between(x, y, e), e


@inner_kernel
def from_polytope(sizes: Vector, hull: Matrix, R: Vector, r: Vector) -> float:
    """Largest separation of a polytope a, without its radius, and a cylinder b, where edges run along rims."""
    best = -1e300
    for i in range(int(hull[int(sizes[0]), Hull.EDGES])):
        x, u, _ = polytopes.edge_of(hull, int(sizes[0]), i, R, r)
        for part in range(4):
            found, n, e = line_and_rim(
                part & 1, x, u, sizes[PairSize.B], sizes[PairSize.B + 1] if part < 2 else -sizes[PairSize.B + 1]
            )
            if found:
                best = max(best, polytopes.separation_along(n, sizes, hull, R, r))
                best = max(best, polytopes.separation_along(e, sizes, hull, R, r))
    return best


@inner_kernel
def from_cylinder(sizes: Vector, R: Vector, r: Vector, turned: Vector) -> float:
    """Largest separation of two cylinders where a rim runs along the axis or a rim of the other; `turned` as there."""
    best = -1e300
    x, axis_b = three(turned, 9), (R[6], R[7], R[8])
    for part in range(4):
        side = 1.0 if part < 2 else -1.0
        found, n, e = line_and_rim(
            part & 1, (r[0], r[1], r[2]), column(R, 2), sizes[PairSize.B], side * sizes[PairSize.B + 1]
        )
        if found:
            best = max(best, cylinders.separation_along(n, sizes, R, r), cylinders.separation_along(e, sizes, R, r))
        found, n, e = line_and_rim(part & 1, x, axis_b, sizes[0], side * sizes[1])
        if found:
            n, e = to_b(R, (-n[0], -n[1], -n[2])), to_b(R, (-e[0], -e[1], -e[2]))
            best = max(best, cylinders.separation_along(n, sizes, R, r), cylinders.separation_along(e, sizes, R, r))
    for part in range(8):
        z = sizes[PairSize.B + 1] if part & 4 else -sizes[PairSize.B + 1]
        rim = cylinders.rim_of(1.0 if part & 2 else -1.0, sizes, R, r)
        angle = rim_minimum(part & 1, rim, (sizes[0], sizes[PairSize.B]), z)
        if angle >= 0.0:
            p, ea, _ = point_of(rim, sizes[0], angle)
            y, e, _, _ = opposite(p, sizes[PairSize.B], z)
            n, into = unit_between(p, y, e), (-ea[0], -ea[1], -ea[2])
            best = max(best, cylinders.separation_along(n, sizes, R, r), cylinders.separation_along(e, sizes, R, r))
            best = max(best, cylinders.separation_along(into, sizes, R, r))
    return best
