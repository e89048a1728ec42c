"""Stewart platform: a plate on six legs that change their length."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.models.links import from_z
from sim.mechanism.body import Body
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Cylinder
from solvers.types import Floats

_RADII = {"cylinder": 0.025, "rod": 0.015}  # of both parts of a leg [m]


@checked_numbers("models")
def stewart(
    *,
    base_radius: float = 0.5,
    plate_radius: float = 0.3,
    height: float = 0.6,
    spread: float = 0.25,
    plate_mass: float = 10.0,
    leg_mass: float = 0.5,
    spring: float = 0.0,
    damper: float = 0.0,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Six legs with universal joints on the ground, a slider each, and ball joints under the plate: 6-UPS.

        ___plate___    z up    q  (22,) of leg 0 to 5: swing of its cylinder (2) [rad] and its extension [m]; then the
         /\\ /\\ /\\                  attitude of the plate to rod 0, a quaternion (4)
        /  X  X  \\             u  (6,) force of each slider [N]; a positive force extends the leg

    The plate hangs on leg 0 in the tree. The ball joints of the other legs close five loops, which leave the plate its
    six degrees of freedom.

    Args:
        base_radius: radius of the circle of the joints on the ground [m].
        plate_radius: radius of the circle of the joints under the plate [m].
        height: height of the plate in the neutral state [m].
        spread: half the angle between neighbouring joints on the ground [rad]; pi/3 - spread under the plate.
        plate_mass: mass of the plate [kg].
        leg_mass: mass of each cylinder and of each rod [kg].
        spring: spring constant of each slider [N/m], with its rest at the neutral length.
        damper: damper of each slider [N s/m].
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state holds the plate level.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    feet, tops = _hexagon(base_radius, spread), _hexagon(plate_radius, np.pi / 3 - spread)
    bodies, joints, closing = [], [], []
    for k, (foot, top) in enumerate(zip(feet, tops, strict=True)):
        leg = top + np.array([0.0, 0.0, height]) - foot
        length = float(np.linalg.norm(leg))
        bodies += [Body(f"{name}_{k}", leg_mass, shape=Cylinder(r, length / 2)) for name, r in _RADII.items()]
        turn = np.array(from_z(leg / length))
        joints += _leg_joints(k, foot, turn, length, spring=spring, damper=damper)
        end, upright = (0.0, 0.0, length / 4), turn * (1.0, -1.0, -1.0, -1.0)
        closing.append(Joint("spherical", f"rod_{k}", "plate", f"ball_{k}", end, top, orientation=upright, close=k > 0))
    bodies.append(Body("plate", plate_mass, shape=Cylinder(plate_radius, 0.03)))
    return Mechanism(
        bodies,
        [*joints, *closing],
        inputs=[Input(f"slider_{k}") for k in range(6)],
        gravity=gravity,
        name="stewart",
    )


def _leg_joints(k: int, foot: Floats, turn: Floats, length: float, **slider: Any) -> list[Joint]:
    """The joints of leg k with its foot on the ground, turned from the vertical: its hinge, and its slider."""
    low, top = (0.0, 0.0, -length / 4), (0.0, 0.0, length / 2)
    return [
        Joint("orbital", None, f"cylinder_{k}", f"hinge_{k}", foot, low, orientation=turn),
        Joint("prismatic", f"cylinder_{k}", f"rod_{k}", f"slider_{k}", top, **slider),
    ]


def _hexagon(radius: float, spread: float) -> Floats:
    """Six points on a circle, in three pairs that are `spread` to either side of 0, 120 and 240 degrees, (6, 3)."""
    angles = np.ravel([[a - spread, a + spread] for a in np.radians((0.0, 120.0, 240.0))])
    return np.stack([radius * np.cos(angles), radius * np.sin(angles), np.zeros(6)], axis=1)
