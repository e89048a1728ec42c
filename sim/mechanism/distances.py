"""Signed distances of grid points to a level set and to a mesh."""

from __future__ import annotations

from typing import Any

import numpy as np

from sim.mechanism.level_set import LevelSet
from solvers.types import Floats, Integers

_ROUNDS = 40  # of the search for a nearest point
_NARROW_BAND = 3.0  # [cells] from the surface, where distances are to the level set itself, and not to its triangles
_FEW, _MANY = 8, 64  # triangles with the nearest centres
_CHUNK = 5_000


def distances_to_level(solid: LevelSet) -> Floats:
    """(nx, ny, nz) distances of the grid points to phi = 0, with the sign of phi [m].

    Near it by x <- x - f g/|g|^2 - (I - n n^T)(x - c), which comes to rest where c - x is along the normal, if c is
    nearer than the centre of curvature; farther away, to its triangles.
    """
    counts = solid.values.shape
    nodes = np.stack(np.meshgrid(*(np.arange(n) for n in counts), indexing="ij"), axis=-1).reshape(-1, 3)
    points: Floats = solid.origin + solid.spacing * nodes
    vertices, faces = solid.surface
    corners: Floats = vertices[faces]
    out, start = to_triangles(points, corners, 2.0 * solid.spacing)
    near = out < _NARROW_BAND * solid.spacing
    c, x = points[near], start[near]
    for _ in range(_ROUNDS):
        f, g = solid.field(x)
        size = np.maximum(np.linalg.norm(g, axis=1), 1e-300)[:, None]
        n = g / size
        away = c - x
        step = away - n * (n * away).sum(axis=1)[:, None] - n * (f[:, None] / size)
        length = np.linalg.norm(step, axis=1)
        x = x + step * np.minimum(0.5, 0.5 * solid.spacing / np.maximum(length, 1e-300))[:, None]
        if length.max(initial=0.0) < 1e-10 * solid.spacing:
            break
    found = np.linalg.norm(c - solid.settled(x)[0], axis=1)
    better = found <= out[near] + 0.1 * solid.spacing  # the others converged elsewhere
    out[near] = np.where(better, found, out[near])
    return np.asarray(np.where(solid.values.ravel() < 0.0, -out, out).reshape(counts))


def to_triangles(points: Floats, corners: Floats, spacing: float) -> tuple[Floats, Floats]:
    """Distances (n,) of points to triangles (k, 3, 3), and the nearest points (n, 3).

    Triangles are divided until their edges have the spacing; those with the nearest centres are candidates, many near
    the surface. Far from it another triangle may be nearer, by much less than the spacing.
    """
    from scipy.spatial import cKDTree

    corners = _divided(corners, spacing)
    tree = cKDTree(corners.mean(axis=1))
    out, nearest = np.empty(len(points)), np.empty_like(points)
    for start in range(0, len(points), _CHUNK):
        some = points[start : start + _CHUNK]
        d, y = _nearest(some, corners[_candidates(tree, some, _FEW)])
        near = np.flatnonzero(d < _NARROW_BAND * spacing)
        if len(near):
            d[near], y[near] = _nearest(some[near], corners[_candidates(tree, some[near], _MANY)])
        out[start : start + len(some)], nearest[start : start + len(some)] = d, y
    return out, nearest


def _candidates(tree: Any, points: Floats, count: int) -> Integers:
    """(n, k) triangles with the nearest centres."""
    return np.asarray(tree.query(points, k=[*range(1, min(count, tree.n) + 1)])[1])


def _divided(corners: Floats, longest: float) -> Floats:
    """Triangles, those with longer edges in four, and again."""
    done = []
    while len(corners):
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        done.append(corners[edges <= longest])
        a, b, c = np.moveaxis(corners[edges > longest], 1, 0)
        d, e, f = (b + c) / 2, (c + a) / 2, (a + b) / 2
        corners = np.concatenate([np.stack(t, axis=1) for t in ((a, f, e), (f, b, d), (e, d, c), (d, e, f))])
    return np.concatenate(done)


def _nearest(x: Floats, corners: Floats) -> tuple[Floats, Floats]:
    """Least distance (n,) of points (n, 3) to their triangles (n, k, 3, 3), and the nearest points (n, 3): within the
    triangle, or on one of its edges.
    """
    x = x[:, None]
    a, b, c = (corners[:, :, k] for k in range(3))
    normal = np.cross(b - a, c - a)
    area = np.maximum((normal * normal).sum(axis=-1), 1e-300)
    within = x - normal * (((x - a) * normal).sum(axis=-1) / area)[..., None]
    sides = [(np.cross(q - p, within - p) * normal).sum(axis=-1) >= 0.0 for p, q in ((a, b), (b, c), (c, a))]
    best = np.where(np.all(sides, axis=0), np.linalg.norm(x - within, axis=-1), np.inf)
    place = within
    for p, q in ((a, b), (b, c), (c, a)):
        e = q - p
        t = np.clip(((x - p) * e).sum(axis=-1) / np.maximum((e * e).sum(axis=-1), 1e-300), 0.0, 1.0)
        y = p + t[..., None] * e
        d = np.linalg.norm(x - y, axis=-1)
        place = np.where((d < best)[..., None], y, place)
        best = np.minimum(d, best)
    pick = best.argmin(axis=1)
    rows = np.arange(len(pick))
    return best[rows, pick], place[rows, pick]


def distances_to_mesh(call: str, points: Floats, counts: tuple[int, ...], vertices: Floats, faces: Integers) -> Floats:
    """(nx, ny, nz) signed distances of the points of a grid to a closed mesh, by the sign of its winding number.

    Points with neighbours of the same distance or more from the surface are on one side with them: the winding number
    is asked for near the surface, and once in every other part of the grid.
    """
    from scipy.ndimage import label

    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    _, same = np.unique(vertices, axis=0, return_inverse=True)  # corners may be listed for each face
    used = np.unique(np.sort(same.ravel()[edges], axis=1), axis=0, return_counts=True)[1]
    if np.any(used % 2):
        raise ValueError(
            f"{call}(mesh): the mesh is not closed: {int((used % 2).sum())} edges have a face on one side only"
        )
    spacing = float(np.linalg.norm(points[1] - points[0]))
    out = to_triangles(points, vertices[faces], spacing)[0]
    far = (out > spacing).reshape(counts)  # neighbours along an axis are on one side
    parts, number = label(far)
    inside = np.zeros(len(points), dtype=bool)
    near = np.flatnonzero(~far.ravel())
    inside[near] = winding(points[near], vertices, faces) > 0.5
    flat = parts.ravel()
    first = np.array([np.flatnonzero(flat == k)[0] for k in range(1, number + 1)], dtype=np.int64)
    whole = winding(points[first], vertices, faces) > 0.5
    inside |= np.concatenate([[False], whole])[flat]
    return np.asarray(np.where(inside, -out, out).reshape(counts))


def winding(points: Floats, vertices: Floats, faces: Integers) -> Floats:
    """(n,) how often a mesh goes around points, without sign: solid angles over 4 pi (van Oosterom, Strackee 1983)."""
    corners = vertices[faces]
    out = np.empty(len(points))
    chunk = max(1, 2_000_000 // max(len(faces), 1))
    for start in range(0, len(points), chunk):
        a, b, c = (corners[None, :, k] - points[start : start + chunk, None] for k in range(3))
        p, q, r = (np.linalg.norm(v, axis=-1) for v in (a, b, c))
        det = (a * np.cross(b, c)).sum(axis=-1)
        dots = p * q * r + (a * b).sum(axis=-1) * r + (b * c).sum(axis=-1) * p + (c * a).sum(axis=-1) * q
        out[start : start + chunk] = np.abs(np.arctan2(det, dots).sum(axis=1)) / (2.0 * np.pi)
    return out
