"""Meshes for pictures: fewer triangles, and normals that keep creases."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.io.meshes.triangles import TriangleMesh
from solvers.types import Floats

_FREE = 1e-3  # of the sum of squares: directions with less are free
CREASE = np.cos(np.radians(40.0))  # between triangles that are shaded as one surface


def clustered(mesh: TriangleMesh, cell: float) -> TriangleMesh:
    """The mesh with one vertex per cube of that edge [m] and colour, where it is nearest to the planes of the triangles
    there in the mean of squares (Lindstrom 2000).

    So flat faces and edges stay where they are, and a part stays behind one of another colour that covers it. Triangles
    with two corners in one cube vanish, and so do copies of a triangle.
    """
    if not len(mesh.faces):
        return mesh
    corners = mesh.faces.ravel()
    keys = np.floor(mesh.vertices / cell).astype(np.int64)[corners]
    if mesh.colors is not None:
        paint = np.unique(np.round(255.0 * mesh.colors).astype(np.int64), axis=0, return_inverse=True)[1].ravel()
        keys = np.column_stack([keys, np.repeat(paint, 3)])
    keys -= keys.min(axis=0)
    _, where = np.unique(np.ravel_multi_index(tuple(keys.T), tuple(keys.max(axis=0) + 1)), return_inverse=True)
    where = where.ravel()
    vertices = _nearest_to_planes(mesh, where, cell)
    faces = where.reshape(-1, 3)
    kept = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    kept = np.flatnonzero(kept)
    _, first = np.unique(np.sort(faces[kept], axis=1), axis=0, return_index=True)
    kept = kept[np.sort(first)]
    return TriangleMesh(vertices, faces[kept], None if mesh.colors is None else mesh.colors[kept])


def _nearest_to_planes(mesh: TriangleMesh, where: NDArray[np.int64], cell: float) -> Floats:
    """(n, 3) vertices of clusters, `where` (3 k,) by corner: the point x of least sum of (a . (x - p))^2, a the vectors
    of area and p the corners; along directions that this leaves free, their mean.
    """
    corners, count = mesh.vertices[mesh.faces.ravel()], np.bincount(where)
    mean = np.stack([np.bincount(where, weights=corners[:, k]) for k in range(3)], axis=1) / count[:, None]
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    area = np.repeat(np.cross(b - a, c - a), 3, axis=0)
    height = (area * (corners - mean[where])).sum(axis=1)
    A = np.empty((len(count), 3, 3))
    right = np.stack([np.bincount(where, weights=area[:, k] * height) for k in range(3)], axis=1)
    for i in range(3):
        for k in range(3):
            A[:, i, k] = np.bincount(where, weights=area[:, i] * area[:, k])
    free = _FREE * np.trace(A, axis1=1, axis2=2)
    A += np.where(free > 0.0, free, 1.0)[:, None, None] * np.eye(3)
    move = np.linalg.solve(A, right[:, :, None])[:, :, 0]
    length = np.linalg.norm(move, axis=1)
    return np.asarray(mean + move * np.minimum(1.0, cell / np.maximum(length, 1e-300))[:, None])


def shaded(mesh: TriangleMesh) -> tuple[Floats, Floats, Floats | None, NDArray[np.int64]]:
    """(vertices (n, 3), their normals (n, 3), their colours (n, 3) or None, faces (k, 3)).

    A vertex is one per surface that meets there: the normal of a corner is the mean, by area, of the triangles at the
    vertex that are within the angle of CREASE of its own.
    """
    corners = mesh.faces.ravel()
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    area = np.cross(b - a, c - a)
    size = np.linalg.norm(area, axis=1)
    unit = area / np.where(size > 0.0, size, 1.0)[:, None]
    owner = np.arange(len(corners)) // 3
    order = np.argsort(corners, kind="stable")
    vertex, own = corners[order], owner[order]
    total = area[own].copy()
    for step in range(1, int(np.bincount(corners).max(initial=1))):
        near = vertex[step:] == vertex[:-step]
        i, j = np.flatnonzero(near), np.flatnonzero(near) + step
        alike = (unit[own[i]] * unit[own[j]]).sum(axis=1) > CREASE
        i, j = i[alike], j[alike]
        total[i] += area[own[j]]
        total[j] += area[own[i]]
        if step >= 24:  # the hub of a fan: its first neighbours are enough
            break
    length = np.linalg.norm(total, axis=1)
    normals = np.empty_like(total)
    normals[order] = total / np.where(length > 0.0, length, 1.0)[:, None]
    key = np.concatenate([corners[:, None], np.round(50.0 * normals).astype(np.int64)], axis=1)
    if mesh.colors is not None:
        key = np.concatenate([key, np.round(255.0 * mesh.colors[owner]).astype(np.int64)], axis=1)
    _, first, where = np.unique(key, axis=0, return_index=True, return_inverse=True)
    colors = None if mesh.colors is None else mesh.colors[owner[first]]
    return mesh.vertices[corners[first]], normals[first], colors, where.reshape(-1, 3)
