"""Plan: the result of `ilqr`, and the history of its iterations."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from dojo_opt.planning.options import Options
from dojo_opt.planning.problem import REPLAY_ACCURACY
from dojo_opt.planning.term import check_order
from sim import drawn
from sim.mechanism import checks
from sim.mechanism.checks import whole_number
from sim.mechanism.short_repr import short_table
from sim.simulator.motion_file import archived, export, opened, restored
from sim.simulator.npz_file import check_head, check_shapes, reading, write_npz
from sim.simulator.results import FeedbackRollout
from sim.simulator.simulator import Simulator
from solvers.status import Status
from solvers.types import Matrix, Stack, Vector

__all__ = ["History", "Plan"]

COLUMNS = ("iter", "cost", "merit", "|grad|", "k_eval", "k_grad", "mu", "alpha", "gap", "viol", "ms")
HEADER = "{:>4} {:>11} {:>11} {:>8} {:>7} {:>7} {:>7} {:>8} {:>7} {:>7} {:>6}".format(*COLUMNS)


RECORDED = (
    *("iteration", "cost", "merit", "gradient", "kappa_eval", "kappa_grad"),
    *("mu", "alpha", "gap", "violation", "milliseconds"),
)


SAVED: dict[str, Any] = {  # fields in the head of a file
    **{"success": bool, "status": int, "message": str, "nit": int, "fun": float, "violation": float, "gap": float},
    **{"seconds": float, "time_step": float, "substeps": int, "history": list},
}


def _check_arrays(sim: Simulator, meta: dict[str, Any], data: dict[str, Any]) -> None:
    """Refuse a file whose arrays or records do not fit one another, or its simulator."""
    check_shapes(data, {"x": (None, None), "u": (None, None), "K": (None, None, None)})
    (knots, nu), ndx = data["u"].shape, data["K"].shape[2]
    nx = data["x"].shape[1] if sim is None else sim.nx
    if sim is not None:
        nu, ndx = sim.nu, sim.ndx
    shapes = {"x": (knots + 1, nx), "u": (knots, nu), "K": (knots, nu, ndx), "k": (knots, nu)}
    shapes |= {"stride": (ndx,)} if "stride" in data else {}
    parts = ("multiplier_", "penalty_")
    check_shapes(data, {**shapes, **{name: (None, None) for name in data if name.startswith(parts)}})
    for name in shapes:
        checks.array(name, data[name], shapes[name])
    if "control_limits" in data:
        check_shapes(data, {"control_limits": (2, nu)})  # infinite ones are none
        lower, upper = data["control_limits"]
        check_order("control_limits", lower, upper, [lower, upper])
    for record in meta["history"]:
        if not all(isinstance(record[name], int | float) for name in RECORDED):
            raise ValueError(f"a record of the history: {checks.shown(record)}")


def table_line(record: dict[str, Any]) -> str:
    """One aligned line of the table of iterations, below its note; alpha is "-" when the line search failed."""
    r = record
    note = f"     {r['note']}\n" if "note" in r else ""
    alpha = f"{r['alpha']:8.2g}" if r["alpha"] > 0.0 else f"{'-':>8}"
    return (
        f"{note}{r['iteration']:4d} {r['cost']:11.5g} {r['merit']:11.5g} {r['gradient']:8.1e} {r['kappa_eval']:7.0e} "
        f"{r['kappa_grad']:7.0e} {r['mu']:7.0e} {alpha} {r['gap']:7.0e} {r['violation']:7.0e} {r['milliseconds']:6.2f}"
    )


@dataclass(repr=False)
class Plan:
    """A planned trajectory with its feedback; fields as in scipy's OptimizeResult where they mean the same.

        u(x) = u_t + K_t (x (-) x_t)

    If the start of the problem is free and its end is the start again (`Periodic`), K is periodic, too: see `repeated`.

    Attributes:
        success: whether the plan is solved: converged, consistent, and within its constraints.
        status: reason for the end of the solve.
        message: the reason as a sentence.
        nit: number of iterations, those whose line search failed included.
        fun: cost, without the terms of the constraints.
        x: (T + 1, nx) states.
        u: (T, nu) inputs [N, N m].
        K: (T, nu, ndx) gains.
        k: (T, nu) step that the last backward pass still proposed [N, N m].
        violation: largest violation of a constraint [unit of its residual].
        gap: largest gap of the dynamics [m, rad, m/s, rad/s].
        seconds: wall time of the solve [s].
        time_step: time step of the simulator [s].
        substeps: number of time steps per knot.
        stride: (ndx,) displacement over one period of a periodic motion (default None: not periodic).
        history: one record per iteration: iteration, cost, merit, gradient, kappa_eval, kappa_grad, mu, alpha, gap,
            violation, milliseconds, predicted (decrease of the merit), and a note where the table has one.
        multipliers: one (m, d) array per constraint.
        penalties: likewise.
        problem: the Problem; not saved.
        simulator: the simulator (default None: that of the problem).
        control_limits: (lower, upper), (nu,) each [N, N m], within which `replay` stays (default None: those of the
            problem, or of the inputs of the mechanism).
    """

    success: bool
    status: Status
    message: str
    nit: int
    fun: float
    x: Matrix
    u: Matrix
    K: Stack
    k: Matrix
    violation: float
    gap: float
    seconds: float
    time_step: float
    substeps: int
    stride: Matrix | None = None
    history: list[dict[str, Any]] = field(default_factory=list)
    multipliers: list[Matrix] = field(default_factory=list)
    penalties: list[Matrix] = field(default_factory=list)
    problem: Any = None
    simulator: Any = None
    control_limits: tuple[Vector, Vector] | None = None

    def __post_init__(self) -> None:
        if self.simulator is None and self.problem is not None:
            self.simulator = self.problem.sim
        if self.control_limits is None and self.problem is not None:
            self.control_limits = self.problem.control_limits

    def __repr__(self) -> str:
        return (
            f"Plan({self.status.name}, {self.nit} iterations, cost {self.fun:.6g}, x {self.x.shape}, u {self.u.shape})"
        )

    def _repr_html_(self) -> str:
        rows = [[r[name] for name in RECORDED] for r in self.history]
        return drawn(self) + short_table(self.closing_line(), COLUMNS, rows)

    @property
    def time(self) -> Matrix:
        """(T + 1,) times of the knots [s]."""
        return np.arange(float(len(self.x))) * (self.time_step * self.substeps)

    def repeated(self, count: int) -> Plan:
        """The motion of a periodic plan several times in a row, with its gains.

        Args:
            count: number of cycles.

        Returns:
            The plan of all cycles: `fun` is their cost. It has neither multipliers nor penalties.

        Raises:
            ValueError: the plan is not periodic, or was loaded from a file and has no simulator.
        """
        n = whole_number("Plan.repeated(count)", count)
        if self.stride is None or self.simulator is None:
            lacking = "a periodic plan (Periodic)" if self.stride is None else "a plan with its simulator"
            raise ValueError(f"Plan.repeated: expected {lacking}")
        cycles = [self.simulator.integrate(self.x[min(i, 1) :], i * self.stride) for i in range(n)]
        u, K, k = (np.concatenate([part] * n) for part in (self.u, self.K, self.k))
        x, fun = np.concatenate(cycles), n * self.fun
        return replace(self, x=x, u=u, K=K, k=k, stride=n * self.stride, fun=fun, multipliers=[], penalties=[])

    def replay(
        self, *, accuracy: float | None = None, kappa: float | None = None, time_step: float | None = None
    ) -> FeedbackRollout:
        """The plan under its own gains, each knot simulated to an accuracy or with another time step, its input held.

        To an accuracy, impacts happen at their own times, not at those of the plan's steps. States of such a simulator
        have the velocities of nodes, so that of the first state is converted. The gains compare the others with the
        plan's mean velocities, for which they were made.

        With a time step, kappa keeps its ratio to it. The force of a contact is kappa/(gap h): with the kappa of the
        plan a step of a fifth would have contacts that are five times as soft, for which its gains were not made.

        Args:
            accuracy: error of the joint coordinates per second of motion [m/s, rad/s], see `Simulator` (default None:
                1e-5 without a time step).
            kappa: central-path parameter [N s m] (default None: that of the plan's simulator, or less if the accuracy
                needs it; with a time step, in proportion to it).
            time_step: time step of the replay; a knot is a whole number of them [s] (default None: an accuracy).

        Returns:
            FeedbackRollout with the solved knots, one state per knot; with an accuracy, with velocities at the nodes.

        Raises:
            ValueError: for a plan without a simulator, an accuracy that its mechanism does not have, a time step beside
                an accuracy, or one that does not divide a knot.
        """
        sim, steps = self.simulator, 1
        if sim is None:
            raise ValueError("Plan.replay: expected a plan with its simulator")
        limits = sim.mechanism.input_limits if self.control_limits is None else self.control_limits
        smoothing = {} if kappa is None else {"kappa": kappa}
        if time_step is None:
            error = REPLAY_ACCURACY if accuracy is None else accuracy
            error = checks.number("Plan.replay(accuracy=...)", error, above=0.0)
            shot = sim.replace(time_step=self.time_step * self.substeps, order=2, accuracy=error, **smoothing)
            start = self._start(sim)
        else:
            steps = self._steps_per_knot(time_step, accuracy)
            smoothing = smoothing or {"kappa": sim.kappa * time_step / self.time_step}
            shot, start = sim.replace(time_step=time_step, **smoothing), self.x[0]
        found = shot.rollout_feedback(start, self.u, xs=self.x, Ks=self.K, substeps=steps, limits=limits)
        return cast(FeedbackRollout, found)

    def _steps_per_knot(self, time_step: float, accuracy: float | None) -> int:
        """Steps per knot of a replay with a time step, which is checked."""
        call = "Plan.replay(time_step=...)"
        h = checks.number(call, time_step, above=0.0)
        if accuracy is not None or self.simulator.accuracy is not None:
            raise ValueError(f"{call}: expected no accuracy beside it, neither here nor of the plan's simulator")
        knot = self.time_step * self.substeps
        steps = round(knot / h)
        if steps < 1 or abs(steps * h - knot) > 1e-9 * knot:
            near = knot / max(round(knot / h), 1)
            raise ValueError(f"{call}: expected a whole part of the knot of {knot:g} s, such as {near:.12g}, got {h:g}")
        return steps

    def _start(self, sim: Simulator) -> Vector:
        """(nx,) the first state, with the velocity at its node: the mean of those over the steps before and after.

        `Simulator.velocity` is the one before the ground acts there: half a step of falling for a robot that stands.
        """
        if sim.order > 2 or sim.accuracy is not None:
            return self.x[0]
        after = sim.step(self.x[0], self.u[0]).x[sim.nq :]
        return np.concatenate([self.x[0, : sim.nq], 0.5 * (self.x[0, sim.nq :] + after)])

    def summary(self) -> str:
        """The table of iterations and a closing line.

        Returns:
            Text of several lines.
        """
        lines = [HEADER, *(table_line(r) for r in self.history)]
        return "\n".join([*lines, self.closing_line()])

    def closing_line(self) -> str:
        """The end of the solve in one line.

        Returns:
            Status, message, iterations, cost, violation, gap and time.
        """
        return (
            f"{self.status.name}: {self.message} {self.nit} iterations, cost {self.fun:.6g}, violation "
            f"{self.violation:.1e}, gap {self.gap:.1e}, {1e3 * self.seconds:.1f} ms"
        )

    def save(self, path: str | Path) -> None:
        """Write all fields but the problem to a file, with the simulator, in a format of dojo-opt without pickles.

        Args:
            path: path of the file; NumPy appends .npz to a name without it.

        Raises:
            OSError: the file cannot be written.
        """
        head, arrays = archived(self.simulator if isinstance(self.simulator, Simulator) else None, "plan")
        arrays |= {name: getattr(self, name) for name in ("x", "u", "K", "k")}
        arrays |= {} if self.stride is None else {"stride": self.stride}
        arrays |= {} if self.control_limits is None else {"control_limits": np.array(self.control_limits)}
        arrays |= {f"multiplier_{i}": a for i, a in enumerate(self.multipliers)}
        arrays |= {f"penalty_{i}": a for i, a in enumerate(self.penalties)}
        meta = {name: getattr(self, name) for name in SAVED} | {"status": int(self.status)}
        write_npz("Plan.save(path)", path, head | meta, arrays)

    @classmethod
    def load(cls, path: str | Path) -> Plan:
        """Read a file that `save` wrote.

        Args:
            path: path of the file.

        Returns:
            The plan with its simulator, without a problem.

        Raises:
            OSError: the file cannot be read.
            ValueError: it is another file, or of a later version.
        """
        call = "Plan.load"
        meta, data = opened(call, path, "plan")
        with reading(call, path, "plan"):
            sim = restored(meta, data)
            check_head(meta, SAVED)
            _check_arrays(sim, meta, data)
            meta["status"] = Status(meta["status"])
            count = sum(name.startswith("multiplier_") for name in data)
            multipliers = [data[f"multiplier_{i}"] for i in range(count)]
            penalties = [data[f"penalty_{i}"] for i in range(count)]
            arrays = {name: data[name] for name in ("x", "u", "K", "k", "stride") if name in data}
            plan = cls(**meta, **arrays, multipliers=multipliers, penalties=penalties, simulator=sim)
        if "control_limits" in data:
            plan.control_limits = data["control_limits"][0], data["control_limits"][1]
        return plan

    def export(self, path: str | Path) -> None:
        """Write the motion for other tools.

        Args:
            path: path of the file. With the suffix .csv a table with named columns, of times, coordinates, velocities
                and inputs; .npz these as arrays; .json the motion of the hinges and slides by their names, as in
                trajectory_msgs/JointTrajectory of ROS.

        Raises:
            OSError: the file cannot be written.
            ValueError: for another suffix, or a plan without a simulator.
        """
        if self.simulator is None:
            raise ValueError("Plan.export: expected a plan with its simulator")
        export("Plan.export(path)", path, self.simulator, self.time, self.x, self.u)


class History:
    """The record of all iterations of a solve, its printed table, and its budget."""

    def __init__(self, options: Options) -> None:
        self._options = options
        self.reset()

    def reset(self, began: float | None = None) -> None:
        """Forget the last solve and start the clock; began: `time.perf_counter()` when it was started elsewhere."""
        self._tick = time.perf_counter()
        self.began = self._tick if began is None else began
        self.records: list[dict[str, Any]] = []
        self._note = ""
        self._headed = False

    def budget(self) -> Status | None:
        """The limit that was reached; None while iterations and time are left."""
        if len(self.records) >= self._options.max_iterations:
            return Status.MAX_ITERATIONS
        if time.perf_counter() - self.began >= self._options.time_limit:
            return Status.TIME_LIMIT
        return None

    def note(self, text: str) -> None:
        """Put a line of text into the table, before the next iteration."""
        self._note = text
        self._say(f"     {text}")

    def _say(self, line: str) -> None:
        """Print a line of the table, the first one below the header."""
        if not self._headed:
            self._options.say(HEADER)
        self._headed = True
        self._options.say(line)

    def add(self, **record: Any) -> bool:
        """Record an iteration, print it, call back; True when the callback wants to stop."""
        tock = time.perf_counter()
        record = {"iteration": len(self.records) + 1, **record, "milliseconds": 1e3 * (tock - self._tick)}
        self._tick = tock
        if self._options.verbose:
            self._say(table_line(record))
        self.records.append(record | {"note": self._note} if self._note else record)
        self._note = ""
        if self._options.callback is not None:
            try:
                self._options.callback(record)
            except StopIteration:
                return True
        return False
