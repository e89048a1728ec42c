"""Derivatives of a step by its parameters, measured: situation x kind of parameter.

Along a random direction of all parameters of a kind, against five-point differences of steps solved at the same kappa,
the best of four sizes; error over the derivative.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from support.parameter_case import Case, kind_of
from support.situations import CASES

Floats = NDArray[np.float64]

BAR = 1e-6
SIZES = (1e-3, 1e-4, 1e-2, 1e-5)
GOOD = 1e-8
ONE_SIDED = (
    "spring",
    "damper",
    "armature",
    "friction",
    "contact_radius",
    "restitution",
    "torsional_friction",
    "rolling_friction",
)  # not below zero


def error(case: Case, *kinds: str) -> float:
    """Largest error of the derivative along a direction of all parameters of these kinds, relative to its size.

    Several kinds have one formula for their directions.
    """
    sim, x, u = case
    kind = kinds[0]
    names = [name for name in sim.parameters().names if kind_of(name) in kinds]
    values = sim.parameters(names).values
    direction = random_direction(kind, values, sim.time_step)
    blocks = sim.linearize(x, u, wrt=names)
    rate = np.concatenate([blocks[name] for name in names], axis=1) @ direction
    here = sim.step(x, u, throw=True)

    def change(size: float) -> Floats:
        moved = sim.with_parameters(dict(zip(names, values + size * direction, strict=True)))
        return np.asarray(sim.difference(moved.step(x, u, throw=True).x, here.x))

    errors = []
    for size in SIZES:
        if kind in ONE_SIDED:
            a, b, c, d = (change(k * size) for k in (1, 2, 3, 4))
            slope = (4.0 * a - 3.0 * b + 4.0 / 3.0 * c - d / 4.0) / size
        else:
            a, b, c, d = (change(k * size) for k in (-2, -1, 1, 2))
            slope = (a - 8.0 * b + 8.0 * c - d) / (12.0 * size)
        errors.append(float(np.abs(slope - rate).max() / max(np.abs(rate).max(), 1e-6)))
        if errors[-1] < GOOD:  # no smaller by chance
            break
    return min(errors)


def random_direction(kind: str, values: Floats, time_step: float) -> Floats:
    """Random, in proportion to the parameters; away from zero where they may not be negative."""
    rng = np.random.default_rng(len(values))
    size = rng.uniform(0.5, 1.0, size=len(values))
    if kind == "time_step":
        return np.asarray(size * rng.choice([-1, 1], len(values)) * time_step)
    if kind in ONE_SIDED:
        return np.asarray(size * np.maximum(np.abs(values), 1.0 if kind in ONE_SIDED[:3] else 0.1))
    return np.asarray(size * rng.choice([-1, 1], len(values)) * np.maximum(np.abs(values), 0.1))


def check(situation: str) -> dict[str, float]:
    """The error by every kind of parameter that the situation has.

    situation: one of CASES.
    """
    case = CASES[situation]()
    return {kind: error(case, kind) for kind in case.kinds()}
