"""Moving references: the states and inputs that a receding horizon tracks, as functions of time."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from types import MethodType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.planning.component_names import chosen_components
from dojo_opt.planning.problem import Problem
from dojo_opt.planning.same_robot import check_same_robot
from dojo_opt.planning.term import PickTerm, StateTerm
from dojo_opt.plant.ground_plane import GroundPlane
from sim.mechanism import checks
from sim.simulator.simulator import Simulator
from solvers.types import Integers, Matrix, Vector

Moving = Callable[[Any], ArrayLike]  # times (n,) [s] -> rows (n, nx) or (n, nu)

_ROUNDING = 1e-9  # laps: times are sums of floating-point steps

__all__ = ["AnchoredReference", "References", "SampledReference", "own_reference"]


def _check_space(call: str, sim: Any) -> None:
    """Refuse what has no states."""
    if not all(hasattr(sim, name) for name in ("nx", "ndx", "integrate", "difference")):
        raise TypeError(f"{call}: expected a Simulator, got {checks.shown(sim)}")


class SampledReference:
    """A trajectory as a function of time: interpolated between its rows, constant after the last one.

    Rows that are states of a simulator are interpolated on their manifold. With a `cycle`, the trajectory is periodic:
    its last row is its first one, displaced by the cycle, and it has neither beginning nor end.

    Args:
        time: (n,) increasing times of the rows [s], n >= 2.
        rows: (n, nx) states, or (n, width) other numbers.
        sim: simulator of the states (default None: the rows are any numbers).
        cycle: (ndx,) change of the state over one period, such as the advance of a gait, or (width,) change of other
            rows (default None: no period).

    Raises:
        ValueError: for times that do not increase, a wrong shape, or a number that is not finite.
    """

    def __init__(
        self, time: ArrayLike, rows: ArrayLike, sim: Simulator | None = None, cycle: ArrayLike | None = None
    ) -> None:
        if sim is not None:
            _check_space("SampledReference(sim=...)", sim)
        self.time = checks.array("SampledReference(time)", time, (None,))
        width = None if sim is None else sim.nx
        self.rows = checks.array("SampledReference(rows)", rows, (len(self.time), width))
        if len(self.time) < 2 or np.any(np.diff(self.time) <= 0.0):
            raise ValueError("SampledReference(time): expected at least two increasing times")
        self._sim = sim
        self._steps = np.diff(self.rows, axis=0) if sim is None else sim.difference(self.rows[1:], self.rows[:-1])
        size = self.rows.shape[1] if sim is None else sim.ndx
        self.cycle = None if cycle is None else checks.array("SampledReference(cycle=...)", cycle, (size,))
        self._one_move = sim is not None and self.cycle is not None and self._commutes(sim, self.cycle)

    def _commutes(self, sim: Simulator, cycle: Vector) -> bool:
        """Whether the cycle does not turn anything: then it can be added to the step between two rows."""
        before, steps = self.rows[:-1], self._steps
        apart = sim.integrate(sim.integrate(before, steps), cycle)
        return bool(np.abs(apart - sim.integrate(before, steps + cycle)).max() < 1e-12)

    def __call__(self, times: ArrayLike) -> Matrix:
        """The trajectory at given times.

        Args:
            times: (n,) times [s].

        Returns:
            (n, nx) states, or (n, width) numbers.
        """
        t = np.atleast_1d(np.asarray(times, dtype=np.float64))
        first, last = self.time[0], self.time[-1]
        laps = np.zeros(len(t))
        if self.cycle is not None:
            laps = np.floor((t - first) / (last - first) + _ROUNDING)
            t = t - laps * (last - first)
        at = np.clip(t, first, last)
        i = np.clip(np.searchsorted(self.time, at, side="right") - 1, 0, len(self.time) - 2)
        f = ((at - self.time[i]) / (self.time[i + 1] - self.time[i]))[:, None]
        before, step = self.rows[i], f * self._steps[i]
        if self._sim is None:
            return before + step if self.cycle is None else before + step + laps[:, None] * self.cycle
        if self.cycle is None:
            return self._sim.integrate(before, step)
        if self._one_move:
            return self._sim.integrate(before, step + laps[:, None] * self.cycle)
        return self._sim.integrate(self._sim.integrate(before, step), laps[:, None] * self.cycle)

    def with_mean_velocities(self, interval: float) -> SampledReference:
        """The same states with their mean velocities over an interval, such as the time step of a model.

        A finely sampled gait has exact touchdowns, but the velocities of its own short steps.

        Args:
            interval: length of the interval before each row [s].

        Returns:
            The new trajectory.

        Raises:
            ValueError: the trajectory has no simulator or no cycle, velocities of its simulator are no means, or the
                interval is not positive.
        """
        if self._sim is None or self.cycle is None:
            raise ValueError(
                "SampledReference.with_mean_velocities: expected states (sim=...) and a cycle, which give the state "
                "before the first row"
            )
        if not self._sim.mean_over:
            raise ValueError(
                "SampledReference.with_mean_velocities: expected a simulator of order 2 without an accuracy, whose "
                f"velocities are means, got {self._sim!r}; its samples have the velocities of their times"
            )
        sim, h = self._sim, checks.number("SampledReference.with_mean_velocities(interval)", interval, above=0.0)
        then = self(self.time - h)
        rows = self.rows.copy()
        rows[:, sim.nq :] = sim.difference(rows, then)[:, : sim.nv] / h
        return SampledReference(self.time, rows, sim, self.cycle)


class AnchoredReference:
    """A reference anchored at the measured state: a constant velocity, or a ramp that restarts with every plan.

        x(t) = begin + (end - begin) min(s, 1),  s = (t - t0) / duration,  on the manifold

    t0 is the beginning of the present horizon. The `anchored` coordinates begin where the robot is measured at t0, and
    do not stop at the end of the ramp: a constant velocity for ever.

    Args:
        sim: simulator of the model.
        begin: (nx,) first state.
        end: (nx,) state after the duration (default None: the first one).
        duration: length of the ramp [s].
        anchored: numbers below nv, or names as in `Mechanism.components`, of coordinates that begin where they are
            measured (default none).

    Raises:
        ValueError: for an argument of the wrong shape or out of range, or an unknown name.
    """

    def __init__(
        self, sim: Simulator, begin: ArrayLike, end: ArrayLike | None = None, duration: float = 1.0, anchored: Any = ()
    ) -> None:
        _check_space("AnchoredReference(sim)", sim)
        checks.shape("AnchoredReference(anchored=...)", anchored)
        self.begin = checks.array("AnchoredReference(begin)", begin, (sim.nx,))
        self._end = self.begin if end is None else checks.array("AnchoredReference(end=...)", end, (sim.nx,))
        self._duration = checks.number("AnchoredReference(duration=...)", duration, above=0.0)
        self._step = sim.difference(self._end, self.begin)
        self._on = np.zeros(sim.ndx, dtype=bool)
        if np.size(anchored):
            self._on[chosen_components("AnchoredReference(anchored=...)", anchored, sim)] = True
        self._sim = sim
        self.reset()

    def anchor(self, time: float, x: Vector) -> None:
        """Begin anew.

        Args:
            time: beginning of the horizon [s].
            x: (nx,) state there.
        """
        self._t0, sim = time, self._sim
        off = np.where(self._on, sim.difference(np.asarray(x), self.begin), 0.0)
        self._from = sim.integrate(self.begin, off)

    def reset(self) -> None:
        """Forget where the robot was measured."""
        self.anchor(0.0, self.begin)

    def __call__(self, times: ArrayLike) -> Matrix:
        """The target at given times.

        Args:
            times: (n,) times [s].

        Returns:
            (n, nx) states.
        """
        share = (np.asarray(times, dtype=np.float64)[:, None] - self._t0) / self._duration
        share = np.where(self._on, share, np.clip(share, 0.0, 1.0))
        return self._sim.integrate(self._from, share * self._step)


def _owner(function: Any) -> Any:
    """The object that a method belongs to; any other object itself."""
    return function.__self__ if isinstance(function, MethodType) else function


def _moves(owner: Any) -> bool:
    """Whether an object remembers where the robot was."""
    return hasattr(owner, "anchor") and not isinstance(owner, type)


def own_reference(given: Any) -> Any:
    """The same reference for another controller.

    Args:
        given: as of `References`.

    Returns:
        The same, with a copy of each object that is anchored.
    """
    copies: dict[int, Any] = {}

    def own(value: Any) -> Any:
        owner = _owner(value)
        if not _moves(owner):
            return value
        copied = copies.setdefault(id(owner), copy.copy(owner))
        return MethodType(value.__func__, copied) if isinstance(value, MethodType) else copied

    return {key: own(value) for key, value in given.items()} if isinstance(given, Mapping) else own(given)


class References:
    """The costs of a problem whose references move, and the functions that move them.

    A function takes times (n,) [s] and returns rows (n, nx) or (n, nu). A trajectory is an array of rows one knot
    apart, or an object with `x` (n, nx) and `time` (n,), such as a plan. Both start at time zero. If a function has a
    method anchor(time, x), as `AnchoredReference` has, it is called with the beginning of each horizon and the state
    there; a method reset() is called when the controller begins anew. Controllers that are made from another one, as
    by `MPC.fresh`, have a copy of such an object (copy.copy), so `anchor` assigns attributes and writes into none.

    Args:
        problem: the problem; the references of its terms are overwritten.
        given: one function or trajectory for all `Tracking` costs, or {index of a cost: function or trajectory} for
            `Tracking` and `Effort`; None for references that stay.

    Raises:
        ValueError: for a cost without a reference, or rows of the wrong shape.
    """

    def __init__(self, problem: Problem, given: Any) -> None:
        self._h = problem.knot_time
        self._sim = problem.sim
        table = dict(given) if isinstance(given, Mapping) else {}
        if given is not None and not table:
            table = {i: given for i, term in enumerate(problem.costs) if isinstance(term, StateTerm)}
            if not table:
                raise ValueError("MPC(reference=...): the problem has no Tracking cost")
        self._moving: list[tuple[StateTerm | PickTerm, Moving]] = []
        for index, value in table.items():
            call = f"MPC(reference={{{index!r}: ...}})"
            if not isinstance(index, int | np.integer) or not 0 <= index < len(problem.costs):
                raise ValueError(f"{call}: expected the index of a cost, 0 to {len(problem.costs) - 1}")
            term = problem.costs[index]
            if not isinstance(term, StateTerm | PickTerm):
                raise ValueError(f"{call}: the reference of a {term.name} cannot move")
            self._moving.append((term, self._function(call, value, isinstance(term, StateTerm))))
        states = (f for term, f in self._moving if isinstance(term, StateTerm) and not hasattr(f, "anchor"))
        self.state: Moving | None = next(states, None)  # one that is a function of time alone
        self._call_checked(0.0)
        self._begin = np.nan  # [s] of the first knot
        self.plane = GroundPlane()  # at the last move

    def reset(self) -> None:
        """Have objects that are anchored forget where they were."""
        for owner in {id(owner): owner for _, function in self._moving if _moves(owner := _owner(function))}.values():
            if hasattr(owner, "reset"):
                owner.reset()

    @property
    def tracked(self) -> Integers | None:
        """Numbers of the coordinates that the first moving `Tracking` weighs; None if no state moves."""
        term = next((term for term, _ in self._moving if isinstance(term, StateTerm)), None)
        return None if term is None else np.flatnonzero(term.weight[:, : self._sim.nv].any(axis=0))

    def _function(self, call: str, value: Any, of_states: bool) -> Moving:
        if callable(value):
            return value
        if hasattr(value, "x") and hasattr(value, "time"):
            if isinstance(other := getattr(value, "simulator", None), Simulator):
                check_same_robot(f"{call}: expected a motion", self._sim, other, np.asarray(value.x))
            return SampledReference(value.time, value.x, self._sim)
        rows = checks.array(call, value, (None, self._sim.nx if of_states else self._sim.nu))
        return SampledReference(self._h * np.arange(len(rows)), rows, self._sim if of_states else None)

    def _call_checked(self, time: float) -> None:
        """Check once that every function returns rows of the shape of its reference."""
        for term, function in self._moving:
            times = time + self._h * term.knots
            checks.array(f"MPC(reference=...) at {times.size} times", function(times), term.reference.shape)

    def move(self, time: float, plane: GroundPlane | None = None, x: Vector | None = None) -> None:
        """Move the references to the present.

        Args:
            time: time of the first knot [s].
            plane: the ground, onto which states are carried (default None: that of the references).
            x: (nx,) state at the first knot, for functions that are anchored there (default None: they stay).
        """
        self._begin, self.plane = time, plane or GroundPlane()
        for term, function in self._moving:
            if x is not None and hasattr(function, "anchor"):
                function.anchor(time, x)
            term.reference[:] = function(time + self._h * term.knots)
            if self.plane != GroundPlane() and isinstance(term, StateTerm):
                term.reference[:] = self.plane.carry(term.reference, self._sim.mechanism)

    def rows(self, kind: type[StateTerm] | type[PickTerm], begin: float, count: int) -> Matrix | None:
        """Rows of the first reference of a kind, one knot apart.

        Rows of the present horizon are not computed again; their states are on the plane already.

        Args:
            kind: class of the term.
            begin: time of the first row [s].
            count: number of rows.

        Returns:
            (count, nx) states or (count, nu) inputs; None if no such reference moves.
        """
        for term, function in self._moving:
            if isinstance(term, kind):
                first = (begin - self._begin) / self._h - term.knots[0]
                k = round(first) if np.isfinite(first) else -1
                if abs(first - k) < 1e-6 and 0 <= k <= len(term.knots) - count and np.all(np.diff(term.knots) == 1):
                    return term.reference[k : k + count]
                return np.asarray(function(begin + self._h * np.arange(float(count))))
        return None
