"""A hopper on one parallel leg: two motors at the hip, a diamond of four links, as the legs of Minitaur."""

from __future__ import annotations

from dataclasses import dataclass, replace

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
    reach, knee = _stance(upper, lower, angle)
    halves = _Half("front", 1.0, upper, lower), _Half("back", -1.0, upper, lower)
    links = [link for half in halves for link in half.links(upper_mass, lower_mass)]
    hips = [replace(half.hip(), damper=damper, armature=rotor) for half in halves]
    knees = [replace(half.knee(), limits=half.turned(straight, folded)) for half in halves]
    return Mechanism(
        [Body("body", body_mass, shape=Box(0.2, 0.12, 0.08)), *links],
        [Joint("planar_axis", None, "body", "base", axis=Y), *hips, *knees, _pin(lower)],
        contacts=[
            Contact("front_shank", _end(lower), foot_radius, friction=friction, law=law, name="foot"),
            Contact("body", radius=0.05, friction=friction, law=law, name="hull"),
        ],
        inputs=[Input(hip.name) for hip in hips],
        gravity=gravity,
        name="minitaur_leg",
        neutral={"base": (0.0, reach + foot_radius, 0.0)} | halves[0].bent(angle, knee) | halves[1].bent(angle, knee),
    )


def _stance(upper: float, lower: float, angle: float) -> tuple[float, float]:
    """From the foot to the hip [m], and the angle of the knees [rad], with the thighs at an angle from the vertical."""
    across = upper * np.sin(angle)  # from a knee to the middle
    if not abs(across) < lower:
        raise ValueError(f"minitaur_leg(lower=...): expected more than {abs(across):.3g} m, to the middle, got {lower}")
    reach = upper * np.cos(angle) + np.sqrt(lower**2 - across**2)
    return float(reach), angle + float(np.arcsin(across / lower))


def _end(length: float) -> tuple[float, float, float]:
    """The lower end of a link of this length [m]."""
    return (0.0, 0.0, -length / 2)


def _pin(lower: float) -> Joint:
    """The hinge at the foot, which closes the loop of shanks of this length [m]."""
    return Joint("revolute", "front_shank", "back_shank", "foot", _end(lower), _end(lower), axis=Y, close=True)


@dataclass(frozen=True)
class _Half:
    """One half of the leg: a thigh and a shank that hang from their upper ends."""

    side: str
    sign: float  # of the angle of a bent knee
    upper: float  # length of the thigh [m]
    lower: float  # of the shank [m]

    def links(self, upper_mass: float, lower_mass: float) -> list[Body]:
        """Thigh and shank of these masses [kg]."""
        return [
            Body(f"{self.side}_thigh", upper_mass, shape=Box(0.015, 0.015, self.upper)),
            Body(f"{self.side}_shank", lower_mass, shape=Box(0.012, 0.012, self.lower)),
        ]

    def hip(self) -> Joint:
        top = (0.0, 0.0, self.upper / 2)
        return Joint("revolute", "body", f"{self.side}_thigh", f"{self.side}_hip", child_point=top, axis=Y)

    def knee(self) -> Joint:
        thigh, shank, top = f"{self.side}_thigh", f"{self.side}_shank", (0.0, 0.0, self.lower / 2)
        return Joint("revolute", thigh, shank, f"{self.side}_knee", _end(self.upper), top, axis=Y)

    def turned(self, least: float, most: float) -> list[float]:
        """Limits of the knee for the least and the largest bend [rad]."""
        return sorted((self.sign * least, self.sign * most))

    def bent(self, hip: float, knee: float) -> dict[str, ArrayLike]:
        """Coordinates for angles of thigh and knee [rad]."""
        return {f"{self.side}_hip": -self.sign * hip, f"{self.side}_knee": self.sign * knee}
