"""Rescue: further starts of a tick that accepts no step, rollouts with and without random splines on the inputs."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.planning.ilqr import Solver
from dojo_opt.planning.iterate import Iterate
from sim.mechanism import checks
from sim.mechanism.checks import whole_number
from sim.mechanism.short_repr import short_repr
from solvers.types import Matrix, Stack

__all__ = ["SCALES", "Rescue", "Starts"]

SCALES = (1.0, 0.5, 0.0)  # of the gains of the rollouts that are compared
# iterations of a time step, at most: most rollouts under the gains of a lost plan end in a step without a solution
_FEW_ITERATIONS = 60


@dataclass(frozen=True)
class Rescue:
    """Further starts of a tick of `MPC` whose plan is rejected.

    All of them are rollouts from the measured state: of the previous plan without its gains, under half of them and
    all, and of its inputs with random splines added. A rollout fails where a step takes more than 60 iterations. The
    planner iterates from the one of the least merit, within the same tick, and the result is the plan. So a plan that
    has been lost, as after an impact that it did not foresee, is replaced at once by one that begins where the robot
    is.

    Attributes:
        splines: number of random splines; each costs a rollout (default 8).
        points: points of a spline along the horizon, linear in between (default 5).
        spread: standard deviation of a point, a number or (nu,) [N, N m] (default 0.05).
        iterations: iterations of time steps that the rollouts of a tick may take, those of its rejected plan included:
            no further start is tried after that many, and the best one becomes the plan as it is. A measure of time
            that is the same on every machine (default None: no limit).
        always: whether every tick tries them, and takes a start that is better than its plan, not only one that is
            stuck (default False).
        seed: seed of the splines, which are drawn anew in every rescue (default 0).
    """

    splines: int = 8
    points: int = 5
    spread: ArrayLike = 0.05
    iterations: int | None = None
    always: bool = False
    seed: int = 0

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for name, least in (("splines", 0), ("points", 2), ("seed", 0)):
            whole_number(f"Rescue({name}=...)", getattr(self, name), least)
        if self.iterations is not None:
            whole_number("Rescue(iterations=...)", self.iterations)
        checks.flag("Rescue(always=...)", self.always)
        spread = checks.floats("Rescue(spread=...)", self.spread)
        if spread.ndim > 1 or not np.all(np.isfinite(spread)) or not np.all(spread >= 0.0):
            raise ValueError(f"Rescue(spread=...): expected numbers >= 0, got {checks.shown(self.spread)}")


class Starts:
    """The starts of a `Rescue`, for a planner.

    Args:
        solver: the planner of a tick.
        settings: number and size of the splines.

    Raises:
        ValueError: a spread of the wrong shape.
    """

    def __init__(self, solver: Solver, settings: Rescue) -> None:
        nu = solver.problem.sim.nu
        spread = checks.floats("Rescue(spread=...)", settings.spread)
        if spread.shape not in ((), (nu,)):
            raise ValueError(f"Rescue(spread=...): expected a number or ({nu},), got {spread.shape}")
        self._solver, self._settings, self._spread = solver, settings, spread
        self.always = settings.always
        self.forget()

    def forget(self) -> None:
        """Draw the same splines again."""
        self._random = np.random.default_rng(self._settings.seed)
        self._until = np.inf  # end of the tick by `perf_counter` [s]
        self._last = np.inf  # iterations of the planner's steps after which a tick has none left

    def begin(self, until: float) -> None:
        """A tick begins, which may last until this time of `perf_counter` [s]."""
        self._until = until
        if self._settings.iterations is not None:
            self._last = self._solver.step_iterations + self._settings.iterations

    @property
    def exhausted(self) -> bool:
        """Whether the tick has used up its iterations or its time."""
        return self._solver.step_iterations >= self._last or perf_counter() > self._until

    def best(self, x: Matrix, u: Matrix, K: Stack) -> Iterate | None:
        """The rollout of the least merit.

        Args:
            x: (T + 1, nx) states of the previous plan, from now on.
            u: (T, nu) its inputs.
            K: (T, nu, ndx) its gains.

        Returns:
            The rollout; None when the simulator can step none of them to its end with a finite merit.
        """
        nominal, none = Iterate(x, u), np.zeros_like(K)
        starts = [(nominal, scale * K) for scale in reversed(SCALES)]  # without gains is the best in nearly all ticks
        starts += [(Iterate(x, u + change), none) for change in self._splines(*u.shape)]
        found: Iterate | None = None
        for start, gains in starts:
            shot = self._solver.rollout(start, gains, _FEW_ITERATIONS)
            if shot is not None and np.isfinite(shot.merit) and (found is None or shot.merit < found.merit):
                found = shot
            if self.exhausted:
                break
        return found

    def _splines(self, horizon: int, nu: int) -> Stack:
        """(splines, T, nu) changes of the inputs."""
        count, points = self._settings.splines, self._settings.points
        values = self._spread * self._random.standard_normal((count, points, nu))
        at = np.linspace(0.0, points - 1.0, horizon)
        left = np.minimum(at.astype(np.int64), points - 2)
        share = (at - left)[:, None]
        return np.asarray((1.0 - share) * values[:, left] + share * values[:, left + 1])
