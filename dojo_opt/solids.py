"""What shapes, and bodies without one, look like: geometries of MeshCat and where they are in the body."""

from __future__ import annotations

from typing import Any

import numpy as np

from sim import shapes
from sim.mechanism import Mechanism
from sim.polytope import Polytope

__all__ = ["THICK", "bones", "place_of", "solids_of"]

THICK = 0.002  # of a drawn plane [m]
_BALL = 0.02  # radius of what stands for a body without a shape [m]


def bones(mechanism: Mechanism, name: str) -> list[tuple[Any, Any]]:
    """A body without a shape: rods from its joint to those that it carries, or to its centre of mass; or a ball."""
    own = next(np.asarray(j.child_point) for j in mechanism.joints if j.child == name)
    ends = [np.asarray(j.parent_point) for j in mechanism.joints if j.parent == name] or [np.zeros(3)]
    solids = solids_of(shapes.Sphere(_BALL))
    for end in ends:
        along = end - own
        length = float(np.linalg.norm(along))
        if length > _BALL:
            direction = along / length
            half = np.array([1.0 + direction[2], -direction[1], direction[0], 0.0])  # turns z into the direction
            turn = half / np.linalg.norm(half) if direction[2] > -1.0 + 1e-9 else np.array([0.0, 1.0, 0.0, 0.0])
            rod = shapes.Capsule(min(0.5 * _BALL, 0.1 * length), length, center=0.5 * (own + end), orientation=turn)
            solids += solids_of(rod)
    return solids


def solids_of(shape: Any) -> list[tuple[Any, Any]]:
    """(MeshCat geometry, placement in the body) of a shape."""
    from meshcat import geometry

    place = place_of(shape.center, shape.orientation)
    if isinstance(shape, shapes.Sphere):
        return [(geometry.Sphere(shape.radius), place)]
    if isinstance(shape, shapes.Box):
        return [(geometry.Box([shape.x, shape.y, shape.z]), place)]
    if isinstance(shape, shapes.HalfSpace):
        return [(geometry.Box([10.0, 10.0, THICK]), place @ place_of((0, 0, -0.5 * THICK)))]
    if isinstance(shape, Polytope):
        from scipy.spatial import ConvexHull

        points = np.asarray(shape.vertices)
        return [(geometry.TriangularMeshGeometry(points, ConvexHull(points).simplices), place)]
    # MeshCat's cylinders stand along y, ours along z
    upright = place @ place_of((0, 0, 0), (np.sqrt(0.5), np.sqrt(0.5), 0, 0))
    solids = [(geometry.Cylinder(shape.length, shape.radius), upright)]
    if isinstance(shape, shapes.Capsule):
        ends = [place @ place_of((0, 0, side * shape.length / 2)) for side in (-1, 1)]
        solids += [(geometry.Sphere(shape.radius), end) for end in ends]
    return solids


def place_of(position: Any, quaternion: Any = (1.0, 0.0, 0.0, 0.0)) -> Any:
    """Homogeneous matrix (4, 4) of a pose."""
    matrix = np.eye(4)
    matrix[:3, :3] = shapes.rotation_matrix(quaternion)
    matrix[:3, 3] = position
    return matrix
