"""SuiteTask: a task of a published suite: controller, plant, starts, and the criterion of success."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dojo_opt.cost import ResidualCost, Tracking
from dojo_opt.mpc.controller import MPC
from dojo_opt.mpc.servo import ModelServo
from dojo_opt.planning.same_robot import check_same_robot
from dojo_opt.plant.closed_loop import ClosedLoop, closed_loop
from dojo_opt.plant.plant import Plant
from dojo_opt.plant.tick import milliseconds
from sim.mechanism.checks import shown, whole_number
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.overlaps import overlaps
from sim.mechanism.short_repr import short_repr
from sim.mechanism.stance import gaps
from sim.simulator.simulator import Simulator
from solvers.types import Vector

__all__ = ["TaskOutcome", "SuiteTask", "held", "lifted", "quadratic", "servo_effort", "timed"]

_CLEAR = 1e-6  # [m] between a lifted start and the obstacle around it
_DRAWS = 1000  # of a perturbed start
_RAISED = 3  # times that a start is lifted: the coordinate may raise the deepest contact by less than its own change


class TaskOutcome(NamedTuple):
    """How a run of a task ended.

    Attributes:
        success: whether it lasted to its end and achieved the aim of the task.
        measures: numbers that decide it, by name with unit.
        tick_median_ms: median of the processor times of the ticks [ms].
        tick_99_ms: 99th percentile of them [ms].
        penetration: largest depth of a contact [m].
        fallbacks: ticks whose plan was rejected.
    """

    success: bool
    measures: dict[str, float]
    tick_median_ms: float
    tick_99_ms: float
    penetration: float
    fallbacks: int


@dataclass(frozen=True)
class SuiteTask:
    """A task of a published suite.

    Attributes:
        name: name of the task.
        mpc: the controller.
        model: simulator of the plant: mechanism, time step and smoothing.
        start: (nx,) first state.
        duration: length of a run [s].
        spread: (ndx,) largest change of each component of a perturbed start [m, rad, m/s, rad/s].
        judge: function of a run that returns (whether it is a success, the numbers that decide it by name).
        rate: rate at which the publication replans [Hz].
        rise: coordinate that lifts a start out of the ground (default None: starts are taken as they are).
        lost: function of a state that returns whether a run has failed there, which ends it (default None: none has).
        finished: function of (time [s], state) that returns whether the aim is achieved, which ends a run (default
            None: runs last their duration).
    """

    name: str
    mpc: MPC
    model: Simulator
    start: Vector
    duration: float
    spread: Vector
    judge: Callable[[ClosedLoop], tuple[bool, dict[str, float]]] = field(repr=False)
    rate: float = 0.0
    rise: int | None = None
    lost: Callable[[Vector], bool] | None = field(default=None, repr=False)
    finished: Callable[[float, Vector], bool] | None = field(default=None, repr=False)

    __repr__ = short_repr

    def initial_state(self, seed: int | None = None) -> Vector:
        """A first state.

        Args:
            seed: seed of a random change within `spread` (default None: no change).

        Returns:
            (nx,) state, lifted out of the ground by the coordinate `rise`. A random change is drawn again while shapes
            overlap: hard contact has no such state, and throws its bodies apart.

        Raises:
            ValueError: for a seed out of range, or a spread within which shapes overlap almost everywhere.
        """
        if seed is None:
            return self._raised(self.start)
        generator = np.random.default_rng(whole_number("SuiteTask.initial_state(seed)", seed, 0))
        for _ in range(_DRAWS):
            dx = self.spread * generator.uniform(-1.0, 1.0, self.spread.size)
            x = self._raised(self.model.integrate(self.start, dx))
            if not overlaps(self.model.mechanism, x[: self.model.nq]):
                return x
        raise ValueError(f"{self.name}: shapes overlap in each of {_DRAWS} starts within the spread")

    def _raised(self, x: Vector) -> Vector:
        """The state x (nx,) out of the ground."""
        return x if self.rise is None else lifted(self.model, x, self.rise)

    def plant(self, seed: int | None = None, **perturbation: Any) -> Plant:
        """The plant of the task.

        Args:
            seed: seed of its start (default None: the given one).
            **perturbation: fields of `dojo.Perturbation` by name.

        Returns:
            The plant.

        Raises:
            TypeError: for an unknown field.
            ValueError: for an argument out of range.
        """
        return Plant(self.model, self.initial_state(seed), **perturbation)

    def run(self, seed: int | None = None, plant: Plant | None = None, seconds: float | None = None) -> ClosedLoop:
        """Run the task in closed loop.

        Args:
            seed: seed of the start (default None: the given one); not with a plant, which has its own start.
            plant: another plant (default None: that of `plant(seed)`).
            seconds: length of the run [s] (default None: that of the task).

        Returns:
            The record of the run.

        Raises:
            ValueError: for an argument out of range, or both a seed and a plant.
            Interrupted: after Ctrl-C, a KeyboardInterrupt; its `result` is the run so far.
        """
        if seed is not None and plant is not None:
            raise ValueError(
                "SuiteTask.run(seed=..., plant=...): expected one of them; use plant=task.plant(seed, ...)"
            )
        plant = self.plant(seed) if plant is None else plant
        duration = self.duration if seconds is None else seconds
        return closed_loop(self.mpc, plant, duration, fallen=self.lost, finished=self.finished)

    def outcome(self, loop: ClosedLoop) -> TaskOutcome:
        """How a run ended. One that is shorter than the task, and has not achieved its aim before, is no success.

        Args:
            loop: a run of this task.

        Returns:
            Its outcome.

        Raises:
            TypeError: for anything but a ClosedLoop.
            ValueError: for a run of a robot with other coordinates than those of the task.
        """
        if not isinstance(loop, ClosedLoop):
            raise TypeError(f"SuiteTask.outcome(loop): expected a ClosedLoop, as from run(), got {shown(loop)}")
        expected = f"SuiteTask.outcome(loop): expected a run of {self.name!r}"
        check_same_robot(expected, self.model, loop.simulator, loop.x)
        done, measures = self.judge(loop)
        ms = milliseconds(loop.log, cpu=True)
        times = (float(np.median(ms)), float(np.percentile(ms, 99))) if ms.size else (np.nan, np.nan)
        depth = max(0.0, -float(loop.contacts.gap.min(initial=np.inf)))
        lasted = loop.duration > self.duration - 0.5 * self.model.time_step
        early = self.finished is not None and self.finished(loop.duration, loop.x[-1])
        fallbacks = sum(tick.fallback for tick in loop.log)
        return TaskOutcome(loop.survived and done and (lasted or early), measures, *times, depth, fallbacks)


def timed(rate: float) -> dict[str, Any]:
    """Settings of `dojo.MPC` for a rate of plans that take one tick to compute.

    Args:
        rate: plans per second [Hz].

    Returns:
        `period`, `computation` and `patience`.
    """
    return {"period": 1.0 / rate, "computation": 1.0 / rate, "patience": 3}


def quadratic(
    reference: ArrayLike, dt: float, horizon: int, running: Sequence[ArrayLike], end: Sequence[ArrayLike]
) -> Tracking:
    """dt sum_t [dq' Qq dq + dv' Qv dv] over all knots but the last, and dq' Qfq dq + dv' Qfv dv there.

    Args:
        reference: (nx,) state.
        dt: length of a knot [s].
        horizon: number T of knots.
        running: (Qq, Qv), each a number or (nv,).
        end: (Qfq, Qfv), likewise.

    Returns:
        The cost.
    """
    size = max(np.size(w) for w in (*running, *end))
    rows = [np.concatenate([np.broadcast_to(w, (size,)) for w in pair]) for pair in (running, end)]
    return Tracking(reference, np.vstack([np.tile(dt * rows[0], (horizon, 1)), rows[1]]))


def servo_effort(
    sim: Simulator, own: Mechanism, weight: ArrayLike, horizon: int, reference: ArrayLike = 0.0
) -> ResidualCost:
    """sum_t (tau_t - r)' R (tau_t - r) of the forces tau = u - kp (q - rest) - kd v of servos in the model.

    Args:
        sim: simulator of a model whose driven joints have springs and dampers.
        own: mechanism of the robot, without them.
        weight: R, a number or (nu,) [1/N^2, 1/(N m)^2].
        horizon: number T of knots.
        reference: r, a number or (nu,) [N, N m] (default 0).

    Returns:
        The cost.
    """
    servo, wanted = ModelServo(sim, own), np.array(np.broadcast_to(reference, (sim.nu,)), dtype=np.float64)
    kp, kd, rest, nu, ndx = servo.kp, servo.kd, servo.rest, sim.nu, sim.ndx
    place, velocity, dof, nv = servo.place, servo.velocity, servo.dof, sim.nv

    def force(x, u, out):  # type: ignore[no-untyped-def]
        for i in range(nu):
            out[i] = u[i] - kp[i] * (x[place[i]] - rest[i]) - kd[i] * x[velocity[i]] - wanted[i]

    def slope(x, u, out):  # type: ignore[no-untyped-def]
        for i in range(nu):
            out[i, :] = 0.0
            out[i, dof[i]] = -kp[i]
            out[i, nv + dof[i]] = -kd[i]
            out[i, ndx + i] = 1.0

    return ResidualCost(force, nu, weight, slope, knots=range(horizon))


def held(loop: ClosedLoop, fulfilled: NDArray[np.bool_]) -> float:
    """Longest time for which a condition holds.

    Args:
        loop: a run.
        fulfilled: (N + 1,) whether it does, by state.

    Returns:
        The time [s].
    """
    best = count = 0
    for ok in fulfilled:
        count = count + 1 if ok else 0
        best = max(best, count)
    return max(0, best - 1) * loop.simulator.time_step


def lifted(model: Simulator, x: Vector, rise: int) -> Vector:
    """The state with one coordinate raised until no contact is in the ground.

    Args:
        model: simulator of the plant.
        x: (nx,) state.
        rise: number of the coordinate [m].

    Returns:
        (nx,) state.
    """
    for _ in range(_RAISED):
        depth = -float(gaps(model.mechanism, x[: model.nq]).min(initial=np.inf))
        if depth <= 0.0:
            return x
        dx = np.zeros(model.ndx)
        dx[rise] = depth + _CLEAR
        x = model.integrate(x, dx)
    return x
