"""Delta robot: three arms with parallelograms that hold a platform level."""

from __future__ import annotations

from dataclasses import dataclass, replace

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

_SIDES = (-0.5, 0.5)  # of the two rods of an arm, in units of the gap between them


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
    bodies, joints, balls = [], [], []
    for limb in (_Arm(k, arm, angle, forearm, out) for k in range(3)):
        bodies += limb.links(arm_mass, rod_mass)
        pairs = [limb.rod_joints(side * gap, platform_radius) for side in _SIDES]
        joints += [replace(limb.motor(base_radius, height), damper=damper, limits=limits), *(pair[0] for pair in pairs)]
        balls += [pair[1] for pair in pairs]
    bodies.append(Body("platform", platform_mass, shape=Cylinder(platform_radius + gap / 2, 0.02)))
    return Mechanism(
        bodies,
        [*joints, balls[0], *(replace(ball, close=True) for ball in balls[1:])],
        inputs=[Input(f"motor_{k}") for k in range(3)],
        gravity=gravity,
        name="delta",
        neutral={f"motor_{k}": angle for k in range(3)},
    )


@dataclass(frozen=True)
class _Arm:
    """One of the three arms with its two rods, in the neutral state."""

    number: int
    length: float  # of the arm [m]
    angle: float  # below the horizontal [rad]
    forearm: float  # length of a rod [m]
    out: float  # from the end of the arm to the platform, inwards [m]

    @property
    def yaw(self) -> float:
        """Its direction [rad]."""
        return 2.0 * np.pi * self.number / 3

    @property
    def radial(self) -> Floats:
        """(3,) outwards."""
        return np.array([np.cos(self.yaw), np.sin(self.yaw), 0.0])

    @property
    def tangent(self) -> Floats:
        """(3,) across, level."""
        across = self.yaw + np.pi / 2
        return np.array([np.cos(across), np.sin(across), 0.0])

    @property
    def axes(self) -> Floats:
        """(3, 3) of the arm."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        lowered = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
        return np.asarray(np.array([self.radial, self.tangent, [0.0, 0.0, 1.0]]).T @ lowered)

    @property
    def rod_axes(self) -> Floats:
        """(3, 3) of both rods."""
        drop = float(np.sqrt(self.forearm**2 - self.out**2))
        return rotation_matrix(from_z((-self.out * self.radial - np.array([0.0, 0.0, drop])) / self.forearm))

    def _rod(self, side: float) -> str:
        return f"rod_{self.number}_{'l' if side < 0 else 'r'}"

    def links(self, arm_mass: float, rod_mass: float) -> list[Body]:
        """The arm and its rods, of these masses [kg]."""
        rods = [Body(self._rod(side), rod_mass, shape=Cylinder(0.008, self.forearm)) for side in _SIDES]
        return [Body(f"arm_{self.number}", arm_mass, shape=Box(self.length, 0.04, 0.04)), *rods]

    def motor(self, radius: float, height: float) -> Joint:
        """Its hinge, so far from the axis and so high [m]; at zero the arm points outwards."""
        place = radius * self.radial + np.array([0.0, 0.0, height])
        turn = np.array([np.cos(self.yaw / 2), 0.0, 0.0, np.sin(self.yaw / 2)])
        arm, inner = f"arm_{self.number}", (-self.length / 2, 0.0, 0.0)
        return Joint(
            "revolute", None, arm, f"motor_{self.number}", place, inner, axis=(0.0, 1.0, 0.0), orientation=turn
        )

    def rod_joints(self, aside: float, radius: float) -> tuple[Joint, Joint]:
        """The universal joint of a rod at the arm and the ball joint at the platform, which stands level.

        aside: from the middle of the pair [m]; radius: from there to the middle of the platform [m].
        """
        name, axes = self._rod(aside), self.rod_axes
        low, end = (0.0, 0.0, -self.forearm / 2), (0.0, 0.0, self.forearm / 2)
        corner = radius * self.radial + aside * self.tangent
        at, turn = (self.length / 2, aside, 0.0), quaternion(self.axes.T @ axes)
        universal = Joint("orbital", f"arm_{self.number}", name, "", at, low, orientation=turn)
        ball = Joint("spherical", name, "platform", f"ball{name[3:]}", end, corner, orientation=quaternion(axes.T))
        return universal, ball
