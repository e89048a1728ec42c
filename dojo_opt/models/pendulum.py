"""One link on a pivot."""

from __future__ import annotations

from numpy.typing import ArrayLike

from dojo_opt.models.npendulum import npendulum
from sim.mechanism.mechanism import Mechanism


def pendulum(
    *,
    mass: float = 1.0,
    length: float = 1.0,
    width: float = 0.1,
    spring: float = 0.0,
    damper: float = 0.0,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """A uniform link; angle zero is hanging down, pi is upright.

        pivot o  z = 1.1 length       q  (1,) angle about x [rad]
              |                       u  (1,) torque at the pivot [N m]

    mass [kg], length and width [m], spring [N m/rad], damper [N m s/rad].
    """
    return npendulum(
        1, mass=mass, length=length, width=width, spring=spring, damper=damper, gravity=gravity, name="pendulum"
    )
