"""Separating axes of two boxes: three faces of each, nine pairs of edges.   Gottschalk, Lin, Manocha 1996."""

from __future__ import annotations

from math import sqrt

from sim.collision.axes import PARALLEL, Arrangement, edge_must_exceed
from sim.collision.box import column
from sim.collision.witness import TIE, dot
from sim.model import Vector
from sim.rotation import Vec3
from solvers.jit import inner_kernel


@inner_kernel
def separation(ha: Vec3, hb: Vec3, R: Vector, r: Vector) -> Arrangement:
    """(face, edge, s): the face that separates most, 0-2 of b, 3-5 of a; the pair of edges 3 i + j (e_i of b, e_j of
    a), or -1 where the face does better; the separation s along the better one, negative inside.
    """
    face, s = 0, -1e300
    tie = TIE * (hb[0] + hb[1] + hb[2])
    for i in range(3):
        k = 3 * i
        d = abs(r[i]) - hb[i] - ha[0] * abs(R[k]) - ha[1] * abs(R[k + 1]) - ha[2] * abs(R[k + 2])
        if d > s + tie:
            face, s = i, d
    for j in range(3):
        d = abs(R[j] * r[0] + R[3 + j] * r[1] + R[6 + j] * r[2]) - ha[j]
        d -= hb[0] * abs(R[j]) + hb[1] * abs(R[3 + j]) + hb[2] * abs(R[6 + j])
        if d > s + tie:
            face, s = 3 + j, d
    edge, least = -1, edge_must_exceed(s, hb)
    for i in range(3):
        k, l = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            a, b = R[3 * k + j], R[3 * l + j]
            q = a * a + b * b
            if q < PARALLEL * PARALLEL:
                continue
            m, o = (j + 1) % 3, (j + 2) % 3
            d = abs(r[l] * a - r[k] * b) - hb[k] * abs(b) - hb[l] * abs(a)
            d -= ha[m] * abs(R[3 * i + o]) + ha[o] * abs(R[3 * i + m])
            # d/sqrt(q) > least, without the root of every pair
            if d * abs(d) > least * abs(least) * q:
                d /= sqrt(q)
                edge, s, least = 3 * i + j, d, d
    return face, edge, s


@inner_kernel
def facing(face: int, R: Vector, r: Vector) -> tuple[int, float, int, float]:
    """(i, top, j, bottom): face `top` e_i of b and face `bottom` e_j of a, turned towards each other."""
    if face < 3:
        i, top = face, (1.0 if r[face] >= 0.0 else -1.0)
        j = _largest(R[3 * i], R[3 * i + 1], R[3 * i + 2])
        return i, top, j, (-1.0 if top * R[3 * i + j] >= 0.0 else 1.0)
    j = face - 3
    bottom = -1.0 if dot(column(R, j), (r[0], r[1], r[2])) >= 0.0 else 1.0
    i = _largest(R[j], R[3 + j], R[6 + j])
    return i, (-1.0 if bottom * R[3 * i + j] >= 0.0 else 1.0), j, bottom


@inner_kernel
def _largest(a: float, b: float, c: float) -> int:
    if abs(a) >= abs(b) and abs(a) >= abs(c):
        return 0
    return 1 if abs(b) >= abs(c) else 2
