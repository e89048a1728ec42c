"""Costs and constraints on frames of links, on the centre of mass and on the momentum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dojo_opt.planning.task_space.quantity import FramePoses, FrameVelocities, Momenta, Quantity
from dojo_opt.planning.task_space.task_spec import TaskSpec
from dojo_opt.planning.term import numbers
from sim.mechanism import checks
from sim.simulator.kinematics import Kinematics
from sim.simulator.simulator import Simulator
from solvers.types import Integers, Vector

_UNIT = (1.0, 0.0, 0.0, 0.0)


def frame_on_body(call: str, sim: Simulator, frame: str, offset: ArrayLike) -> tuple[int, Vector]:
    """(number of the body, (7,) point and quaternion) of a frame whose origin is moved by `offset` in its own axes."""
    from scipy.spatial.transform import Rotation

    kin = Kinematics(sim)
    body, point, turn = kin.place(checks.one_of(f"{call}(frame)", frame, kin.frames))
    if body < 0:
        raise ValueError(f"{call}(frame): {frame!r} is fixed to the world")
    moved = point + turn @ np.asarray(checks.vector(f"{call}(offset=...)", offset, 3))
    x, y, z, w = Rotation.from_matrix(turn).as_quat()
    return body, np.array([*moved, w, x, y, z])


@dataclass(frozen=True)
class Point(TaskSpec):
    """Place of a frame, or of a point fixed to it.

    Entries are "x", "y" and "z", world axes. At a few knots it is a via-point; with bounds it is a box.

    Attributes:
        frame: name of a link, merged ones too, or of a body, as in `dojo.Kinematics`; of a body, its centre of mass.
        target: (3,) place, or one row per knot [m] (default the origin of the world).
        offset: (3,) of the point from the origin of the frame, in its axes [m] (default zero).
    """

    frame: str
    target: ArrayLike = 0.0
    offset: ArrayLike = (0.0, 0.0, 0.0)

    __repr__ = TaskSpec.__repr__

    def _bound(self, sim: Simulator, knots: Integers) -> tuple[Quantity, Integers, ArrayLike]:
        frame = frame_on_body("Point", sim, self.frame, self.offset)
        return FramePoses(sim, knots, frame, np.tile(_UNIT, (knots.size, 1))), np.arange(3), self.target


@dataclass(frozen=True)
class Frame(TaskSpec):
    """Place and orientation of a frame; one of them is free where its target is None.

    Entries are "x", "y", "z" in world axes, together "place", and "rx", "ry", "rz", the rotation vector from the target
    in the axes of the target, together "orientation".

    Attributes:
        frame: name of a link, merged ones too, or of a body, as in `dojo.Kinematics`.
        place: (3,) place of the frame, or one row per knot [m] (default None: any).
        orientation: unit quaternion (w, x, y, z) from the axes of the frame to those of the world, or one row per knot
            (default None: any).
        offset: (3,) of the point from the origin of the frame, in its axes [m] (default zero).
    """

    frame: str
    place: ArrayLike | None = None
    orientation: ArrayLike | None = None
    offset: ArrayLike = (0.0, 0.0, 0.0)

    __repr__ = TaskSpec.__repr__

    def _bound(self, sim: Simulator, knots: Integers) -> tuple[Quantity, Integers, ArrayLike]:
        if self.place is None and self.orientation is None:
            raise ValueError("Frame(...): expected place=..., orientation=..., or both")
        if self.orientation is not None and (self.lower is not None or self.upper is not None):
            raise ValueError("Frame(orientation=...): expected no bounds; see Point")
        frame = frame_on_body("Frame", sim, self.frame, self.offset)
        aims = unit_rows("Frame(orientation=...)", _UNIT if self.orientation is None else self.orientation, knots.size)
        parts, targets = [], []
        if self.place is not None:
            given = numbers("Frame(place=...)", self.place)
            if given.shape not in ((3,), (knots.size, 3)):
                raise ValueError(f"Frame(place=...): expected shape (3,) or ({knots.size}, 3), got {given.shape}")
            parts, targets = [0, 1, 2], [np.broadcast_to(given, (knots.size, 3))]
        if self.orientation is not None:
            parts, targets = [*parts, 3, 4, 5], [*targets, np.zeros((knots.size, 3))]
        return FramePoses(sim, knots, frame, aims), np.array(parts), np.concatenate(targets, axis=1)


def unit_rows(call: str, value: ArrayLike, rows: int) -> NDArray[np.float64]:
    """Unit quaternions (rows, 4)."""
    given = numbers(call, value)
    if given.shape not in ((4,), (rows, 4)):
        raise ValueError(f"{call}: expected shape (4,) or ({rows}, 4), got {given.shape}")
    return np.array([checks.quaternion(call, row) for row in np.broadcast_to(given, (rows, 4))])


@dataclass(frozen=True)
class Velocity(TaskSpec):
    """Velocity of a frame: the mean one of the time step before a state, as in `Simulator.maximal`.

    Entries are "x", "y", "z", together "linear", and "rx", "ry", "rz", together "angular", in world axes.

    Attributes:
        frame: name of a link, merged ones too, or of a body, as in `dojo.Kinematics`.
        target: (6,) velocity [m/s] and angular velocity [rad/s], or one row per knot (default zero).
        offset: (3,) of the point from the origin of the frame, in its axes [m] (default zero).
    """

    frame: str
    target: ArrayLike = 0.0
    offset: ArrayLike = (0.0, 0.0, 0.0)

    __repr__ = TaskSpec.__repr__

    def _bound(self, sim: Simulator, knots: Integers) -> tuple[Quantity, Integers, ArrayLike]:
        needs_order_two("Velocity", sim)
        frame = frame_on_body("Velocity", sim, self.frame, self.offset)
        return FrameVelocities(sim, knots, frame), np.arange(6), self.target


def needs_order_two(call: str, sim: Simulator) -> None:
    """Refuse simulators whose states have velocities at nodes."""
    if not sim.mean_over:
        raise ValueError(f"{call}: expected a Simulator of order 2, whose velocities are means, got {sim!r}")


@dataclass(frozen=True)
class CenterOfMass(TaskSpec):
    """Centre of mass of all bodies; entries are "x", "y" and "z", world axes.

    Attributes:
        target: (3,) place, or one row per knot [m] (default the origin of the world).
    """

    target: ArrayLike = 0.0

    __repr__ = TaskSpec.__repr__

    def _bound(self, sim: Simulator, knots: Integers) -> tuple[Quantity, Integers, ArrayLike]:
        return Momenta(sim, knots), np.arange(3), self.target


@dataclass(frozen=True)
class Momentum(TaskSpec):
    """Momentum of all bodies, and angular momentum about their centre of mass: means of the step before a state.

    Entries are "px", "py", "pz", together "linear", and "lx", "ly", "lz", together "angular", in world axes.

    Attributes:
        target: (6,) momentum [kg m/s] and angular momentum [kg m^2/s], or one row per knot (default zero).
    """

    target: ArrayLike = 0.0

    __repr__ = TaskSpec.__repr__

    def _bound(self, sim: Simulator, knots: Integers) -> tuple[Quantity, Integers, ArrayLike]:
        needs_order_two("Momentum", sim)
        return Momenta(sim, knots), np.arange(3, 9), self.target
