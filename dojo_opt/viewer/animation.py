"""An animation of a trajectory or a plan as one HTML file: opens in any browser, needs no server and no network.

The drawing is MeshCat's: its scene commands and its viewer, put into the page.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dojo_opt.viewer import drawing, overlays
from dojo_opt.viewer.key_frames import FRAMES, sparse
from dojo_opt.viewer.motion import Motion, motion
from dojo_opt.viewer.page import group_of, label, page, spacing
from dojo_opt.viewer.whole_file import whole_file
from sim.mechanism import checks, shapes
from sim.mechanism.body import Body
from sim.mechanism.contact import Contact
from sim.mechanism.joint import WORLD
from sim.mechanism.pack import contact_frame
from sim.mechanism.shapes import PLATE
from sim.mechanism.terrain import Terrain
from sim.simulator.simulator import Simulator

__all__ = ["save_html"]

_GRID, _SQUARE, _PIECE = 20.0, 0.5, 1.0  # edge of the drawn floor, of its squares, length of a piece of a line [m]
_AROUND, _FINE, _LINES = 1.0, 0.02, 160  # of drawn terrain: margin, spacing [m], and lines along one axis at most

_OTHERS = (".mp4", ".gif", ".webm", ".avi", ".mov", ".png", ".jpg", ".jpeg", ".svg", ".pdf")

_FLOOR, _LINE = 0xECEBE7, 0xB9B7B1  # colours
_RUBBER, _EARTH = (0.2, 0.2, 0.2), (0.6, 0.56, 0.5, 0.6)


def save_html(
    result: Any,
    path: str | Path,
    *,
    simulator: Simulator | None = None,
    forces: bool = False,
    traces: bool = False,
    goal: bool = True,
    names: Sequence[str] = (),
    together: bool = False,
) -> Path:
    """Write an animation that opens in a browser.

    The page has a clock, speeds, steps from knot to knot, and boxes that show and hide contact forces, the paths of the
    base and of the ends of the limbs, and the goal of a plan that has its problem, as a ghost. Several results move
    side by side, or in one place, as a measured motion and its prediction: a robot that is there again has another
    colour.

    Args:
        result: Trajectory, Plan or ClosedLoop; a Mechanism, which stands in its neutral state; or a list of these.
        path: path of the HTML file.
        simulator: simulator of the result, for one that was read from a file (default None: that of the result).
        forces: whether the contact forces are shown at the beginning. A bar as long as the robot is its weight.
        traces: whether the paths are shown at the beginning.
        goal: whether the ghost is shown at the beginning.
        names: names of the results, for the bar of the page (default none).
        together: whether several results move in one place; one sees through all but the first.

    Returns:
        The path.

    Raises:
        TypeError: the result is none of these.
        ValueError: the result does not know its simulator, the list is empty, there are not as many names, or the path
            is that of a picture or a video.
        SimulationError: a step of a plan cannot be solved again, for its forces.
        OSError: the file cannot be written.
    """
    target = checks.path("save_html(path)", path)
    results = list(result) if isinstance(result, list | tuple) else [result]
    if not results:
        raise ValueError("save_html(result): expected one result or more, got an empty list")
    labels = checks.names("save_html(names=...)", names)
    if labels and len(labels) != len(results):
        raise ValueError(f"save_html(names=...): expected {len(results)} names, got {len(labels)}")
    checks.flag("save_html(together=...)", together)
    shown = {"forces": forces, "paths": traces, "ghost": goal}
    motions = [motion(one, simulator) for one in results]
    if target.suffix.lower() in _OTHERS:
        raise ValueError(
            f"save_html(path): expected a page such as {target.stem}.html, got {target.name!r}; pictures "
            "are those of save_picture, videos those of save_video"
        )
    with whole_file(target) as file:
        file.write_text(html_of(*motions, shown=shown, names=labels, together=together), encoding="utf-8")
    return target


def load_meshcat() -> None:
    """Import MeshCat as a whole: Ctrl-C within leaves modules of Python's library that cannot be imported again."""
    from solvers.compiler.signals import signals_held

    with signals_held(), warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # MeshCat loads its server, and that an old part of zmq
        import meshcat  # noqa: F401


def html_of(
    *motions: Motion,
    moving: bool = True,
    shown: Mapping[str, bool] | None = None,
    names: Sequence[str] = (),
    together: bool = False,
) -> str:
    """The page of motions side by side, or in one place.

    Args:
        *motions: the motions, the first one where it is, the others beside it.
        moving: whether they are played; otherwise the page has their first poses.
        shown: whether "forces", "paths" and the "ghost" of the goal are shown at the beginning (default None: none).
        names: names of the motions (default none).
        together: whether all of them are where they are.

    Returns:
        The text of an HTML file.
    """
    load_meshcat()
    commands = _ground(motions[0])
    clips: dict[Any, Any] = {}
    away = 0.0 if together else spacing(motions)
    end = max(float(m.time[-1]) for m in motions)
    for k, m in enumerate(motions):
        at = group_of(k)
        commands += [*_scene(m, at), *_beside(at, (0.0, -k * away, 0.0))]
        if moving and len(m.time) > 1:
            commands += overlays.paths(m, at)
            bars, lengths = overlays.forces(m, at, end)
            commands += bars
            clips |= {**_clips(m, at, end), **lengths}
    return page(motions, [*commands, *([_animation(clips)] if moving else [])], shown or {}, names, away)


def _beside(group: tuple[str, ...], offset: tuple[float, ...]) -> list[Any]:
    """Commands that put a motion beside the first one."""
    from meshcat.commands import SetTransform
    from meshcat.path import Path as Node

    return [] if len(group) == 1 else [SetTransform(drawing.matrix(offset), Node(group))]


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


def _scene(m: Motion, group: tuple[str, ...] = ("meshcat",)) -> list[Any]:
    """Commands that draw every body at its first pose, the balls of its contacts, and obstacles."""
    from meshcat import geometry
    from meshcat.commands import SetObject, SetTransform

    commands = []
    for k, body in enumerate(m.mechanism.bodies):
        node = node_of("bodies", k, body.name, group)
        for part, piece in enumerate(m.pieces[body.name]):
            solid, paint, place = drawing.geometry(piece)
            commands.append(SetObject(solid, paint, node.append(f"part{part}")))
            commands.append(SetTransform(place, node.append(f"part{part}")))
        for c, contact in enumerate(m.mechanism.contacts):
            if contact.body == body.name and _shows(contact, body):
                ball = node.append(label(f"contact {c}", contact.name))
                commands.append(SetObject(geometry.Sphere(max(contact.radius, 0.01)), drawing.material(_RUBBER), ball))
                commands.append(SetTransform(drawing.matrix(contact.point), ball))
        commands.append(SetTransform(drawing.matrix(m.position[0, k], m.quaternion[0, k]), node))
    for part, piece in enumerate(m.pieces[WORLD]):
        solid, paint, place = drawing.geometry(piece)
        node = node_of("obstacles", part, WORLD, group)
        commands += [SetObject(solid, paint, node), SetTransform(place, node)]
    for k, collision in enumerate(m.mechanism.collisions):
        if collision.b != WORLD or collision.shape_b is None or isinstance(collision.shape_b, shapes.String):
            continue
        for part, piece in enumerate(drawing.of_solid(collision.shape_b, _EARTH)):
            node = node_of("obstacles", k, collision.name, group).append(f"part{part}")
            solid, paint, place = drawing.geometry(piece)
            commands += [SetObject(solid, paint, node), SetTransform(place, node)]
    return commands


def _shows(contact: Contact, body: Body) -> bool:
    """Whether a contact is drawn: on a body with a picture none, on one with shapes those that are balls."""
    if body.visuals or (contact.radius == 0.0 and body.shapes):
        return False
    balls = [s for s in body.shapes if isinstance(s, shapes.Sphere) and s.radius >= contact.radius]
    return not any(np.allclose(np.asarray(s.center), np.asarray(contact.point)) for s in balls)


def node_of(kind: str, number: int, name: str, group: tuple[str, ...] = ("meshcat",)) -> Any:
    """Where a body or an obstacle is in MeshCat's scene."""
    from meshcat.path import Path as Node

    return Node((*group, kind, label(str(number), name)))


def _clips(m: Motion, group: tuple[str, ...], end: float) -> dict[Any, Any]:
    """One clip per body, a key at every knot; the browser interpolates. A motion that ends early stays at its end."""
    from meshcat.animation import AnimationClip

    clips = {}
    every = sparse(m.time)
    last = len(m.time) - 1
    rows = [*range(0, last, every), last]
    times = [*m.time[rows]]
    if end > times[-1]:
        times, rows = [*times, end], [*rows, last]
    for k, body in enumerate(m.mechanism.bodies):
        clip = AnimationClip(fps=FRAMES)
        for time, row in zip(times, rows, strict=True):
            clip.set_property(float(time * FRAMES), "position", "vector3", m.position[row, k].tolist())
            turn = np.roll(m.quaternion[row, k], -1).tolist()
            clip.set_property(float(time * FRAMES), "quaternion", "quaternion", turn)
        clips[node_of("bodies", k, body.name, group)] = clip
    return clips


def _animation(clips: dict[Any, Any]) -> Any:
    from meshcat.animation import Animation
    from meshcat.commands import SetAnimation

    return SetAnimation(Animation(clips, default_framerate=FRAMES), play=True, repetitions=1000)
