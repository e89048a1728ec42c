"""An underwater vehicle with six thrusters."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.models.links import Link, bodies, touch
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box

INERTIA = (0.29874124659, -0.03211874071, 0.00179507011, 0.50529405748, -0.00095289894, 0.62284393213)
HULL = Link(19.1834, (0.0, 0.0, 0.0), INERTIA, Box(0.45, 0.35, 0.25))
ROTOR = Link(0.01, (0.0, 0.0, 0.0), (1.94999922e-06, 0.00013660827869, 0.00013840827797))
# position [m] and direction of the thrust
THRUSTERS = (
    ((0.14, -0.09, 0.059), (-(0.5**0.5), -(0.5**0.5), 0.0)),
    ((0.14, 0.09, 0.059), (-(0.5**0.5), 0.5**0.5, 0.0)),
    ((-0.14, -0.09, 0.059), (0.5**0.5, -(0.5**0.5), 0.0)),
    ((-0.14, 0.09, 0.059), (0.5**0.5, 0.5**0.5, 0.0)),
    ((0.0, -0.0855, 0.165), (0.0, 0.0, 1.0)),
    ((0.0, 0.0855, 0.165), (0.0, 0.0, 1.0)),
)


@checked_numbers("models")
def uuv(
    *,
    damper: float = 10.0,
    friction: float = 0.5,
    law: str = "nonlinear",
    gravity: ArrayLike = (0.0, 0.0, 0.0),
) -> Mechanism:
    """One rigid body in water, 19.24 kg: weight and lift cancel, and a damper takes the place of drag.

        q  (7,) position of the centre of mass [m], quaternion
        u  (6,) thrusts [N]: four in the horizontal plane, two upwards

    Masses, inertias and dimensions are those of the model of the University of Maryland's mini Tortuga in Dojo.

    Args:
        damper: drag on every velocity [N s/m] and angular velocity [N m s/rad].
        friction: coefficient of friction of the two contacts.
        law: contact law, see `dojo.Contact`.
        gravity: (3,) acceleration of gravity [m/s^2]; zero by default, as the lift cancels it.

    Returns:
        The mechanism. Its neutral state is one metre over the ground z = 0.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    links = {"hull": HULL.welded(*((ROTOR, point) for point, _ in THRUSTERS))}
    com = np.asarray(links["hull"].com)
    inputs = [
        Input(body="hull", force=along, torque=np.cross(point - com, along), frame="body", name=f"thruster_{k + 1}")
        for k, (point, along) in enumerate(THRUSTERS)
    ]
    contacts = [
        touch(links, "hull", (x, 0.0, 0.07), 0.21, name, friction=friction, law=law)
        for x, name in ((0.12, "front"), (-0.12, "rear"))
    ]
    base = Joint("floating", None, "hull", name="base", damper=damper)
    neutral = {"base": (0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0)}
    return Mechanism(bodies(links), [base], contacts, inputs, gravity=gravity, name="uuv", neutral=neutral)
