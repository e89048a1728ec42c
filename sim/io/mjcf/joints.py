"""The joints of an MJCF body, which act one after the other, as joints of the mechanism.

Translations followed by at most one hinge or ball are one joint where a kind with these coordinates exists. All others
are a chain: a body without mass between one joint and the next. That is exact: the configurations are the same, and
massless bodies do not appear in the discrete Lagrangian; and as in MuJoCo, two hinges whose axes have become parallel
make the step singular unless they have an armature.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from sim.io.mjcf.welded_bodies import GeomGroup, name_of
from sim.io.urdf.report import Notes
from sim.mechanism.axes import translation_axes
from sim.mechanism.body import Body
from sim.mechanism.joint import KINDS, WORLD, Joint
from sim.mechanism.pose import HERE, Pose, turn
from solvers.types import Floats

FREE, BALL, SLIDE, HINGE = range(4)  # mjtJoint
_CLOSE = 1e-9
_NARROWEST = 0.499  # share of a range that its margin leaves free at each end, at most


class Carried(NamedTuple):
    """The link of a group to its parent: massless bodies, joints, and the place of each joint of the file in them."""

    bodies: list[Body]
    joints: list[Joint]
    homes: dict[int, tuple[str, int]]  # joint of the file: joint of the mechanism, first degree of freedom


def carry(model: Any, group: GeomGroup, merge: bool, notes: Notes) -> Carried:
    """The joints of one group, from the parent to it."""
    start = int(model.body_jntadr[group.body])
    ids = list(range(start, start + int(model.body_jntnum[group.body])))
    runs = _runs(model, ids) if merge else [[j] for j in ids]
    bodies, joints, homes = [], [], {}
    parent = group.parent.name if group.parent else WORLD
    frame = Pose(group.pose.rotation, group.pose.point - (group.parent.com if group.parent else 0.0))
    for k, run in enumerate(runs):
        last = k == len(runs) - 1
        child = group.name if last else f"{group.name}.{name_of(model, 'joint', run[-1])}"
        joint = _joint(model, run, parent, child, frame, group.com if last else np.zeros(3), notes)
        for n, j in enumerate(run):
            homes[j] = (joint.name, n)
        joints.append(joint)
        if not last:
            bodies.append(Body(child, 0.0))
            parent, frame = child, HERE
    return Carried(bodies, joints, homes)


def _runs(model: Any, ids: list[int]) -> list[list[int]]:
    """Joints in a row that one joint of the mechanism can stand for."""
    out: list[list[int]] = []
    for j in ids:
        if out and _kind(model, [*out[-1], j]):
            out[-1].append(j)
        else:
            out.append([j])
    return out


def _kind(model: Any, run: list[int]) -> str | None:
    """The kind of joint with the coordinates of these, or None: translations along its axes, then a rotation."""
    types = [int(model.jnt_type[j]) for j in run]
    if types == [FREE]:
        return "floating"
    ntrans = sum(t == SLIDE for t in types)
    rotations = types[ntrans:]
    if SLIDE in rotations or len(rotations) > 1:
        return None
    nrot = {HINGE: 1, BALL: 3}[rotations[0]] if rotations else 0
    others = {name: free for name, free in KINDS.items() if name != "screw"}  # which turns as a hinge does
    kind = next((name for name, free in others.items() if free == (ntrans, nrot)), None)
    if ntrans and kind:
        slides = np.array([model.jnt_axis[j] for j in run[:ntrans]])
        axes = translation_axes(ntrans, _axis(model, run))[:ntrans]
        if not np.allclose(axes, slides, atol=_CLOSE):
            return None
    return kind


def _axis(model: Any, run: list[int]) -> Floats:
    """Axis of the joint for a run: of its hinge, else that of its slide or across its two slides."""
    last = run[-1]
    if model.jnt_type[last] == HINGE or len(run) == 1 and model.jnt_type[last] == SLIDE:
        return np.array(model.jnt_axis[last])
    slides = [np.array(model.jnt_axis[j]) for j in run if model.jnt_type[j] == SLIDE]
    if len(slides) == 1:
        return slides[0]
    across = np.cross(slides[0], slides[1]) if len(slides) == 2 else np.array([0.0, 0.0, 1.0])
    return across if np.linalg.norm(across) > _CLOSE else np.array([0.0, 0.0, 1.0])


def _joint(model: Any, run: list[int], parent: str, child: str, frame: Pose, com: Floats, notes: Notes) -> Joint:
    """One joint; frame: of the body's frame, at zero displacement, in the parent from its centre of mass."""
    kind = _kind(model, run)
    assert kind is not None
    name = child if len(run) > 1 else name_of(model, "joint", run[0])
    if kind == "floating":
        j = run[0]
        armature = _dofs(model, "dof_armature", j, 6)
        if model.jnt_stiffness[j]:
            notes.add("springs of free joints are omitted", [name_of(model, "joint", j)], warn=True)
        if armature[3:].any():
            text = "armature of the rotations of free joints is omitted"
            notes.add(text, [name_of(model, "joint", j)], warn=True)
            armature[3:] = 0.0
        damper = _dofs(model, "dof_damping", j, 6)
        return Joint(kind, parent, child, name, child_point=-com, damper=damper, armature=armature)
    last = run[-1]
    slides = [j for j in run if model.jnt_type[j] == SLIDE]
    anchor = np.array(model.jnt_pos[last]) if model.jnt_type[last] != SLIDE else np.zeros(3)
    start = anchor - sum((model.qpos0[model.jnt_qposadr[j]] * model.jnt_axis[j] for j in slides), np.zeros(3))
    rotation = frame.rotation
    if model.jnt_type[last] == HINGE:
        rotation = rotation @ turn(model.jnt_axis[last], -float(model.qpos0[model.jnt_qposadr[last]]))
    widths = [3 if model.jnt_type[j] == BALL else 1 for j in run]
    scalar = [j for j in run if model.jnt_type[j] != BALL]
    springs = [float(model.jnt_stiffness[j]) for j in scalar]
    rests = [float(model.qpos_spring[model.jnt_qposadr[j]]) for j in scalar]
    armature = np.concatenate([_dofs(model, "dof_armature", j, n) for j, n in zip(run, widths, strict=True)])
    pad = [0.0] * (3 if model.jnt_type[last] == BALL else 0)
    if pad:
        _ball_notes(model, last, armature[-3:], notes)
        armature[-3:] = 0.0
    bounds = [range_of(model, j) if model.jnt_limited[j] else None for j in scalar]
    return Joint(
        kind,
        parent,
        child,
        name,
        parent_point=frame.at(start),
        child_point=anchor - com,
        axis=_axis(model, run),
        orientation=Pose(rotation, start).quaternion,
        spring=springs + pad,
        damper=np.concatenate([_dofs(model, "dof_damping", j, n) for j, n in zip(run, widths, strict=True)]),
        rest=rests + pad,
        armature=armature,
        limits=[*bounds, *(None for _ in pad)] if any(bounds) else None,
    )


def range_of(model: Any, j: int) -> tuple[float, float]:
    """Range of a hinge or slide within its margin, from which on MuJoCo's limit pushes."""
    low, high = (float(x) for x in model.jnt_range[j])
    margin = min(float(model.jnt_margin[j]), _NARROWEST * (high - low))
    return low + margin, high - margin


def _dofs(model: Any, field: str, j: int, count: int) -> Floats:
    """Values of the degrees of freedom of a joint."""
    start = int(model.jnt_dofadr[j])
    return np.array(getattr(model, field)[start : start + count], dtype=np.float64)


def _ball_notes(model: Any, j: int, armature: Floats, notes: Notes) -> None:
    """Notes on the unsupported attributes of a ball joint."""
    name = [name_of(model, "joint", j)]
    if model.jnt_limited[j]:
        notes.add(
            "ranges of ball joints are omitted (a cone= of the joint limits the swing of its axis)", name, warn=True
        )
    if model.jnt_stiffness[j] > 0.0:
        notes.add("springs of ball joints are omitted", name, warn=True)
    if armature.any():
        notes.add("armature of ball joints is omitted", name, warn=True)
