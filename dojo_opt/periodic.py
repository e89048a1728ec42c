"""Periodic: the motion ends as it began, somewhere else."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dojo_opt.names import chosen_components
from dojo_opt.penalty import penalty_derivatives
from dojo_opt.term import StateTerm, Term, table
from sim.mechanism.brief import brief_repr
from solvers.rotation import inverse_right_jacobian

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

__all__ = ["Periodic"]


@dataclass(frozen=True)
class Periodic:
    """(x_T (-) (x_0 (+) shift))_i = 0 for the chosen tangent components i (default all).

    shift: (ndx,), zero in the rotations: by what a period moves the robot on. For problems whose start is free.
    """

    shift: ArrayLike = 0.0
    components: Any = None

    __repr__ = brief_repr

    def bind(self, sim: Any, horizon: int, layout: Integers) -> Term:
        shift = table("Periodic(shift=...)", self.shift, 1, sim.ndx)[0]
        if np.any(shift[layout < 0]):
            raise ValueError("Periodic(shift=...): expected zeros for rotations by quaternion")
        mask = np.zeros((1, sim.ndx))
        mask[:, chosen_components("Periodic(components=...)", self.components, sim)] = 1.0
        return PeriodicTerm(sim, horizon, mask, shift, layout)


class PeriodicTerm(StateTerm):
    """r = x_T (-) (x_0 (+) shift); its dependence on x_0 is left to `jacobians`."""

    def __init__(self, sim: Any, horizon: int, mask: Array, shift: Array, layout: Integers) -> None:
        super().__init__("Periodic", np.array([horizon]), mask, np.zeros((1, sim.nx)), layout)
        self._sim, self.shift = sim, shift

    def update(self, xs: Array, us: Array) -> None:
        self.reference[0] = self._sim.integrate(xs[0], self.shift)
        super().update(xs, us)

    def coupling(self, xs: Array, us: Array) -> tuple[Array, Array, Array, Array]:
        """(dr/dx_T, dr/dx_0, first and second derivative of the contribution by r) at (xs, us)."""
        self.update(xs, us)
        first, second = np.empty_like(self.weight), np.empty_like(self.weight)
        penalty_derivatives(self.residual, self.weight, self.slope, self.one_sided, first, second)
        end, start = np.eye(self._layout.size), -np.eye(self._layout.size)
        i = 0
        while i < self._layout.size:
            if self._layout[i] >= 0:
                i += 1
                continue
            r = self.residual[0, i : i + 3]
            J = np.array(inverse_right_jacobian(r[0], r[1], r[2])).reshape(3, 3)
            end[i : i + 3, i : i + 3] = J  # r = log(q_0^* q_T): Jr^-1 on the right,
            start[i : i + 3, i : i + 3] = -J.T  # and Jl^-1 = Jr^-T on the left
            i += 3
        return end, start, first[0], second[0]
