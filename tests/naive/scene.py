"""A mechanism as plain data, for the slow reference: bodies, joints, contacts, limits, inputs, gravity.

Joint i carries body i. With parent pose (x_a, q_a), translations t and relative rotation q_J the child is at
    q_b = q_a offset q_J,     x_b = x_a + R_a (parent_point + R_offset (trans_axes^T t)) - R_b child_point.
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
class Body:
    mass: float
    inertia: Array  # (3, 3) about the centre of mass, body axes


@dataclass(frozen=True)
class Joint:
    parent: int  # body index, -1 for the world
    trans_axes: Array = field(default_factory=lambda: np.zeros((0, 3)))  # free translations, joint frame
    nrot: int = 0  # 0, 1 (about axis) or 3
    axis: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    parent_point: Array = field(default_factory=lambda: ZERO)
    child_point: Array = field(default_factory=lambda: ZERO)
    offset: Array = field(default_factory=lambda: UNIT)
    spring: Array | float = 0.0  # per degree of freedom
    damper: Array | float = 0.0
    rest: Array | float = 0.0

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
class Contact:
    body: int
    point: Array = field(default_factory=lambda: ZERO)
    radius: float = 0.0
    friction: float = 0.5
    law: int = NONLINEAR
    frame: Array = field(default_factory=lambda: FLAT)
    height: float = 0.0


@dataclass(frozen=True)
class Limit:
    dof: int  # index into v, a scalar degree of freedom
    sign: float  # +1 lower bound, -1 upper bound
    bound: float


@dataclass(frozen=True)
class Input:
    kind: int  # JOINT: index is a degree of freedom; WORLD, BODY: index is a body
    index: int
    wrench: Array = field(default_factory=lambda: np.zeros(6))


@dataclass(frozen=True)
class Scene:
    bodies: Sequence[Body]
    joints: Sequence[Joint]
    contacts: Sequence[Contact] = ()
    limits: Sequence[Limit] = ()
    inputs: Sequence[Input] = ()
    gravity: Array = field(default_factory=lambda: np.array([0.0, 0.0, -9.81]))

    @property
    def nq(self) -> int:
        return sum(joint.nq for joint in self.joints)

    @property
    def nv(self) -> int:
        return sum(joint.nv for joint in self.joints)


def split(scene: Scene, q: Array) -> list[Array]:
    """Coordinates per joint."""
    return np.split(q, np.cumsum([joint.nq for joint in scene.joints])[:-1], axis=-1)


def poses(scene: Scene, q: Array) -> tuple[Array, Array]:
    """Positions (nbody, 3) and quaternions (nbody, 4) of the bodies at the joint coordinates q."""
    pos, quat = [], []
    for joint, qj in zip(scene.joints, split(scene, q), strict=True):
        xa, qa = (ZERO, UNIT) if joint.parent < 0 else (pos[joint.parent], quat[joint.parent])
        turned = UNIT
        if joint.nrot == 1:
            turned = rot.exp(joint.axis * qj[-1])
        elif joint.nrot == 3:
            turned = qj[-4:]
        frame = rot.mul(qa, joint.offset)
        qb = rot.mul(frame, turned)
        slide = joint.trans_axes.T @ qj[: joint.ntrans]
        xb = xa + rot.rotate(qa, joint.parent_point) + rot.rotate(frame, slide) - rot.rotate(qb, joint.child_point)
        pos.append(xb)
        quat.append(qb)
    return np.array(pos), np.array(quat)


def advance(scene: Scene, q: Array, v: Array, h: float) -> Array:
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


def from_model(model: Any) -> Scene:
    """The scene of a `sim.model.Model`."""
    bodies = [Body(float(m), J.reshape(3, 3)) for m, J in zip(model.body_mass, model.body_inertia, strict=True)]
    joints = []
    for i in range(len(bodies)):
        nt, dofs = int(model.joint_ntrans[i]), slice(model.body_vadr[i], model.body_vadr[i + 1])
        joints.append(
            Joint(
                int(model.body_parent[i]), model.joint_trans_axes[i].reshape(3, 3)[:nt], int(model.joint_nrot[i]),
                model.joint_axis[i], model.joint_parent_point[i], model.joint_child_point[i], model.joint_offset[i],
                model.dof_spring[dofs], model.dof_damper[dofs], model.dof_rest[dofs],
            )
        )  # fmt: skip
    contacts = [
        Contact(int(model.contact_body[c]), model.contact_point[c], float(model.contact_radius[c]),
                float(model.contact_friction[c]), int(model.contact_law[c]), model.contact_frame[c].reshape(3, 3),
                float(model.contact_height[c]))
        for c in range(len(model.contact_body))
    ]  # fmt: skip
    limits = [Limit(int(d), float(s), float(b))
              for d, s, b in zip(model.limit_dof, model.limit_sign, model.limit_bound, strict=True)]  # fmt: skip
    inputs = [Input(int(k), int(i), w)
              for k, i, w in zip(model.input_kind, model.input_index, model.input_wrench, strict=True)]  # fmt: skip
    return Scene(bodies, joints, contacts, limits, inputs, np.array(model.gravity))
