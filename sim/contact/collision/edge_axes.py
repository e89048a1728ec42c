"""Rules of the separating axes: the choice between a face and an edge, and the resulting contact points."""

from __future__ import annotations

from sim.contact.collision.witness import TIE
from solvers.compiler import inner_kernel
from solvers.rotation import Vec3

# result of `separation` of a pair: face, edge or -1, separation, side of the axis of the face (1, -1), of the edge
Arrangement = tuple[int, int, float, float, float]

OPEN = (1 << 30) - 1  # both sides of every axis
_GAP = 1e-3  # part of the smallest half extent by which shapes may overlap along an axis that counts as separating

PARALLEL = 1e-6  # sine of the angle below which two edges span no plane
SWINGS = 0.1  # sine of the angle below which the normal of two edges turns too far within a step to be relied on
_FACE_FIRST = 0.95  # an edge decides inside only where it needs less than this part of the depth below a face
_DEEPER = 2.0  # points this many times deeper than the least depth,
_SLACK = 1e-2  # and this part of the smallest half extent, are no contact


@inner_kernel
def side(x: float, sides: int, k: int) -> float:
    """The side of axis k, 1 or -1, on which x is; of one that is open on one side that one; 0 where both are closed."""
    both = (sides >> (2 * k)) & 3
    if both == 3:
        return 1.0 if x >= 0.0 else -1.0
    return 1.0 if both == 1 else (-1.0 if both == 2 else 0.0)


@inner_kernel
def opened(k: int, x: float) -> int:
    """The bit of axis k for an open side x (1, -1)."""
    return (1 if x >= 0.0 else 2) << (2 * k)


@inner_kernel
def separates_from(best: float, h: Vec3) -> float:
    """Separation from which on an axis counts as separating, when that of the best is `best`."""
    return min(best, 0.0) - _GAP * min(h[0], h[1], h[2])


@inner_kernel
def edge_must_exceed(s: float, h: Vec3) -> float:
    """Separation that an edge must exceed to decide, when that of the best face is s."""
    tie = TIE * (h[0] + h[1] + h[2])
    return s * (1.0 + TIE) + tie if s > 0.0 else _FACE_FIRST * s + tie


@inner_kernel
def deepest(s: float, h: Vec3) -> float:
    """Distance below which a point is no contact, at separation s: deep inside, with a shorter way out elsewhere."""
    return (_DEEPER * s if s < 0.0 else s / _DEEPER) - _SLACK * min(h[0], h[1], h[2])


@inner_kernel
def side_of(i: int, n: Vec3, face: int, top: float) -> int:
    """Which side (edge_clipping.py) of the face `top` e_face is the edge along e_i farthest along n, or -1 for none."""
    if i == face or n[face] * top < 0.0:
        return -1
    m = 3 - i - face
    return (0 if m == (face + 1) % 3 else 2) + (1 if n[m] >= 0.0 else 0)
