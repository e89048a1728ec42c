"""TaskSpec: the common part of costs and constraints in task space: aims, bounds, weights, knots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.planning.task_space.quantity import Quantity
from dojo_opt.planning.task_space.task_term import Entries, PeriodicTaskTerm, TaskTerm
from dojo_opt.planning.term import Spec, Term, check_order, knot_list, numbers, table
from sim.mechanism import checks
from sim.mechanism.short_repr import short_repr
from sim.simulator.simulator import Simulator
from solvers.types import Integers, Matrix, Vector

_FREE = 1e100  # in place of an infinite bound


@dataclass(frozen=True, kw_only=True)
class TaskSpec(Spec):
    """A quantity at a target, within bounds, or the same at the end as at the start.

    In the costs of a problem it adds scale * sum_t sum_i weight_ti r_ti^2; among its constraints r = 0, for entries of
    positive weight. With bounds r is the excess beyond them, in costs as well.

    Attributes:
        lower: least value, a number, one per entry, or one row per knot; infinite where free (default None: none).
        upper: largest value, likewise.
        weight: a number, one per entry, one row per knot, or a dict keyed by names of entries, each a number or one per
            knot; entries without a name in it weigh zero [1 / square of the entry's unit] (default 1).
        knots: numbers of the knots; negative ones count from the end (default None: all of them).
        scale: factor of the whole cost (default 1).
        periodic: whether the value at the end equals that at the start plus the target; a constraint of problems whose
            start is free (default False).
    """

    lower: ArrayLike | None = None
    upper: ArrayLike | None = None
    weight: ArrayLike | Mapping[str, ArrayLike] = 1.0
    knots: Any = None
    scale: float = 1.0
    periodic: bool = False

    __repr__ = short_repr

    _LAST = True  # whether the final knot has one

    def bind(self, sim: Simulator, horizon: int, layout: Integers) -> Term:
        del layout
        call = type(self).__name__
        if not isinstance(self.periodic, bool | np.bool_):
            raise ValueError(f"{call}(periodic=...): expected True or False, got {checks.shown(self.periodic)}")
        if self.periodic:
            return self._tie(sim, horizon)
        knots = knot_list(f"{call}(knots=...)", self.knots, horizon, last=self._LAST)
        quantity, chosen, target = self._bound(sim, knots)
        names, groups = chosen_names(quantity, chosen)
        weight = self._weight(knots.size, names, groups)
        if self.lower is None and self.upper is None:
            reference = table(f"{call}(target=...)", target, knots.size, len(chosen))
            return TaskTerm(call, quantity, Entries(chosen, np.ones(len(chosen)), reference), weight)
        entry, sign, reference = bounds(call, self.lower, self.upper, knots.size, len(chosen))
        entries = Entries(chosen[entry], sign, reference)
        return TaskTerm(call, quantity, entries, np.ascontiguousarray(weight[:, entry]), one_sided=True)

    def _tie(self, sim: Simulator, horizon: int) -> Term:
        call = type(self).__name__
        if not self._LAST:
            raise ValueError(f"{call}(periodic=True): it depends on the inputs, which the end of a plan does not have")
        if self.knots is not None or self.lower is not None or self.upper is not None:
            raise ValueError(f"{call}(periodic=True): expected no knots and no bounds")
        quantity, chosen, shift = self._bound(sim, np.array([0, horizon]))
        weight = self._weight(1, *chosen_names(quantity, chosen))
        return PeriodicTaskTerm(call, quantity, chosen, table(f"{call}(target=...)", shift, 1, len(chosen)), weight)

    def _weight(self, rows: int, names: Sequence[str], groups: Mapping[str, Sequence[int]]) -> Matrix:
        """scale times the weight, (rows, d)."""
        call, width = f"{type(self).__name__}(weight=...)", len(names)
        if isinstance(self.weight, Mapping):
            out = np.zeros((rows, width))
            for name, value in self.weight.items():
                known = {n: (i,) for i, n in enumerate(names)} | dict(groups)
                at = known[checks.one_of(call, name, known)]
                one = numbers(f"{call}: {name!r}", value)
                if one.shape not in ((), (rows,)):
                    raise ValueError(f"{call}: {name!r}: expected a number or shape ({rows},), got {one.shape}")
                out[:, list(at)] = one if one.ndim == 0 else one[:, None]
        else:
            out = table(call, self.weight, rows, width)
        if np.any(out < 0.0) or not np.isfinite(out).all():
            raise ValueError(f"{call}: expected finite numbers >= 0, got {out.min():g}")
        return checks.number(f"{type(self).__name__}(scale=...)", self.scale, at_least=0.0) * out

    def _bound(self, sim: Simulator, knots: Integers) -> tuple[Quantity, Integers, ArrayLike]:
        """The quantity, its chosen entries, and their target."""
        raise NotImplementedError


def chosen_names(quantity: Quantity, chosen: Integers) -> tuple[list[str], dict[str, list[int]]]:
    """Names of the chosen entries, and groups of several, with their places among them."""
    place = {int(entry): i for i, entry in enumerate(chosen)}
    groups = {name: [place[i] for i in group if i in place] for name, group in quantity.groups.items()}
    return [quantity.names[i] for i in chosen], {name: group for name, group in groups.items() if group}


def bounds(
    call: str, lower: ArrayLike | None, upper: ArrayLike | None, rows: int, width: int
) -> tuple[Integers, Vector, Matrix]:
    """Entries, signs and references of  lower - y <= 0  and  y - upper <= 0, without entries that have no bound."""
    sides = []
    for side, bound, free in (("lower", lower, -np.inf), ("upper", upper, np.inf)):
        given = numbers(f"{call}({side}=...)", free if bound is None else bound)
        if given.shape not in ((), (width,), (rows, width), (rows, 1)):
            raise ValueError(
                f"{call}({side}=...): expected shape (), ({width},) or ({rows}, {width}), got {given.shape}"
            )
        sides.append(np.broadcast_to(given, (rows, width)))
    check_order(call, lower, upper, sides)
    keep = [np.isfinite(side).any(axis=0) for side in sides]
    reference = np.concatenate([side[:, k] for side, k in zip(sides, keep, strict=True)], axis=1)
    if reference.shape[1] == 0:
        raise ValueError(f"{call}: expected a finite bound, got lower {lower!r}, upper {upper!r}")
    sign = np.repeat([-1.0, 1.0], [int(k.sum()) for k in keep])
    entry = np.concatenate([np.flatnonzero(k) for k in keep]).astype(np.int64)
    return entry, sign, np.ascontiguousarray(np.where(np.isfinite(reference), reference, np.sign(reference) * _FREE))
