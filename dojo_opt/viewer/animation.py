"""An animation of a trajectory or a plan as one HTML file: opens in any browser, needs no server and no network.

The drawing is MeshCat's: its scene commands and its viewer, put into the page.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from dojo_opt.viewer.motion import Motion, motion
from dojo_opt.viewer.page import page
from sim.mechanism import shapes
from sim.mechanism.pack import contact_frame
from sim.mechanism.parts import WORLD
from sim.mechanism.shapes import PLATE, Primitive
from sim.mechanism.terrain import Terrain
from sim.simulator.simulator import Simulator

__all__ = ["save_html"]

FRAMES = 60  # per second of the animation
_GRID, _SQUARE, _PIECE = 20.0, 0.5, 1.0  # edge of the drawn floor, of its squares, length of a piece of a line [m]
_AROUND, _FINE, _LINES = 1.0, 0.02, 160  # of drawn terrain: margin, spacing [m], and lines along one axis at most

_FLOOR, _LINE = 0xECEBE7, 0xB9B7B1  # colours


def save_html(result: Any, path: str | Path, *, simulator: Simulator | None = None) -> Path:
    """Write an animation that opens in a browser.

    Args:
        result: Trajectory, Plan or ClosedLoop.
        path: path of the HTML file.
        simulator: simulator of the result, for one that was read from a file (default None: that of the result).

    Returns:
        The path.

    Raises:
        TypeError: the result is none of these.
        ValueError: the result does not know its simulator.
        SimulationError: a step of a plan cannot be solved again, for its forces.
        OSError: the file cannot be written.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # MeshCat loads its server, and that an old part of zmq
        import meshcat  # noqa: F401

    m = motion(result, simulator)
    target = Path(path)
    target.write_text(page(m, [*_ground(m), *_scene(m), _animation(m)]), encoding="utf-8")
    return target


def _ground(m: Motion) -> list[Any]:
    """Commands that draw all ground that contacts touch; level ground at height zero has lines."""
    from meshcat import geometry
    from meshcat.commands import SetObject, SetTransform
    from meshcat.path import Path as Node

    level = [c for c in m.mechanism.contacts if c.terrain is None]
    planes = dict.fromkeys((tuple(np.round(np.asarray(c.normal), 9)), c.height) for c in level)
    earth = geometry.MeshLambertMaterial(color=0x9A8F80, opacity=0.6, transparent=True)
    hills = dict.fromkeys((c.terrain, c.height) for c in m.mechanism.contacts if c.terrain is not None)
    commands = []
    for k, (terrain, height) in enumerate(hills):
        surface = geometry.TriangularMeshGeometry(*_surface(m, terrain, height))
        commands.append(SetObject(surface, earth, Node(("meshcat", "ground", f"terrain{k}"))))
    for k, (normal, height) in enumerate(planes):
        if (normal, height) == ((0.0, 0.0, 1.0), 0.0):
            commands += _floor()
            continue
        n, *sides = contact_frame(normal)
        place = np.eye(4)
        place[:3, :3] = np.stack([*sides, n], axis=1)
        place[:3, 3] = (height - 0.5 * PLATE) * n
        node = Node(("meshcat", "ground", str(k)))
        commands += [SetObject(geometry.Box([10.0, 10.0, PLATE]), earth, node), SetTransform(place, node)]
    return commands


def _floor() -> list[Any]:
    """Commands that draw level ground at height zero: a light plane with lines."""
    from meshcat import geometry
    from meshcat.commands import SetObject, SetTransform
    from meshcat.path import Path as Node

    plane, lines = Node(("meshcat", "floor", "plane")), Node(("meshcat", "floor", "lines"))
    half, places = 0.5 * _GRID, np.arange(-0.5 * _GRID, 0.5 * _GRID + 0.5 * _SQUARE, _SQUARE)
    # in pieces: software renderers drop lines that begin behind the camera
    starts = np.arange(-half, half, _PIECE)
    ends = [(along, side) for along in places for start in starts for side in (start, start + _PIECE)]
    points = np.array([(a, b, 0.0) for a, b in ends] + [(b, a, 0.0) for a, b in ends]).T
    ink = geometry.LineBasicMaterial(color=_LINE)
    return [
        SetObject(geometry.Box([_GRID, _GRID, PLATE]), geometry.MeshBasicMaterial(color=_FLOOR), plane),
        SetTransform(_place((0.0, 0.0, -2.0 * PLATE)), plane),
        SetObject(geometry.LineSegments(geometry.PointsGeometry(points.astype(np.float32)), ink), path=lines),
    ]


def _surface(m: Motion, terrain: Terrain, height: float) -> tuple[Any, Any]:
    """Vertices (n, 3) and triangles (k, 3) of the ground around the motion."""
    low = m.position[..., :2].min(axis=(0, 1)) - _AROUND
    high = m.position[..., :2].max(axis=(0, 1)) + _AROUND
    lines = [np.linspace(a, b, min(_LINES, int((b - a) / _FINE) + 2)) for a, b in zip(low, high, strict=True)]
    X, Y = np.meshgrid(*lines, indexing="ij")
    vertices = np.stack([X, Y, terrain.height(X, Y) + height], axis=-1).reshape(-1, 3)
    corner = np.arange(X.size).reshape(X.shape)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]))
    return vertices, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def _scene(m: Motion) -> list[Any]:
    """Commands that draw every body at its first pose: its shape, and a ball for every contact."""
    from meshcat import geometry
    from meshcat.commands import SetObject, SetTransform

    commands = []
    steel, rubber = geometry.MeshLambertMaterial(color=0x8FA3B8), geometry.MeshLambertMaterial(color=0x333333)
    for k, body in enumerate(m.mechanism.bodies):
        node = _node("bodies", k, body.name)
        for part, (solid, place) in enumerate(_solids(body.shapes)):
            commands.append(SetObject(solid, steel, node.append(f"part{part}")))
            commands.append(SetTransform(place, node.append(f"part{part}")))
        for c, contact in enumerate(m.mechanism.contacts):
            if contact.body == body.name:
                ball = node.append(_label(f"contact {c}", contact.name))
                commands.append(SetObject(geometry.Sphere(max(contact.radius, 0.01)), rubber, ball))
                commands.append(SetTransform(_place(contact.point), ball))
        commands.append(SetTransform(_place(m.position[0, k], m.quaternion[0, k]), node))
    earth = geometry.MeshLambertMaterial(color=0x9A8F80, opacity=0.6, transparent=True)
    for k, collision in enumerate(m.mechanism.collisions):
        if collision.b != WORLD or isinstance(collision.shape_b, shapes.String):
            continue
        for part, (solid, place) in enumerate(_solids([collision.shape_b])):
            node = _node("obstacles", k, collision.name).append(f"part{part}")
            commands += [SetObject(solid, earth, node), SetTransform(place, node)]
    return commands


def _node(kind: str, number: int, name: str) -> Any:
    """Where a body or an obstacle is in MeshCat's scene."""
    from meshcat.path import Path as Node

    return Node(("meshcat", kind, _label(str(number), name)))


def _label(before: str, name: str) -> str:
    """The MeshCat name of a part named by the user: in its paths a slash separates, and in its table of parts
    JavaScript has words of its own, such as "constructor", which the number before keeps apart.
    """
    return escape(f"{before} {name.replace('/', '|')}")


def _solids(found: Sequence[Any]) -> list[tuple[Any, Any]]:
    """(MeshCat geometry, placement in the body) of shapes; a body without one is a small ball."""
    from meshcat import geometry

    if not found:
        return [(geometry.Sphere(0.02), np.eye(4))]
    return [
        (_geometry(part), _place(shape.center, shape.orientation) @ _at(part))
        for shape in found
        for part in shape.primitives()
    ]


def _geometry(part: Primitive) -> Any:
    """The MeshCat geometry of a part of a shape."""
    from meshcat import geometry

    if part.kind == "hull":
        from scipy.spatial import ConvexHull

        return geometry.TriangularMeshGeometry(part.size, ConvexHull(part.size).simplices)
    if part.kind == "cylinder":
        radius, length = part.size.tolist()
        return geometry.Cylinder(length, radius)
    if part.kind == "box":
        return geometry.Box(part.size.tolist())
    return geometry.Sphere(float(part.size[0])) if len(part.size) == 1 else geometry.Ellipsoid(part.size.tolist())


def _at(part: Primitive) -> Any:
    """Its placement in the shape: MeshCat's cylinders stand along y, ours along z."""
    return _place(part.center, (np.sqrt(0.5), np.sqrt(0.5), 0, 0) if part.kind == "cylinder" else (1.0, 0.0, 0.0, 0.0))


def _place(position: Any, quaternion: Any = (1.0, 0.0, 0.0, 0.0)) -> Any:
    """Homogeneous matrix (4, 4) of a pose."""
    matrix = np.eye(4)
    matrix[:3, :3] = shapes.rotation_matrix(quaternion)
    matrix[:3, 3] = position
    return matrix


def _animation(m: Motion) -> Any:
    """One clip per body, a key at every knot; the browser interpolates."""
    from meshcat.animation import Animation, AnimationClip
    from meshcat.commands import SetAnimation

    clips = {}
    # a plant steps more often than a screen: keys that no frame would show only make the file larger
    every = max(1, int(1.0 / (FRAMES * (m.time[1] - m.time[0])) + 1e-9)) if len(m.time) > 1 else 1
    frames = [float(t * FRAMES) for t in m.time[::every]]
    for k, body in enumerate(m.mechanism.bodies):
        clip = AnimationClip(fps=FRAMES)
        for frame, position, quaternion in zip(frames, m.position[::every, k], m.quaternion[::every, k], strict=True):
            clip.set_property(frame, "position", "vector3", position.tolist())
            clip.set_property(frame, "quaternion", "quaternion", np.roll(quaternion, -1).tolist())
        clips[_node("bodies", k, body.name)] = clip
    return SetAnimation(Animation(clips, default_framerate=FRAMES), play=True, repetitions=1000)
