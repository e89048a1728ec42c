"""Overlays of a page on a motion: bars for contact forces, and the paths of the base and of the ends of limbs."""

from __future__ import annotations

from typing import Any

import numpy as np

from dojo_opt.viewer import drawing
from dojo_opt.viewer.key_frames import FRAMES, sparse
from dojo_opt.viewer.motion import Motion

_BARS = 64  # forces at most, of the contacts that carry most
_LEAST = 0.01  # of the weight: smaller forces are not drawn
_THICK = 0.012  # radius of a bar over the size of the robot
_NONE = 1e-6  # scale of a bar without a force: MeshCat's scenes have no empty ones
_POINTS = 400  # of a path at most
_LIMBS = 12  # paths at most
_RED, _BLUE = (0.85, 0.2, 0.15), 0x2B6CB0


def forces(m: Motion, group: tuple[str, ...], end: float) -> tuple[list[Any], dict[Any, Any]]:
    """Bars from the points where contacts press, as long as the robot for its weight.

    Args:
        m: the motion.
        group: where in MeshCat's scene it is.
        end: time of the end of the page [s].

    Returns:
        (commands that draw the bars, their clips by node).
    """
    from meshcat import geometry
    from meshcat.animation import AnimationClip
    from meshcat.commands import SetObject, SetTransform
    from meshcat.path import Path as Node

    weight = sum(body.mass for body in m.mechanism.bodies) * float(np.linalg.norm(np.asarray(m.mechanism.gravity)))
    if not len(m.contact_time) or not m.force.shape[1] or weight <= 0.0:
        return [], {}
    size = 2.0 * m.radius
    strength = np.linalg.norm(m.force, axis=2) / weight
    strength[~np.isfinite(strength)] = 0.0
    most = strength.max(axis=0)
    chosen = [int(k) for k in np.argsort(-most)[:_BARS] if most[k] > _LEAST]
    # a cylinder of MeshCat stands along y; the node of a bar turns and stretches one along z, from its lower end
    upright = drawing.matrix((0.0, 0.0, 0.5), (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0))
    commands, clips = [], {}
    every = sparse(m.contact_time)
    for k in chosen:
        node = Node((*group, "forces", str(k)))
        bar = geometry.Cylinder(1.0, _THICK * size)
        commands.append(SetObject(bar, drawing.material(_RED), node.append("bar")))
        commands.append(SetTransform(upright, node.append("bar")))
        clip = AnimationClip(fps=FRAMES)
        for row in range(0, len(m.contact_time), every):
            frame, long = float(m.contact_time[row] * FRAMES), strength[row, k]
            drawn = long > _LEAST
            along = m.force[row, k] / (long * weight) if drawn else np.array([0.0, 0.0, 1.0])
            scale = [1.0, 1.0, float(size * long)] if drawn else [_NONE] * 3
            point = np.nan_to_num(m.point[row, k])
            clip.set_property(frame, "position", "vector3", point.tolist())
            clip.set_property(frame, "quaternion", "quaternion", np.roll(drawing.from_z(along), -1).tolist())
            clip.set_property(frame, "scale", "vector3", scale)
        if end * FRAMES > frame:
            clip.set_property(end * FRAMES, "scale", "vector3", scale)
        clips[node] = clip
    return commands, clips


def paths(m: Motion, group: tuple[str, ...]) -> list[Any]:
    """Commands that draw the paths of the base and of the ends of limbs: of their contacts, or centres of mass.

    Args:
        m: the motion.
        group: where in MeshCat's scene it is.

    Returns:
        The commands.
    """
    from meshcat import geometry
    from meshcat.commands import SetObject
    from meshcat.path import Path as Node

    mech = m.mechanism
    parents = {joint.parent for joint in mech.joints}
    first = [k for k, body in enumerate(mech.bodies) if body.name == mech.joints[0].child]
    ends = [k for k, body in enumerate(mech.bodies) if body.name not in parents and k not in first]
    count = min(_POINTS, 1 + len(m.time) // sparse(m.time))
    rows = np.unique(np.linspace(0, len(m.time) - 1, count).astype(int))
    commands = []
    for k in [*first, *ends[:_LIMBS]]:
        own = [np.asarray(c.point, dtype=np.float64) for c in mech.contacts if c.body == mech.bodies[k].name]
        point = np.mean(own, axis=0) if own and k not in first else np.zeros(3)
        line = m.points(k, point)[rows].T.astype(np.float32)
        ink = geometry.LineBasicMaterial(color=_BLUE)
        pairs = np.repeat(line, 2, axis=1)[:, 1:-1]  # in pieces: renderers drop lines that begin behind the camera
        commands.append(
            SetObject(geometry.LineSegments(geometry.PointsGeometry(pairs), ink), path=Node((*group, "paths", str(k))))
        )
    return commands
