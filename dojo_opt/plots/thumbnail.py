"""thumbnail: a small picture of a mechanism in its neutral state."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sim.mechanism.forward_kinematics import body_poses
from sim.mechanism.joint import WORLD
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Solid, rotation_matrix
from solvers.types import Floats

_VIEW = np.radians((30.0, 18.0))  # azimuth and elevation of the camera
_SHADOWS = ((1.35, "#f3f3f3"), (1.15, "#e9e9e9"), (0.95, "#dedede"))  # growth and colour of the layers of a shadow
_FILL, _EDGE, _BONE, _CONTACT, _GROUND = "#b9cde4", "#33557a", "#8a8f99", "#c8442d", "#dddddd"


def thumbnail(mechanism: Mechanism, q: ArrayLike | None = None, *, size: float = 2.0) -> Any:
    """A small picture of a mechanism: bodies as hulls of their shapes, joints as lines, contacts as red balls.

    Bodies without a shape are drawn as lines from their joint to those that they carry, and to their contacts.

    Args:
        mechanism: the mechanism.
        q: (nq,) coordinates [m, rad] (default None: those of the neutral state).
        size: edge of the figure [inch].

    Returns:
        A new square figure.
    """
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle, Polygon

    at = body_poses(mechanism.joints, np.asarray(mechanism.neutral if q is None else q, dtype=np.float64))
    right, up, depth = _camera()
    figure = Figure(figsize=(size, size))
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    drawn: list[Floats] = []
    for a, b in _bones(mechanism, at):
        line = np.array([a, b]) @ np.array([right, up]).T
        ax.plot(*line.T, color=_BONE, linewidth=2.0, solid_capstyle="round", zorder=1)
        drawn.append(line)
    solids = [(b.name, shape) for b in mechanism.bodies for shape in b.shapes]
    for name, shape in sorted(solids, key=lambda part: float(at[part[0]].point @ depth)):
        points = np.array([at[name].at(p) for p in _surface(shape)]) @ np.array([right, up]).T
        outline = _hull(points)
        ax.add_patch(Polygon(outline, facecolor=_FILL, edgecolor=_EDGE, linewidth=0.8, zorder=2))
        drawn.append(outline)
    for contact in mechanism.contacts:
        center = np.array([right, up]) @ at[contact.body].at(np.asarray(contact.point))
        drawn.append(center + contact.radius * np.array([[-1.0, -1.0], [1.0, 1.0]]))
        ax.add_patch(Circle(tuple(center), contact.radius, fill=False, edgecolor=_CONTACT, linewidth=0.6, zorder=3))
        ax.plot(*center, ".", color=_CONTACT, markersize=3, zorder=3)
    if mechanism.contacts:
        ax.axhline(0.0, color=_GROUND, linewidth=3, zorder=0)
        _shadow(ax, [np.array([at[name].at(p) for p in _surface(shape)]) for name, shape in solids])
    _frame(ax, np.concatenate(drawn))
    return figure


def _shadow(ax: Any, parts: list[Floats]) -> None:
    """What lies below points (n, 3) of each part on level ground, soft at its edges."""
    from matplotlib.patches import Polygon

    right, up, _ = _camera()
    below = [_hull((points * (1.0, 1.0, 0.0)) @ np.array([right, up]).T) for points in parts]
    for layer, (growth, color) in enumerate(_SHADOWS):
        for outline in below:
            middle = outline.mean(axis=0)
            spread = middle + growth * (outline - middle)
            ax.add_patch(Polygon(spread, facecolor=color, edgecolor="none", zorder=0.1 * (1 + layer)))


def _camera() -> tuple[Floats, Floats, Floats]:
    """Directions right, up, and towards the viewer."""
    a, e = _VIEW
    back = np.array([np.cos(e) * np.cos(a - np.pi / 2), np.cos(e) * np.sin(a - np.pi / 2), np.sin(e)])
    right = np.array([np.cos(a), np.sin(a), 0.0])
    return right, np.cross(back, right), back


def _bones(mechanism: Mechanism, at: Any) -> list[tuple[Floats, Floats]]:
    """Lines from the joint that carries a body to the joints that it carries, and if it has no shape to its contacts;
    to its centre of mass where there are neither.
    """
    out = []
    own = {j.child: at[j.child].at(np.asarray(j.child_point)) for j in mechanism.joints}
    for joint in mechanism.joints:
        if joint.parent == WORLD or joint.parent is None:
            continue
        point = at[joint.parent].at(np.asarray(joint.parent_point))
        out.append((own[joint.parent], point))
        out.append((point, own[joint.child]))
    bare = {b.name for b in mechanism.bodies if not b.shapes}
    ends = [(c.body, np.asarray(c.point)) for c in mechanism.contacts if c.body in bare]
    lonely = bare - {j.parent for j in mechanism.joints} - {name for name, _ in ends}
    ends += [(name, np.zeros(3)) for name in sorted(lonely)]
    return out + [(own[name], at[name].at(point)) for name, point in ends]


def _surface(shape: Solid) -> Floats:
    """Points whose hull is the shape, body axes (n, 3)."""
    return np.asarray(shape.outline() @ rotation_matrix(shape.orientation).T + np.asarray(shape.center))


def _hull(points: Floats) -> Floats:
    """Corners of the convex hull of points in the plane, in order."""
    from scipy.spatial import ConvexHull

    return np.asarray(points[ConvexHull(points).vertices])


def _frame(ax: Any, points: Floats) -> None:
    """Square limits around everything that was drawn."""
    low, high = points.min(axis=0), points.max(axis=0)
    half = 0.56 * max(float((high - low).max()), 1e-3)
    middle = 0.5 * (low + high)
    ax.set_xlim(middle[0] - half, middle[0] + half)
    ax.set_ylim(middle[1] - half, middle[1] + half)
    ax.set_aspect("equal")
    ax.axis("off")
