"""The state nearest to the end of a divided step, where none has the momentum of every link: with that of all of them.

A mean velocity cannot express every momentum: links that turn far about a joint come along a chord, which is shorter
than their arc, so that their momentum has a largest value. Of the states with the total momentum of the floating trees

    min 1/2 |p(q, v; h) - P|^2 in M^-1     subject to     p_r(q, v; h) = P_r        r: rows of the roots that float

by Newton's method with the curvature J^T M^-1 J + mu M, J = dp/dv (Gauss and Newton's, after Levenberg and Marquardt),
and a search along its steps for the exact penalty of the constraint (Nocedal, Wright, Numerical Optimization, 18.3).
The target moves from forces at rest to locked joints, and from there towards P as far as it can be followed.
"""

from __future__ import annotations

import numpy as np

from sim.simulator.engines.intervals import Intervals
from sim.simulator.engines.linear_systems import solved
from solvers.types import Vector

__all__ = ["nearest_state"]

_ITERATIONS = 60
_FINEST = 2e-3  # share of the way to a target below which it is not followed further
_MET = 1e-9  # error of the total momentum, over its size, that the search tells from the other
_CLOSINGS = 3  # steps of the velocity that remove it
_STILL = 1e-8  # change of the velocity, over its size
_SHORTEST = 1e-4  # share of a step in the search
_FIRST, _LEAST, _MOST = 1e-3, 1e-10, 1e6  # mu


class _Projection:
    """The problem above at one configuration."""

    def __init__(self, intervals: Intervals, x: Vector, part: float) -> None:
        self.intervals, self.h = intervals, intervals.time_step
        self.roots = intervals.floating()
        self.mass = intervals.mass(x)
        self.weight = np.linalg.inv(np.linalg.cholesky(self.mass))  # |weight p|^2 = p M^-1 p
        self.target = intervals.momentum(part, x)
        self.still = x.copy()
        self.still[-len(self.target) :] = 0.0
        self.rest = intervals.momentum(self.h, self.still)
        self.locked = self.rest + intervals.locked(x, self.target - self.rest)[0]

    def errors(self, x: Vector, goal: Vector) -> tuple[Vector, Vector]:
        """(weight (p - goal), p_r - goal_r)."""
        error = self.intervals.momentum(self.h, x) - goal
        return self.weight @ error, error[self.roots]

    def step(self, x: Vector, errors: tuple[Vector, Vector], mu: float) -> tuple[Vector, Vector]:
        """(step of the velocity (nv,), multipliers of the constraint)."""
        J = self.intervals.momentum_slopes(self.h, x)[1]
        B, C, nv = self.weight @ J, J[self.roots], len(J)
        rows = np.block([[B.T @ B + mu * self.mass, C.T], [C, np.zeros((len(C), len(C)))]])
        found = solved(rows, np.concatenate([-B.T @ errors[0], -errors[1]]))
        return found[:nv], found[nv:]

    def nearest(self, x: Vector, goal: Vector) -> Vector | None:
        """The solution for a target, sought from the velocity of x; None where the constraint is not met."""
        mu, penalty, errors = _FIRST, 1.0, self.errors(x, goal)
        least, nv = _MET * (1.0 + float(np.abs(goal).max())), len(goal)
        for _ in range(_ITERATIONS):
            change, multipliers = self.step(x, errors, mu)
            if not np.isfinite(change).all():
                return None
            met = float(np.abs(errors[1]).max()) < least
            if met and np.abs(change).max() < _STILL * (1.0 + np.abs(x[-nv:]).max()):
                return x
            penalty = max(penalty, 2.0 * float(np.abs(multipliers).max()))
            share, trial, there = self._search(x, change, goal, errors, penalty)
            if share > 0.0:
                x, errors = trial, there
                mu = max(_LEAST, mu * (0.2 if share == 1.0 else 1.0 if share > 0.2 else 5.0))
            elif met:
                return x
            else:
                mu *= 10.0
                if mu > _MOST:
                    return None
        return x if float(np.abs(errors[1]).max()) < least else None

    def _search(
        self, x: Vector, change: Vector, goal: Vector, errors: tuple[Vector, Vector], penalty: float
    ) -> tuple[float, Vector, tuple[Vector, Vector]]:
        """(share of the step that lowers the penalty function, state and errors there); share 0 where none does."""

        def height(errors: tuple[Vector, Vector]) -> float:
            return float(0.5 * errors[0] @ errors[0] + penalty * np.abs(errors[1]).sum())

        share, before = 1.0, height(errors)
        while share > _SHORTEST:
            trial = x.copy()
            trial[-len(change) :] += share * change
            if self.intervals.of_one(trial) == self.h:
                there = self.errors(trial, goal)
                if height(there) < (1.0 - 1e-12) * before:
                    return share, trial, there
            share *= 0.5
        return 0.0, x, errors

    def meet(self, x: Vector) -> Vector:
        """x with the total momentum of the target, by the smallest change of its velocity in M."""
        x = x.copy()
        for _ in range(_CLOSINGS):
            C = self.intervals.momentum_slopes(self.h, x)[1][self.roots]
            ahead = np.linalg.solve(self.mass, C.T)
            x[-len(ahead) :] -= ahead @ solved(C @ ahead, self.errors(x, self.target)[1])
        return x

    def follow(self, x: Vector, first: Vector, last: Vector) -> tuple[Vector, float]:
        """(solution for the target first + s (last - first), s) with the largest s that steps of s reach."""
        s, step = 0.0, 0.25
        while s < 1.0 and step > _FINEST:
            share = min(1.0, s + step)
            ahead = self.nearest(x, first + share * (last - first))
            if ahead is None:
                step *= 0.5
            else:
                x, s = ahead, share
        return x, s

    def share(self, x: Vector) -> float:
        """Of the momentum of bodies against each other, the part that x has of it, between 0 and 1, in M^-1."""
        one, other = (self.weight @ (p - self.locked) for p in (self.intervals.momentum(self.h, x), self.target))
        square = float(other @ other)
        return min(1.0, max(0.0, float(one @ other) / square)) if square > 0.0 else 0.0


def nearest_state(intervals: Intervals, x: Vector, part: float) -> tuple[Vector, float] | None:
    """The state nearest to the end of a divided step with the momentum of its floating trees.

    Args:
        intervals: conversions of the engine that divides.
        x: (nx,) the end, a state of parts.
        part: time step of the parts [s].

    Returns:
        (state (nx,), share of the momentum of bodies against each other, 1 where it has all of it); None where no tree
        floats, with closed loops, and where not even the momentum of locked joints is reached.
    """
    if not len(intervals.floating()) or intervals.closed:
        return None
    problem = _Projection(intervals, x, part)
    state, s = problem.follow(problem.still, problem.rest, problem.locked)
    if s < 1.0:
        return None
    state, s = problem.follow(state, problem.locked, problem.target)
    whole = intervals.state(problem.h, problem.target, state) if s == 1.0 else None
    if whole is not None and intervals.of_one(whole) == problem.h:
        return whole, 1.0
    state = problem.meet(state)
    if not np.isfinite(state).all() or intervals.of_one(state) < problem.h:
        return None
    return state, min(problem.share(state), float(np.nextafter(1.0, 0.0)))
