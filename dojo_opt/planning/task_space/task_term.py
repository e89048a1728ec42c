"""TaskTerm: chosen entries of a quantity as a cost or a constraint; and its tie of the end to the start."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dojo_opt.planning.penalty import add_dense_expansion, penalty_derivatives
from dojo_opt.planning.task_space.quantity import Quantity
from dojo_opt.planning.term import Term
from sim.simulator.simulator import Simulator
from solvers.types import Integers, Matrix, Stack, Vector


class Entries(NamedTuple):
    """Residual r = sign (y_entry - reference), entry by entry."""

    entry: Integers  # (d,) of the quantity
    sign: Vector  # (d,)
    reference: Matrix  # (m, d)


class TaskTerm(Term):
    """r = sign (y - reference) on chosen entries of a quantity y(x, u)."""

    def __init__(
        self, name: str, quantity: Quantity, entries: Entries, weight: Matrix, *, one_sided: bool = False
    ) -> None:
        super().__init__(name, quantity.knots, weight, one_sided)
        self._quantity, self._entries, self.point_body = quantity, entries, quantity.point_body

    def entry_name(self, sim: Simulator, entry: int) -> str:
        return self._quantity.names[self._entries.entry[entry]]

    def at_kappa(self, kappa: float | None) -> None:
        self._quantity.kappa = kappa

    def update(self, xs: Matrix, us: Matrix) -> None:
        self._residual(self._quantity.values(xs, us))

    def _residual(self, y: Matrix) -> None:
        entry, sign, reference = self._entries
        np.subtract(y[:, entry], reference, out=self.residual)
        self.residual *= sign

    def expand(self, xs: Matrix, us: Matrix, g: Matrix, H: Stack) -> None:
        y, jacobians = self._quantity.expansion(xs, us)
        self._residual(y)
        penalty_derivatives(self.residual, self.weight, self.slope, self.one_sided, self._first, self._second)
        entry, sign, _ = self._entries
        J = np.ascontiguousarray(sign[:, None] * jacobians[:, entry])
        add_dense_expansion(J, self._first, self._second, self.knots, g, H)


class PeriodicTaskTerm(Term):
    """r = y(x_T) - y(x_0) - shift on chosen entries; its dependence on x_0 is left to `FreeStart`, as of `Periodic`."""

    def __init__(self, name: str, quantity: Quantity, entries: Integers, shift: Matrix, weight: Matrix) -> None:
        super().__init__(name, quantity.knots[-1:], weight)
        self._quantity, self._entries, self._shift = quantity, entries, shift
        self.point_body = quantity.point_body

    def entry_name(self, sim: Simulator, entry: int) -> str:
        return self._quantity.names[self._entries[entry]]

    def update(self, xs: Matrix, us: Matrix) -> None:
        self._residual(self._quantity.values(xs, us))

    def _residual(self, y: Matrix) -> None:
        self.residual[0] = (y[1] - y[0])[self._entries] - self._shift[0]

    def expand(self, xs: Matrix, us: Matrix, g: Matrix, H: Stack) -> None:
        end, _, first, second = self.coupling(xs, us)
        J = np.zeros((1, len(end), g.shape[1]))
        J[0, :, : end.shape[1]] = end
        add_dense_expansion(J, first[None], second[None], self.knots, g, H)

    def coupling(self, xs: Matrix, us: Matrix) -> tuple[Matrix, Matrix, Matrix, Matrix]:
        """(dr/dx_T, dr/dx_0, first and second derivative of the contribution by r) at (xs, us)."""
        y, jacobians = self._quantity.expansion(xs, us)
        self._residual(y)
        penalty_derivatives(self.residual, self.weight, self.slope, self.one_sided, self._first, self._second)
        chosen = jacobians[:, self._entries, : jacobians.shape[2] - us.shape[1]]
        return chosen[1].copy(), -chosen[0], self._first[0], self._second[0]
