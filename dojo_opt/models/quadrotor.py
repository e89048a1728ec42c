"""Ascending Technologies' quadrotor Pelican."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.models.links import Link, bodies, grounded, touch
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box

ARM, HEIGHT = 0.21, 0.05  # of the rotors [m]
ROTOR = Link(0.01, (0.0, 0.0, 0.0), (1.94999922e-06, 0.00013660827869, 0.00013840827797))
FRAME = Link(1.0, (0.0, 0.0, 0.0), (0.01, 0.01, 0.02), Box(0.1, 0.1, 0.2))


@checked_numbers("models")
def quadrotor(
    *,
    torque_per_thrust: float = 0.1,
    friction: float = 0.5,
    law: str = "nonlinear",
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """One rigid body with four rotors that push along its z axis, 1.04 kg; it stands on the ground z = 0.

          2         q  (7,) position of the centre of mass [m], quaternion
        3-+-1  x    u  (4,) thrusts of the rotors at +x, +y, -x, -y [N]
          4

    Masses, inertias and dimensions are those of the model by Furrer et al. (RotorS) that Dojo uses.

    Args:
        torque_per_thrust: reaction torque of a rotor over its thrust [m]. The torque about z is positive for the rotors
            on x, negative for those on y.
        friction: coefficient of friction of the eight contacts: rotor guards, and corners below.
        law: contact law, see `dojo.Contact`.
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state stands on the ground.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    ends = [np.array([ARM * x, ARM * y, HEIGHT]) for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1))]
    links = {"frame": FRAME.welded(*((ROTOR, end) for end in ends))}
    com = np.asarray(links["frame"].com)
    inputs = []
    for k, end in enumerate(ends):
        force = np.array([0.0, 0.0, 1.0])
        torque = np.cross(end - com, force) + (0.0, 0.0, torque_per_thrust * (-1) ** k)
        inputs.append(Input(body="frame", force=force, torque=torque, frame="body", name=f"rotor_{k + 1}"))
    guards = [(f"rotor_{k + 1}", end - (0.0, 0.0, 0.005), 0.07) for k, end in enumerate(ends)]
    below = [np.array([0.11 * x, 0.11 * y, -0.085]) for x, y in product((1, -1), repeat=2)]
    corners = [(f"corner_{k}", point, 0.0) for k, point in enumerate(below)]
    contacts = [
        touch(links, "frame", point, radius, name, friction=friction, law=law)
        for name, point, radius in guards + corners
    ]
    base = Joint("floating", None, "frame", name="base", child_point=(0.0, 0.0, 0.0))
    mech = Mechanism(bodies(links), [base], contacts, inputs, gravity=gravity, name="quadrotor")
    return grounded(mech, 2)
