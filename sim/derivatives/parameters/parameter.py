"""Parameter: one number of a mechanism, with its kind, its unit, and its effects on a step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sim.derivatives.parameters.directions import Effect

Term = tuple[Effect, int, int, float]  # effect, index, component, weight

UNITS = {
    "mass": "kg", "inertia": "kg m^2", "com": "m", "parent_point": "m", "child_point": "m", "orientation": "rad",
    "axis": "1", "pitch": "m/rev", "spring": "N/m, N m/rad", "damper": "N s/m, N m s/rad", "rest": "m, rad",
    "armature": "kg, kg m^2",
    "lower": "m, rad", "upper": "m, rad", "cone": "rad", "gear_ratio": "rad/rad, m/rad", "gear_offset": "m, rad",
    "input_force": "1", "input_torque": "m", "friction": "1", "restitution": "1",
    "torsional_friction": "m", "rolling_friction": "m",
    "contact_point": "m", "contact_radius": "m", "contact_height": "m", "contact_normal": "1", "terrain": "m",
    "shape_a": "m", "shape_b": "m", "size_a": "m", "size_b": "m", "gravity": "m/s^2", "time_step": "s",
}  # fmt: skip
KINDS = tuple(UNITS)


class Parameter(NamedTuple):
    """One number of a mechanism."""

    kind: str
    part: str  # "" of gravity and time_step
    component: str  # "" of a single number
    value: float
    terms: tuple[Term, ...]

    @property
    def name(self) -> str:
        """kind:part[component]"""
        part = f":{self.part}" if self.part else ""
        return f"{self.kind}{part}" + (f"[{self.component}]" if self.component else "")


def vector(kind: str, part: str, values: ArrayLike, terms: Callable[[int], Sequence[Term]]) -> list[Parameter]:
    """Parameters of the components of a vector; one without brackets when it has a single one."""
    numbers = np.atleast_1d(np.asarray(values, dtype=np.float64))
    labels = [""] if len(numbers) == 1 else [str(k) for k in range(len(numbers))]
    return [Parameter(kind, part, labels[k], float(x), tuple(terms(k))) for k, x in enumerate(numbers)]
