"""The drawing of a body: its visuals with their colours, or its shapes, and bones between its joints."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sim.io.meshes.shading import clustered, shaded
from sim.io.meshes.triangles import MeshError, TriangleMesh, read_mesh
from sim.mechanism.joint import WORLD
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Capsule, Primitive, Solid, Sphere, rotation_matrix
from sim.mechanism.visual import STEEL, Visual
from solvers.types import Floats

TRIANGLES = 36_000  # of a picture at most: about 2 MB of a page
_FINEST, _COARSER = 500.0, 1.4  # cells along the longest side of the robot, and the growth of a cell
_BONE = 0.025  # radius of a bone over the size of the robot
_DOT = 0.02  # [m] radius of points


class Piece(NamedTuple):
    """One object of a picture, in the frame of its body."""

    solid: Primitive | None
    mesh: TriangleMesh | None  # instead
    place: Floats  # (4, 4)
    color: tuple[float, ...]  # where the mesh has none


def pieces(mech: Mechanism) -> dict[str, list[Piece]]:
    """The drawings by body, and that of the world."""
    out: dict[str, list[Piece]] = {}
    bones = _bones(mech)
    for body in mech.bodies:
        seen = [piece for visual in body.visuals for piece in _of_visual(visual)]
        solids = [] if seen else [*body.shapes, *bones[body.name]]
        out[body.name] = seen + [piece for solid in solids for piece in of_solid(solid, STEEL)]
    out[WORLD] = [piece for visual in mech.scenery for piece in _of_visual(visual)]
    return _lighter(out)


def of_solid(solid: Solid, color: tuple[float, ...]) -> list[Piece]:
    """A shape of that colour."""
    place = matrix(solid.center, solid.orientation)
    return [Piece(part, None, place @ matrix(part.center), color) for part in solid.primitives()]


def _of_visual(visual: Visual) -> list[Piece]:
    """None for a mesh that cannot be read: the shapes of its body stand for it."""
    color = STEEL if visual.color is None else tuple(float(c) for c in np.asarray(visual.color))
    if visual.shape is not None:
        return of_solid(visual.shape, color)
    try:
        own = visual.triangles
        found = read_mesh(Path(visual.mesh)) if own is None else TriangleMesh(own[0], own[1], None)
    except (ImportError, MeshError, OSError):
        return []
    scale = np.asarray(visual.scale)
    faces = found.faces if scale.prod() > 0.0 else found.faces[:, ::-1]
    scaled = TriangleMesh(found.vertices * scale, faces, found.colors)
    return [Piece(None, scaled, matrix(visual.center, visual.orientation), color)]


def _lighter(found: dict[str, list[Piece]]) -> dict[str, list[Piece]]:
    """The pieces with as many triangles as a picture takes, in cells of one size."""
    meshes = [p.mesh for parts in found.values() for p in parts if p.mesh is not None]
    if sum(len(m.faces) for m in meshes) <= TRIANGLES:
        return found
    longest = max(float(np.ptp(m.vertices, axis=0).max()) for m in meshes)
    cell = longest / _FINEST
    unique = {(id(m.vertices), id(m.faces)): m for m in meshes}
    while True:
        light = {key: clustered(m, cell) for key, m in unique.items()}
        if sum(len(light[id(m.vertices), id(m.faces)].faces) for m in meshes) <= TRIANGLES:
            break
        cell *= _COARSER
    return {
        body: [p if p.mesh is None else p._replace(mesh=light[id(p.mesh.vertices), id(p.mesh.faces)]) for p in parts]
        for body, parts in found.items()
    }


def _bones(mech: Mechanism) -> dict[str, list[Solid]]:
    """Rods from the joint that carries a body, or its centre of mass, to the joints that it carries.

    A body that slides carries its rod, as long as it is in the neutral state.
    """
    ends: dict[str, list[Floats]] = {body.name: [] for body in mech.bodies}
    for joint in (*mech.joints, *mech.loops):
        for name, point in ((joint.child, joint.child_point), (joint.parent, joint.parent_point)):
            if name in ends and joint.kind != "floating":
                ends[name].append(np.asarray(point, dtype=np.float64))
    for joint in mech.joints:
        if joint.ntrans == 1 and joint.kind != "floating":
            out = float(np.asarray(mech.neutral)[mech.q_slice(joint.name)][0])
            ends[joint.child].append(np.asarray(joint.child_point) - out * np.asarray(joint.axis))
    feet: dict[str, list[Floats]] = {body.name: [] for body in mech.bodies}
    for contact in mech.contacts:
        feet[contact.body].append(np.asarray(contact.point, dtype=np.float64))
    spans = [float(np.linalg.norm(p)) for points in (*ends.values(), *feet.values()) for p in points]
    radius = _BONE * max(spans, default=1.0)
    return {
        body.name: _rods(ends[body.name], [] if body.shapes else feet[body.name], radius, bool(body.shapes))
        for body in mech.bodies
    }


def _rods(joints: Sequence[Floats], feet: Sequence[Floats], radius: float, shaped: bool) -> list[Solid]:
    """Rods of one body, from its first joint; a ball where it has no shape and there is no other place to go to."""
    start = joints[0] if joints else np.zeros(3)
    targets = [*joints[1:], *feet] or [np.zeros(3)]
    out: list[Solid] = []
    for end in targets:
        along = end - start
        length = float(np.linalg.norm(along))
        if length > 1e-9:
            out.append(Capsule(radius, length, center=0.5 * (start + end), orientation=from_z(along / length)))
    return out if out or shaped else [Sphere(_DOT if radius < 1e-9 else 2.0 * radius)]


def from_z(along: Floats) -> tuple[float, ...]:
    """Quaternion of the shortest rotation that takes z to a unit vector."""
    x, y, z = along
    if z < -1.0 + 1e-12:
        return 0.0, 1.0, 0.0, 0.0
    q = np.array([1.0 + z, -y, x, 0.0])
    return tuple(float(c) for c in q / np.linalg.norm(q))


def matrix(position: Any, quaternion: Any = (1.0, 0.0, 0.0, 0.0)) -> Floats:
    """Homogeneous matrix (4, 4) of a pose."""
    out = np.eye(4)
    out[:3, :3] = rotation_matrix(quaternion)
    out[:3, 3] = position
    return out


def extent(found: Sequence[Piece]) -> Floats:
    """Points (n, 3) of the body frame around which the pieces lie."""
    points = [np.zeros((1, 3))]
    for piece in found:
        if piece.mesh is not None:
            own = piece.mesh.vertices
            own = np.array([own.min(axis=0), own.max(axis=0)]) if len(own) else np.zeros((1, 3))
        else:
            assert piece.solid is not None
            size = piece.solid.size
            of_points = piece.solid.kind in ("hull", "triangles")
            radius = 0.0 if of_points else float(np.max(size))
            own = size if of_points else np.array([[-radius] * 3, [radius] * 3])
        points.append(own @ piece.place[:3, :3].T + piece.place[:3, 3])
    return np.concatenate(points)


def geometry(piece: Piece) -> tuple[Any, Any, Floats]:
    """(MeshCat geometry, material, placement in the body) of a piece."""
    from meshcat import geometry as meshcat

    if piece.mesh is None:
        assert piece.solid is not None
        if piece.solid.kind == "triangles":
            corners = piece.solid.size
            mesh = TriangleMesh(corners, np.arange(len(corners)).reshape(-1, 3), None)
            return _surface(mesh), material(piece.color), piece.place
        if piece.solid.kind == "hull":
            shape = _hull(piece.solid.size)
            return _surface(shape), material(piece.color), piece.place
        # MeshCat's cylinders stand along y, ours along z
        turned = piece.place @ matrix((0, 0, 0), (np.sqrt(0.5), np.sqrt(0.5), 0, 0))
        if piece.solid.kind == "cylinder":
            radius, length = piece.solid.size.tolist()
            return meshcat.Cylinder(length, radius), material(piece.color), turned
        if piece.solid.kind == "box":
            return meshcat.Box(piece.solid.size.tolist()), material(piece.color), piece.place
        size = piece.solid.size
        ball = meshcat.Sphere(float(size[0])) if len(size) == 1 else meshcat.Ellipsoid(size.tolist())
        return ball, material(piece.color), piece.place
    return _surface(piece.mesh), material(piece.color, piece.mesh.colors is not None), piece.place


def _hull(points: Floats) -> TriangleMesh:
    """The triangles of a convex hull, seen from outside."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    faces = hull.simplices.astype(np.int64)
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0.0
    faces[inward] = faces[inward, ::-1]
    return TriangleMesh(points, faces, None)


def material(color: Sequence[float], by_vertex: bool = False) -> Any:
    """MeshCat's material of a colour with or without alpha, or of the colours of the vertices."""
    from meshcat import geometry as meshcat

    red, green, blue = (round(255.0 * c) for c in color[:3])
    alpha = float(color[3]) if len(color) > 3 else 1.0
    paint = 0xFFFFFF if by_vertex else 65536 * red + 256 * green + blue
    return meshcat.MeshLambertMaterial(color=paint, opacity=alpha, transparent=alpha < 1.0, vertexColors=by_vertex)


def _surface(mesh: TriangleMesh) -> Any:
    """MeshCat geometry of triangles with normals, and colours where they have some."""
    from meshcat import geometry as meshcat

    vertices, normals, colors, faces = shaded(mesh)

    class Surface(meshcat.Geometry):
        """Triangles with the normals of their vertices."""

        def lower(self, object_data: Any) -> Any:
            del object_data
            arrays = {"position": vertices, "normal": normals} | ({} if colors is None else {"color": colors})
            packed = {name: meshcat.pack_numpy_array(a.T.astype(np.float32)) for name, a in arrays.items()}
            index = meshcat.pack_numpy_array(faces.T.astype(np.uint32))
            return {"uuid": self.uuid, "type": "BufferGeometry", "data": {"attributes": packed, "index": index}}

    return Surface()
