"""Franka Emika's arm Panda with its gripper."""

from __future__ import annotations

from math import pi

from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.models.links import Link, Mount, bodies, joints
from sim.mechanism.mechanism import Mechanism

LINKS = {
    "link1": Link(4.970684, (0.003875, 0.002081, -0.04762), (0.70337, -1.39e-4, 6.772e-3, 0.70661, 0.019169, 0.009117)),
    "link2": Link(
        0.646926, (-0.003141, -0.02872, 0.003495), (7.962e-3, -3.925e-3, 0.010254, 0.02811, 7.04e-4, 0.025995)
    ),
    "link3": Link(
        3.228604, (0.027518, 0.039252, -0.066502), (0.037242, -4.761e-3, -0.011396, 0.036155, -0.012805, 0.01083)
    ),
    "link4": Link(
        3.587895, (-0.05317, 0.104419, 0.027454), (0.025853, 7.796e-3, -1.332e-3, 0.019552, 8.641e-3, 0.028323)
    ),
    "link5": Link(
        1.225946, (-0.011953, 0.041065, -0.038437), (0.035549, -2.117e-3, -4.037e-3, 0.029474, 2.29e-4, 8.627e-3)
    ),
    "link6": Link(
        1.666555, (0.060149, -0.014117, -0.010517), (1.964e-3, 1.09e-4, -1.158e-3, 4.354e-3, 3.41e-4, 5.433e-3)
    ),
    "link7": Link(
        0.735522, (0.010517, -0.004252, 0.061597), (0.012516, -4.28e-4, -1.196e-3, 0.010027, -7.41e-4, 4.815e-3)
    ),
}
HAND = Link(0.7, (0.0, 0.0, 0.0), (5e-3, 5e-3, 5e-3))
FINGER = Link(0.3, (0.0, 0.0, 0.0), (1e-3, 1e-3, 1e-3))
# hinge in the frame of the link before [m], roll [rad], stops [rad]
HINGES = (
    ((0.0, 0.0, 0.333), 0.0, (-2.8973, 2.8973)),
    ((0.0, 0.0, 0.0), -pi / 2, (-1.7628, 1.7628)),
    ((0.0, -0.316, 0.0), pi / 2, (-2.8973, 2.8973)),
    ((0.0825, 0.0, 0.0), pi / 2, (-3.0718, -0.0698)),
    ((-0.0825, 0.384, 0.0), -pi / 2, (-2.8973, 2.8973)),
    ((0.0, 0.0, 0.0), pi / 2, (-0.0175, 3.7525)),
    ((0.088, 0.0, 0.0), pi / 2, (-2.8973, 2.8973)),
)
READY = (0.0, -pi / 4, 0.0, -3 * pi / 4, 0.0, pi / 2, pi / 4)


@checked_numbers("models")
def panda(
    *,
    spring: float = 0.0,
    damper: float = 5.0,
    limits: bool = True,
    gripper: bool = True,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Seven hinges and two fingers; its base is fixed at the origin.

        q  (9,) joint1 .. joint7 [rad], finger1, finger2 [m]
        u  (9,) torques [N m] and forces [N] in the same order

    Dimensions and stops are the maker's. Masses and inertias were identified by Gaz, Cognetti, Oliva, Robuffo Giordano,
    De Luca, RA-L 2019. Those of the hand and the fingers are those of the model in Dojo.

    Args:
        spring: spring constant of every joint [N m/rad; of the fingers N/m], with its rest at zero.
        damper: damper of every joint [N m s/rad; of the fingers N s/m].
        limits: whether the joints have stops.
        gripper: whether the arm has a hand and fingers; q and u are (7,) without.
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state is the maker's ready pose.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    links = dict(LINKS)
    mounts = [
        Mount(f"link{i}", f"link{i - 1}" if i > 1 else None, point, (0, 0, 1), stops, (roll, 0, 0), name=f"joint{i}")
        for i, (point, roll, stops) in enumerate(HINGES, 1)
    ]
    neutral = {f"joint{i + 1}": angle for i, angle in enumerate(READY)}
    if gripper:
        links["link7"] = links["link7"].welded((HAND, (0.0, 0.0, 0.107)))
        tips = (0.0, 0.0, 0.107 + 0.0584)
        for k, y in ((1, 1.0), (2, -1.0)):
            links[f"finger{k}"] = FINGER
            mounts.append(Mount(f"finger{k}", "link7", tips, (0.0, y, 0.0), (0.0, 0.04), kind="prismatic"))
            neutral[f"finger{k}"] = 0.02
    made = joints(links, mounts, spring=spring, damper=damper, limits=limits)
    return Mechanism(bodies(links), made, gravity=gravity, name="panda", neutral=neutral)
