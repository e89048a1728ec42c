"""Mechanisms for the slow reference: free body, pendulums, a chain with a ball joint, hopper, 13-body tree."""

from __future__ import annotations

import numpy as np

from naive import rotation as rot
from naive.scene import JOINT, NONLINEAR, Limit, PlainBody, PlainContact, PlainInput, PlainJoint, PlainScene

X, Y, Z = np.eye(3)
FLOATING = {"trans_axes": np.eye(3), "nrot": 3}


def box(mass: float, x: float, y: float, z: float) -> PlainBody:
    """Solid box with sides x, y, z."""
    return PlainBody(mass, mass / 12.0 * np.diag([y * y + z * z, x * x + z * z, x * x + y * y]))


def free_body() -> PlainScene:
    """Inertia .1, .2, .3 with one product, no gravity."""
    inertia = np.array([[0.1, 0.01, 0.0], [0.01, 0.2, 0.0], [0.0, 0.0, 0.25]])
    return PlainScene([PlainBody(1.3, inertia)], [PlainJoint(-1, **FLOATING)], gravity=np.zeros(3))


def pendulum(links: int = 1, **joint: float) -> PlainScene:
    """Rods of 1 m and 1 kg, turning about x."""
    ends = {"nrot": 1, "axis": X, "child_point": 0.5 * Z}
    joints = [PlainJoint(i - 1, parent_point=-0.5 * Z if i else 0.0 * Z, **ends, **joint) for i in range(links)]
    return PlainScene([box(1.0, 0.1, 0.1, 1.0)] * links, joints, inputs=[PlainInput(JOINT, i) for i in range(links)])


def spherical_chain() -> PlainScene:
    """Four links: revolute, spherical with spring and damper, prismatic, revolute."""
    offset = rot.exp(np.array([0.3, -0.2, 0.5]))
    ends = {"parent_point": np.array([0.05, 0.0, -0.4]), "child_point": 0.4 * Z}
    rest = np.array([0.2, -0.1, 0.3])
    joints = [
        PlainJoint(-1, nrot=1, axis=X, child_point=0.4 * Z),
        PlainJoint(0, nrot=3, offset=offset, spring=6.0, damper=0.3, rest=rest, **ends),
        PlainJoint(1, trans_axes=Y[None], spring=40.0, damper=0.5, rest=0.1, **ends),
        PlainJoint(2, nrot=1, axis=np.array([0.0, 0.6, 0.8]), offset=offset, damper=0.2, **ends),
    ]
    inputs = [PlainInput(JOINT, i) for i in range(6)]
    return PlainScene([box(1.0 + 0.3 * i, 0.1, 0.2, 0.8) for i in range(4)], joints, inputs=inputs)


def hopper(law: int = NONLINEAR) -> PlainScene:
    """Body of 4.18 kg on a leg that slides along z, spring, damper and limits in the leg."""
    ball = [PlainBody(4.18, 4.18 * 0.004 * np.eye(3)), PlainBody(0.52, 0.52 * 0.001 * np.eye(3))]
    leg = PlainJoint(0, trans_axes=-Z[None], spring=200.0, damper=0.1, rest=0.5)
    contacts = [PlainContact(1, radius=0.05, friction=0.5, law=law), PlainContact(0, radius=0.1, friction=0.5, law=law)]
    limits = [Limit(6, 1.0, 0.2), Limit(6, -1.0, 0.6)]
    inputs = [PlainInput(JOINT, 6), PlainInput(JOINT, 3), PlainInput(JOINT, 4)]
    return PlainScene(ball, [PlainJoint(-1, **FLOATING), leg], contacts, limits, inputs)


def quadruped(law: int = NONLINEAR, friction: float = 0.8) -> PlainScene:
    """Trunk and four legs of three links: 13 bodies, 18 degrees of freedom, 24 limits, 4 feet."""
    bodies, joints = [box(6.0, 0.36, 0.2, 0.1)], [PlainJoint(-1, **FLOATING)]
    contacts, limits = [], []
    bounds = ((-0.6, 0.6), (-0.6, 1.6), (-2.6, -0.6))
    for leg, (sx, sy) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
        first = len(bodies)
        bodies += [box(0.7, 0.08, 0.08, 0.08), box(1.0, 0.05, 0.05, 0.2), box(0.17, 0.03, 0.03, 0.2)]
        soft = {"nrot": 1, "spring": 3.0, "damper": 0.1}
        joints += [
            PlainJoint(0, axis=X, parent_point=np.array([0.18 * sx, 0.05 * sy, 0.0]), **soft),
            PlainJoint(first, axis=Y, parent_point=0.08 * sy * Y, child_point=0.1 * Z, rest=0.8, **soft),
            PlainJoint(first + 1, axis=Y, parent_point=-0.1 * Z, child_point=0.1 * Z, rest=-1.5, **soft),
        ]
        contacts.append(PlainContact(first + 2, point=-0.1 * Z, radius=0.02, friction=friction, law=law))
        for k, (low, high) in enumerate(bounds):
            limits += [Limit(6 + 3 * leg + k, 1.0, low), Limit(6 + 3 * leg + k, -1.0, high)]
    return PlainScene(bodies, joints, contacts, limits, [PlainInput(JOINT, 6 + i) for i in range(12)])
