"""Selection of parameters by name, and the mechanism with other values of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from sim.derivatives.parameters.damper_inertia_effects import with_damper_inertia
from sim.derivatives.parameters.directions import Effect, ParameterTerm
from sim.derivatives.parameters.mechanism_editor import Draft
from sim.derivatives.parameters.parameters import KINDS, Parameter, ParameterPlan, Parameters
from sim.mechanism import checks
from sim.mechanism.mechanism import Mechanism
from sim.model.model import Model

Table = Mapping[str, list[Parameter]]  # by every name that stands for some
COMMON = "*"


def by_names(known: Sequence[Parameter]) -> Table:
    """The parameters by all names but those of `kind:*`."""
    table: dict[str, list[Parameter]] = {}
    for p in known:
        for name in dict.fromkeys((p.kind, f"{p.kind}:{p.part}", p.name)):
            table.setdefault(name, []).append(p)
    return table


def chosen(call: str, table: Table, name: str) -> list[Parameter]:
    """The parameters that a name stands for; `kind:*` is one for all parts, of the mean of their values."""
    kind = name.split(":")[0].split("[")[0] if isinstance(name, str) else name
    checks.one_of(f"{call}: parameter", kind, KINDS)
    of_kind = table.get(kind, [])
    if name.startswith(f"{kind}:{COMMON}"):
        found = [p for p in _common(of_kind) if name in (f"{kind}:{COMMON}", p.name)]
    else:
        found = table.get(name, [])
    if not found:
        parts = list(dict.fromkeys(f"{p.kind}:{p.part}" if p.part else p.name for p in of_kind))
        known = checks.listed(parts, name) if parts else "none"
        hint = checks.nearest(name, [*parts, f"{kind}:{COMMON}"]) if parts else ""
        raise ValueError(f"{call}: no parameter {name!r}; parameters of this kind: {known}{hint}")
    return found


def _common(parameters: Sequence[Parameter]) -> list[Parameter]:
    """One parameter per component, for all parts that have it."""
    found = []
    for component in dict.fromkeys(p.component for p in parameters):
        same = [p for p in parameters if p.component == component]
        value = float(np.mean([p.value for p in same]))
        terms = tuple(term for p in same for term in p.terms)
        found.append(Parameter(same[0].kind, COMMON, component, value, terms))
    return found


def select(call: str, table: Table, names: Sequence[str], model: Model) -> tuple[Parameters, ParameterPlan]:
    """The parameters of the names, in their order, and the terms of their columns, at the values in the model."""
    found, parameters = listed(call, table, names)
    found = with_damper_inertia(model, found)
    rows_of = [(int(e), i, k, column) for column, p in enumerate(found) for e, i, k, _ in p.terms]
    terms = np.array(rows_of, dtype=np.int64).reshape(-1, 4)
    weights = np.array([term[3] for p in found for term in p.terms], dtype=np.float64)
    of_terrain = terms[:, ParameterTerm.EFFECT] == Effect.TERRAIN
    heights = np.ascontiguousarray(terms[of_terrain][:, [ParameterTerm.INDEX, ParameterTerm.COLUMN]])
    plan = ParameterPlan(terms[~of_terrain], weights[~of_terrain], len(found), heights, weights[of_terrain])
    return parameters, plan


def listed(call: str, table: Table, names: Sequence[str]) -> tuple[list[Parameter], Parameters]:
    """The parameters of the names, in their order, also as names and values."""
    found: list[Parameter] = []
    rows: dict[str, slice] = {}
    for name in names:
        some = chosen(call, table, name)
        rows[name] = slice(len(found), len(found) + len(some))
        found += some
    values = np.array([p.value for p in found])
    values.flags.writeable = False  # kept by the simulator
    return found, Parameters(tuple(p.name for p in found), values, rows)


def with_values(
    call: str, mech: Mechanism, table: Table, values: Mapping[str, ArrayLike]
) -> tuple[Mechanism, float | None]:
    """The mechanism with other values of the named parameters in the table; the time step if it is named."""
    time_step = None
    changes: dict[tuple[str, str, str], float] = {}
    for name, given in checks.mapping(call, values).items():
        found = chosen(call, table, name)
        numbers = np.atleast_1d(checks.floats(f"{call}: {name!r}", given))
        numbers = checks.array(f"{call}: {name!r}", numbers, (len(found),))
        for p, value in zip(found, numbers, strict=True):
            if p.part != COMMON:
                changes[p.kind, p.part, p.component] = float(value)
                continue
            for q in table[p.kind]:
                if q.component == p.component:
                    changes[q.kind, q.part, q.component] = q.value + float(value) - p.value
    together: dict[tuple[str, str], dict[str, float]] = {}
    for (kind, part, component), value in changes.items():
        together.setdefault((kind, part), {})[component] = value
    draft = Draft(mech)
    # the centre of mass last: it moves the points that the others put in their places
    for (kind, part), entries in sorted(together.items(), key=lambda item: item[0][0] == "com"):
        if kind == "time_step":
            time_step = entries[""]
        else:
            draft.change(kind, part, entries)
    return draft.finish(), time_step
