"""A pole hinged to a cart on a rail."""

from __future__ import annotations

from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from sim.mechanism import checks
from sim.mechanism.body import Body
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Capsule

CART_INERTIA = (0.106974, 0.106974, 0.00636812)
POLE_INERTIA = (0.0422274, 0.0422274, 0.0012155)


@checked_numbers("models")
def cartpole(
    *,
    cart_mass: float = 1.0063,
    pole_mass: float = 0.4321,
    pole_length: float = 1.0,
    cart_inertia: ArrayLike = CART_INERTIA,
    pole_inertia: ArrayLike = POLE_INERTIA,
    damper: ArrayLike = (0.0, 0.0),
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """A pole hinged to a cart on a rail. The pole hangs at an angle of zero and is upright at pi.

        --[cart]-- rail along y, z = 0     q  (2,) cart position [m], pole angle about x [rad]
             o                             u  (1,) force on the cart along y [N]
             |  pole

    The default masses and inertias are MuJoCo's.

    Args:
        cart_mass: mass of the cart [kg].
        pole_mass: mass of the pole [kg].
        pole_length: length of the pole [m]; its centre of mass is half of it from the hinge.
        cart_inertia: (3,) or (3, 3) inertia of the cart about its centre of mass, body axes [kg m^2].
        pole_inertia: (3,) or (3, 3) likewise of the pole, z along the pole [kg m^2].
        damper: (2,) dampers of the rail [N s/m] and of the hinge [N m s/rad].
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state hangs, with the cart at y = 0.

    Raises:
        ValueError: for an argument of the wrong shape or out of range; the message names the part.
    """
    rail, hinge = checks.vector("cartpole(damper=...)", damper, 2)
    bodies = [
        Body("cart", cart_mass, cart_inertia, Capsule(0.1125, 0.3, orientation=(0.5**0.5, -(0.5**0.5), 0.0, 0.0))),
        Body("pole", pole_mass, pole_inertia, Capsule(0.075, pole_length)),
    ]
    joints = [
        Joint("prismatic", None, "cart", axis=(0.0, 1.0, 0.0), damper=rail),
        Joint("revolute", "cart", "pole", child_point=(0.0, 0.0, pole_length / 2), axis=(1.0, 0.0, 0.0), damper=hinge),
    ]
    return Mechanism(bodies, joints, inputs=[Input("cart")], gravity=gravity, name="cartpole")
