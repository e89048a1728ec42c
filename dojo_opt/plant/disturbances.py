"""Disturbances: perturbations of a plant drawn at random."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.plant.perturbation import Perturbation, Push
from sim.mechanism import checks
from sim.mechanism.brief import brief_repr
from sim.mechanism.checks import whole_number

__all__ = ["Disturbances"]


@dataclass(frozen=True)
class Disturbances:
    """A sampler: every quantity uniform in its range (low, high), every direction uniform in the horizontal plane.

    Ranges without extent are constants. The push happens once; its impulse has the drawn size.
    """

    nv: int  # of the robot, whose first two velocities are those of its base along x and y
    velocity: float = 0.0  # largest initial velocity of the base along x and along y [m/s]
    push: tuple[float, float] = (0.0, 0.0)  # [N s]
    push_time: tuple[float, float] = (1.0, 2.0)  # [s]
    payload: tuple[float, float] = (0.0, 0.0)  # [kg]
    payload_inertia: float = 0.0  # per kg of payload [m^2]
    friction: tuple[float, float] | None = None
    slope: tuple[float, float] = (0.0, 0.0)  # [rad], towards any heading
    delay: float = 0.0  # [s]
    noise: ArrayLike = 0.0

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        call = "Disturbances"
        whole_number(f"{call}(nv)", self.nv)
        checks.number(f"{call}(velocity=...)", self.velocity, at_least=0.0)
        for name in ("push", "push_time", "payload", "friction", "slope"):
            if (given := getattr(self, name)) is not None:
                low, high = checks.vector(f"{call}({name}=...)", given, 2)
                if not low <= high:
                    raise ValueError(f"{call}({name}=...): expected (low, high) with low <= high, got {given!r}")

    def __call__(self, rng: np.random.Generator) -> Perturbation:
        """One draw; the same numbers are drawn whatever the ranges, so that studies with the same seed are paired."""
        unit = rng.uniform(size=8)
        within = [lo + (hi - lo) * r for (lo, hi), r in zip(self._ranges(), unit[2:6], strict=True)]
        push, push_time, payload, slope = within
        offset = np.zeros(2 * self.nv)
        offset[self.nv : self.nv + 2] = self.velocity * (2.0 * unit[:2] - 1.0)
        angle = 2.0 * np.pi * unit[6]
        impulse = push * np.array([np.cos(angle), np.sin(angle), 0.0])
        friction = None if self.friction is None else self.friction[0] + (self.friction[1] - self.friction[0]) * unit[7]
        return Perturbation(
            offset=offset,
            pushes=[Push(push_time, impulse)] if push else [],
            payload=payload,
            payload_inertia=self.payload_inertia * payload,
            friction=friction,
            slope=slope,
            slope_heading=2.0 * np.pi * rng.uniform() if slope else 0.0,
            delay=self.delay,
            noise=self.noise,
            seed=int(rng.integers(2**31)),
        )

    def _ranges(self) -> list[tuple[float, float]]:
        return [self.push, self.push_time, self.payload, self.slope]
