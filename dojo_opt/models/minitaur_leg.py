"""A hopper on one parallel leg: two motors at the hip, a diamond of four links, as the legs of Minitaur."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from sim.mechanism.body import Body
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box

Y = (0.0, 1.0, 0.0)


@checked_numbers("models")
def minitaur_leg(
    *,
    body_mass: float = 2.0,
    upper: float = 0.1,
    lower: float = 0.2,
    upper_mass: float = 0.05,
    lower_mass: float = 0.05,
    angle: float = 1.2,
    damper: float = 0.01,
    rotor: float = 1e-4,
    straight: float = 0.3,
    folded: float = 2.6,
    foot_radius: float = 0.01,
    friction: float = 0.8,
    law: str = "nonlinear",
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """A hopper in the x-z plane: the hip of its leg is at the centre of mass of the body, its knees point fore and aft.

          [body]         z up, x forward
        back / \\ front    q  (7,) position x, z [m] and pitch of the body about y [rad]; angle of the front and of the
            o   o             back thigh to the body from pointing down, of the front and of the back shank to its
             \\ /              thigh [rad]
              o foot     u  (2,) torque of the front and of the back motor, about y [N m]

    The leg swings when both motors turn together, and stretches when they turn against each other. The shanks meet at
    the foot, where a pin closes the loop. The knees stop before the leg is straight or folded, where the two halves
    would lie on each other and part ways.

    Args:
        body_mass: mass of the body [kg].
        upper: length of a thigh [m].
        lower: length of a shank [m].
        upper_mass: mass of one thigh [kg].
        lower_mass: mass of one shank [kg].
        angle: angle of the thighs from the vertical in the neutral state [rad].
        damper: damper of each motor [N m s/rad].
        rotor: inertia of the rotor of each motor, seen behind the gear [kg m^2].
        straight: least angle of a knee [rad]; 0 would be a straight leg.
        folded: largest angle of a knee [rad]; pi would be a folded leg.
        foot_radius: radius of the ball at the foot [m].
        friction: coefficient of friction of the foot and of the body.
        law: contact law, see `dojo.Contact`.
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state stands on the foot, the body above it.

    Raises:
        ValueError: for an argument out of range, or shanks too short to meet.
    """
    across = upper * np.sin(angle)  # from a knee to the middle
    if not abs(across) < lower:
        raise ValueError(f"minitaur_leg(lower=...): expected more than {abs(across):.3g} m, to the middle, got {lower}")
    reach = upper * np.cos(angle) + np.sqrt(lower**2 - across**2)
    knee = angle + float(np.arcsin(across / lower))
    bodies = [Body("body", body_mass, shape=Box(0.2, 0.12, 0.08))]
    neutral: dict[str, ArrayLike] = {"base": (0.0, float(reach) + foot_radius, 0.0)}
    hips, knees = [], []
    for side, sign in (("front", 1.0), ("back", -1.0)):
        bodies.append(Body(f"{side}_thigh", upper_mass, shape=Box(0.015, 0.015, upper)))
        bodies.append(Body(f"{side}_shank", lower_mass, shape=Box(0.012, 0.012, lower)))
        hip, hinge = _hip_and_knee(side, upper, lower)
        hips.append(replace(hip, damper=damper, armature=rotor))
        knees.append(replace(hinge, limits=sorted((sign * straight, sign * folded))))
        neutral |= {f"{side}_hip": -sign * angle, f"{side}_knee": sign * knee}
    end = (0.0, 0.0, -lower / 2)
    pin = Joint("revolute", "front_shank", "back_shank", "foot", end, end, axis=Y, close=True)
    foot = Contact("front_shank", end, foot_radius, friction=friction, law=law, name="foot")
    hull = Contact("body", radius=0.05, friction=friction, law=law, name="hull")
    return Mechanism(
        bodies,
        [Joint("planar_axis", None, "body", "base", axis=Y), *hips, *knees, pin],
        contacts=[foot, hull],
        inputs=[Input("front_hip"), Input("back_hip")],
        gravity=gravity,
        name="minitaur_leg",
        neutral=neutral,
    )


def _hip_and_knee(side: str, upper: float, lower: float) -> tuple[Joint, Joint]:
    """The joints of one half of the leg, whose thigh and shank of these lengths [m] hang from their upper ends."""
    thigh, shank = f"{side}_thigh", f"{side}_shank"
    top, bottom, start = (0.0, 0.0, upper / 2), (0.0, 0.0, -upper / 2), (0.0, 0.0, lower / 2)
    hip = Joint("revolute", "body", thigh, f"{side}_hip", child_point=top, axis=Y)
    return hip, Joint("revolute", thigh, shank, f"{side}_knee", bottom, start, axis=Y)
