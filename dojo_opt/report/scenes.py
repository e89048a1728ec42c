"""The scenes of the timing report: mechanisms with a start and inputs that keep them where the clock should run."""

from __future__ import annotations

import numpy as np

from sim.mechanism import Mechanism
from sim.model import Vector
from sim.parts import Body, Contact, Joint
from sim.shapes import Box

THIGH, CALF = 0.8, -1.6  # [rad] joint angles that put each foot below its hip
LINK = 0.2  # [m] thigh and calf
FOOT = 0.02  # [m]
GRAVITY = 9.81
TRUNK, HIP, UPPER, LOWER = 6.0, 0.7, 1.0, 0.2  # [kg]
HIP_X, HIP_Y, ABDUCTION = 0.18, 0.05, 0.085  # [m]
UPPER_COM, LOWER_COM = 0.03, 0.1  # [m] from the joint above
STIFFNESS, DAMPING = 80.0, 4.0  # [N m/rad, N m s/rad] the joints are held by springs, so that standing is stable
LEGS = {"front_left": (1, 1), "front_right": (1, -1), "rear_left": (-1, 1), "rear_right": (-1, -1)}


def quadruped() -> Mechanism:
    """Trunk, and four legs of hip, thigh and calf: 13 bodies, 18 degrees of freedom, 4 feet; numbers near an A1."""
    bodies = [Body("trunk", TRUNK, shape=Box(x=0.36, y=0.2, z=0.11))]
    joints = [Joint("floating", None, "trunk")]
    contacts = []
    held = {"spring": STIFFNESS, "damper": DAMPING}
    for leg, (front, left) in LEGS.items():
        hip, thigh, calf = f"{leg}_hip", f"{leg}_thigh", f"{leg}_calf"
        bodies += [Body(hip, HIP, (5e-4, 8e-4, 6e-4)), Body(thigh, UPPER, (5.5e-3, 5.1e-3, 1.4e-3))]
        bodies.append(Body(calf, LOWER, (1.6e-3, 1.6e-3, 5e-5)))
        at = (front * HIP_X, left * HIP_Y, 0.0)
        joints.append(Joint("revolute", "trunk", hip, axis=(1, 0, 0), parent_point=at, rest=0.0, **held))
        at, top = (0.0, left * ABDUCTION, 0.0), (0.0, 0.0, UPPER_COM)
        joints.append(
            Joint("revolute", hip, thigh, axis=(0, 1, 0), parent_point=at, child_point=top, rest=THIGH, **held)
        )
        at, top = (0.0, 0.0, UPPER_COM - LINK), (0.0, 0.0, LOWER_COM)
        joints.append(
            Joint("revolute", thigh, calf, axis=(0, 1, 0), parent_point=at, child_point=top, rest=CALF, **held)
        )
        contacts.append(Contact(calf, point=(0.0, 0.0, LOWER_COM - LINK), radius=FOOT, friction=0.8, name=leg))
    return Mechanism(bodies, joints, contacts, name="quadruped")


def quadruped_standing() -> tuple[Vector, Vector]:
    """State (37,) and joint torques (12,) [N m] of the quadruped at rest on its four feet.

    Each torque balances the moment about its axis of the foot force and of the weights beyond the joint.
    """
    q = np.zeros(19)
    q[2] = FOOT + LINK * (np.cos(THIGH) + np.cos(THIGH + CALF))
    q[3] = 1.0
    q[7:] = np.tile([0.0, THIGH, CALF], 4)

    foot_force = GRAVITY * (TRUNK / 4 + HIP + UPPER + LOWER)
    upper, knee = -UPPER_COM * np.sin(THIGH), -LINK * np.sin(THIGH)  # x from the hip
    lower = knee - LOWER_COM * np.sin(THIGH + CALF)
    foot = knee - LINK * np.sin(THIGH + CALF)
    calf = (foot - knee) * foot_force - (lower - knee) * LOWER * GRAVITY
    thigh = foot * foot_force - (lower * LOWER + upper * UPPER) * GRAVITY
    hip = -ABDUCTION * (foot_force - (UPPER + LOWER) * GRAVITY)
    torques = np.concatenate([[left * hip, thigh, calf] for _, left in LEGS.values()])
    return np.concatenate([q, np.zeros(18)]), torques
