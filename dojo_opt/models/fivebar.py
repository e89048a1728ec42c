"""A planar arm of two cranks on the ground whose forearms meet: both motors stand still."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from sim.mechanism.body import Body
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box

Y = (0.0, 1.0, 0.0)


@checked_numbers("models")
def fivebar(
    *,
    crank: float = 0.3,
    forearm: float = 0.4,
    base: float = 0.2,
    density: float = 2.0,
    width: float = 0.03,
    angle: float = 0.6,
    limits: tuple[float, float] | None = (0.0, 1.2),
    spring: float = 0.0,
    damper: float = 0.0,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """A planar arm that hangs below two motors; its forearms meet at a pin that closes the loop.

        motor_l o---o motor_r      z up, x to the right
               /     \\             q  (4,) angles about y [rad]: of the cranks from pointing down, left and right;
              o       o                 of the forearms to their cranks, left and right
               \\     /             u  (2,) torques of the two motors [N m]
                 \\ /
                  o pin

    Args:
        crank: length of a crank [m].
        forearm: length of a forearm [m].
        base: distance of the two motors [m].
        density: mass per length of the links [kg/m].
        width: edge of the square cross-section of the links [m].
        angle: angle by which the cranks open outwards in the neutral state [rad].
        limits: (least, largest) such angle [rad]; None for no stops. The arm is singular with its forearms in one line,
            or on one another.
        spring: spring constant of the motors [N m/rad], with its rest at the neutral angle.
        damper: damper of the motors [N m s/rad].
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state is symmetric, with the pin below the middle of the motors.

    Raises:
        ValueError: for an argument out of range, or forearms too short to meet.
    """
    up = {"crank": (0.0, 0.0, crank / 2), "forearm": (0.0, 0.0, forearm / 2)}
    down = {"crank": (0.0, 0.0, -crank / 2), "forearm": (0.0, 0.0, -forearm / 2)}
    length = {"crank": crank, "forearm": forearm}
    across = base / 2 + crank * np.sin(angle)  # from an elbow to the middle
    if not abs(across) < forearm:
        raise ValueError(f"fivebar(forearm=...): expected more than {abs(across):.3g} m, to the middle, got {forearm}")
    inwards = float(np.arcsin(across / forearm))
    neutral: dict[str, float] = {}
    bodies, joints = [], []
    for side, sign in (("l", -1.0), ("r", 1.0)):
        bodies += [Body(f"{k}_{side}", density * n, shape=Box(width, width, n)) for k, n in length.items()]
        rest = -sign * angle
        bounds = None if limits is None else sorted(-sign * bound for bound in limits)
        motor: dict[str, Any] = {"axis": Y, "spring": spring, "damper": damper, "rest": rest, "limits": bounds}
        where = (sign * base / 2, 0.0, crank + forearm)
        joints.append(Joint("revolute", None, f"crank_{side}", f"motor_{side}", where, up["crank"], **motor))
        ends = (f"crank_{side}", f"forearm_{side}", f"elbow_{side}", down["crank"], up["forearm"])
        joints.append(Joint("revolute", *ends, axis=Y))
        neutral |= {f"motor_{side}": rest, f"elbow_{side}": sign * (angle + inwards)}
    pin = Joint("revolute", "forearm_l", "forearm_r", "pin", down["forearm"], down["forearm"], axis=Y, close=True)
    return Mechanism(
        bodies,
        [*joints[::2], *joints[1::2], pin],
        inputs=[Input("motor_l"), Input("motor_r")],
        gravity=gravity,
        name="fivebar",
        neutral=neutral,
    )
