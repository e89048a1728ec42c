"""Two links on a pivot, driven at the elbow only."""

from __future__ import annotations

from dataclasses import replace

from numpy.typing import ArrayLike

from dojo_opt.models.npendulum import npendulum
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.parts import Input


def acrobot(
    *,
    mass: float = 1.0,
    length: float = 1.0,
    width: float = 0.05,
    damper: float = 0.1,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Two equal links; both angles zero is hanging straight down, (pi, 0) is upright.

        pivot o  z = 2.2 length       q  (2,) angle of link_0 to the vertical, of link_1 to link_0, about x [rad]
              |                       u  (1,) torque at the elbow [N m]
              |

    mass [kg] and length [m] of one link, damper of both joints [N m s/rad].
    """
    chain = npendulum(2, mass=mass, length=length, width=width, damper=damper, gravity=gravity, name="acrobot")
    return replace(chain, inputs=[Input("joint_1", name="elbow")])
