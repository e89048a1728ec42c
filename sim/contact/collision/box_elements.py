"""Two elements of two boxes, named by a number: the features of a contact point of boxes, smooth in their pose.

A code holds the kind, the two faces and further indices (`code_of`); 0 means no elements.

    VERTEX_FACE     vertex k of the face `bottom` e_j of a above the face `top` e_i of b
    CROSSING        edge k of the face of a across a side of the face of b
    CORNER_FACE     corner k of the face of b below the face of a
    EDGES           edge along e_j of a, through the middle of corner k, against one along e_i of b; `top` n points to a
    VERTEX_BOX      corner k of a against the nearest element of b
    BOX_VERTEX      corner k of b against the nearest element of a
"""

from __future__ import annotations

from sim.contact.collision.box import column, corner, to_a, to_b, vertex_on_box, vertex_under_box
from sim.contact.collision.edge_clipping import common_normal, edge_normal, side_edge
from sim.contact.collision.witness import FACE, NOWHERE, along, axis, edges, vertex_a, vertex_b
from solvers.compiler import inner_kernel
from solvers.rotation import Vec3
from solvers.types import Vector

VERTEX_FACE, CROSSING, CORNER_FACE, EDGES, VERTEX_BOX, BOX_VERTEX = 1, 2, 3, 4, 5, 6
Facing = tuple[int, float, int, float]  # i, top, j, bottom: face `top` e_i of b, face `bottom` e_j of a

_RADII = (0.0, 0.0)


@inner_kernel
def code_of(kind: int, faces: Facing, k: int, other: int) -> int:
    """Number of two elements; `other`: the side of a CROSSING, the corner of b of EDGES."""
    i, top, j, bottom = faces
    code = 65536 + kind + 8 * i + 64 * j + 512 * k + 4096 * other
    return code + (32 if top > 0.0 else 0) + (32768 if bottom > 0.0 else 0)


@inner_kernel
def faces_of(code: int) -> Facing:
    """(i, top, j, bottom) of a code."""
    return (code >> 3) & 3, (1.0 if code & 32 else -1.0), (code >> 6) & 3, (1.0 if code & 32768 else -1.0)


@inner_kernel
def vertex(k: int, j: int, bottom: float, h: Vec3, R: Vector, r: Vector) -> Vec3:
    """Vertex k = 0..3 of the face `bottom` e_j of a, around it: the signs are ++, -+, --, +-."""
    x = along((r[0], r[1], r[2]), bottom * h[j], column(R, j))
    m, o = (j + 1) % 3, (j + 2) % 3
    x = along(x, h[m] if k == 0 or k == 3 else -h[m], column(R, m))
    return along(x, h[o] if k < 2 else -h[o], column(R, o))


@inner_kernel
def face_corner(k: int, i: int, top: float, h: Vec3) -> Vec3:
    """Corner k = 0..3 of the face `top` e_i of b, in the same order."""
    m, o = (i + 1) % 3, (i + 2) % 3
    y = along(axis(i, top * h[i]), h[m] if k == 0 or k == 3 else -h[m], axis(m, 1.0))
    return along(y, h[o] if k < 2 else -h[o], axis(o, 1.0))


@inner_kernel
def edge_of(k: int, i: int, h: Vec3) -> Vec3:
    """Middle of the edge along e_i through corner k."""
    x = corner(k, h)
    return (0.0 if i == 0 else x[0]), (0.0 if i == 1 else x[1]), (0.0 if i == 2 else x[2])


@inner_kernel
def face_edge(k: int, j: int, bottom: float, h: Vec3, R: Vector, r: Vector) -> tuple[Vec3, Vec3, float]:
    """Middle, direction and half length of edge k of the face `bottom` e_j of a: from vertex k to k + 1."""
    x, y = vertex(k, j, bottom, h, R, r), vertex((k + 1) & 3, j, bottom, h, R, r)
    l = (j + 1) % 3 if k & 1 == 0 else (j + 2) % 3
    return (0.5 * (x[0] + y[0]), 0.5 * (x[1] + y[1]), 0.5 * (x[2] + y[2])), column(R, l), h[l]


@inner_kernel
def put_elements(code: int, ha: Vec3, hb: Vec3, R: Vector, r: Vector, out: Vector) -> None:
    """Contact of the two elements `code`, which is not 0."""
    kind, k, other = code & 7, (code >> 9) & 7, (code >> 12) & 7
    i, top, j, bottom = faces_of(code)
    if kind == VERTEX_FACE:
        x = vertex(k, j, bottom, ha, R, r)
        vertex_a(x, axis(i, top), NOWHERE, top * x[i] - hb[i], _RADII, NOWHERE, FACE, out)
    elif kind == CROSSING:
        x, ua, _ = face_edge(k, j, bottom, ha, R, r)
        y, ub, _ = side_edge(other, i, top, hb)
        edges(x, ua, y, ub, common_normal(ua, ub, axis(i, top)), _RADII, out)
    elif kind == CORNER_FACE:
        y = face_corner(k, i, top, hb)
        z = to_a(R, (y[0] - r[0], y[1] - r[1], y[2] - r[2]))
        n = column(R, j)
        n = (-bottom * n[0], -bottom * n[1], -bottom * n[2])
        vertex_b(y, n, NOWHERE, bottom * z[j] - ha[j], _RADII, NOWHERE, FACE, out)
    elif kind == EDGES:
        x = to_b(R, edge_of(k, j, ha))
        ua, ub = column(R, j), axis(i, 1.0)
        y = edge_of(other, i, hb)
        edges((x[0] + r[0], x[1] + r[1], x[2] + r[2]), ua, y, ub, edge_normal(ub, ua, top), _RADII, out)
    elif kind == VERTEX_BOX:
        x = to_b(R, corner(k, ha))
        vertex_on_box((x[0] + r[0], x[1] + r[1], x[2] + r[2]), hb, 0.0, out)
    else:
        vertex_under_box(corner(k, hb), ha, R, r, out)
