"""Delta robot: three arms with parallelograms that hold a platform level."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.models.links import from_z
from sim.mechanism.body import Body
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.pose import quaternion
from sim.mechanism.shapes import Box, Cylinder, rotation_matrix
from solvers.types import Floats


@checked_numbers("models")
def delta(
    *,
    base_radius: float = 0.2,
    platform_radius: float = 0.06,
    arm: float = 0.3,
    forearm: float = 0.7,
    gap: float = 0.1,
    angle: float = 0.3,
    arm_mass: float = 0.4,
    rod_mass: float = 0.05,
    platform_mass: float = 0.3,
    damper: float = 0.0,
    limits: tuple[float, float] | None = (-1.0, 1.3),
    height: float = 1.0,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Three motors under the ceiling turn the arms; two parallel rods per arm carry the platform.

        motor o---arm---o    z up    q  (19,) of arm 0 to 2: its angle from the horizontal, downwards [rad], and the
                       //                 swings of its two rods (2 each) [rad]; then the attitude of the platform to
        platform ====o//                  the first rod, a quaternion (4)
                                     u  (3,) torque of each motor [N m]; a positive torque lowers the arm

    Rods have universal joints at the arm and ball joints at the platform. Five of the latter close loops, which leave
    the platform its three translations.

    Args:
        base_radius: distance of the motors from the vertical axis of the robot [m].
        platform_radius: distance of the pairs of ball joints from the middle of the platform [m].
        arm: length of an arm [m].
        forearm: length of a rod [m].
        gap: distance between the two rods of an arm [m].
        angle: angle of the arms below the horizontal in the neutral state [rad].
        arm_mass: mass of one arm [kg].
        rod_mass: mass of one rod [kg].
        platform_mass: mass of the platform [kg].
        damper: damper of each motor [N m s/rad].
        limits: (lowest, highest) angle of each arm [rad]; None for no stops.
        height: height of the motors over the origin [m].
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state holds the platform level below the middle of the motors.

    Raises:
        ValueError: for an argument out of range, or arms and rods that do not reach the platform.
    """
    out = base_radius + arm * np.cos(angle) - platform_radius  # from the end of an arm to the platform
    if not abs(out) < forearm:
        raise ValueError(
            f"delta(forearm=...): expected more than {abs(out):.3g} m, from an arm to the platform, got {forearm}"
        )
    drop = float(np.sqrt(forearm**2 - out**2))
    bodies, joints, balls = [], [], []
    for k in range(3):
        yaw = 2.0 * np.pi * k / 3
        radial, tangent = (np.array([np.cos(a), np.sin(a), 0.0]) for a in (yaw, yaw + np.pi / 2))
        bodies.append(Body(f"arm_{k}", arm_mass, shape=Box(arm, 0.04, 0.04)))
        motor = _motor(k, yaw, base_radius * radial + np.array([0.0, 0.0, height]), arm)
        joints.append(replace(motor, damper=damper, limits=limits))
        lowered = np.array([[np.cos(angle), 0.0, np.sin(angle)], [0.0, 1.0, 0.0], [-np.sin(angle), 0.0, np.cos(angle)]])
        arm_axes = np.array([radial, tangent, [0.0, 0.0, 1.0]]).T @ lowered
        rod_axes = rotation_matrix(from_z((-out * radial - np.array([0.0, 0.0, drop])) / forearm))
        for side in (-0.5, 0.5):
            name = f"rod_{k}_{'l' if side < 0 else 'r'}"
            bodies.append(Body(name, rod_mass, shape=Cylinder(0.008, forearm)))
            corner = platform_radius * radial + side * gap * tangent
            pair = _rod_joints(f"arm_{k}", name, (arm / 2, side * gap, 0.0), corner, forearm, arm_axes, rod_axes)
            joints.append(pair[0])
            balls.append(pair[1])
    bodies.append(Body("platform", platform_mass, shape=Cylinder(platform_radius + gap / 2, 0.02)))
    return Mechanism(
        bodies,
        [*joints, balls[0], *(replace(ball, close=True) for ball in balls[1:])],
        inputs=[Input(f"motor_{k}") for k in range(3)],
        gravity=gravity,
        name="delta",
        neutral={f"motor_{k}": angle for k in range(3)},
    )


def _motor(k: int, yaw: float, place: Floats, arm: float) -> Joint:
    """The hinge of arm k, `arm` long [m], at a place of the world (3,) [m]; at zero the arm points along yaw [rad]."""
    frame = np.array([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)])
    inner = (-arm / 2, 0.0, 0.0)
    return Joint("revolute", None, f"arm_{k}", f"motor_{k}", place, inner, axis=(0.0, 1.0, 0.0), orientation=frame)


def _rod_joints(
    arm: str, rod: str, at: ArrayLike, corner: Floats, length: float, arm_axes: Floats, rod_axes: Floats
) -> tuple[Joint, Joint]:
    """The universal joint of a rod at its arm and the ball joint at the platform, which stands level.

    at, corner: (3,) where they are in arm and platform [m]; arm_axes, rod_axes: (3, 3) of the neutral state.
    """
    low, end = (0.0, 0.0, -length / 2), (0.0, 0.0, length / 2)
    universal = Joint("orbital", arm, rod, "", at, low, orientation=quaternion(arm_axes.T @ rod_axes))
    ball = Joint("spherical", rod, "platform", f"ball{rod[3:]}", end, corner, orientation=quaternion(rod_axes.T))
    return universal, ball
