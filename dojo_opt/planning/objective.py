"""Objective: all terms of a problem, their quadratic model along a trajectory, the multipliers of its constraints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from dojo_opt.planning.options import Options
from dojo_opt.planning.problem import Problem
from dojo_opt.planning.term import Term, largest_violation
from solvers.types import Matrix

_LEAST = 1e-3  # share of the largest unit: least unit of a component


class Objective:
    """cost + augmented Lagrangian (the merit), with gradient g (T + 1, ndx + nu) and Gauss-Newton Hessian H."""

    def __init__(self, problem: Problem, options: Options) -> None:
        size = problem.sim.ndx + problem.sim.nu
        self._sim = problem.sim
        self.costs = problem.costs
        self.constraints = problem.constraints
        self.g = np.zeros((problem.horizon + 1, size))
        self.H = np.zeros((problem.horizon + 1, size, size))
        self._options = options
        self._refined = len(problem.refined_constraints)
        self._last: list[Matrix] = []
        terms = (*self.costs, *self.constraints)
        self._forces = [term for term in terms if type(term).at_kappa is not Term.at_kappa]

    def reset(self, multipliers: Sequence[Matrix] = (), penalties: Sequence[Matrix] = ()) -> None:
        """Start with zero multipliers and the first penalty, or with those of an earlier plan of the same problem.

        Constraints that this problem has more than that one, after the others, start anew. That one may have more only
        if it is this problem refined, which has additional constraints; their multipliers are not used.
        """
        shapes = [term.slope.shape for term in self.constraints]
        for given in (multipliers, penalties):
            common = min(len(given), len(shapes))
            surplus = len(given) - len(shapes) > self._refined
            if surplus or [a.shape for a in given[:common]] != shapes[:common]:
                raise ValueError(
                    f"ilqr(warm_start=...): expected multipliers of shapes {shapes}, got {[a.shape for a in given]}"
                )
        for i, term in enumerate(self.constraints):
            first = self._options.penalty * self._unit(term)
            term.slope[:] = multipliers[i] if i < len(multipliers) else 0.0
            term.weight[:] = 0.5 * (penalties[i] if i < len(penalties) else first) * term.mask
        self._last = []

    def _unit(self, term: Term) -> Any:
        """Scale of a constraint's penalties, the curvature 2 w of the costs: scaled costs have the same iterations.

        A component of x or u has that of its own weight; without one, and for anything else, it is the largest.
        """
        largest = max((2.0 * float(cost.weight.max(initial=0.0)) for cost in self.costs), default=0.0)
        largest = largest if largest > 0.0 else 1.0
        if term.columns is None:
            return largest
        own = np.zeros(self.g.shape[1])
        for cost in self.costs:
            if cost.columns is not None:
                np.maximum.at(own, cost.columns, 2.0 * cost.weight.max(axis=0))
        own = own[term.columns]
        return np.where(own > 0.0, np.maximum(own, _LEAST * largest), largest)

    def at_kappa(self, kappa: float | None) -> Objective:
        """Take forces at this central-path parameter from now on: that of the trajectory; None changes nothing."""
        if kappa is not None:
            for term in self._forces:
                term.at_kappa(kappa)
        return self

    def evaluate(self, xs: Matrix, us: Matrix) -> tuple[float, float]:
        """(cost, merit) at (xs, us)."""
        cost = 0.0
        for term in self.costs:
            cost += term.value(xs, us)
        merit = cost
        for term in self.constraints:
            merit += term.value(xs, us)
        return cost, merit

    def expand(self, xs: Matrix, us: Matrix) -> None:
        """Fill g and H at (xs, us)."""
        self.g.fill(0.0)
        self.H.fill(0.0)
        for term in (*self.costs, *self.constraints):
            term.expand(xs, us, self.g, self.H)

    def term_not_finite(self, xs: Matrix, us: Matrix) -> str:
        """The first cost or constraint whose residual or derivatives at (xs, us) are not finite, as a sentence."""
        for kind, terms in (("cost", self.costs), ("constraint", self.constraints)):
            for number, term in enumerate(terms):
                g, H = np.zeros_like(self.g), np.zeros_like(self.H)
                term.expand(xs, us, g, H)
                if not all(np.isfinite(part).all() for part in (term.residual, g, H)):
                    return f" It is {kind} {number}, {term.title}."
        return ""

    def worst(self, xs: Matrix, us: Matrix) -> tuple[float, str]:
        """Largest violation of a constraint, and which entry of which it is."""
        found = 0.0, ""
        for term in self.constraints:
            term.update(xs, us)
            size = term.violation()
            if size.size and size.max() > found[0]:
                row, entry = divmod(int(size.argmax()), size.shape[1])
                entry_name = term.entry_name(self._sim, entry)
                found = float(size.max()), f"{term.name} of {entry_name} at knot {term.knots[row]}"
        return found

    def violation(self, xs: Matrix, us: Matrix) -> float:
        """Largest violation of a constraint; 0 without constraints."""
        return largest_violation(self.constraints, xs, us)

    def mismatch(self, xs: Matrix, us: Matrix) -> float:
        """Largest violation of a constraint, or of the complementarity of an inequality and its multiplier."""
        worst = 0.0
        for term in self.constraints:
            term.update(xs, us)
            worst = max(worst, float(term.mismatch().max(initial=0.0)))
        return worst

    def update_multipliers(self, xs: Matrix, us: Matrix) -> None:
        """l <- l + rho r (kept >= 0 for inequalities); rho grows where the violation fell too little."""
        options = self._options
        now = []
        for i, term in enumerate(self.constraints):
            term.update(xs, us)
            violation = term.mismatch()
            term.slope += 2.0 * term.weight * term.residual
            if term.one_sided:
                np.maximum(term.slope, 0.0, out=term.slope)
            now.append(violation)
            if self._last:
                slow = violation > np.maximum(
                    options.violation_ratio * self._last[i], 0.1 * options.violation_tolerance
                )
                term.weight[slow] = np.minimum(term.weight[slow] * options.penalty_growth, 0.5 * options.penalty_max)
        self._last = now
