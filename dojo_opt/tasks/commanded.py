"""A gait under a velocity command: the reference of a robot that is steered while it walks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.gaits.gait import Gait
from dojo_opt.mpc.moving_reference import SampledReference
from sim.mechanism import checks
from sim.model.state_columns import BaseState
from sim.simulator.simulator import Simulator
from solvers.types import Matrix, Vector

Maker = Callable[[Simulator, Vector], Gait]

__all__ = ["CommandedGait", "SteeredGait"]

_FINE = 8  # rows of the reference per knot
_SAME = 1e-3  # [m/s, rad/s] commands this near to each other are one
_ROUNDING = 1e-9  # of a period: times are sums of floating-point steps


class _Stride:
    """One period of a gait at one command, from the origin, heading along x."""

    def __init__(self, sim: Simulator, make: Maker, command: Vector) -> None:
        fine = make(sim.replace(time_step=sim.time_step / _FINE), command)
        self.period = float(fine.time[-1])
        self.move = _Place.of(fine.x[-1]).seen_from(_Place.of(fine.x[0]))
        self._sim = sim
        self._rows = SampledReference(fine.time, _Place.of(fine.x[0]).back().carry(sim, fine.x), sim)
        torque = make(sim, command).torques()
        held = np.vstack([torque, torque[:1]])
        self.torque = SampledReference(sim.time_step * np.arange(len(held)), held, cycle=np.zeros(sim.nu))

    def place(self, phase: float) -> _Place:
        """Where the base is at a time of the period."""
        return _Place.of(self._rows([phase])[0])

    def states(self, phase: Vector) -> Matrix:
        """(n, nx) states at times of the period, with the velocities that states of the model have."""
        sim, before = self._sim, phase - self._sim.time_step
        if not sim.mean_over:
            return self._rows(phase)
        early = before < 0.0
        x, then = self._rows(phase), self._rows(np.where(early, before + self.period, before))
        then[early] = self.move.back().carry(sim, then[early])
        x[:, sim.nq :] = sim.difference(x, then)[:, : sim.nv] / sim.time_step
        return x


class _Place:
    """A place and a heading in the plane, and the motion that leads there from the origin."""

    def __init__(self, at: complex, heading: float) -> None:
        self.at, self.heading = at, heading

    @classmethod
    def of(cls, x: Vector) -> _Place:
        """Place of the base of a state (nx,)."""
        w, a, b, d = x[BaseState.QUATERNION]
        return cls(complex(*x[:2]), float(np.arctan2(2.0 * (w * d + a * b), 1.0 - 2.0 * (b * b + d * d))))

    def then(self, other: _Place) -> _Place:
        """This motion, and from there the other one."""
        return _Place(self.at + other.at * np.exp(1j * self.heading), self.heading + other.heading)

    def back(self) -> _Place:
        """The motion that undoes this one."""
        return _Place(-self.at * np.exp(-1j * self.heading), -self.heading)

    def seen_from(self, other: _Place) -> _Place:
        """The motion from another place to this one."""
        return other.back().then(self)

    def times(self, count: float) -> _Place:
        """This motion, repeated."""
        turn = np.exp(1j * self.heading)
        straight = abs(turn - 1.0) < 1e-12
        far = count if straight else (1.0 - np.exp(1j * self.heading * count)) / (1.0 - turn)
        return _Place(self.at * far, self.heading * count)

    def carry(self, sim: Simulator, x: Matrix) -> Matrix:
        """(n, nx) states of a robot on a floating base, carried along."""
        out, turn = x.copy(), np.exp(1j * self.heading)
        for first, moved in ((0, self.at), (sim.nq, 0.0)):
            place = (x[:, first] + 1j * x[:, first + 1]) * turn + moved
            out[:, first], out[:, first + 1] = place.real, place.imag
        c, s = np.cos(0.5 * self.heading), np.sin(0.5 * self.heading)
        w, a, b, d = x[:, BaseState.QUATERNION].T
        out[:, BaseState.QUATERNION] = np.stack([c * w - s * d, c * a - s * b, c * b + s * a, c * d + s * w], axis=1)
        return out


class CommandedGait:
    """States and torques over time of a gait that moves at a commanded velocity, period after period.

    Args:
        sim: simulator of the model, whose time step divides the period.
        make: function of (simulator, command) -> Gait of one period.
        command: (3,) velocity of the base forward and to the left, and rate of its heading [m/s, m/s, rad/s].
        place: (3,) where the base begins, x and y [m], and its heading [rad] (default: at the origin, along x).

    Raises:
        ValueError: for an argument of the wrong shape, or a command that the legs cannot follow.
    """

    def __init__(self, sim: Simulator, make: Maker, command: ArrayLike, place: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        self._sim, self._make = sim, make
        x, y, heading = checks.array("legged_mpc(place=...)", place, (3,)).tolist()
        self._first = _Place(complex(x, y), heading)
        self.begin(checks.array("legged_mpc(velocity=...)", command, (3,)))

    def begin(self, command: Vector) -> None:
        """Begin at the first place, at time zero.

        Args:
            command: (3,) command.
        """
        self.command, self._time, self._origin = command, 0.0, self._first
        self._stride = _Stride(self._sim, self._make, command)

    def _lap(self, times: ArrayLike) -> tuple[Vector, Vector]:
        """Number of the period, and the time in it [s]."""
        t, period = np.asarray(times, dtype=np.float64) - self._time, self._stride.period
        lap = np.floor(t / period + _ROUNDING)
        return lap, np.clip(t - lap * period, 0.0, period)

    def __call__(self, times: ArrayLike) -> Matrix:
        """The states.

        Args:
            times: (n,) times [s].

        Returns:
            (n, nx) states.
        """
        lap, phase = self._lap(times)
        x = self._stride.states(phase)
        for number in np.unique(lap):
            here = lap == number
            x[here] = self._origin.then(self._stride.move.times(number)).carry(self._sim, x[here])
        return x

    def torques(self, times: ArrayLike) -> Matrix:
        """The torques by inverse dynamics.

        Args:
            times: (n,) times [s].

        Returns:
            (n, nu) inputs [N, N m].
        """
        return self._stride.torque(np.asarray(times, dtype=np.float64) - self._time)


class SteeredGait(CommandedGait):
    """A gait under a command that changes; each horizon takes the command at its beginning for its whole length.

    Place, heading and phase of the reference go on where the command changes.

    Args:
        sim: simulator of the model, whose time step divides the period.
        make: function of (simulator, command) -> Gait of one period.
        command: function of a time [s] -> (3,) command, see `CommandedGait`.
        place: (3,) where the base begins, see there.

    Raises:
        ValueError: for an argument of the wrong shape, or a command that the legs cannot follow.
    """

    def __init__(
        self,
        sim: Simulator,
        make: Maker,
        command: Callable[[float], ArrayLike],
        place: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        self._function, self._now = command, 0.0
        super().__init__(sim, make, command(0.0), place)

    def reset(self) -> None:
        """Begin anew, at the first place with the command of time zero."""
        command, self._now = self._asked(0.0), 0.0
        if self._time != 0.0 or np.any(command != self.command):
            self.begin(command)

    def _asked(self, time: float) -> Vector:
        """The command (3,) of a time."""
        return checks.array("legged_mpc(velocity=function)", self._function(time), (3,))

    def anchor(self, time: float, x: Vector) -> None:
        """Take the command of a time.

        Args:
            time: beginning of the horizon [s].
            x: (nx,) state there, which is not needed.
        """
        del x
        command = self._asked(time)
        if time < self._now:
            self.begin(command)
        elif np.abs(command - self.command).max() > _SAME:
            lap, phase = (float(part[0]) for part in self._lap([time]))
            old, new = self._stride, _Stride(self._sim, self._make, command)
            here = self._origin.then(old.move.times(lap)).then(old.place(phase))
            self._origin = here.then(new.place(phase).back())
            self.command, self._stride, self._time = command, new, time - phase
        self._now = time
