"""Names instead of numbers: components of dx and of u by joint, degree of freedom, and input."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from sim.mechanism import checks
from sim.mechanism.dofs import components
from sim.simulator.simulator import Simulator
from solvers.types import Integers

__all__ = ["chosen_components", "chosen_inputs", "component_name", "input_weight", "state_weight"]


def chosen_components(call: str, chosen: Any, sim: Simulator) -> Integers:
    """Components of dx by number or name; None means all. Names as in `Mechanism.components`."""
    if _named(chosen):
        return components(call, sim.mechanism.joints, chosen)
    return _numbers(call, chosen, sim.ndx)


def chosen_inputs(call: str, chosen: Any, sim: Simulator) -> Integers:
    """Components of u by number or name; None means all."""
    if not _named(chosen):
        return _numbers(call, chosen, sim.nu)
    names = sim.mechanism.input_names
    wanted = [chosen] if isinstance(chosen, str) else list(chosen)
    return np.array([names.index(checks.one_of(call, name, names)) for name in wanted], dtype=np.int64)


def _named(chosen: Any) -> bool:
    return isinstance(chosen, str) or (
        isinstance(chosen, list | tuple) and len(chosen) > 0 and all(isinstance(name, str) for name in chosen)
    )


def _numbers(call: str, chosen: Any, count: int) -> Integers:
    if chosen is None:
        return np.arange(count)
    checks.shape(call, chosen)
    numbers = np.atleast_1d(np.asarray(chosen))
    if numbers.dtype.kind not in "iu":
        raise ValueError(f"{call}: expected names or whole numbers, got {chosen!r}")
    if numbers.size == 0 or np.any(numbers < 0) or np.any(numbers >= count):
        raise ValueError(f"{call}: expected components in [0, {count}), got {numbers.tolist()}")
    return numbers.astype(np.int64)


def state_weight(call: str, weight: Any, sim: Simulator) -> Any:
    """(ndx,) weights from a dict keyed by name, zero where none is given; anything else unchanged."""
    if not isinstance(weight, Mapping):
        return weight
    out = np.zeros(sim.ndx)
    for name, value in weight.items():
        at = components(call, sim.mechanism.joints, name)
        out[at] = _value(f"{call}: {name!r}", value, at.size)
    return out


def input_weight(call: str, weight: Any, sim: Simulator) -> Any:
    """(nu,) weights from a dict keyed by names of inputs, zero where none is given; anything else unchanged."""
    if not isinstance(weight, Mapping):
        return weight
    out = np.zeros(sim.nu)
    for name, value in weight.items():
        out[chosen_inputs(call, name, sim)] = checks.number(f"{call}: {name!r}", value)
    return out


def _value(call: str, value: Any, size: int) -> Any:
    """One number for all components of a name, or one for each."""
    return checks.number(call, value) if checks.ndim(call, value) == 0 else checks.array(call, value, (size,))


def component_name(sim: Simulator, column: int) -> str:
    """Of a column of z = (dx, du)."""
    dofs = sim.mechanism.dof_names
    if column < sim.nv:
        return str(dofs[column])
    if column < sim.ndx:
        return f"v {dofs[column - sim.nv]}"
    return f"input {sim.mechanism.input_names[column - sim.ndx]}"
