"""identify: parameters of a simulator from measured motions, by Gauss-Newton over multiple shooting.

    min over theta and the starts s_k    sum_k sum_t rho(|r_kt|^2) + max(1, rms^2) sum_i ((theta_i - m_i)/s_i)^2

with r of windows.py, and prior knowledge of some parameters, m_i +- s_i. Errors of the
model add to the noise of the measurement; rms^2 measures by how much, and the data are down-weighted by it.

Starts are eliminated window by window (Schur complement), so the work grows with the data and not with its square. rho
is Huber's, by iteratively reweighted least squares: a state whose scaled error has a root mean square above `outlier`
counts linearly. Levenberg and Marquardt's damping; parameters stay within their bounds by projection. Motions through
many contacts have local minima: fits from several starts, in workers if wanted, keep the one of the least cost.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.identification.delayed_space import DelayedSpace
from dojo_opt.identification.normal_equations import NormalEquations
from dojo_opt.identification.parameter_space import ParameterSpace
from dojo_opt.identification.windows import Predictor, Window, WindowErrors, cut_windows
from dojo_opt.planning.executors import check_executor, results_in_order
from sim.mechanism import checks
from sim.mechanism.memory_limit import room_for
from sim.mechanism.renamed import renamed, renamed_keywords
from sim.mechanism.short_repr import short_table
from sim.simulator.results import Trajectory
from sim.simulator.simulator import Simulator
from solvers.status import MESSAGES, Status
from solvers.types import Floats

__all__ = ["Identified", "IdentifyOptions", "identify"]

_DAMPING, _LEAST, _LARGEST = 1e-3, 1e-9, 1e8  # share of the diagonal
_LEAST_NOISE = 1e-150  # whose inverse has a square
_UNSEEN = 1e-8  # of the largest eigenvalue: combinations that the data do not determine
_NEARLY = 10.0  # tolerances: the decrease that a fit may still expect at its end, where no step brings one
_WITHIN = 0.1  # standard deviations: the change of the parameters that it may still expect there
_AWAY = 0.3  # times a value: standard deviation of the starts of further fits without a prior
_EXACT = 1e-10  # square of the errors over their noise: data without noise
_MESSAGES = {**MESSAGES, Status.LINE_SEARCH: "No damped step decreases the cost as the linear model expects."}
_MISSED = 0.5  # share of outliers above which the model does not explain the data
COLUMNS = ("iteration", "kappa", "cost", "rms", "damping", "step", "outliers", "unsolved", "seconds")
_HEADER = "{:>9} {:>8} {:>12} {:>9} {:>8} {:>8} {:>8} {:>8} {:>8}".format(*COLUMNS)


@dataclass(frozen=True, repr=False)
class Identified:
    """Identified parameters, with the accuracy to which the data determine them.

    Attributes:
        success: whether the last smoothing converged.
        status: SOLVED, or the reason for an early end: MAX_ITERATIONS, LINE_SEARCH if no damped step decreases the
            cost as the linear model expects, SIMULATION_FAILED if no window can be predicted.
        message: the same as a sentence; also whether most states are outliers, which the model does not explain.
        labels: names of the fitted values.
        values: (n,) fitted values, in the units of their parameters.
        start: (n,) values before the fit.
        covariance: (n, n); infinite on the diagonal for parameters that the data do not determine.
        simulator: the simulator with the fitted values, and the kappa of the one that the fit began with.
        rms: root mean square of the errors over their noise: 1 if the given noise is right.
        unseen: combinations, by label, that change no prediction and have no prior.
        outliers: share of states with reduced weight.
        cost: cost of the data and the prior, see the module.
        window_starts: (nx,) fitted first state of every window.
        windows: the measured windows, with the inputs that act under the delay.
        noise: (ndx,) standard deviations of the measurement.
        solved: whether each window could be predicted at the end.
        history: one record per iteration.
        kappa: smoothing of the last iterations, by which the errors and predictions are [N s m].
        cpu_seconds: processor time [s].
    """

    success: bool
    status: Status
    message: str
    labels: tuple[str, ...]
    values: Floats
    start: Floats
    covariance: Floats
    simulator: Simulator
    rms: float
    unseen: list[dict[str, float]]
    outliers: float
    cost: float = float("nan")
    window_starts: list[Floats] = field(default_factory=list)
    windows: list[Window] = field(default_factory=list)
    noise: Floats = field(default_factory=lambda: np.zeros(0))
    solved: list[bool] = field(default_factory=list)
    history: list[dict[str, Any]] = field(default_factory=list)
    kappa: float = float("nan")
    cpu_seconds: float = 0.0

    starts = renamed("window_starts")
    seconds = renamed("cpu_seconds")

    @property
    def unsolved(self) -> int:
        """Number of windows without a prediction at the end, which are not counted."""
        return self.solved.count(False)

    @property
    def deviation(self) -> Floats:
        """(n,) standard deviations."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> Floats:
        """(n, n) correlation of the estimates; NaN for parameters that the data do not determine."""
        d = self.deviation
        with np.errstate(invalid="ignore"):
            return self.covariance / np.outer(d, d)

    def predictions(self) -> list[tuple[Window, Trajectory, Floats]]:
        """The motions that the values predict, of all windows but the unsolved ones; computed once.

        Returns:
            The window, the trajectory from its start, and (T + 1, ndx) the residuals: predicted (-) measured states
            over the noise, 0 where the noise is infinite.
        """
        return list(self._predictions)

    @cached_property
    def _predictions(self) -> list[tuple[Window, Trajectory, Floats]]:
        out, sim = [], self.simulator.replace(kappa=self.kappa)
        for window, start, solved in zip(self.windows, self.window_starts, self.solved, strict=True):
            path = sim.rollout(start, window.u) if solved else None
            if path is not None and path.success:
                out.append((window, path, sim.difference(path.x, window.x) / self.noise))
        return out

    def __repr__(self) -> str:
        return f"Identified({self.closing_line()})"

    def _repr_html_(self) -> str:
        return short_table(self.closing_line(), ("parameter", "value", "deviation", "before"), self._rows())

    def _rows(self) -> list[tuple[Any, ...]]:
        return list(zip(self.labels, self.values, self.deviation, self.start, strict=True))

    def closing_line(self) -> str:
        """The end of the fit in one line.

        Returns:
            The line.
        """
        return (
            f"{self.status.name}: {self.message} rms {self.rms:.3f} of the noise, {100 * self.outliers:.1f} % "
            f"outliers, {self.unsolved} windows unsolved, {self.cpu_seconds:.1f} s"
        )

    def summary(self) -> str:
        """The table of parameters and a closing line.

        Returns:
            Lines of text.
        """
        lines = [f"{'parameter':32} {'value':>12} {'deviation':>12} {'before':>12}"]
        lines += [f"{name:32} {value:12.6g} {sd:12.3g} {old:12.6g}" for name, value, sd, old in self._rows()]
        for combination in self.unseen:
            terms = " ".join(f"{v:+.2f} {k}" for k, v in combination.items())
            lines.append(f"not determined by the data: {terms}")
        return "\n".join([*lines, self.closing_line()])


class Prior:
    """Prior knowledge of parameters: independent and normal.

    mean (n,); precision (n,) the inverse of the variance, 0 where nothing is known
    """

    def __init__(self, space: DelayedSpace, given: Mapping[str, Any]) -> None:
        self.mean, self.precision = space.values.copy(), np.zeros(len(space.values))
        for name, value in checks.mapping("identify(prior=...)", given).items():
            call = f"identify(prior=...): {name!r}"
            rows = [
                k for k, label in enumerate(space.labels) if label == name or label.startswith((f"{name}:", f"{name}["))
            ]
            if not rows:
                checks.one_of("identify(prior=...)", name, space.labels)
            mean, deviation = value if isinstance(value, tuple) else (self.mean[rows], value)
            self.mean[rows] = np.broadcast_to(checks.floats(call, mean), (len(rows),))
            self.precision[rows] = checks.number(call, deviation, above=0.0) ** -2

    def cost(self, theta: Floats) -> float:
        """Square of the distance from the mean, over the deviations."""
        return float(np.sum(self.precision * (theta - self.mean) ** 2))


class _Expectation(NamedTuple):
    """Effect of a step in the linear model."""

    decrease: float  # of the cost
    deviations: float  # by which the parameters change, in standard deviations


class _Fit:
    """Parameters, starts and their normal equations."""

    def __init__(
        self, space: DelayedSpace, windows: list[Window], predictor: Predictor, outlier: float, prior: Prior
    ) -> None:
        self.space, self.windows, self.predictor, self.outlier, self.prior = space, windows, predictor, outlier, prior
        self.theta, self.base = space.values.copy(), space.simulator(space.values)
        self.prior_weight = 1.0  # of the prior
        self.starts = [w.x[0].copy() for w in windows]
        # coordinates differ in size by orders of magnitude
        self.unit = np.maximum(np.abs(space.values), 1e-3)

    def errors(self, theta: Floats, starts: list[Floats], kappa: float, slopes: bool) -> list[WindowErrors] | None:
        """Of all windows; None where the parameters are impossible."""
        try:
            sim = self.space.simulator(theta).replace(kappa=kappa)
        except ValueError:
            return None
        windows = self.space.delayed(self.windows, theta)
        if not slopes:
            return self.predictor.errors(sim, windows, starts)
        predict, chain = self.predictor.predict, self.space.slopes(theta)
        return [predict(sim, chain, w, s, kappa) for w, s in zip(windows, starts, strict=True)]

    def weigh(self, found: list[WindowErrors], usable: list[bool]) -> tuple[float, list[Floats], float]:
        """(cost, weights of the states of each window, share of outliers)."""
        total, weights, far, count = 0.0, [], 0, 0
        for w, use in zip(found, usable, strict=True):
            size = np.sqrt(np.mean(w.errors**2, axis=1))
            out = self.outlier / np.maximum(size, self.outlier) * use
            weights.append(out)
            inside = size <= self.outlier
            rho = np.where(inside, size**2, 2.0 * self.outlier * size - self.outlier**2) * w.errors.shape[1]
            if use:
                total, far, count = total + float(rho.sum()), far + int((~inside).sum()), count + len(size)
        return total, weights, far / max(count, 1)

    def pull(self, theta: Floats) -> float:
        """Cost of the distance from the prior."""
        return self.prior_weight * self.prior.cost(theta)

    def rest(self, cost: float, found: list[WindowErrors], usable: list[bool]) -> float:
        """The cost of the data and the prior, whose share is chosen anew."""
        values = sum(w.errors.size for w, use in zip(found, usable, strict=True) if use)
        self.prior_weight = max(1.0, cost / max(values, 1))
        return cost + self.pull(self.theta)

    def step(self, equations: NormalEquations, damping: float) -> tuple[Floats, list[Floats], _Expectation]:
        """New parameters, within their bounds, new starts, and the effect of both in the linear model."""
        H, g, back = equations.reduced(damping)
        H += self.prior_weight * np.diag(self.prior.precision * self.unit**2)
        g += self.prior_weight * self.prior.precision * (self.theta - self.prior.mean) * self.unit
        low, high = (self.space.low - self.theta) / self.unit, (self.space.high - self.theta) / self.unit
        H = H + np.diag(damping * np.diag(H) + 1e-14 * max(np.trace(H), 1e-14))
        free = np.ones(len(g), dtype=np.bool_)
        d = np.zeros(len(g))
        for _ in range(len(g)):  # bounds that the step meets hold, and the others answer
            rest = -g - H[:, ~free] @ d[~free]
            d[free] = np.linalg.solve(H[np.ix_(free, free)], rest[free])
            out = free & ((d < low) | (d > high))
            if not out.any():
                break
            d = np.where(out, np.clip(d, low, high), d)
            free &= ~out
        theta = np.clip(self.theta + self.unit * d, self.space.low, self.space.high)
        moves = -(back[:, :, -1] + back[:, :, :-1] @ d)
        decrease = self.pull(self.theta) - self.pull(theta) - equations.change(d, moves)
        expected = _Expectation(decrease, float(np.sqrt(d @ H @ d)))
        return theta, list(self.base.integrate(np.array(self.starts), moves)), expected


@dataclass(frozen=True)
class IdentifyOptions:
    """Settings of `identify`.

    Attributes:
        window: steps that are predicted from one start, which is free within the noise (default None: whole motions).
        every: number of steps from one compared state to the next (default 1).
        delay: time from an input to the moment when it acts [s]: a number if it is known, or the range (low, high) of a
            delay to fit, as the parameter "delay" (default 0). An input that acts within a step counts with its share
            of the step; before a motion, inputs are those of its first step. Delays have local minima, a time step
            apart: give `fits`, which are spread over the range evenly.
        kappas: smoothing of contacts, one after the other [N s m]: smooth contacts act at a distance (default None:
            that of the simulator).
        outlier: number of deviations; states whose errors have a larger root mean square count linearly (default 3).
        tolerance: share of the cost; a smoothing ends when an iteration brings less (default 1e-4).
        max_iterations: limit per smoothing (default 30).
        verbose: whether to print a line per iteration (default False).
    """

    window: int | None = None
    every: int = 1
    delay: float | tuple[float, float] = 0.0
    kappas: Sequence[float] | None = None
    outlier: float = 3.0
    tolerance: float = 1e-4
    max_iterations: int = 30
    verbose: bool = False

    def __post_init__(self) -> None:
        for name in ("every", "max_iterations", *(() if self.window is None else ("window",))):
            checks.whole_number(f"identify({name}=...)", getattr(self, name))
        for name in ("outlier", "tolerance"):
            checks.number(f"identify({name}=...)", getattr(self, name), above=0.0)
        if self.kappas is not None:
            kappas = checks.floats("identify(kappas=...)", self.kappas).ravel().tolist()
            for kappa in kappas:
                checks.number("identify(kappas=...)", kappa, above=0.0)
            if not kappas:
                raise ValueError("identify(kappas=...): expected at least one number")
            object.__setattr__(self, "kappas", tuple(kappas))


def identify(
    sim: Simulator,
    trajectories: Sequence[Any],
    parameters: Sequence[str] = (),
    bodies: Sequence[str] = (),
    *,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    prior: Mapping[str, Any] | None = None,
    noise: ArrayLike = 1.0,
    fits: int = 1,
    seed: int = 0,
    executor: Executor | None = None,
    **options: Any,
) -> Identified:
    """Fit parameters to measured motions: see the module.

    Args:
        sim: simulator to begin with; its time step is that of the measurements.
        trajectories: of `rollout`, or (states (T + 1, nx), inputs (T, nu)), measured.
        parameters: names, as in `Simulator.parameters`.
        bodies: whose mass, centre and inertia are fitted together, as physical bodies; see `ParameterSpace`.
        bounds: {name: (low, high)}, as in `ParameterSpace`.
        prior: {name: deviation} or {name: (mean, deviation)} of parameters with prior knowledge, from a ruler, scales,
            or a data sheet. A name covers all its components; the mean is that of `sim` by default, or one number or
            one for each component. A few motions determine a few parameters; the others stay at their priors.
        noise: standard deviation of the measured state, a number or (ndx,); infinite for components without a
            measurement.
        fits: number of fits; the first begins with the values of `sim`, further ones with values drawn from the
            prior, or around those of `sim` with a deviation of three tenths (default 1). The best one is returned.
        seed: of these values (default 0).
        executor: whose workers fit, as for `dojo.monte_carlo`; the result does not depend on it (default None).
        **options: fields of `dojo.IdentifyOptions` by name, whose help has their units and defaults: window, every,
            delay, kappas, outlier, tolerance, max_iterations, verbose.

    Returns:
        Identified.

    Raises:
        TypeError: for an argument of the wrong kind.
        ValueError: for a value out of range, or an unknown name.
    """
    call = "identify"
    if not isinstance(sim, Simulator):
        raise TypeError(f"{call}(sim): expected a Simulator, got {sim!r}")
    if "starts" in options:  # its name until version 0.2
        renamed_keywords(call, options, {"starts": "fits"})
        fits = options.pop("fits")
    checks.keywords(f"{call}(...)", options, [f.name for f in fields(IdentifyOptions)])
    o = IdentifyOptions(**options)
    parameters, bodies = checks.names(f"{call}(parameters)", parameters), checks.names(f"{call}(bodies=...)", bodies)
    space = DelayedSpace(ParameterSpace(sim, parameters, bodies, bounds), o.delay, sim.time_step)
    deviations = checks.spread(f"{call}(noise=...)", noise, sim.ndx)
    if not np.all(deviations > 0.0) or not np.isfinite(deviations).any():
        raise ValueError(f"{call}(noise=...): expected numbers above 0, not all infinite, got {noise!r}")
    if deviations.min() < _LEAST_NOISE:
        raise ValueError(f"{call}(noise=...): expected at least {_LEAST_NOISE:g}, got {deviations.min():g}")
    check_executor(call, executor)
    known = Prior(space, checks.mapping(f"{call}(prior=...)", prior))
    windows = cut_windows(sim, trajectories, o.window, space.past)
    count = room_for(f"{call}(fits=...)", fits, 8.0 * sum(w.x.size for w in windows), noun="fits")
    first = _first_values(space, known, count, checks.whole_number(f"{call}(seed=...)", seed, 0))
    calls = [(space, windows, deviations, o, known, values) for values in first]
    found = list(results_in_order(_fitted, calls, executor))
    best = min(found, key=lambda each: (each.unsolved, each.cost))
    return replace(best, cpu_seconds=sum(each.cpu_seconds for each in found))


def _first_values(space: DelayedSpace, known: Prior, count: int, seed: int) -> list[Floats]:
    """Values (n,) that fits begin with: those of the space, then random ones within their bounds."""
    rng, out = np.random.default_rng(seed), [space.values.copy()]
    told = known.precision > 0.0
    middle = np.where(told, known.mean, space.values)
    spread = np.where(told, np.maximum(known.precision, 1e-300) ** -0.5, _AWAY * np.abs(space.values))
    while len(out) < count:
        values = np.clip(middle + spread * rng.standard_normal(len(middle)), space.low, space.high)
        if space.fitted and not told[-1]:  # minima lie side by side, and the range is all that is known
            values[-1] = space.low[-1] + (len(out) - 0.5) / (count - 1) * (space.high[-1] - space.low[-1])
        with suppress(ValueError):  # of bodies that cannot be
            space.simulator(values)
            out.append(values)
    return out


def _fitted(
    space: DelayedSpace, windows: list[Window], noise: Floats, o: IdentifyOptions, known: Prior, values: Floats
) -> Identified:
    """The fit from one start; at module level, so that other processes can import it."""
    began = time.process_time()
    fit = _Fit(space, windows, Predictor(space, noise, o.every), o.outlier, known)
    fit.theta = values.copy()
    history: list[dict[str, Any]] = []
    levels, status = (fit.base.kappa,) if o.kappas is None else o.kappas, Status.SOLVED
    for kappa in levels:
        status = _descend(fit, kappa, o, began, history)
        if status == Status.SIMULATION_FAILED:
            break
    return _identified(fit, kappa, status, history, began)


def _descend(fit: _Fit, kappa: float, o: IdentifyOptions, began: float, history: list[dict[str, Any]]) -> Status:
    """Iterations at one smoothing; how they ended."""
    found = fit.errors(fit.theta, fit.starts, kappa, slopes=True)
    if found is None:
        return Status.SIMULATION_FAILED
    usable = [w.solved for w in found]
    data, weights, far = fit.weigh(found, usable)
    damping, cost = _DAMPING, fit.rest(data, found, usable)
    for _ in range(o.max_iterations):
        if not any(usable):
            return Status.SIMULATION_FAILED
        if data <= _EXACT * sum(w.errors.size for w, use in zip(found, usable, strict=True) if use):
            return Status.SOLVED
        accepted, gain, equations = False, 0.0, NormalEquations(found, weights, fit.unit)
        expected = None  # of the least damped step
        while damping < _LARGEST and not accepted:
            theta, starts, now = fit.step(equations, damping)
            expected = now if expected is None else expected
            if now.decrease <= o.tolerance * cost:  # more damping predicts still less
                return _stopped(expected, cost, o)
            trial = fit.errors(theta, starts, kappa, slopes=False)
            if trial is not None and all(t.solved or not use for t, use in zip(trial, usable, strict=True)):
                ahead = fit.weigh(trial, usable)[0] + fit.pull(theta)
                accepted, gain = ahead < cost, (cost - ahead) / cost
            damping = max(damping / 5.0, _LEAST) if accepted else 4.0 * damping
        if expected is None or not accepted:
            return Status.LINE_SEARCH
        size = float(np.linalg.norm((theta - fit.theta) / fit.unit))
        fit.theta, fit.starts = theta, starts
        again = fit.errors(theta, starts, kappa, slopes=True)
        assert again is not None
        found, usable = again, [w.solved for w in again]
        data, weights, far = fit.weigh(found, usable)
        cost = fit.rest(data, found, usable)
        values = sum(w.errors.size for w, use in zip(found, usable, strict=True) if use)
        record = dict(
            zip(
                COLUMNS,
                (len(history) + 1, kappa, cost, np.sqrt(data / max(values, 1)), damping, size, far,
                 usable.count(False), time.process_time() - began),
                strict=True,
            )
        )  # fmt: skip
        if o.verbose:
            head = [] if history else [_HEADER]
            line = "{:9d} {:8.1e} {:12.6g} {:9.4f} {:8.1e} {:8.1e} {:8.4f} {:8d} {:8.1f}".format(*record.values())
            print("\n".join([*head, line]), file=sys.stdout, flush=True)
        history.append(record)
        if gain < o.tolerance:
            return _stopped(expected, cost, o)
    return Status.MAX_ITERATIONS


def _stopped(expected: _Expectation, cost: float, o: IdentifyOptions) -> Status:
    """How a smoothing ends whose cost falls no further, by the expectation of the least damped step.

    Where that is large, the motions are not as the linear model has them, as at a change of contacts. Where it would
    hardly change the parameters, these are found, though the starts of the windows may not be.
    """
    near = expected.decrease <= _NEARLY * o.tolerance * cost or expected.deviations <= _WITHIN
    return Status.SOLVED if near else Status.LINE_SEARCH


def _identified(fit: _Fit, kappa: float, status: Status, history: list[dict[str, Any]], began: float) -> Identified:
    """The result, with the covariance of the parameters at the end."""
    space, n = fit.space, len(fit.theta)
    found = fit.errors(fit.theta, fit.starts, kappa, slopes=True) or []
    usable = [w.solved for w in found]
    cost, weights, far = fit.weigh(found, usable)
    H = NormalEquations(found, weights, fit.unit).reduced(0.0)[0]
    count = sum(w.errors.size for w, use in zip(found, usable, strict=True) if use)
    free = count - n - sum(usable) * fit.base.ndx
    variance = max(cost / max(free, 1), 1e-30)
    H = 0.5 * (H + H.T) / variance + np.diag(fit.prior.precision * fit.unit**2)
    sizes, axes = np.linalg.eigh(H)
    seen = sizes > _UNSEEN * max(sizes.max(initial=0.0), 1e-300)
    covariance = (axes[:, seen] / sizes[seen]) @ axes[:, seen].T * np.outer(fit.unit, fit.unit)
    blind = np.max(np.abs(axes[:, ~seen]), axis=1, initial=0.0) > 1e-3
    covariance[blind, :] = covariance[:, blind] = np.nan
    covariance[blind, blind] = np.inf
    unseen = [
        {space.labels[i]: float(axis[i]) for i in np.argsort(-np.abs(axis)) if abs(axis[i]) > 0.05}
        for axis in axes[:, ~seen].T
    ]
    return Identified(
        status == Status.SOLVED, status, _message(status, far), space.labels, fit.theta, space.values, covariance,
        space.simulator(fit.theta), float(np.sqrt(cost / max(count, 1))), unseen, far,
        fit.rest(cost, found, usable), fit.starts, space.delayed(fit.windows, fit.theta), fit.predictor.noise, usable,
        history, kappa, time.process_time() - began,
    )  # fmt: skip


def _message(status: Status, outliers: float) -> str:
    """A sentence about the end of a fit, and one about a model that does not explain the data."""
    if outliers <= _MISSED:
        return _MESSAGES[status]
    return (
        f"{_MESSAGES[status]} But the predictions miss {100 * outliers:.0f} % of the states by far more than the "
        "noise, so do not trust the values: end kappas=... with that of the motions, give shorter windows, or fit more "
        "parameters."
    )
