"""A T-shaped handle in free fall, which turns over and over."""

from __future__ import annotations

from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from sim.mechanism.body import Body
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Capsule


@checked_numbers("models")
def dzhanibekov(
    *,
    mass: float = 1.0,
    length: float = 0.8,
    stem_mass: float = 0.5,
    stem_length: float = 0.35,
    radius: float = 0.05,
    gravity: ArrayLike = (0.0, 0.0, 0.0),
) -> Mechanism:
    """A bar along y with a stem along -x in its middle, both capsules, in space.

            |       q  (7,) position of the centre of mass of the bar [m], its quaternion
        ----|       u  (0,) nothing drives it
            |

    The moments of inertia of the whole are .029 about y, .062 about x, the axis to spin it about, and .087 kg m^2 about
    z. (Dojo's bar has the moments .03, .001, .1 kg m^2, which no rigid body has: the largest exceeds the sum of the
    others.)

    Args:
        mass: mass of the bar [kg].
        length: length of the bar between the centres of its caps [m].
        stem_mass: mass of the stem [kg].
        stem_length: length of the stem between the centres of its caps [m].
        radius: radius of both capsules [m].
        gravity: (3,) acceleration of gravity [m/s^2]; zero by default, in space.

    Returns:
        The mechanism.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    bar = Body("bar", mass, shape=Capsule(radius, length, orientation=(0.5**0.5, 0.5**0.5, 0.0, 0.0)))
    stem = Body("stem", stem_mass, shape=Capsule(radius, stem_length, orientation=(0.5**0.5, 0.0, 0.5**0.5, 0.0)))
    middle = (-radius - stem_length / 2, 0.0, 0.0)
    joints = [Joint("floating", None, "bar"), Joint("fixed", "bar", "stem", parent_point=middle)]
    return Mechanism([bar, stem], joints, gravity=gravity, name="dzhanibekov")
