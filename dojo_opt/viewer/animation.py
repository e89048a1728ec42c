"""An animation of a trajectory or a plan as one HTML file: opens in any browser, needs no server and no network.

The drawing is MeshCat's: its scene commands and its viewer, put into the page.
"""

from __future__ import annotations

import warnings
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from dojo_opt.viewer import drawing
from dojo_opt.viewer.motion import Motion, motion
from dojo_opt.viewer.page import page
from sim.mechanism import shapes
from sim.mechanism.pack import contact_frame
from sim.mechanism.parts import WORLD, Body, Contact
from sim.mechanism.shapes import PLATE
from sim.mechanism.terrain import Terrain
from sim.simulator.simulator import Simulator

__all__ = ["save_html"]

FRAMES = 60  # per second of the animation
_GRID, _SQUARE, _PIECE = 20.0, 0.5, 1.0  # edge of the drawn floor, of its squares, length of a piece of a line [m]
_AROUND, _FINE, _LINES = 1.0, 0.02, 160  # of drawn terrain: margin, spacing [m], and lines along one axis at most

_FLOOR, _LINE = 0xECEBE7, 0xB9B7B1  # colours
_RUBBER, _EARTH = (0.2, 0.2, 0.2), (0.6, 0.56, 0.5, 0.6)


def save_html(result: Any, path: str | Path, *, simulator: Simulator | None = None) -> Path:
    """Write an animation that opens in a browser.

    Args:
        result: Trajectory, Plan or ClosedLoop; or a Mechanism, which stands in its neutral state.
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
    target = Path(path)
    target.write_text(html_of(motion(result, simulator)), encoding="utf-8")
    return target


def html_of(m: Motion, *, moving: bool = True) -> str:
    """The page of a motion.

    Args:
        m: the motion.
        moving: whether it is played; otherwise the page has its first poses.

    Returns:
        The text of an HTML file.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # MeshCat loads its server, and that an old part of zmq
        import meshcat  # noqa: F401

    return page(m, [*_ground(m), *_scene(m), *([_animation(m)] if moving else [])])


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
        SetTransform(drawing.matrix((0.0, 0.0, -2.0 * PLATE)), plane),
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
    """Commands that draw every body at its first pose, the balls of its contacts, and obstacles."""
    from meshcat import geometry
    from meshcat.commands import SetObject, SetTransform

    commands = []
    for k, body in enumerate(m.mechanism.bodies):
        node = node_of("bodies", k, body.name)
        for part, piece in enumerate(m.pieces[body.name]):
            solid, paint, place = drawing.geometry(piece)
            commands.append(SetObject(solid, paint, node.append(f"part{part}")))
            commands.append(SetTransform(place, node.append(f"part{part}")))
        for c, contact in enumerate(m.mechanism.contacts):
            if contact.body == body.name and _shows(contact, body):
                ball = node.append(_label(f"contact {c}", contact.name))
                commands.append(SetObject(geometry.Sphere(max(contact.radius, 0.01)), drawing.material(_RUBBER), ball))
                commands.append(SetTransform(drawing.matrix(contact.point), ball))
        commands.append(SetTransform(drawing.matrix(m.position[0, k], m.quaternion[0, k]), node))
    for part, piece in enumerate(m.pieces[WORLD]):
        solid, paint, place = drawing.geometry(piece)
        node = node_of("obstacles", part, WORLD)
        commands += [SetObject(solid, paint, node), SetTransform(place, node)]
    for k, collision in enumerate(m.mechanism.collisions):
        if collision.b != WORLD or collision.shape_b is None or isinstance(collision.shape_b, shapes.String):
            continue
        for part, piece in enumerate(drawing.of_solid(collision.shape_b, _EARTH)):
            node = node_of("obstacles", k, collision.name).append(f"part{part}")
            solid, paint, place = drawing.geometry(piece)
            commands += [SetObject(solid, paint, node), SetTransform(place, node)]
    return commands


def _shows(contact: Contact, body: Body) -> bool:
    """Whether a contact is drawn: on a body with a picture none, on one with shapes those that are balls."""
    if body.visuals or (contact.radius == 0.0 and body.shapes):
        return False
    balls = [s for s in body.shapes if isinstance(s, shapes.Sphere) and s.radius >= contact.radius]
    return not any(np.allclose(np.asarray(s.center), np.asarray(contact.point)) for s in balls)


def node_of(kind: str, number: int, name: str) -> Any:
    """Where a body or an obstacle is in MeshCat's scene."""
    from meshcat.path import Path as Node

    return Node(("meshcat", kind, _label(str(number), name)))


def _label(before: str, name: str) -> str:
    """The MeshCat name of a part named by the user: in its paths a slash separates, and in its table of parts
    JavaScript has words of its own, such as "constructor", which the number before keeps apart.
    """
    return escape(f"{before} {name.replace('/', '|')}")


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
        clips[node_of("bodies", k, body.name)] = clip
    return SetAnimation(Animation(clips, default_framerate=FRAMES), play=True, repetitions=1000)
