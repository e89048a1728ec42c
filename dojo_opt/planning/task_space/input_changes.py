"""Changes of the inputs from one knot to the next, as a cost or a constraint."""

from __future__ import annotations

import numpy as np

from dojo_opt.planning.task_space.task_term import Entries
from dojo_opt.planning.term import Term
from sim.simulator.simulator import Simulator
from solvers.types import Integers, Matrix, Stack, Vector


class InputChanges(Term):
    """r = sign (u_t - u_t-1 - reference) at knots t, u_-1 given or free.

    Terms of a plan have one knot each. The gradient of this one is exact; its Hessian, which couples neighbours, is
    bounded by one that does not:  (a - b)^2 <= 2 a^2 + 2 b^2  for the changes a, b of neighbours. The bound only makes
    steps shorter: the solution is the same.
    """

    def __init__(self, knots: Integers, weight: Matrix, entries: Entries, before: Vector, *, one_sided: bool) -> None:
        super().__init__("TorqueRate", knots, weight, one_sided)
        self._input, self._sign, self._reference = entries
        self._before = before

    def entry_name(self, sim: Simulator, entry: int) -> str:
        return f"input {sim.mechanism.input_names[self._input[entry]]}"

    def update(self, xs: Matrix, us: Matrix) -> None:
        earlier = np.concatenate([self._before[None], us[:-1]])
        change = (us - earlier)[self.knots][:, self._input]
        np.multiply(self._sign, change - self._reference, out=self.residual)

    def _add(self, xs: Matrix, us: Matrix, g: Matrix, H: Stack) -> None:
        column = g.shape[1] - us.shape[1] + self._input
        slope = self._sign * self._first
        for row, t in enumerate(self.knots):
            np.add.at(g[t], column, slope[row])
            np.add.at(H[t], (column, column), (2.0 if t > 0 else 1.0) * self._second[row])
            if t > 0:
                np.add.at(g[t - 1], column, -slope[row])
                np.add.at(H[t - 1], (column, column), 2.0 * self._second[row])
