"""identify: parameters of a simulator from measured motions, by Gauss-Newton over multiple shooting.

    min over theta and the starts s_k    sum_k sum_t rho(|r_kt|^2) + max(1, v) sum_i ((theta_i - m_i)/s_i)^2

with r of windows.py, and prior knowledge of some parameters, m_i +- s_i. Errors of the model add to the noise of the
measurement; v, the variance of r without outliers, measures by how much, and the data are down-weighted by it.

Starts are eliminated window by window (Schur complement), so the work grows with the data and not with its square. rho
is Huber's, by iteratively reweighted least squares: a state whose scaled error has a root mean square above `outlier`
counts linearly. Levenberg and Marquardt's damping; parameters stay within their bounds by projection. Long
predictions through contacts have local minima. So a fit begins with windows of a few steps, which are doubled, with the
starts found so far; starts of windows that stay missed are drawn again. Fits from several values of the parameters, in
workers if wanted, keep the one of the least cost.
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
from dojo_opt.identification.prior import Prior
from dojo_opt.identification.shooting_fit import Expectation, ShootingFit
from dojo_opt.identification.windows import Predictor, Window, WindowErrors, cut_windows
from dojo_opt.planning.executors import check_executor, results_in_order
from sim.mechanism import checks
from sim.mechanism.memory_limit import room_for
from sim.mechanism.renamed import renamed, renamed_keywords
from sim.mechanism.short_repr import short_table
from sim.simulator.results import Interrupted, Trajectory
from sim.simulator.simulator import Simulator
from solvers.status import MESSAGES, Status
from solvers.types import Floats

__all__ = ["Identified", "IdentifyOptions", "identify"]

_DAMPING, _LEAST, _LARGEST = 1e-3, 1e-9, 1e8  # share of the diagonal
_LEAST_NOISE = 1e-150  # whose inverse has a square
_IDLE = 1e-20  # square of the largest effect of a parameter: those of parameters without any
_UNSEEN = 1e-8  # of the largest eigenvalue, for parameters of the same effect: combinations without any
_SHARE = 0.01  # of the effect of a parameter in a combination without any: that of one which has a part in it
_POOR, _GOOD = 0.1, 0.5  # shares of the expected decrease: of a step that is refused, and that lowers the damping
_NEARLY = 10.0  # tolerances: the decrease that a fit may still expect at its end, where no step brings one
_WITHIN = 0.1  # standard deviations: the change of the parameters that it may still expect there
_AWAY = 0.3  # times a value: standard deviation of the starts of further fits without a prior
_EXACT = 1e-10  # square of the errors over their noise: data without noise
_MESSAGES = {**MESSAGES, Status.LINE_SEARCH: "No damped step decreases the cost as the linear model expects."}
_SHORTEST = 5  # steps of the windows that fits of whole motions begin with
_ROUGH, _FEW = 1e-2, 10  # tolerance and iterations of all stages but the last
_MISSED = 0.1  # share of outliers above which the model does not explain the data
COLUMNS = ("iteration", "window", "kappa", "cost", "rms", "damping", "step", "outliers", "unsolved", "seconds")
_HEADER = "{:>9} {:>6} {:>8} {:>12} {:>9} {:>8} {:>8} {:>8} {:>8} {:>8}".format(*COLUMNS)


@dataclass(frozen=True, repr=False)
class Identified:
    """Identified parameters, with the accuracy to which the data determine them.

    Attributes:
        success: whether the fit converged to a model that explains the data.
        status: SOLVED, or the reason why not: MAX_ITERATIONS, LINE_SEARCH if no damped step decreases the cost as the
            linear model expects, SIMULATION_FAILED if no window can be predicted, NOT_EXPLAINED if more than a
            tenth of the states are outliers, INTERRUPTED after Ctrl-C.
        message: the same as a sentence.
        labels: names of the fitted values.
        values: (n,) fitted values, in the units of their parameters.
        start: (n,) values before the fit.
        covariance: (n, n); infinite on the diagonal for parameters that the data do not determine.
        simulator: the simulator with the fitted values, and the kappa of the one that the fit began with.
        rms: root mean square of the errors over their noise, to which outliers count linearly: 1 if the given noise is
            right.
        unseen: combinations, by label, that change no prediction and have no prior: changes of the values over
            `ParameterSpace.scale`.
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
            terms = " ".join(f"{v:+.2g} {k}" for k, v in combination.items())
            lines.append(f"not determined by the data: {terms}")
        return "\n".join([*lines, self.closing_line()])


@dataclass(frozen=True)
class IdentifyOptions:
    """Settings of `identify`.

    Attributes:
        window: steps that are predicted from one start, which is free within the noise (default None: whole motions).
        shortest: steps of the windows that a fit begins with, at least, which are doubled up to those of `window`, as
            long predictions have local minima (default None: 5 for whole motions, and `window` where it is given).
        redraws: times that starts of missed windows are drawn again, for windows of each length (default 3); with 0,
            starts also stay where they are when the smoothing changes.
        every: number of steps from one compared state to the next (default 1).
        delay: time from an input to the moment when it acts [s]: a number if it is known, or the range (low, high) of a
            delay to fit, as the parameter "delay" (default 0). An input that acts within a step counts with its share
            of the step; before a motion, inputs are those of its first step. Delays have local minima, a time step
            apart: give `fits`, which are spread over the range evenly.
        kappas: smoothing of contacts, one after the other [N s m]: smooth contacts act at a distance (default None:
            that of the simulator). The last one is that of all windows but the shortest.
        outlier: number of deviations; states whose errors have a larger root mean square count linearly (default 3).
        tolerance: share of the cost; a smoothing ends when an iteration brings less (default 1e-4).
        max_iterations: limit per smoothing (default 30).
        verbose: whether to print a line per iteration (default False).
    """

    window: int | None = None
    shortest: int | None = None
    redraws: int = 3
    every: int = 1
    delay: float | tuple[float, float] = 0.0
    kappas: Sequence[float] | None = None
    outlier: float = 3.0
    tolerance: float = 1e-4
    max_iterations: int = 30
    verbose: bool = False

    def __post_init__(self) -> None:
        checks.whole_number("identify(redraws=...)", self.redraws, 0)
        given = [name for name in ("window", "shortest") if getattr(self, name) is not None]
        for name in ("every", "max_iterations", *given):
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
        sim: simulator to begin with, of order 2; its time step is that of the measurements.
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
        seed: of these values, and of drawn starts (default 0).
        executor: whose workers fit, as for `dojo.monte_carlo`; the result does not depend on it (default None).
        **options: fields of `dojo.IdentifyOptions` by name, whose help has their units and defaults: window,
            shortest, redraws, every, delay, kappas, outlier, tolerance, max_iterations, verbose.

    Returns:
        Identified.

    Raises:
        TypeError: for an argument of the wrong kind.
        ValueError: for a value out of range, an unknown name, a simulator of higher order or with an accuracy, or a
            Trajectory of another robot, under external wrenches, with another time step, or with velocities at nodes.
        Interrupted: after Ctrl-C, a KeyboardInterrupt; its `result` is the best of the finished fits, or else the fit
            so far, INTERRUPTED, by the windows that it has got to; None before its first predictions.
    """
    call = "identify"
    _check_simulator(call, sim)
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
    checks.whole_number(f"{call}(seed=...)", seed, 0)
    first = _first_values(space, known, count, seed)
    calls = [(space, windows, deviations, o, known, seed, values) for values in first]
    found: list[Identified] = []
    try:
        found.extend(results_in_order(_fitted, calls, executor))  # those before Ctrl-C stay
    except KeyboardInterrupt as stop:
        raise Interrupted(_best(found) if found else getattr(stop, "result", None)) from None
    return _best(found)


def _check_simulator(call: str, sim: Any) -> None:
    """Refuse what is no Simulator, or one whose steps have no derivatives by parameters."""
    if not isinstance(sim, Simulator):
        raise TypeError(f"{call}(sim): expected a Simulator, got {sim!r}")
    if sim.order > 2 or sim.accuracy is not None:
        kind, way = (f"order {sim.order}", "order=2") if sim.accuracy is None else ("an accuracy", "accuracy=None")
        raise ValueError(
            f"{call}(sim): expected steps of order 2, which have derivatives by parameters, got {kind}; use "
            f"sim.replace({way}), and motions with its velocities"
        )


def _best(found: list[Identified]) -> Identified:
    """The best of several fits, with the time of all."""
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
    space: DelayedSpace,
    windows: list[Window],
    noise: Floats,
    o: IdentifyOptions,
    known: Prior,
    seed: int,
    values: Floats,
) -> Identified:
    """The fit from one start; at module level, so that other processes can import it."""
    began = time.process_time()
    fit = ShootingFit(space, windows, Predictor(space, noise, o.every), o.outlier, known)
    fit.theta = values.copy()
    history: list[dict[str, Any]] = []
    try:
        kappa, status = _descended(fit, windows, o, seed, began, history)
        errors = fit.errors(fit.theta, fit.starts, kappa, slopes=True) or []
    except KeyboardInterrupt:
        if fit.reached is None:
            raise
        fit.theta, fit.windows, fit.starts, kappa, errors = fit.reached
        raise Interrupted(_identified(fit, kappa, errors, Status.INTERRUPTED, history, began)) from None
    return _identified(fit, kappa, errors, status, history, began)


def _descended(
    fit: ShootingFit, windows: list[Window], o: IdentifyOptions, seed: int, began: float, history: list[dict[str, Any]]
) -> tuple[float, Status]:
    """All stages of a fit: the smoothing of the last one, and how it ended."""
    rng, stages, status = np.random.default_rng(seed), _stages(fit, windows, o), Status.SOLVED
    for before, stage in zip((None, *stages), stages, strict=False):
        fit.cut(windows, stage.length)
        if o.redraws and before is not None and before.kappa != stage.kappa:
            fit.begin_again(stage.kappa)
        status = _descend(fit, stage, began, history)
        for _ in range(o.redraws if stage.kappa == stages[-1].kappa else 0):
            if status == Status.SIMULATION_FAILED or not fit.redraw(stage.kappa, rng):
                break
            status = _descend(fit, stage, began, history)
        if status == Status.SIMULATION_FAILED:
            break
    fit.cut(windows, stages[-1].length)
    return stage.kappa, status


class _Stage(NamedTuple):
    """A length of the windows, a smoothing, and how exactly they are solved."""

    length: int
    kappa: float
    options: IdentifyOptions


def _stages(fit: ShootingFit, windows: list[Window], o: IdentifyOptions) -> list[_Stage]:
    """All smoothings with the shortest windows, then longer and longer ones; only the last is solved exactly."""
    kappas = (fit.base.kappa,) if o.kappas is None else o.kappas
    longest = max(len(w.u) for w in windows)
    shortest = o.shortest or o.window or _SHORTEST
    doublings = max(int(np.log2(longest / shortest)), 0)
    first = -(-longest // 2**doublings)
    pairs = [(first, kappa) for kappa in kappas] + [(first * 2**k, kappas[-1]) for k in range(1, doublings + 1)]
    rough = replace(o, tolerance=max(o.tolerance, _ROUGH), max_iterations=min(o.max_iterations, _FEW))
    return [_Stage(*pair, rough) for pair in pairs[:-1]] + [_Stage(*pairs[-1], o)]


def _descend(fit: ShootingFit, stage: _Stage, began: float, history: list[dict[str, Any]]) -> Status:
    """Iterations of one stage; how they ended."""
    length, kappa, o = stage
    found = fit.errors(fit.theta, fit.starts, kappa, slopes=True)
    if found is None:
        return Status.SIMULATION_FAILED
    fit.reach(kappa, found)
    usable = [w.solved for w in found]
    data, weights, far = fit.weigh(found, usable)
    damping, cost = _DAMPING, fit.rest(data, found, usable)
    for _ in range(o.max_iterations):
        if not any(usable):
            return Status.SIMULATION_FAILED
        if data <= _EXACT * sum(w.errors.size for w, use in zip(found, usable, strict=True) if use):
            return Status.SOLVED
        accepted, gain, share, equations = False, 0.0, 0.0, NormalEquations(found, weights, fit.unit)
        expected = None  # of the least damped step
        while damping < _LARGEST and not accepted:
            theta, starts, now = fit.step(equations, damping)
            expected = now if expected is None else expected
            if now.decrease <= o.tolerance * cost:  # more damping predicts still less
                return _stopped(expected, cost, o)
            trial = fit.errors(theta, starts, kappa, slopes=False)
            if trial is not None and all(t.solved or not use for t, use in zip(trial, usable, strict=True)):
                ahead = fit.weigh(trial, usable)[0] + fit.pull(theta)
                gain, share = (cost - ahead) / cost, (cost - ahead) / now.decrease
                accepted = share > _POOR
            if not accepted:
                damping *= 4.0
            elif share > _GOOD:
                damping = max(damping / 5.0, _LEAST)
        if expected is None or not accepted:
            return Status.LINE_SEARCH
        size = float(np.linalg.norm((theta - fit.theta) / fit.unit))
        fit.theta, fit.starts = theta, starts
        again = fit.errors(theta, starts, kappa, slopes=True)
        assert again is not None
        fit.reach(kappa, again)
        found, usable = again, [w.solved for w in again]
        data, weights, far = fit.weigh(found, usable)
        cost = fit.rest(data, found, usable)
        values = sum(w.errors.size for w, use in zip(found, usable, strict=True) if use)
        record = dict(
            zip(
                COLUMNS,
                (len(history) + 1, length, kappa, cost, np.sqrt(data / max(values, 1)), damping, size, far,
                 usable.count(False), time.process_time() - began),
                strict=True,
            )
        )  # fmt: skip
        if o.verbose:
            head = [] if history else [_HEADER]
            line = "{:9d} {:6d} {:8.1e} {:12.6g} {:9.4f} {:8.1e} {:8.1e} {:8.4f} {:8d} {:8.1f}".format(*record.values())
            print("\n".join([*head, line]), file=sys.stdout, flush=True)
        history.append(record)
        if gain < o.tolerance:
            return _stopped(expected, cost, o)
    return Status.MAX_ITERATIONS


def _stopped(expected: Expectation, cost: float, o: IdentifyOptions) -> Status:
    """How a smoothing ends whose cost falls no further, by the expectation of the least damped step.

    Where that is large, the motions are not as the linear model has them, as at a change of contacts. Where it would
    hardly change the parameters, these are found, though the starts of the windows may not be.
    """
    near = expected.decrease <= _NEARLY * o.tolerance * cost or expected.deviations <= _WITHIN
    return Status.SOLVED if near else Status.LINE_SEARCH


def _identified(
    fit: ShootingFit,
    kappa: float,
    found: list[WindowErrors],
    status: Status,
    history: list[dict[str, Any]],
    began: float,
) -> Identified:
    """The result, with the covariance of the parameters at the end, where the windows have the errors `found`."""
    space, n = fit.space, len(fit.theta)
    usable = [w.solved for w in found]
    cost, weights, far = fit.weigh(found, usable)
    equations = NormalEquations(found, weights, fit.unit)
    H = equations.reduced(0.0)[0]
    message, missed = _MESSAGES[status], _MESSAGES[Status.NOT_EXPLAINED]
    if status == Status.SOLVED and far > _MISSED:
        status, message = Status.NOT_EXPLAINED, missed
    elif far > _MISSED:
        message = f"{message} {missed}"
    count = sum(w.errors.size for w, use in zip(found, usable, strict=True) if use)
    variance = max(fit.noise_variance(cost, found, usable, n + sum(usable) * fit.base.ndx), 1e-30)
    known = fit.prior.precision * fit.unit**2
    covariance, shares, axes = _covariance(H / variance + np.diag(known), np.diag(equations.PP) / variance + known)
    covariance = covariance * np.outer(fit.unit, fit.unit)
    unseen = [
        {space.labels[i]: float(axis[i]) for i in np.argsort(-np.abs(axis)) if abs(share[i]) > _SHARE}
        for share, axis in zip(shares.T, axes.T, strict=True)
    ]
    return Identified(
        status == Status.SOLVED, status, message, space.labels, fit.theta, space.values, covariance,
        space.simulator(fit.theta), float(np.sqrt(cost / max(count, 1))), unseen, far,
        fit.rest(cost, found, usable), fit.starts, space.delayed(fit.windows, fit.theta), fit.predictor.noise, usable,
        history, kappa, time.process_time() - began,
    )  # fmt: skip


def _covariance(H: Floats, effects: Floats) -> tuple[Floats, Floats, Floats]:
    """Covariance H^-1 (n, n); of combinations without effect (n, k), the shares of the parameters and their changes.

    H (n, n) the inverse of the covariance. effects (n,): squares of the effects of single parameters, where starts of
    windows stay. Parameters are compared by them: values say little about the size of a parameter that may be zero.
    """
    H = 0.5 * (H + H.T)
    alive = effects > _IDLE * effects.max(initial=0.0)
    size = np.sqrt(np.where(alive, effects, 1.0))
    sizes, axes = np.linalg.eigh((H / np.outer(size, size))[np.ix_(alive, alive)])
    seen = sizes > _UNSEEN * sizes.max(initial=1e-300)
    covariance, shares = np.zeros_like(H), np.zeros((len(H), int((~seen).sum())))
    covariance[np.ix_(alive, alive)] = (axes[:, seen] / sizes[seen]) @ axes[:, seen].T
    covariance /= np.outer(size, size)
    shares[alive] = axes[:, ~seen]
    shares = np.hstack([shares, np.eye(len(H))[:, ~alive]])
    blind = np.max(np.abs(shares), axis=1, initial=0.0) > _SHARE
    covariance[blind, :] = covariance[:, blind] = np.nan
    covariance[blind, blind] = np.inf
    changes = shares / size[:, None]
    return covariance, shares, changes / np.linalg.norm(changes, axis=0)
