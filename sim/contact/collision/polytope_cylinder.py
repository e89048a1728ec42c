"""Polytope a (a box or a capsule is one, too) against cylinder b.

    feature k < na      corner k of a against the element of the cylinder that is nearest to it
    na to na + 7        where a has faces: points of the rims (rim.py) below the face of a that separates the two most
    the rest            CROSSINGS edges of a across the side or a rim of b; or the point of a rim that is nearest to a

Every normal is a lower bound of the distance, by the reach of the two shapes along it; of the normals of all pairs of
elements that may be nearest the best is the distance, apart as well as inside. Deeper points are not contacts.

Codes: 16 + 8 i + the element of b (cylinder.py), i: the face, or the edge, with its side and its sector on a rim.
"""

from __future__ import annotations

from math import sqrt

from sim.contact.collision.box import to_b
from sim.contact.collision.cylinder import SIDE, TOP, nearest, reach, vertex_on_cylinder
from sim.contact.collision.feature_code import substituted_feature
from sim.contact.collision.parallel_elements import from_polytope
from sim.contact.collision.polytope_cylinder_crossings import (
    corner_of,
    crossings,
    nearest_rim_point,
    put_crossing,
    separation_along,
)
from sim.contact.collision.polytope_table import above, face_rows, row
from sim.contact.collision.rim import (
    plane_rim,
    rim_below,
)
from sim.contact.collision.witness import TIE, absent, dot
from sim.model.record_columns import Hull, HullFace, PairSize, Witness
from sim.model.shape_kinds import CROSSINGS, RIM_POINTS
from solvers.compiler import inner_kernel
from solvers.rotation import Vec3, three
from solvers.types import Integers, Matrix, Vector

MISSED = 1e-2  # parts of the radius by which no contact is as near as the shapes: a point is added

END, FACE, CORNER, CROSS, ALIGNED = 0, 1, 2, 3, 4
Survey = tuple[float, int, int, int, int]  # separation, its source, index, face of a (row), end of b (TOP, BOTTOM)


@inner_kernel
def face_plane(hull: Matrix, face: int, R: Vector, r: Vector) -> tuple[Vec3, float]:
    """n, s of the plane n.x = s of a face of a (its row), n into a."""
    m = to_b(R, row(hull, face))
    return (-m[0], -m[1], -m[2]), -hull[face, HullFace.OFFSET] - dot(m, (r[0], r[1], r[2]))


@inner_kernel
def apart_at_least(sizes: Vector, hull: Matrix, R: Vector, r: Vector) -> float:
    """A bound of the distance of the two, a without its radius: along the axis of b, across it through the centre of a,
    and along the faces of a.
    """
    o, rho, half = int(sizes[0]), sizes[PairSize.B], sizes[PairSize.B + 1]
    best = separation_along((0.0, 0.0, 1.0 if r[2] > 0.0 else -1.0), sizes, hull, R, r)
    across = sqrt(r[0] * r[0] + r[1] * r[1])
    if across > 0.0:
        best = max(best, separation_along((r[0] / across, r[1] / across, 0.0), sizes, hull, R, r))
    start, behind = face_rows(hull, o)
    for f in range(start, behind):
        n, s = face_plane(hull, f, R, r)
        best = max(best, s - reach(n, rho, half))
    return best


@inner_kernel
def survey(
    sizes: Vector, hull: Matrix, R: Vector, r: Vector, out: Vector, codes: Integers, first: int, room: int
) -> Survey:
    """Distance of the two, negative inside, and the elements that give its normal; overwrites `out`."""
    o, rho, half = int(sizes[0]), sizes[PairSize.B], sizes[PairSize.B + 1]
    na = int(hull[o, Hull.CORNERS])
    best, kind, which, face, end = -1e300, END, 0, 0, TOP
    for k in range(2):
        s = separation_along((0.0, 0.0, 1.0 if k == 0 else -1.0), sizes, hull, R, r)
        if s > best:
            best, end = s, TOP + k
    highest = -1e300
    start, behind = face_rows(hull, o)
    for f in range(start, behind):
        n, s = face_plane(hull, f, R, r)
        s -= reach(n, rho, half)
        if s > highest:
            highest, face = s, f
    if highest > best:
        best, kind = highest, FACE
    s, code = crossings(sizes, hull, R, r, out, codes, first, room)
    if s > best + TIE * rho:
        best, kind, which = s, CROSS, code
    for k in range(na):
        x = corner_of(hull, o, k, R, r)
        where = nearest(x, rho, half)
        where = SIDE if where < SIDE else where
        vertex_on_cylinder(where, x, 0.0, rho, half, out)
        s = separation_along(three(out, Witness.NORMAL), sizes, hull, R, r)
        if s > best + TIE * rho:
            best, kind, which = s, CORNER, 8 * k + where
    if best < sizes[1]:
        s = from_polytope(sizes, hull, R, r)
        if s > best + TIE * rho:
            best, kind, which = s, ALIGNED, 0
    return best, kind, which, face, end


@inner_kernel
def choose_elements(
    sizes: Vector, hull: Matrix, R: Vector, r: Vector, codes: Integers, first: int, out: Vector
) -> None:
    """codes[first:] = the elements of all contact points at this pose; uses up `out`."""
    o, rho, half = int(sizes[0]), sizes[PairSize.B], sizes[PairSize.B + 1]
    na = int(hull[o, Hull.CORNERS])
    rims = RIM_POINTS if int(hull[o, Hull.FACES]) > 0 else 0
    begin = first + na + rims
    for k in range(CROSSINGS):
        codes[begin + k] = 0
    s, kind, which, face, end = survey(sizes, hull, R, r, out, codes, begin + 1, CROSSINGS - 1)
    deepest = min(s, 0.0) - TIE * (rho + half)
    for k in range(na):
        x = corner_of(hull, o, k, R, r)
        where = nearest(x, rho, half)
        low = (x[2] if end == TOP else -x[2]) < half and x[0] * x[0] + x[1] * x[1] <= rho * rho
        if s < 0.0 and kind == END and low:
            where = end
        if kind == CORNER and which >> 3 == k:
            where = which & 7
        codes[first + k] = 16 + where
    for k in range(rims):
        codes[first + na + k] = rim_at_face(k, face, deepest, sizes, hull, R, r)
    if kind == CROSS:
        codes[begin] = which
    for k in range(begin + 1, begin + CROSSINGS):
        if codes[k] == 0 or codes[k] == codes[begin]:
            codes[k] = 0
            continue
        put_crossing(codes[k], sizes, hull, R, r, out)
        d = out[Witness.GAP] + sizes[1]
        if d < 0.0 and (s > 0.0 or d < deepest):
            codes[k] = 0
    least = 1e300
    for k in range(first, begin + CROSSINGS):
        put_elements(k - first, codes[k], sizes, hull, R, r, out)
        least = min(least, out[Witness.GAP] + sizes[1])
    if least > s + MISSED * rho:
        codes[begin] = nearest_rim_point(sizes, hull, R, r, out)


@inner_kernel
def rim_at_face(k: int, face: int, deepest: float, sizes: Vector, hull: Matrix, R: Vector, r: Vector) -> int:
    """Code of point k of the rims where it is below the face of a, and no deeper than the shapes are; 0 elsewhere."""
    below, x = rim_below(k, face_plane(hull, face, R, r), (sizes[PairSize.B], sizes[PairSize.B + 1]), deepest, R, r)
    return 16 + 8 * (face - int(sizes[0])) if below and above(hull, int(sizes[0]), face, x) else 0


@inner_kernel
def put_elements(feature: int, code: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector, out: Vector) -> None:
    """Contact of the elements `code`."""
    feature, code = substituted_feature(feature, code)
    o, rho, half = int(sizes[0]), sizes[PairSize.B], sizes[PairSize.B + 1]
    na = int(hull[o, Hull.CORNERS])
    if code == 0:
        absent(out)
    elif feature < na:
        vertex_on_cylinder(code & 7, corner_of(hull, o, feature, R, r), sizes[1], rho, half, out)
    elif int(hull[o, Hull.FACES]) > 0 and feature < na + RIM_POINTS:
        n, s = face_plane(hull, o + (code >> 3) - 2, R, r)
        plane_rim(feature - na, n, s, rho, half, out)
    else:
        put_crossing(code, sizes, hull, R, r, out)


@inner_kernel
def corner_instead(feature: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector) -> int:
    """Code of the element of b nearest to corner `feature` of a; 0 if that is not a corner."""
    o = int(sizes[0])
    if feature >= int(hull[o, Hull.CORNERS]):
        return 0
    return 16 + nearest(corner_of(hull, o, feature, R, r), sizes[PairSize.B], sizes[PairSize.B + 1])
