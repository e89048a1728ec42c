"""ParameterEngine: parameters of a simulator by name, and derivatives by them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.derivatives.parameters.parameters import KINDS, ParameterPlan, Parameters, all_parameters
from sim.derivatives.parameters.selection import select, with_values
from sim.integrators.adjoint import Sweep
from sim.mechanism import checks
from sim.mechanism.mechanism import Mechanism
from sim.simulator.engine import Engine, Rolled
from sim.simulator.sensitivity import adjoint_sweep, parameter_columns, roll_parameters
from solvers.types import Vector

Floats = NDArray[np.float64]
_VARIABLES = ("state", "input")


class ParameterEngine:
    """Derivatives by the parameters of one simulator; selections of parameters are those of `select`."""

    def __init__(self, engine: Engine, mechanism: Mechanism, time_step: float) -> None:
        self._engine, self._mechanism, self._time_step = engine, mechanism, time_step
        self._known = all_parameters(mechanism, time_step)
        # those made so far: finding parameters by name takes longer than their derivatives
        self._selections: dict[tuple[str, ...], tuple[Parameters, ParameterPlan]] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """Those of all parameters."""
        return tuple(p.name for p in self._known)

    def select(self, call: str, wrt: Sequence[str]) -> tuple[tuple[str, ...], Parameters, ParameterPlan]:
        """The names, one or several; those of them that are parameters, and the terms of their columns."""
        asked = _different_names(call, wrt)
        names = tuple(name for name in asked if name not in _VARIABLES)
        if names and self._engine.settings.order != 2:
            raise ValueError(f"{call}: expected a simulator of order 2, got order {self._engine.settings.order}")
        return asked, *self._selection(call, names)

    def values(self, call: str, wrt: Sequence[str]) -> Parameters:
        """Parameters by name."""
        return self._selection(call, _different_names(call, wrt))[0]

    def _selection(self, call: str, names: tuple[str, ...]) -> tuple[Parameters, ParameterPlan]:
        if names not in self._selections:
            self._selections[names] = select(call, self._known, names)
        return self._selections[names]

    def with_values(self, call: str, values: Mapping[str, ArrayLike]) -> tuple[Mechanism, float]:
        """The mechanism and the time step with other values of parameters."""
        return with_values(call, self._mechanism, self._time_step, values)

    def columns(self, step: tuple[Vector, Vector], A: Floats, plan: ParameterPlan) -> Floats:
        """See `parameter_columns`."""
        return parameter_columns(self._engine, self._mechanism, step, A, plan)

    def roll(
        self, x: Vector, us: Floats, plan: ParameterPlan, kappa: float | None, wrenches: Floats | None
    ) -> tuple[Rolled, Floats]:
        """See `roll_parameters`."""
        return roll_parameters(self._engine, self._mechanism, (x, us, wrenches), plan, kappa)

    def sweep(
        self,
        path: tuple[Floats, Floats],
        loss: Floats,
        plan: ParameterPlan,
        kappa: float | None,
        wrenches: Floats | None,
    ) -> tuple[int, Sweep]:
        """See `adjoint_sweep`."""
        return adjoint_sweep(self._engine, self._mechanism, (*path, wrenches), loss, plan, kappa)


def _different_names(call: str, wrt: Sequence[str]) -> tuple[str, ...]:
    """The names, one or several, all different."""
    names = (wrt,) if isinstance(wrt, str) else tuple(wrt)
    for name in names:
        if not isinstance(name, str):
            raise ValueError(f"{call}: expected names, got {name!r}")
        checks.one_of(f"{call}: kind", name.split(":")[0].split("[")[0], (*_VARIABLES, *KINDS))
    checks.distinct(call, names)
    return names
