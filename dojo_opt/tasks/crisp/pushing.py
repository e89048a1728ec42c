"""Flat objects on a table, pushed at their faces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.planning.plan import Plan
from sim.mechanism.body import Body
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.model.state_columns import BaseState
from solvers.types import Vector

Point = tuple[float, float]

__all__ = ["Face", "Placed", "flat_pose", "slider"]

_G = 9.8  # [m/s^2]


class Face(NamedTuple):
    """A straight side of an object.

    Attributes:
        begin: one end, from the centre of mass [m].
        end: the other end [m].
        inward: unit normal into the object.
    """

    begin: Point
    end: Point
    inward: Point


def slider(
    name: str, mass: float, inertia: float, friction: float, corners: Sequence[Point], faces: Sequence[Face]
) -> Mechanism:
    """An object that stands on its corners, with two pushing forces at every face, one at each end.

    Together, they are a normal force anywhere on the face.

        q  (7,) position [m] and quaternion
        u  (2 n,) forces at the ends of the n faces, which only push [N]

    Args:
        name: name of the body.
        mass: mass [kg].
        inertia: moment of inertia about the vertical [kg m^2].
        friction: coefficient of friction on the table.
        corners: corners from the centre of mass [m].
        faces: sides.

    Returns:
        The mechanism.
    """
    inputs = []
    for k, face in enumerate(faces):
        force = np.array([*face.inward, 0.0])
        for end, point in (("begin", face.begin), ("end", face.end)):
            torque = np.cross([*point, 0.0], force)
            push = Input(
                body=name, force=force, torque=torque, frame="body", limits=(0.0, np.inf), name=f"face {k} {end}"
            )
            inputs.append(push)
    contacts = [
        Contact(name, (x, y, 0.0), 0.0, friction=friction, name=f"corner {k}") for k, (x, y) in enumerate(corners)
    ]
    return Mechanism(
        [Body(name, mass, inertia * np.diag([0.6, 0.6, 1.0]))],
        [Joint("floating", None, name)],
        contacts,
        inputs,
        gravity=(0.0, 0.0, -_G),
        name=name,
    )


def flat_pose(pose: ArrayLike) -> Vector:
    """The state at rest of an object that lies on the table.

    Args:
        pose: (3,) x, y [m] and heading [rad].

    Returns:
        (13,) state.
    """
    x, y, heading = np.asarray(pose, dtype=np.float64)
    return np.array([x, y, 0.0, np.cos(0.5 * heading), 0.0, 0.0, np.sin(0.5 * heading), *np.zeros(6)])


class Placed:
    """Whether an object ends near a pose.

    Args:
        pose: (3,) x, y [m] and heading [rad].
        near: largest distance from it [m].
        turned: largest angle from it [rad].
    """

    def __init__(self, pose: ArrayLike, near: float, turned: float) -> None:
        self._goal = np.asarray(pose, dtype=np.float64)
        self._near, self._turned = near, turned

    def __call__(self, plan: Plan) -> tuple[bool, dict[str, float]]:
        """Judge a plan.

        Args:
            plan: the plan.

        Returns:
            Whether it does, and the numbers that decide it.
        """
        x = plan.x[-1]
        off = float(np.hypot(*(x[:2] - self._goal[:2])))
        w, _, _, z = x[BaseState.QUATERNION]
        angle = 2.0 * np.arctan2(z, w) - self._goal[2]
        turn = abs(float(np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi))
        return off < self._near and turn < self._turned, {"off [mm]": 1e3 * off, "turned off [rad]": turn}
