"""Term: one cost or constraint bound to a simulator and a horizon, with its residuals, weights and multipliers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.planning.component_names import component_name
from dojo_opt.planning.manifold import state_residual
from dojo_opt.planning.penalty import add_dense_expansion, add_expansion, penalty, penalty_derivatives
from dojo_opt.planning.residual import ResidualKernels
from sim.mechanism import checks
from sim.simulator.simulator import Simulator
from solvers.rotation import inverse_right_jacobian
from solvers.types import Integers, Matrix, Stack, Vector

_ROUNDED = 1e-12  # below, it is as near to one as sums get


class Spec(Protocol):
    """A cost or a constraint as a user writes it."""

    def bind(self, sim: Simulator, horizon: int, layout: Integers) -> Term:
        """The term of one simulator and horizon, with its arrays; `Problem` calls it.

        Args:
            sim: the simulator.
            horizon: number T of knots.
            layout: (ndx,) address in x of every tangent component; negative for rotations by quaternion.

        Returns:
            The term.

        Raises:
            ValueError: a field has the wrong shape, an unknown name, or a knot beyond the horizon.
        """
        ...


class Term:
    """Residual r (m, d) at `knots` (m,), weight and slope (m, d); `dojo_opt.planning.penalty` has its formula.

    A cost keeps its weights; of a constraint, slope is the multiplier and weight half the penalty.
    """

    point_body: int | None = None  # body on which it has a point other than the centre of mass

    def __init__(self, name: str, knots: Integers, weight: Matrix, one_sided: bool = False) -> None:
        self.name = name
        self.knots = knots
        self.weight = weight
        self.mask = (weight > 0.0).astype(float)  # entries that take part
        self.slope = np.zeros_like(weight)
        self.one_sided = one_sided
        self.residual = np.zeros_like(weight)
        self.columns: Integers | None = None  # of z = (dx, du), that of each entry, where it belongs to a single one
        self._first = np.empty_like(weight)
        self._second = np.empty_like(weight)

    def update(self, xs: Matrix, us: Matrix) -> None:
        """Fill `residual`."""
        raise NotImplementedError

    def _add(self, xs: Matrix, us: Matrix, g: Matrix, H: Stack) -> None:
        raise NotImplementedError

    def value(self, xs: Matrix, us: Matrix) -> float:
        """Contribution of the term to the merit at (xs, us)."""
        self.update(xs, us)
        return float(penalty(self.residual, self.weight, self.slope, self.one_sided))

    def value_at(self, knot: int, xs: Matrix, us: Matrix) -> float:
        """The part of `value` that belongs to a knot."""
        rows = self.knots == knot
        if not rows.any():
            return 0.0
        self.update(xs, us)
        return float(penalty(self.residual[rows], self.weight[rows], self.slope[rows], self.one_sided))

    def expand(self, xs: Matrix, us: Matrix, g: Matrix, H: Stack) -> None:
        """Add gradient and Gauss-Newton Hessian at (xs, us) to g (T + 1, ndx + nu) and H."""
        self.update(xs, us)
        penalty_derivatives(self.residual, self.weight, self.slope, self.one_sided, self._first, self._second)
        self._add(xs, us, g, H)

    def entry_name(self, sim: Simulator, entry: int) -> str:
        """The subject of an entry of the residual, in words."""
        return f"entry {entry}" if self.columns is None else component_name(sim, int(self.columns[entry]))

    @property
    def title(self) -> str:
        """Its name in a message."""
        return self.name

    def at_kappa(self, kappa: float | None) -> None:
        """Take forces at this central-path parameter from now on; None for that of the simulator."""

    def violation(self) -> Matrix:
        """|r| of equalities, max(r, 0) of inequalities, at the last `update`; zero where an entry takes no part."""
        size = np.maximum(self.residual, 0.0) if self.one_sided else np.abs(self.residual)
        return np.multiply(size, self.mask, out=size)

    def mismatch(self) -> Matrix:
        """As `violation`, but of inequalities |max(r, -l / rho)|: zero only where r l = 0 too, so that l is right."""
        if not self.one_sided:
            return self.violation()
        slack = np.divide(self.slope, 2.0 * self.weight, out=np.zeros_like(self.slope), where=self.weight > 0.0)
        return np.abs(np.maximum(self.residual, -slack)) * self.mask


def largest_violation(constraints: Sequence[Term], xs: Matrix, us: Matrix) -> float:
    """Largest violation of a constraint at (xs, us); 0 without constraints."""
    worst = 0.0
    for term in constraints:
        term.update(xs, us)
        worst = max(worst, float(term.violation().max(initial=0.0)))
    return worst


class StateTerm(Term):
    """r = x (-) reference on all tangent components."""

    def __init__(self, name: str, knots: Integers, weight: Matrix, reference: Matrix, layout: Integers) -> None:
        super().__init__(name, knots, weight)
        self.reference = reference
        self._layout = layout
        column = np.arange(layout.size)
        first = (layout < 0) & (np.append(0, layout[:-1]) != layout)
        self._column = np.where(first, -(column + 1), column)
        self._sign = np.ones(layout.size)
        self.columns = column

    def update(self, xs: Matrix, us: Matrix) -> None:
        state_residual(self._layout, xs, self.knots, self.reference, self.residual)

    def _add(self, xs: Matrix, us: Matrix, g: Matrix, H: Stack) -> None:
        add_expansion(self.residual, self._first, self._second, self.knots, self._column, self._sign, g, H)


class PeriodicTerm(StateTerm):
    """r = x_T (-) (x_0 (+) shift); its dependence on x_0 is left to `jacobians`."""

    def __init__(self, sim: Simulator, horizon: int, mask: Matrix, shift: Matrix, layout: Integers) -> None:
        super().__init__("Periodic", np.array([horizon]), mask, np.zeros((1, sim.nx)), layout)
        self._sim, self.shift = sim, shift

    def update(self, xs: Matrix, us: Matrix) -> None:
        self.reference[0] = self._sim.integrate(xs[0], self.shift)
        super().update(xs, us)

    def coupling(self, xs: Matrix, us: Matrix) -> tuple[Matrix, Matrix, Matrix, Matrix]:
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


class Pick(NamedTuple):
    """Scalar components of x or of u."""

    of_state: bool
    address: Integers  # in x or in u
    column: Integers  # in z = (dx, du)
    sign: Vector


class PickTerm(Term):
    """r = sign * (component - reference) on chosen scalar components of x or of u."""

    def __init__(
        self, name: str, knots: Integers, weight: Matrix, reference: Matrix, pick: Pick, one_sided: bool = False
    ) -> None:
        super().__init__(name, knots, weight, one_sided)
        self.reference, self.pick = reference, pick
        self.columns = pick.column
        self._whole = not pick.of_state and np.array_equal(pick.address, np.arange(weight.shape[1]))

    def update(self, xs: Matrix, us: Matrix) -> None:
        source = xs if self.pick.of_state else us
        rows = source[self.knots] if self._whole else source[self.knots[:, None], self.pick.address]
        np.subtract(rows, self.reference, out=self.residual)
        self.residual *= self.pick.sign

    def _add(self, xs: Matrix, us: Matrix, g: Matrix, H: Stack) -> None:
        add_expansion(self.residual, self._first, self._second, self.knots, self.pick.column, self.pick.sign, g, H)


class ResidualTerm(Term):
    """r = a user's compiled function of (x, u)."""

    def __init__(
        self, name: str, knots: Integers, weight: Matrix, one_sided: bool, kernels: ResidualKernels, layout: Integers
    ) -> None:
        super().__init__(name, knots, weight, one_sided)
        self._kernels = kernels
        self._layout = layout

    @property
    def title(self) -> str:
        return f"{self.name} of {self._kernels.name!r}"

    def update(self, xs: Matrix, us: Matrix) -> None:
        self._kernels.values(xs, us, self.knots, self.residual)

    def _add(self, xs: Matrix, us: Matrix, g: Matrix, H: Stack) -> None:
        jacobian = self._kernels.jacobians(self._layout, xs, us, self.knots, self.residual.shape[1])
        add_dense_expansion(jacobian, self._first, self._second, self.knots, g, H)


def numbers(call: str, value: ArrayLike) -> Matrix:
    """`value` as an array of floats; anything else is refused by a ValueError that names the call."""
    return checks.floats(call, value)


def check_order(call: str, lower: Any, upper: Any, sides: list[Any]) -> None:
    """Refuse bounds that nothing meets; sides: `lower` and `upper` as arrays of the same shape."""
    if np.any(np.isnan(sides)) or np.any(sides[0] > sides[1]):
        raise ValueError(f"{call}: expected lower <= upper, got lower {lower!r}, upper {upper!r}")
    for side, bound, beyond in (("lower", sides[0], np.inf), ("upper", sides[1], -np.inf)):
        if np.any(bound == beyond):
            raise ValueError(f"{call}: {side}: expected a number, or {-beyond:g} for no bound, got {beyond:g}")


def table(call: str, value: ArrayLike, rows: int, columns: int) -> Matrix:
    """Broadcast `value` to (rows, columns) and refuse anything that is not finite."""
    array = numbers(call, value)
    if array.shape not in ((), (columns,), (rows, columns), (1, columns), (rows, 1)):
        raise ValueError(f"{call}: expected shape (), ({columns},) or ({rows}, {columns}), got {array.shape}")
    if not np.all(np.isfinite(array)):
        index = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise ValueError(f"{call}: expected finite numbers, got {array[index]} at index {index}")
    return np.ascontiguousarray(np.broadcast_to(array, (rows, columns)), dtype=float).copy()


def state_table(call: str, value: ArrayLike, rows: int, columns: int, layout: Integers) -> Matrix:
    """`table` of states, whose quaternions have to be of length one; layout: see `manifold.tangent_layout`."""
    states = table(call, value, rows, columns)
    for first in np.unique(-layout[layout < 0] - 1):
        part = states[:, first : first + 4]
        length = np.linalg.norm(part, axis=1)
        off = np.abs(length - 1.0)
        if off.max(initial=0.0) > checks.UNIT:
            row = int(off.argmax())
            raise ValueError(
                f"{call}: expected a unit quaternion (w, x, y, z) at [{first}:{first + 4}], got length {length[row]:g}"
                + (f" in row {row}" if rows > 1 else "")
            )
        part[off > _ROUNDED] /= length[off > _ROUNDED, None]
    return states


def knot_list(call: str, knots: Any, horizon: int, last: bool) -> Integers:
    """Knot numbers as an array; None means all, with the final one if `last`; negative ones count from the end."""
    count = horizon + 1 if last else horizon
    if knots is None:
        return np.arange(count)
    chosen = checks.whole_numbers(call, knots)
    if chosen.ndim != 1 or chosen.size == 0 or np.any(chosen < -count) or np.any(chosen >= count):
        raise ValueError(f"{call}: expected knots in [{-count}, {count}), got {chosen.tolist()}")
    return np.where(chosen < 0, chosen + count, chosen).astype(np.int64)
