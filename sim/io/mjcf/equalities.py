"""The equality constraints of an MJCF file: <connect> and <weld> as joints that close loops, <joint> as a gear.

    connect   a point of body 1 stays on a point of body 2: a spherical joint
    weld      the pose of body 2 in body 1 stays: a fixed joint
    joint     a coordinate is a linear function of another one

Others (of tendons and flexes, curved functions, a coordinate that is held) are omitted, with a warning that names
them. MuJoCo's are soft, those of the mechanism are not.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sim.io.mjcf.welded_bodies import GeomGroup, Where, name_of, pose_of
from sim.io.urdf.report import Notes
from sim.mechanism.gear import Gear
from sim.mechanism.joint import WORLD, Joint
from sim.mechanism.pose import HERE, Pose

CONNECT, WELD, JOINT = 0, 1, 2  # mjtEq
_OTHERS = {3: "tendon", 4: "flex", 5: "flexvert", 6: "flexstrain"}
_SITE = 6  # mjtObj


def find_loops(model: Any, where: Where, notes: Notes) -> list[Joint]:
    """The joints that close loops; unsupported ones go into the notes."""
    out = []
    for k in range(model.neq):
        name, kind = name_of(model, "equality", k), int(model.eq_type[k])
        if kind == JOINT:
            continue
        if not model.eq_active0[k]:
            notes.add("equality constraints that the file switches off are omitted", [name])
            continue
        if kind not in (CONNECT, WELD):
            label = _OTHERS.get(kind, f"type {kind}")
            text = "equality constraints other than connect, weld and joint are omitted"
            notes.add(text, [f"{name} ({label})"], warn=True)
            continue
        first, second = _ends(model, k, kind, where)
        if first[0] is second[0]:
            notes.add("equality constraints inside of one body, which hold by themselves", [name])
            continue
        notes.add("equality constraints are rigid here", [name])
        out.append(_joint(name, kind, *((first, second) if second[0] else (second, first))))
    return out


def find_gears(model: Any, homes: dict[int, tuple[str, int]], notes: Notes) -> list[Gear]:
    """The gears: q1 - q1_0 = a0 + a1 (q2 - q2_0), q_0 of the reference configuration."""
    out = []
    for k in np.flatnonzero(np.asarray(model.eq_type) == JOINT):
        name, poly = name_of(model, "equality", int(k)), np.array(model.eq_data[k, :5], dtype=np.float64)
        first, second = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        if not model.eq_active0[k]:
            notes.add("equality constraints that the file switches off are omitted", [name])
        elif second < 0 or poly[2:].any():
            notes.add("equality constraints that hold one joint, or are not linear, are omitted", [name], warn=True)
        else:
            start, other = (float(model.qpos0[model.jnt_qposadr[j]]) for j in (first, second))
            (joint, dof), (leader, leading) = homes[first], homes[second]
            offset = start + float(poly[0]) - float(poly[1]) * other
            notes.add("equality constraints are rigid here", [name])
            out.append(Gear(joint, leader, float(poly[1]), offset, dof=dof, other_dof=leading, name=name))
    return out


def _ends(
    model: Any, k: int, kind: int, where: Where
) -> tuple[tuple[GeomGroup | None, Pose], tuple[GeomGroup | None, Pose]]:
    """The groups (None: the world) of both bodies, and the frames in them that stay on each other."""
    ends, data = [], np.array(model.eq_data[k], dtype=np.float64)
    frames = [HERE, HERE]
    if int(model.eq_objtype[k]) != _SITE:
        points = (data[:3], data[3:6]) if kind == CONNECT else (data[3:6], data[:3])
        frames = [Pose(np.eye(3), point) for point in points]
        if kind == WELD:
            frames[0] = pose_of(points[0], data[6:10])
    for index, frame in zip((int(model.eq_obj1id[k]), int(model.eq_obj2id[k])), frames, strict=True):
        body, at = index, frame
        if int(model.eq_objtype[k]) == _SITE:
            body = int(model.site_bodyid[index])
            at = pose_of(model.site_pos[index], model.site_quat[index])
        group, pose = where[body]
        ends.append((group, pose.then(at)))
    return ends[0], ends[1]


def _joint(name: str, kind: int, first: tuple[GeomGroup | None, Pose], second: tuple[GeomGroup | None, Pose]) -> Joint:
    """The closing joint with its frame in the first group; the second is not the world."""
    (parent, frame), (child, other) = first, second
    assert child is not None
    return Joint(
        "spherical" if kind == CONNECT else "fixed",
        parent.name if parent else WORLD,
        child.name,
        name,
        parent_point=frame.point - (parent.com if parent else 0.0),
        child_point=other.point - child.com,
        orientation=Pose(frame.rotation @ other.rotation.T, frame.point).quaternion,
        close=True,
    )
