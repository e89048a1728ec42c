"""The way of an object that a hand pushes along a table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dojo_opt.gaits.minimum_jerk import minimum_jerk
from sim.mechanism.body import Body
from sim.mechanism.shapes import Solid, Stance, rotation_matrices
from sim.mechanism.short_repr import short_repr
from sim.simulator.kinematics import Kinematics
from solvers.types import Floats

__all__ = ["PushedObject"]

_CALL = "problems.push"
_GAP = 0.01  # [m] between the hand and the object at the beginning
_REST = 0.2  # of the duration, at the end
_DOWN = np.array([0.0, 0.0, -1.0])
_ROUGH = 0.5  # friction of an object whose shapes have none
_LEVEL = 0.01  # of the height of the centre of mass: points this near to the lowest one are on the table
_UPRIGHT = 0.8  # of the height from which a push tips the object over


@dataclass(frozen=True)
class PushedObject:
    """An object that stands on a table with its x axis along its way, and its hand behind it.

    Attributes:
        body: the object.
        way: (3,) its displacement along the table [m].
        shares: (n,) of the time, negative before the beginning.
    """

    body: Body
    way: Floats
    shares: Floats

    __repr__ = short_repr

    @classmethod
    def of(cls, body: Any, way: Floats, horizon: int) -> PushedObject:
        """An object that moves along `way` (3,) [m] in a number of knots, from the knot before the first one on."""
        if not isinstance(body, Body):
            raise TypeError(f"{_CALL}(object): expected a Body, got {body!r}")
        made = cls(body, way, np.arange(-1.0, horizon + 1.0) / ((1.0 - _REST) * horizon))
        rear, front, _ = made._footing()
        if not rear < 0.0 < front:
            raise ValueError(
                f"{_CALL}(object): body {body.name!r} rolls along its way, and goes on when the hand stops, or falls "
                "over: its centre of mass has to be between points on which it stands"
            )
        return made

    @property
    def friction(self) -> list[float]:
        """Coefficients of its shapes, 0.5 where they have none."""
        return [_ROUGH if shape.friction is None else shape.friction for shape in self.body.shapes]

    @property
    def far(self) -> float:
        """Length of its way [m]."""
        return float(np.linalg.norm(self.way))

    @property
    def forward(self) -> Floats:
        """(3,) direction of its way."""
        return np.asarray(self.way / self.far)

    @property
    def up(self) -> Floats:
        """(3,) from the table to its centre of mass [m]."""
        return np.array([0.0, 0.0, self.half(_DOWN)])

    @property
    def heading(self) -> list[float]:
        """The quaternion that turns x to its way."""
        half = 0.5 * float(np.arctan2(self.forward[1], self.forward[0]))
        return [np.cos(half), 0.0, 0.0, np.sin(half)]

    @property
    def _hand_moved(self) -> Floats:
        """(n,) of the hand, from where it would touch the object at the beginning [m]."""
        return -_GAP + (self.far + _GAP) * minimum_jerk(self.shares)

    @property
    def moved(self) -> Floats:
        """(n,) of the object [m]."""
        return np.maximum(self._hand_moved, 0.0)

    def hands(self, radius: float) -> Floats:
        """(n, 3) places of the ball of a hand from the point of the table below the object at the beginning [m]."""
        back = self.half(np.array([-1.0, 0.0, 0.0])) + radius
        up = np.array([0.0, 0.0, max(radius, self._height())])
        return up - back * self.forward + self._hand_moved[:, None] * self.forward

    def _height(self) -> float:
        """Height of a push [m]: that of the centre of mass, or lower, where the object would tip over.

        The friction mu m g, pushed at a height z, lifts the rear once mu z is more than the way from the centre of mass
        to the front edge.
        """
        _, front, friction = self._footing()
        middle = self.half(_DOWN)
        return middle if friction * middle <= _UPRIGHT * front else _UPRIGHT * front / friction

    def _footing(self) -> tuple[float, float, float]:
        """Ends of the points on the table along the way, from the centre of mass [m], and their largest friction."""
        low, rows = _LEVEL * self.half(_DOWN) - self.half(_DOWN), []
        for shape, friction in zip(self.body.shapes, self.friction, strict=True):
            stance = _stance(shape)
            points = shape.place(stance.points)
            rows += [(x, friction) for x, _, z in points if z - stance.radius <= low]
        ends, frictions = zip(*rows, strict=True)
        return min(ends), max(ends), max(frictions)

    def places(self, below: Floats) -> Floats:
        """(n, 3) places of the object that begins over a point of the table (3,) [m]."""
        return below + self.up + self.moved[:, None] * self.forward

    def half(self, direction: Floats) -> float:
        """How far its shapes reach in a direction (3,) from its centre of mass [m]."""
        if not self.body.shapes:
            raise ValueError(f"{_CALL}(object): body {self.body.name!r} has no shape")
        return max(_reach(shape, direction) for shape in self.body.shapes)

    def is_clear(self, kin: Kinematics, below: Floats, hands: Floats) -> bool:
        """Whether joints and centres of mass of an arm stay above the table and outside the object.

        Args:
            kin: of the arm.
            below: (3,) point of the table below the object at the beginning [m].
            hands: (n, nq) coordinates of the arm.
        """
        arm = _points(kin, hands)
        axes = np.array([self.forward, np.cross([0.0, 0.0, 1.0], self.forward), [0.0, 0.0, 1.0]])
        relative = (arm - self.places(below)) @ axes.T
        low = [-self.half(-axis) for axis in np.eye(3)]
        high = [self.half(axis) for axis in np.eye(3)]
        inside = np.all((relative > low) & (relative < high), axis=-1)
        return not np.any(inside) and bool(np.all(arm[..., 2] > below[2]))


def _points(kin: Kinematics, hands: Floats) -> Floats:
    """(k, n, 3) centres of mass and joints of an arm at coordinates (n, nq), but for the joint of its base."""
    mech = kin.mechanism
    bodies = kin.sim.maximal(np.concatenate([hands, np.zeros((len(hands), kin.sim.nv))], axis=1))
    number = {name: k for k, name in enumerate(mech.body_names)}
    points = [bodies[:, k, :3] for k in range(len(number))]
    for joint in mech.joints:
        if joint.parent in number:  # that of the base may be on the table
            body = bodies[:, number[joint.child]]
            points.append(body[:, :3] + rotation_matrices(body[:, 6:10]) @ np.asarray(joint.child_point, dtype=float))
    return np.array(points)


def _stance(shape: Solid) -> Stance:
    """The points on which a shape stands."""
    stance = shape.stance()
    if stance is None:
        raise ValueError(f"{_CALL}(object): expected a Box, Sphere, Capsule or Polytope, got {shape!r}")
    return stance


def _reach(shape: Solid, direction: Floats) -> float:
    """How far a shape on its body reaches in a direction (3,) [m]."""
    stance = _stance(shape)
    return float((shape.place(stance.points) @ direction).max()) + stance.radius
