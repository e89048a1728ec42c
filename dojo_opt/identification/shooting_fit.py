"""ShootingFit: parameters and starts of windows, their errors, and the steps of Gauss-Newton's method."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dojo_opt.identification.delayed_space import DelayedSpace
from dojo_opt.identification.normal_equations import NormalEquations
from dojo_opt.identification.prior import Prior
from dojo_opt.identification.windows import Predictor, Window, WindowErrors
from sim.simulator.simulator import Simulator
from solvers.types import Floats

__all__ = ["Expectation", "Reached", "ShootingFit"]

_MISSED = 2.0  # times the cost of most windows, or that of the noise: windows whose starts are drawn again
_DRAWS = 32  # starts of a missed window, the measured one among them
_AT_ONCE = 32  # missed windows whose draws are one batch
_BETTER = 0.99  # share of its cost that a drawn start may have
_WIDEST = 10.0  # standard deviations by which starts are drawn


class Expectation(NamedTuple):
    """Effect of a step in the linear model."""

    decrease: float  # of the cost
    deviations: float  # by which the parameters change, in standard deviations


class Reached(NamedTuple):
    """Where a fit has got to, all of one moment."""

    theta: Floats
    windows: list[Window]
    starts: list[Floats]
    kappa: float
    found: list[WindowErrors]  # with derivatives


class ShootingFit:
    """Parameters and starts of windows, from one step to the next."""

    def __init__(
        self, space: DelayedSpace, windows: list[Window], predictor: Predictor, outlier: float, prior: Prior
    ) -> None:
        self.space, self.windows, self.predictor, self.outlier, self.prior = space, windows, predictor, outlier, prior
        self.theta, self.base = space.values.copy(), space.simulator(space.values)
        self.prior_weight = 1.0  # of the prior
        self.starts = [w.x[0].copy() for w in windows]
        self.unit = space.scale  # coordinates differ in size by orders of magnitude
        self.variance = 0.0  # of the errors over their noise, without outliers
        self.reached: Reached | None = None  # that Ctrl-C leaves

    def reach(self, kappa: float, found: list[WindowErrors]) -> None:
        """Note the errors here, in one assignment."""
        if any(w.solved for w in found):
            self.reached = Reached(self.theta, self.windows, self.starts, kappa, found)

    def cut(self, windows: list[Window], length: int) -> None:
        """Replace the windows by pieces of these ones; starts stay where a window began there before."""
        known = {(w.trajectory, w.first): start for w, start in zip(self.windows, self.starts, strict=True)}
        self.windows = [piece for w in windows for piece in w.pieces(length)]
        self.starts = [known.get((w.trajectory, w.first), w.x[0]).copy() for w in self.windows]

    def errors(self, theta: Floats, starts: list[Floats], kappa: float, slopes: bool) -> list[WindowErrors] | None:
        """Of all windows; None where the parameters are impossible."""
        try:
            sim, windows = self._model(theta, kappa)
        except ValueError:
            return None
        if not slopes:
            return self.predictor.errors(sim, windows, starts)
        predict, chain = self.predictor.predict, self.space.slopes(theta)
        return [predict(sim, chain, w, s, kappa) for w, s in zip(windows, starts, strict=True)]

    def _model(self, theta: Floats, kappa: float) -> tuple[Simulator, list[Window]]:
        """The simulator of the parameters at a smoothing, and the windows with their delay."""
        return self.space.simulator(theta).replace(kappa=kappa), self.space.delayed(self.windows, theta)

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

    def noise_variance(self, cost: float, found: list[WindowErrors], usable: list[bool], fitted: int = 0) -> float:
        """Variance of the errors over their noise, by so many fitted values fewer than errors: Huber's estimate.

            sum min(|r|, k)^2 / (share of inliers)    over the errors that are free

        An outlier counts as one at the threshold k, however far it is (Huber and Ronchetti, Robust Statistics, 7.6).
        The normal equations count outliers by their weights already, so the share is no square. Where outliers are
        many, they are errors of the model: the variance is at most that of the cost.
        """
        sizes, total, count = [], 0.0, 0
        for w, use in zip(found, usable, strict=True):
            if use:
                size = np.sqrt(np.mean(w.errors**2, axis=1))
                total += float((np.minimum(size, self.outlier) ** 2).sum()) * w.errors.shape[1]
                count += w.errors.size
                sizes.append(size)
        inside = float(np.mean(np.concatenate(sizes) <= self.outlier)) if sizes else 1.0
        return min(cost, total / max(inside, 1e-12)) / max(count - fitted, 1)

    def rest(self, cost: float, found: list[WindowErrors], usable: list[bool]) -> float:
        """The cost of the data and the prior, whose share is chosen anew."""
        self.variance = self.noise_variance(cost, found, usable)
        self.prior_weight = max(1.0, self.variance)
        return cost + self.pull(self.theta)

    def step(self, equations: NormalEquations, damping: float) -> tuple[Floats, list[Floats], Expectation]:
        """New parameters, within their bounds, new starts, and the effect of both in the linear model."""
        H, g, back = equations.reduced(damping)
        H += self.prior_weight * np.diag(self.prior.precision * self.unit**2)
        # bodies that noise alone would change by more than their size stay near: a body may not become flat
        H += self.variance * np.diag(self.space.of_bodies)
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
        expected = Expectation(decrease, float(np.sqrt(d @ H @ d)))
        return theta, list(self.base.integrate(np.array(self.starts), moves)), expected

    def begin_again(self, kappa: float) -> None:
        """Replace starts by measured ones that cost less: those of another smoothing may be far off."""
        sim, windows = self._model(self.theta, kappa)
        measured = [w.x[0].copy() for w in windows]
        ends = [self.predictor.errors(sim, windows, starts) for starts in (self.starts, measured)]
        for k, (now, other) in enumerate(zip(*ends, strict=True)):
            if self.cost_of(other) < self.cost_of(now):
                self.starts[k] = measured[k]

    def redraw(self, kappa: float, rng: np.random.Generator) -> bool:
        """Replace the starts of missed windows by better ones among random draws; whether there are any.

        A start from which a contact closes a step too early or too late is a local minimum: errors rise before they
        fall. Draws are from N(s_k, c (S_k'S_k)^-1), the distribution of the start for known parameters, where c
        grows with the errors of the window.
        """
        sim, windows = self._model(self.theta, kappa)
        costs = np.array([self.cost_of(w) for w in self.predictor.errors(sim, windows, self.starts)])
        solved = np.isfinite(costs)
        if not solved.any():
            return False
        missed = np.flatnonzero(solved & (costs > _MISSED * max(1.0, float(np.median(costs[solved])))))
        chain, changed = self.space.slopes(self.theta), False
        for few in np.array_split(missed, -(-len(missed) // _AT_ONCE)) if len(missed) else ():
            starts = []
            for k in few:
                moves = self._draws(self.predictor.predict(sim, chain, windows[k], self.starts[k], kappa), rng)
                starts += [windows[k].x[0], *sim.integrate(np.tile(self.starts[k], (_DRAWS - 1, 1)), moves)]
            found = self.predictor.errors(sim, [windows[k] for k in few for _ in range(_DRAWS)], starts)
            tried = np.array([self.cost_of(w) for w in found]).reshape(len(few), _DRAWS)
            for n, k in enumerate(few):
                best = int(np.argmin(tried[n]))
                if tried[n, best] < _BETTER * costs[k]:
                    self.starts[k], changed = starts[n * _DRAWS + best], True
        return changed

    def cost_of(self, found: WindowErrors) -> float:
        """Cost of one window, per number; infinite without a prediction."""
        return self.weigh([found], [True])[0] / found.errors.size if found.solved else np.inf

    def _draws(self, found: WindowErrors, rng: np.random.Generator) -> Floats:
        """(draws - 1, ndx) moves of the start of a window."""
        S = NormalEquations([found], self.weigh([found], [True])[1], self.unit).SS[0]
        root = np.linalg.cholesky(S + 1e-12 * max(float(np.trace(S)), 1e-12) * np.eye(len(S)))
        wide = min(float(np.sqrt(np.mean(found.errors**2))), _WIDEST) * np.exp(rng.uniform(-1.0, 1.0, (_DRAWS - 1, 1)))
        drawn = wide * rng.standard_normal((_DRAWS - 1, len(S)))
        return np.asarray(np.linalg.solve(root.T, drawn.T).T, dtype=np.float64)
