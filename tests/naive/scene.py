"""A mechanism as plain data, for the slow reference: bodies, joints, contacts, limits, inputs, gravity.

Joint i carries body i. With parent pose (x_a, q_a), translations t and relative rotation q_J the child is at
    q_b = q_a offset q_J,     x_b = x_a + R_a (parent_point + R_offset (trans_axes^T t)) - R_b child_point.
Of a screw that turns by q, t is lead q axis instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from naive import rotation as rot
from naive.rotation import Array

ZERO = np.zeros(3)
UNIT = np.array([1.0, 0.0, 0.0, 0.0])
FLAT = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # normal z, tangents x and y
IMPACT, LINEAR, NONLINEAR = 0, 1, 2
JOINT, WORLD, BODY = 0, 1, 2


@dataclass(frozen=True)
class PlainBody:
    mass: float
    inertia: Array  # (3, 3) about the centre of mass, body axes


@dataclass(frozen=True)
class PlainJoint:
    parent: int  # body index, -1 for the world
    trans_axes: Array = field(default_factory=lambda: np.zeros((0, 3)))  # free translations, joint frame
    nrot: int = 0  # 0, 1 (about axis), 2 (rotation vector along swing_axes) or 3
    axis: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    parent_point: Array = field(default_factory=lambda: ZERO)
    child_point: Array = field(default_factory=lambda: ZERO)
    offset: Array = field(default_factory=lambda: UNIT)
    spring: Array | float = 0.0  # per degree of freedom
    damper: Array | float = 0.0
    rest: Array | float = 0.0
    armature: Array | float = 0.0  # inertia of a coordinate alone
    swing_axes: Array = field(default_factory=lambda: np.eye(3)[:2])
    lead: float = 0.0  # of a screw: along the axis per radian about it

    @property
    def ntrans(self) -> int:
        return len(self.trans_axes)

    @property
    def nv(self) -> int:
        return self.ntrans + self.nrot

    @property
    def nq(self) -> int:
        return self.ntrans + (4 if self.nrot == 3 else self.nrot)


@dataclass(frozen=True)
class PlainContact:
    body: int
    point: Array = field(default_factory=lambda: ZERO)
    radius: float = 0.0
    friction: float = 0.5
    law: int = NONLINEAR
    frame: Array = field(default_factory=lambda: FLAT)
    height: float = 0.0


@dataclass(frozen=True)
class Limit:
    dof: int  # index into v, a scalar degree of freedom; of a cone, the first of three rotations
    sign: float  # +1 lower bound, -1 upper bound, 0 cone
    bound: float


@dataclass(frozen=True)
class PlainInput:
    kind: int  # JOINT: index is a degree of freedom; WORLD, BODY: index is a body
    index: int
    wrench: Array = field(default_factory=lambda: np.zeros(6))


@dataclass(frozen=True)
class PlainScene:
    bodies: Sequence[PlainBody]
    joints: Sequence[PlainJoint]
    contacts: Sequence[PlainContact] = ()
    limits: Sequence[Limit] = ()
    inputs: Sequence[PlainInput] = ()
    gravity: Array = field(default_factory=lambda: np.array([0.0, 0.0, -9.81]))

    @property
    def nq(self) -> int:
        return sum(joint.nq for joint in self.joints)

    @property
    def nv(self) -> int:
        return sum(joint.nv for joint in self.joints)


def split(scene: PlainScene, q: Array) -> list[Array]:
    """Coordinates per joint."""
    return np.split(q, np.cumsum([joint.nq for joint in scene.joints])[:-1], axis=-1)


def poses(scene: PlainScene, q: Array) -> tuple[Array, Array]:
    """Positions (nbody, 3) and quaternions (nbody, 4) of the bodies at the joint coordinates q."""
    pos, quat = [], []
    for joint, qj in zip(scene.joints, split(scene, q), strict=True):
        xa, qa = (ZERO, UNIT) if joint.parent < 0 else (pos[joint.parent], quat[joint.parent])
        turned = UNIT
        if joint.nrot == 1:
            turned = rot.exp(joint.axis * qj[-1])
        elif joint.nrot == 2:
            turned = rot.exp(joint.swing_axes.T @ qj[-2:])
        elif joint.nrot == 3:
            turned = qj[-4:]
        frame = rot.mul(qa, joint.offset)
        qb = rot.mul(frame, turned)
        slide = joint.trans_axes.T @ qj[: joint.ntrans]
        if joint.lead:
            slide = joint.lead * qj[-1] * joint.axis
        xb = xa + rot.rotate(qa, joint.parent_point) + rot.rotate(frame, slide) - rot.rotate(qb, joint.child_point)
        pos.append(xb)
        quat.append(qb)
    return np.array(pos), np.array(quat)


def advance(scene: PlainScene, q: Array, v: Array, h: float) -> Array:
    """q (+) h v, joint by joint; quaternions by the exponential map on the right."""
    out, start = [], 0
    for joint, qj in zip(scene.joints, split(scene, q), strict=True):
        vj = v[start : start + joint.nv]
        start += joint.nv
        if joint.nrot == 3:
            out += [qj[:-4] + h * vj[:-3], rot.mul(qj[-4:], rot.exp(h * vj[-3:]))]
        else:
            out.append(qj + h * vj)
    return np.concatenate(out)


def translation_axes(joint: Any) -> Array:
    """Free translations in the joint frame: along the axis, across it (x, y, z without the nearest), or all."""
    if joint.ntrans != 2:
        return np.array([joint.axis]) if joint.ntrans == 1 else np.eye(3)[: joint.ntrans]
    return plane_axes(np.asarray(joint.axis))


def plane_axes(axis: Array) -> Array:
    """Two directions across an axis: x, y, z without the nearest."""
    rows: list[Array] = []
    for e in np.delete(np.eye(3), np.argmax(np.abs(axis)), axis=0):
        across = e - axis * (axis @ e) - sum((row * (row @ e) for row in rows), np.zeros(3))
        rows.append(across / np.linalg.norm(across))
    return np.array(rows)


def contact_frame(normal: Any) -> Array:
    """Normal, a tangent along x (along y for a normal near x), and normal cross tangent."""
    n = np.asarray(normal)
    along = np.eye(3)[0 if abs(n[0]) < 0.9 else 1]
    t = along - n * (n @ along)
    t /= np.linalg.norm(t)
    return np.array([n, t, rot.cross(n, t)])


def from_mechanism(mech: Any) -> PlainScene:
    """The scene of a `dojo_opt.Mechanism`, from the attributes of its parts."""
    names = [body.name for body in mech.bodies]
    bodies = [PlainBody(body.mass, np.array(body.inertia)) for body in mech.bodies]
    joints, limits, dof = [], [], {}
    for j in mech.joints:
        parent = names.index(j.parent) if j.parent in names else -1
        dof[j.name] = sum(other.nv for other in joints)
        points = (np.array(j.parent_point), np.array(j.child_point), np.array(j.orientation))
        joints.append(
            PlainJoint(
                parent,
                translation_axes(j),
                j.nrot,
                np.array(j.axis),
                *points,
                *(np.array(value) for value in (j.spring, j.damper, j.rest, j.armature)),
                plane_axes(np.array(j.axis)),
                j.pitch / (2.0 * np.pi),
            )
        )
        if j.cone is not None:
            limits.append(Limit(dof[j.name] + j.ntrans, 0.0, j.cone))
        for k, bounds in enumerate(j.limits):
            limits += [Limit(dof[j.name] + k, s, b) for s, b in zip((1.0, -1.0), bounds, strict=True) if np.isfinite(b)]
    laws = {"impact": IMPACT, "linear": LINEAR, "nonlinear": NONLINEAR}
    contacts = [
        PlainContact(
            names.index(c.body), np.array(c.point), c.radius, c.friction, laws[c.law], contact_frame(c.normal), c.height
        )
        for c in mech.contacts
    ]
    inputs = []
    for part in mech.inputs:
        if part.joint is not None:
            inputs.append(PlainInput(JOINT, dof[part.joint] + part.dof))
        else:
            wrench = np.concatenate((part.force, part.torque))
            inputs.append(PlainInput(WORLD if part.frame == "world" else BODY, names.index(part.body), wrench))
    return PlainScene(bodies, joints, contacts, limits, inputs, np.array(mech.gravity))
