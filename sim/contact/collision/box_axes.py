"""Separating axes of two boxes: three faces of each, nine pairs of edges.   Gottschalk, Lin, Manocha 1996.

Axes 0-2 are the normals of b, 3-5 those of a, 6 + 3 i + j is e_i of b x e_j of a. An axis has two sides, and a is on
one of them; `sides` has two bits per axis that mark those that are open (edge_axes.py).
"""

from __future__ import annotations

from math import sqrt

from sim.contact.collision.edge_axes import (
    OPEN,
    PARALLEL,
    SWINGS,
    Arrangement,
    edge_must_exceed,
    opened,
    separates_from,
    side,
)
from sim.contact.collision.witness import TIE
from solvers.compiler import inner_kernel
from solvers.rotation import Vec3
from solvers.types import Vector


@inner_kernel
def along_b(i: int, ha: Vec3, hb: Vec3, R: Vector) -> float:
    """Reach of the two boxes along axis i of b: half extent of b and of the shadow of a."""
    k = 3 * i
    return hb[i] + ha[0] * abs(R[k]) + ha[1] * abs(R[k + 1]) + ha[2] * abs(R[k + 2])


@inner_kernel
def along_a(j: int, ha: Vec3, hb: Vec3, R: Vector) -> float:
    """Reach of the two boxes along axis j of a: half extent of a and of the shadow of b."""
    return ha[j] + hb[0] * abs(R[j]) + hb[1] * abs(R[3 + j]) + hb[2] * abs(R[6 + j])


@inner_kernel
def across(i: int, j: int, ha: Vec3, hb: Vec3, R: Vector, r: Vector) -> tuple[float, float, float]:
    """(x, reach, q) along n = e_i of b x e_j of a: n.r, the reach of the boxes, and n.n, all without its root."""
    k, l = (i + 1) % 3, (i + 2) % 3
    m, o = (j + 1) % 3, (j + 2) % 3
    a, b = R[3 * k + j], R[3 * l + j]
    reach = hb[k] * abs(b) + hb[l] * abs(a) + ha[m] * abs(R[3 * i + o]) + ha[o] * abs(R[3 * i + m])
    return r[l] * a - r[k] * b, reach, a * a + b * b


@inner_kernel
def separation(ha: Vec3, hb: Vec3, R: Vector, r: Vector, sides: int) -> Arrangement:
    """(face, edge, s, side of the face, side of the edge) of the open sides, or of all faces where none is open.

    face: the face that separates most, 0-2 of b, 3-5 of a; edge: the pair of edges 3 i + j (e_i of b, e_j of a), or -1
    where the face does better; s: the separation along the better one, negative inside.
    """
    if sides & 4095 == 0:
        sides |= 4095
    face, s, up, over = 0, -1e300, 1.0, 1.0
    tie = TIE * (hb[0] + hb[1] + hb[2])
    for k in range(6):
        j = k - 3
        x = r[k] if k < 3 else R[j] * r[0] + R[3 + j] * r[1] + R[6 + j] * r[2]
        t = side(x, sides, k)
        if t == 0.0:
            continue
        d = t * x - (along_b(k, ha, hb, R) if k < 3 else along_a(j, ha, hb, R))
        if d > s + tie:
            face, s, up = k, d, t
    edge, least = -1, edge_must_exceed(s, hb)
    for i in range(3):
        for j in range(3):
            x, reach, q = across(i, j, ha, hb, R, r)
            t = side(x, sides, 6 + 3 * i + j)
            if q < PARALLEL * PARALLEL or t == 0.0:
                continue
            d = t * x - reach
            # d/sqrt(q) > least, without the root of every pair
            if d * abs(d) > least * abs(least) * q:
                d /= sqrt(q)
                edge, s, least, over = 3 * i + j, d, d, t
    return face, edge, s, up, over


@inner_kernel
def open_sides(ha: Vec3, hb: Vec3, R: Vector, r: Vector) -> int:
    """The axes, with their sides, that separate the two boxes."""
    best = separates_from(separation(ha, hb, R, r, OPEN)[2], (min(ha[0], hb[0]), min(ha[1], hb[1]), min(ha[2], hb[2])))
    found = 0
    for i in range(3):
        if abs(r[i]) - along_b(i, ha, hb, R) >= best:
            found |= opened(i, r[i])
        x = R[i] * r[0] + R[3 + i] * r[1] + R[6 + i] * r[2]
        if abs(x) - along_a(i, ha, hb, R) >= best:
            found |= opened(3 + i, x)
        for j in range(3):
            x, reach, q = across(i, j, ha, hb, R, r)
            if q < SWINGS * SWINGS:
                found |= 3 << (2 * (6 + 3 * i + j))
            elif abs(x) - reach >= best * sqrt(q):
                found |= opened(6 + 3 * i + j, x)
    return found


@inner_kernel
def facing(face: int, up: float, R: Vector) -> tuple[int, float, int, float]:
    """(i, top, j, bottom): face `top` e_i of b and face `bottom` e_j of a, turned towards each other."""
    if face < 3:
        i, top = face, up
        j = _largest(R[3 * i], R[3 * i + 1], R[3 * i + 2])
        return i, top, j, (-1.0 if top * R[3 * i + j] >= 0.0 else 1.0)
    j = face - 3
    bottom = -up
    i = _largest(R[j], R[3 + j], R[6 + j])
    return i, (-1.0 if bottom * R[3 * i + j] >= 0.0 else 1.0), j, bottom


@inner_kernel
def _largest(a: float, b: float, c: float) -> int:
    if abs(a) >= abs(b) and abs(a) >= abs(c):
        return 0
    return 1 if abs(b) >= abs(c) else 2
