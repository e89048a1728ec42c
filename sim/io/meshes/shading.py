"""Meshes for pictures: fewer triangles, and normals that keep creases."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.io.meshes.triangles import TriangleMesh
from solvers.types import Floats

CREASE = np.cos(np.radians(40.0))  # between triangles that are shaded as one surface


def clustered(mesh: TriangleMesh, cell: float) -> TriangleMesh:
    """The mesh with one vertex per cube of that edge [m], at the mean of its vertices (Rossignac and Borrel 1993).

    Triangles with two corners in one cube vanish, and so do copies of a triangle.
    """
    if not len(mesh.faces):
        return mesh
    keys = np.floor(mesh.vertices / cell).astype(np.int64)
    keys -= keys.min(axis=0)
    spans = keys.max(axis=0) + 1
    _, where = np.unique((keys[:, 0] * spans[1] + keys[:, 1]) * spans[2] + keys[:, 2], return_inverse=True)
    where = where.ravel()
    counts = np.bincount(where)
    vertices = np.stack([np.bincount(where, weights=mesh.vertices[:, k]) / counts for k in range(3)], axis=1)
    faces = where[mesh.faces]
    kept = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    kept = np.flatnonzero(kept)
    _, first = np.unique(np.sort(faces[kept], axis=1), axis=0, return_index=True)
    kept = kept[np.sort(first)]
    return TriangleMesh(vertices, faces[kept], None if mesh.colors is None else mesh.colors[kept])


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
