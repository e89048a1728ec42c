"""Whether two convex shapes a and b are apart, by how far they reach: Gilbert's method (SIAM J. Control 4, 1966).

    v := the point nearest to the origin on the segment from v to w,      w: the point of a - b that is lowest along v

v is a point of a - b, so |v| is no less than the distance, and w.v/|v| no more. Elements whose closest points are
between lines that run along each other give no normal of their own: shapes that are apart there would seem to overlap.
"""

from __future__ import annotations

from math import sqrt

from sim.collision.witness import dot
from sim.rotation import Vec3
from solvers.jit import inner_kernel

TRIALS = 60  # of a search
_EXACT = 0.99  # part of |v| at which a lower bound of the distance is one


@inner_kernel
def farthest(n: Vec3, rho: float, half: float) -> Vec3:
    """Point of a cylinder that is farthest along n."""
    a = sqrt(n[0] * n[0] + n[1] * n[1])
    k = rho / a if a > 0.0 else 0.0
    return k * n[0], k * n[1], (half if n[2] >= 0.0 else -half)


@inner_kernel
def is_exact(s: float, v: Vec3) -> bool:
    """Whether s, a lower bound of the distance, is all but |v|; or v all but zero."""
    return s > _EXACT * sqrt(dot(v, v)) or dot(v, v) < 1e-24


@inner_kernel
def nearest_between(v: Vec3, w: Vec3) -> Vec3:
    """Point nearest to the origin on the segment from v to w."""
    d = (w[0] - v[0], w[1] - v[1], w[2] - v[2])
    size = dot(d, d)
    t = min(max(-dot(v, d) / size, 0.0), 1.0) if size > 0.0 else 0.0
    return v[0] + t * d[0], v[1] + t * d[1], v[2] + t * d[2]
