"""Case: a step for which derivatives by parameters are measured."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.derivatives.parameters.parameters import KINDS
from sim.simulator.simulator import Simulator

Floats = NDArray[np.float64]


class Case(NamedTuple):
    """A step."""

    sim: Simulator
    x: Floats
    u: Floats

    def kinds(self) -> list[str]:
        """The kinds of its parameters; without restitution, a step need not be a continuous function of it."""
        known = self.sim.parameters().names
        bounces = self.sim.model.contact_restitution.any()
        return [k for k in KINDS if any(kind_of(n) == k for n in known) and (bounces or k != "restitution")]


def kind_of(name: str) -> str:
    """Kind of the parameter of that name: "com" of "com:body[2]"."""
    return name.partition(":")[0].partition("[")[0]


def turned(w: ArrayLike) -> Floats:
    """Quaternion of the rotation vector w [rad]."""
    angle = float(np.linalg.norm(w))
    return np.concatenate([[np.cos(0.5 * angle)], 0.5 * np.sinc(0.5 * angle / np.pi) * np.asarray(w)])
