"""A pole hinged to a cart on a rail."""

from __future__ import annotations

from numpy.typing import ArrayLike

from sim.mechanism import checks
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.parts import Body, Input, Joint
from sim.mechanism.shapes import Capsule

CART_INERTIA = (0.106974, 0.106974, 0.00636812)
POLE_INERTIA = (0.0422274, 0.0422274, 0.0012155)


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
    """The pole hangs down at angle zero and is upright at pi.

        --[cart]-- rail along y, z = 0     q  (2,) cart position [m], pole angle about x [rad]
             o                             u  (1,) force on the cart along y [N]
             |  pole

    The default masses and inertias are MuJoCo's. Inertias about the centres of mass, body axes, z along the pole
    [kg m^2]; the centre of mass of the pole is half a pole length from the hinge. damper: (rail, hinge)
    [N s/m, N m s/rad].
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
