"""Four links in a ring that hangs from one of its corners."""

from __future__ import annotations

from math import pi

from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from sim.mechanism.body import Body
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box

X = (1.0, 0.0, 0.0)


@checked_numbers("models")
def fourbar(
    *,
    mass: float = 1.0,
    length: float = 1.0,
    width: float = 0.05,
    opening: float = pi / 4,
    damper: float = 1.0,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """A rhombus of four equal links that swings and folds. Its loop leaves two degrees of freedom.

               o pivot         z up, y to the right
        link_1 / \\ link_3      q  (5,) angles about x [rad]: of the ring, of link_3 to link_1, of link_2 to link_1,
              o   o                of link_4 to link_3, of link_4 to link_2, the joint that closes the ring
        link_2 \\ / link_4      u  (5,) torque at each of these joints [N m]
                o

    Args:
        mass: mass of one link [kg].
        length: length of one link [m].
        width: edge of the square cross-section of the links [m].
        opening: angle of link_1 from the vertical in the neutral state [rad].
        damper: damper of every joint, the closing one included [N m s/rad].
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state hangs symmetrically below the pivot, at z = 2.2 length.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    up, down = (0.0, 0.0, length / 2), (0.0, 0.0, -length / 2)
    shape = Box(width, width, length)
    joints = [
        Joint("revolute", None, "link_1", "pivot", (0.0, 0.0, 2.2 * length), up, axis=X, damper=damper),
        Joint("revolute", "link_1", "link_3", "joint_13", up, up, axis=X, damper=damper),
        Joint("revolute", "link_1", "link_2", "joint_12", down, up, axis=X, damper=damper),
        Joint("revolute", "link_3", "link_4", "joint_34", down, up, axis=X, damper=damper),
        Joint("revolute", "link_2", "link_4", "joint_24", down, down, axis=X, damper=damper, close=True),
    ]
    turn = 2.0 * opening
    return Mechanism(
        bodies=[Body(f"link_{k}", mass, shape=shape) for k in (1, 2, 3, 4)],
        joints=joints,
        inputs=[Input(j.name) for j in joints],
        gravity=gravity,
        name="fourbar",
        neutral={"pivot": -opening, "joint_13": turn, "joint_12": turn, "joint_34": -turn, "joint_24": -turn},
    )
