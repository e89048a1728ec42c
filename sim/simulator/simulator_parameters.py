"""SimulatorParameters: parameters of a simulator by name, and derivatives by them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike

from sim.derivatives.parameters.parameters import KINDS, Parameter, ParameterPlan, Parameters, all_parameters
from sim.derivatives.parameters.selection import Table, by_names, listed, select, with_values
from sim.integrators.adjoint import Sweep
from sim.mechanism import checks
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.pack import pack
from sim.model.model import Model
from sim.simulator.engines.engine import Engine, Rolled
from sim.simulator.engines.intervals import Intervals
from sim.simulator.sensitivity import Request, adjoint_sweep, roll_parameters
from solvers.types import Floats, Vector

_VARIABLES = ("state", "input")
_NUDGE, _LEAST = 1e-5, 1e-2  # relative size of the differences of parameters, of values of at least that size
_LINKED = ("dof_damper", "dof_spring", "contact_restitution")  # arrays whose kernels are linked where they are not zero
_OF_MOMENTUM = frozenset(  # kinds on which the momentum of a state depends
    ("mass", "inertia", "com", "parent_point", "child_point", "orientation", "axis", "spring", "rest", "armature")
    + ("damper", "pitch", "gravity", "time_step")
)


class SimulatorParameters:
    """Derivatives by the parameters of one simulator; selections of parameters are those of `select`."""

    def __init__(self, engine: Engine, mechanism: Mechanism, time_step: float) -> None:
        self._engine, self._mechanism, self._time_step = engine, mechanism, time_step
        # those made so far: finding parameters by name takes longer than their derivatives
        self._selections: dict[tuple[str, ...], tuple[Parameters, ParameterPlan]] = {}
        self._written = mechanism  # that of the values in the model, which `adopt` changes
        self._of_written: Table | None = None
        self._packed: Model | None = None  # it, as `adopt` has packed it last

    @cached_property
    def _known(self) -> list[Parameter]:
        return all_parameters(self._mechanism, self._time_step)

    @property
    def _table(self) -> Table:
        """By names, at the values in the model."""
        if self._written is self._mechanism:
            return self._own_table
        if self._of_written is None:
            self._of_written = by_names(all_parameters(self._written, self._time_step))
        return self._of_written

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters."""
        return tuple(p.name for p in self._known)

    def select(self, call: str, wrt: Sequence[str]) -> tuple[tuple[str, ...], Parameters, ParameterPlan]:
        """The names, one or several; those of them that are parameters, and the terms of their columns."""
        asked = _different_names(call, wrt)
        names = tuple(name for name in asked if name not in _VARIABLES)
        if names and self._engine.settings.order != 2:
            s = self._engine.settings
            raise ValueError(f"{call}: expected a simulator of order 2, got {s.kind}; use {s.way_to_order_two}")
        if names not in self._selections:
            self._selections[names] = select(call, self._table, names, self._engine.model)
        return asked, *self._selections[names]

    def values(self, call: str, wrt: Sequence[str]) -> Parameters:
        """Parameters by name, with the values that the simulator was made with."""
        return listed(call, self._own_table, _different_names(call, wrt))[1]

    @cached_property
    def _own_table(self) -> Table:
        return by_names(self._known)

    def with_values(self, call: str, values: Mapping[str, ArrayLike]) -> tuple[Mechanism, float]:
        """The mechanism and the time step with other values of parameters."""
        mech, time_step = with_values(call, self._mechanism, self._own_table, values)
        return mech, self._time_step if time_step is None else time_step

    def adopt(self, call: str, values: Mapping[str, ArrayLike]) -> None:
        """Write other values of parameters into the model; arrays that they do not change stay as they are."""
        if self._engine.settings.order != 2 or self._engine.settings.accuracy or "time_step" in values:
            raise ValueError(f"{call}: expected steps of order 2, without accuracy, and no time_step")
        old = pack(self._written) if self._packed is None else self._packed
        written = self.with_values(call, values)[0]
        new = pack(written)
        changes = [
            (own, after)
            for name, own, before, after in zip(Model._fields, self._engine.model, old, new, strict=True)
            if name != "optional" and isinstance(own, np.ndarray) and not np.array_equal(before, after)
        ]
        linked = [getattr(self._engine.model, name) for name in _LINKED]
        new_part = [own.any() != after.any() for own, after in changes if any(own is array for array in linked)]
        if any(own.dtype != np.float64 for own, _ in changes) or any(new_part):
            raise ValueError(f"{call}: expected values that keep the structure of the model, such as no new damper")
        for own, after in changes:
            np.copyto(own, after)
        self._now(written, new)
        self._engine.refresh()

    def follow(self, other: SimulatorParameters) -> None:
        """Know that the model has taken over the values of another simulator."""
        self._now(other._written, other._packed)

    def _now(self, written: Mechanism, packed: Model | None) -> None:
        """The mechanism of the values in the model has changed, and with it all derivatives."""
        self._written, self._packed, self._of_written = written, packed, None
        self._selections.clear()

    def roll(
        self,
        x: Vector,
        us: Floats,
        selection: tuple[Parameters, ParameterPlan],
        kappa: float | None,
        wrenches: Floats | None,
    ) -> tuple[Rolled, Floats]:
        """See `roll_parameters`."""
        path = x, us, self._engine.external(wrenches)
        return roll_parameters(self._engine, self._request(*selection), path, kappa)

    def sweep(
        self,
        path: tuple[Floats, Floats],
        loss: Floats,
        selection: tuple[Parameters, ParameterPlan],
        kappa: float | None,
        wrenches: Floats | None,
    ) -> tuple[int, Sweep]:
        """See `adjoint_sweep`."""
        return adjoint_sweep(self._engine, self._request(*selection), (*path, wrenches), loss, kappa)

    def _request(self, found: Parameters, plan: ParameterPlan) -> Request:
        return Request(self._written, plan, lambda *conversion: self._conversion_columns(found, *conversion))

    def _conversion_columns(self, found: Parameters, x: Vector, interval: float, other: float) -> Floats:
        """d(x over another interval)/d(parameters), (ndx, n), by central differences: only divided steps need them.

        Both intervals are multiples of the time step, so they grow with it. Contacts have no part in a momentum.
        """
        out = np.zeros((self._engine.ndx, len(found.names)))
        for j, (name, value) in enumerate(zip(found.names, found.values, strict=True)):
            if name.split(":")[0].split("[")[0] not in _OF_MOMENTUM:
                continue
            nudge = _NUDGE * max(abs(float(value)), _LEAST)
            at = partial(self._converted, name, (interval, other), x)
            try:
                ends, weights = [at(value - nudge), at(value + nudge)], (-1.0, 1.0)
            except ValueError:  # at the bound of its values: ahead of it
                ends, weights = [at(value + nudge), at(value + 2.0 * nudge)], (4.0, -1.0)
            steps = self._engine.states.difference(np.tile(at(value), (2, 1)), np.array(ends))
            out[:, j] = weights @ steps / (2.0 * nudge)
        return out

    def _converted(self, name: str, intervals: tuple[float, float], x: Vector, value: float) -> Vector:
        """x over another interval with another value of a parameter; NaN where it has no velocity there."""
        mech, h = with_values("derivatives of a divided step", self._written, self._table, {name: value})
        engine, scale = Engine(pack(mech), self._engine.settings), 1.0 if h is None else h / self._time_step
        interval, other = intervals
        end = Intervals(engine).changed(scale * interval, scale * other, x)
        return np.full_like(x, np.nan) if end is None else end


def _different_names(call: str, wrt: Sequence[str]) -> tuple[str, ...]:
    """The names, one or several, all different."""
    names = (wrt,) if isinstance(wrt, str) else checks.names(call, wrt)
    for name in names:
        checks.one_of(f"{call}: kind", name.split(":")[0].split("[")[0], (*_VARIABLES, *KINDS))
    checks.distinct(call, names)
    return names
