"""Cylinder against cylinder.

    feature 0-7     points of the rims of b (rim.py) at the end of a that separates the two most
    feature 8-15    points of the rims of a at such an end of b
    the rest        CROSSINGS: the two axes, the axis of one and a rim of the other, two rims; or a point of a rim of a

The rules are those of polytope_cylinder.py. Features of a, whose rims touch a line or a plane of b, are computed
in the frame of a and exchanged; `turned` (12,) is the pose of b in that frame.

Codes: 16 + 8 i + kind, i: the end; or which rims, the side of the normal of two axes, and the sector on a rim.
"""

from __future__ import annotations

from math import sqrt

from sim.contact.collision.box import column
from sim.contact.collision.cylinder_crossings import (
    crossing,
    nearest_rim_point,
    put_crossing,
    separation_along,
    turn_around,
)
from sim.contact.collision.edge_clipping import BORDER
from sim.contact.collision.feature_code import substituted_feature
from sim.contact.collision.parallel_elements import from_cylinder
from sim.contact.collision.polytope_cylinder import MISSED
from sim.contact.collision.rim import (
    plane_rim,
    rim_below,
)
from sim.contact.collision.swapped_shapes import exchange
from sim.contact.collision.witness import TIE, absent, along, dot
from sim.model.record_columns import PairSize, Witness
from sim.model.shape_kinds import CROSSINGS, RIM_POINTS
from solvers.compiler import inner_kernel
from solvers.rotation import Vec3, three
from solvers.types import Integers, Vector

_PARTS = 17  # places where two cylinders may cross: 1 of the axes, 2 on every rim, 2 of every two rims

Survey = tuple[float, int, float, float]  # separation, code of a crossing that gives it or 0, ends of a and of b


@inner_kernel
def apart_at_least(sizes: Vector, R: Vector, r: Vector) -> float:
    """A bound of the distance of the two: along both axes, and across them through the centre of the other."""
    u = column(R, 2)
    x = (r[0], r[1], r[2])
    best = -1e300
    for k in range(2):
        axis = (0.0, 0.0, 1.0) if k == 0 else u
        t = dot(axis, x)
        side = 1.0 if t > 0.0 else -1.0
        best = max(best, separation_along((side * axis[0], side * axis[1], side * axis[2]), sizes, R, r))
        n = along(x, -t, axis)
        across = sqrt(dot(n, n))
        if across > 0.0:
            best = max(best, separation_along((n[0] / across, n[1] / across, n[2] / across), sizes, R, r))
    return best


@inner_kernel
def survey(
    sizes: Vector, R: Vector, r: Vector, turned: Vector, out: Vector, codes: Integers, first: int, room: int
) -> Survey:
    """Distance of the two, negative inside, and its source; the codes of all crossings from `first`."""
    best, which, found, up, down = -1e300, 0, 0, 1.0, 1.0
    u = column(R, 2)
    for k in range(2):
        side = 1.0 if k == 0 else -1.0
        s = separation_along((0.0, 0.0, side), sizes, R, r)
        if s > best:
            best, down = s, side
    highest = -1e300
    for k in range(2):
        side = 1.0 if k == 0 else -1.0
        s = separation_along((-side * u[0], -side * u[1], -side * u[2]), sizes, R, r)
        if s > highest:
            highest, up = s, side
    best = max(best, highest)
    for part in range(_PARTS):
        code = crossing(part, sizes, R, r, turned, out)
        if code == 0:
            continue
        s = separation_along(three(out, Witness.NORMAL), sizes, R, r)
        if s > best + TIE * sizes[PairSize.B]:
            best, which = s, code
        if found < room:
            codes[first + found] = code
            found += 1
    if best < 0.0:
        s = from_cylinder(sizes, R, r, turned)
        if s > best + TIE * sizes[PairSize.B]:
            best, which = s, 0
    return best, which, up, down


@inner_kernel
def rim_at_end(
    k: int, end: float, deepest: float, own: tuple[float, float], other: tuple[float, float], R: Vector, r: Vector
) -> int:
    """Code of point k of the rims of a cylinder with sizes `own`, at the end of another one (`other`), whose pose in
    its frame is R, r; 0 where it is not below that end, or deeper than the shapes are.
    """
    below, x = rim_below(k, end_plane(end, other, R, r), own, deepest, R, r)
    a = other[0] * (1.0 + BORDER)
    return 16 + (8 if end > 0.0 else 0) if below and x[0] * x[0] + x[1] * x[1] <= a * a else 0


@inner_kernel
def end_plane(end: float, sizes: tuple[float, float], R: Vector, r: Vector) -> tuple[Vec3, float]:
    """n, s of the plane n.x = s of an end (1, -1) of a cylinder at the pose R, r; n into it."""
    n = (-end * R[2], -end * R[5], -end * R[8])
    return n, dot(n, (r[0], r[1], r[2])) - sizes[1]


@inner_kernel
def choose_elements(
    sizes: Vector, R: Vector, r: Vector, turned: Vector, codes: Integers, first: int, out: Vector
) -> None:
    """codes[first:] = the elements of all contact points at this pose; `out` and `turned` are scratch."""
    turn_around(R, r, turned)
    begin = first + 2 * RIM_POINTS
    for k in range(CROSSINGS):
        codes[begin + k] = 0
    s, which, up, down = survey(sizes, R, r, turned, out, codes, begin + 1, CROSSINGS - 1)
    deepest = min(s, 0.0) - TIE * (sizes[PairSize.B] + sizes[PairSize.B + 1])
    a, b = (sizes[0], sizes[1]), (sizes[PairSize.B], sizes[PairSize.B + 1])
    for k in range(RIM_POINTS):
        codes[first + k] = rim_at_end(k, up, deepest, b, a, R, r)
        codes[first + RIM_POINTS + k] = rim_at_end(k, down, deepest, a, b, turned[:9], turned[9:])
    codes[begin] = which
    for k in range(begin + 1, begin + CROSSINGS):
        if codes[k] == 0 or codes[k] == which:
            codes[k] = 0
            continue
        put_crossing(codes[k], sizes, R, r, turned, out)
        if out[Witness.GAP] < 0.0 and (s > 0.0 or out[Witness.GAP] < deepest):
            codes[k] = 0
    least = 1e300
    for k in range(first, begin + CROSSINGS):
        put_elements(k - first, codes[k], sizes, R, r, turned, out)
        least = min(least, out[Witness.GAP])
    if least > s + MISSED * sizes[PairSize.B]:
        codes[begin] = nearest_rim_point(sizes, R, r, turned, out)


@inner_kernel
def put_elements(feature: int, code: int, sizes: Vector, R: Vector, r: Vector, turned: Vector, out: Vector) -> None:
    """Contact of the elements `code`; uses up `turned`."""
    feature, code = substituted_feature(feature, code)
    if code == 0:
        absent(out)
        return
    turn_around(R, r, turned)
    end = 1.0 if code & 8 else -1.0
    if feature < RIM_POINTS:
        n, s = end_plane(end, (sizes[0], sizes[1]), R, r)
        plane_rim(feature, n, s, sizes[PairSize.B], sizes[PairSize.B + 1], out)
    elif feature < 2 * RIM_POINTS:
        n, s = end_plane(
            end,
            (sizes[PairSize.B], sizes[PairSize.B + 1]),
            turned[:9],
            turned[9:],
        )
        plane_rim(feature - RIM_POINTS, n, s, sizes[0], sizes[1], out)
        exchange(turned[:9], turned[9:], out)
    else:
        put_crossing(code, sizes, R, r, turned, out)
