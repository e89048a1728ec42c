"""Constraints: the hard aims of a plan, met by an augmented Lagrangian with a multiplier and a penalty per entry."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dojo_opt.planning.names import chosen_components, chosen_inputs, component_name
from dojo_opt.planning.residual import ResidualKernels, check_residual
from dojo_opt.planning.term import (
    PeriodicTerm,
    Pick,
    PickTerm,
    ResidualTerm,
    StateTerm,
    Term,
    knot_list,
    numbers,
    state_table,
    table,
)
from sim.mechanism.brief import brief_repr

Integers = NDArray[np.int64]
Vector = NDArray[np.float64]

__all__ = ["ControlBounds", "Goal", "Periodic", "ResidualConstraint", "StateBounds"]


@dataclass(frozen=True)
class Goal:
    """(x_t (-) target)_i = 0 for the chosen tangent components i (default all) at `knots` (default the last).

    target: (nx,), or one row per knot. components: numbers, or names as in `Mechanism.components`: "base", "v knee".
    """

    target: ArrayLike
    components: Any = None
    knots: Any = -1

    __repr__ = brief_repr

    def bind(self, sim: Any, horizon: int, layout: Integers) -> Term:
        knots = knot_list("Goal(knots=...)", self.knots, horizon, last=True)
        target = state_table("Goal(target=...)", self.target, knots.size, sim.nx, layout)
        mask = np.zeros((knots.size, sim.ndx))
        mask[:, chosen_components("Goal(components=...)", self.components, sim)] = 1.0
        return StateTerm("Goal", knots, mask, target, layout)


def _bounds(call: str, lower: ArrayLike, upper: ArrayLike, rows: int, chosen: Integers) -> tuple[Any, Integers, Vector]:
    """Reference, repeated components and signs of  lower - z <= 0  and  z - upper <= 0, without infinite bounds."""
    columns = chosen.size
    with_inf = []
    for side, bound in (("lower", lower), ("upper", upper)):
        given = numbers(f"{call}({side}=...)", bound)
        if given.shape not in ((), (columns,), (rows, columns)):
            raise ValueError(f"{call}({side}=...): expected shape () or ({columns},), got {given.shape}")
        with_inf.append(np.broadcast_to(given, (rows, columns)))
    if np.any(np.isnan(with_inf)) or np.any(with_inf[0] > with_inf[1]):
        raise ValueError(f"{call}: expected lower <= upper, got lower {lower!r}, upper {upper!r}")
    keep = [np.any(np.isfinite(b), axis=0) for b in with_inf]
    reference = np.concatenate([b[:, k] for b, k in zip(with_inf, keep, strict=True)], axis=1)
    big = np.where(np.isfinite(reference), reference, np.sign(reference) * 1e100)
    sign = np.repeat([-1.0, 1.0], [int(k.sum()) for k in keep])
    return np.ascontiguousarray(big), np.concatenate([chosen[k] for k in keep]), sign


@dataclass(frozen=True)
class StateBounds:
    """lower <= component <= upper of chosen scalar tangent components (default all) at `knots` (default 1 to T).

    lower, upper: scalars or one per component, infinite where free. components: numbers, or names as in
    `Mechanism.components`: "base z", "v knee". A rotation by quaternion has no such bounds.
    """

    lower: ArrayLike
    upper: ArrayLike
    components: Any = None
    knots: Any = None

    __repr__ = brief_repr

    def bind(self, sim: Any, horizon: int, layout: Integers) -> Term:
        knots = knot_list("StateBounds(knots=...)", self.knots, horizon, last=True)
        knots = knots[knots > 0] if self.knots is None else knots
        chosen = chosen_components("StateBounds(components=...)", self.components, sim)
        reference, columns, sign = _bounds("StateBounds", self.lower, self.upper, knots.size, chosen)
        if np.any(layout[columns] < 0):
            bad = int(columns[layout[columns] < 0][0])
            name = component_name(sim, bad)
            raise ValueError(
                f"StateBounds(components=...): component {bad} ({name}) belongs to a quaternion: no bounds"
            )
        pick = Pick(True, layout[columns], columns, sign)
        return PickTerm("StateBounds", knots, np.ones_like(reference), reference, pick, one_sided=True)


@dataclass(frozen=True)
class ControlBounds:
    """lower <= u_i <= upper for chosen controls (default all) at `knots` (default all), as a soft-to-hard constraint.

    components: numbers or names of inputs.
    `Problem(control_limits=...)` is exact at every iteration and usually better; use this to bound single knots.
    """

    lower: ArrayLike
    upper: ArrayLike
    components: Any = None
    knots: Any = None

    __repr__ = brief_repr

    def bind(self, sim: Any, horizon: int, layout: Integers) -> Term:
        del layout
        knots = knot_list("ControlBounds(knots=...)", self.knots, horizon, last=False)
        chosen = chosen_inputs("ControlBounds(components=...)", self.components, sim)
        reference, columns, sign = _bounds("ControlBounds", self.lower, self.upper, knots.size, chosen)
        pick = Pick(False, columns, sim.ndx + columns, sign)
        return PickTerm("ControlBounds", knots, np.ones_like(reference), reference, pick, one_sided=True)


@dataclass(frozen=True)
class ResidualConstraint:
    """r(x_t, u_t) = 0, or r <= 0 with equality=False, for a compiled function of the user; see `ResidualCost`."""

    function: Callable[..., Any]
    dimension: int
    equality: bool = True
    jacobian: Callable[..., Any] | None = None
    knots: Any = None

    __repr__ = brief_repr

    def bind(self, sim: Any, horizon: int, layout: Integers) -> Term:
        check_residual("ResidualConstraint", self.function, self.dimension, self.jacobian, sim)
        knots = knot_list("ResidualConstraint(knots=...)", self.knots, horizon, last=True)
        kernels = ResidualKernels(self.function, self.jacobian, sim.nu)
        weight = np.ones((knots.size, self.dimension))
        return ResidualTerm("ResidualConstraint", knots, weight, not self.equality, kernels, layout)


@dataclass(frozen=True)
class Periodic:
    """(x_T (-) (x_0 (+) shift))_i = 0 for the chosen tangent components i (default all).

    shift: (ndx,) displacement over one period, zero in the rotations. For problems whose start is free.
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
