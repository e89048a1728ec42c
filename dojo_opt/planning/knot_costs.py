"""KnotCosts: the costs of a problem at one knot after another, for environments."""

from __future__ import annotations

import numpy as np

from dojo_opt.planning.manifold import state_difference
from dojo_opt.planning.problem import Problem
from dojo_opt.planning.term import PickTerm, StateTerm
from solvers.compiler import kernel
from solvers.types import Cube, Integers, Matrix, Vector


@kernel
def _knot_cost(
    layout: Integers, states: Cube, residual: Vector, address: Integers, picks: Cube, t: int, xs: Matrix, us: Matrix
) -> float:
    """Sum of w r^2 over all costs at the knot t; there is no input at the last one.

    states     (n, T + 1, nx + ndx) reference and weights of costs of whole states
    picks      (2, T + 1, m) references and weights of costs of single components of z = (x, u), at `address` (m,)
    """
    total, x, nx = 0.0, xs[t], xs.shape[1]
    for i in range(address.shape[0]):
        a, w = address[i], picks[1, t, i]
        if w > 0.0:
            z = x[a] if a < nx else us[t, a - nx]
            total += w * (z - picks[0, t, i]) ** 2
    for i in range(states.shape[0]):
        state_difference(layout, x, states[i, t, :nx], residual)
        for j in range(residual.shape[0]):
            total += states[i, t, nx + j] * residual[j] ** 2
    return total


class KnotCosts:
    """Costs of states, controls and components in one compiled call; the others by their terms.

    Args:
        problem: the problem; its terms are written into.
    """

    def __init__(self, problem: Problem) -> None:
        knots, sim = problem.horizon + 1, problem.sim
        once = [term for term in problem.costs if len(np.unique(term.knots)) == len(term.knots)]
        whole = [term for term in once if type(term) is StateTerm]
        single = [term for term in once if type(term) is PickTerm]
        self._others = [term for term in problem.costs if term not in whole and term not in single]
        n, m, nx = len(whole), sum(term.weight.shape[1] for term in single), sim.nx
        self._layout, self._residual = problem.layout, np.zeros(sim.ndx)
        self._states = np.zeros((n, knots, nx + sim.ndx))
        self._states[..., :nx] = problem.start  # where there is no cost: a state with quaternions of length one
        for i, cost in enumerate(whole):
            self._states[i, cost.knots, :nx], self._states[i, cost.knots, nx:] = cost.reference, cost.weight
        self._address, self._picks, last = np.zeros(m, dtype=np.int64), np.zeros((2, knots, m)), 0
        for term in single:
            own = slice(last, last := last + term.weight.shape[1])
            self._address[own] = term.pick.address + (0 if term.pick.of_state else nx)
            self._picks[0, term.knots, own], self._picks[1, term.knots, own] = term.reference, term.weight

    def __call__(self, knot: int, xs: Matrix, us: Matrix) -> float:
        """Cost of a knot of the trajectory xs (T + 1, nx), us (T, nu)."""
        states, picks = (self._layout, self._states, self._residual), (self._address, self._picks)
        total = float(_knot_cost(*states, *picks, knot, xs, us))
        for term in self._others:
            total += term.value_at(knot, xs, us)
        return total
