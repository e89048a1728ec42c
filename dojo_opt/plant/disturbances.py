"""Disturbances: perturbations of a plant drawn at random."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.plant.perturbation import Perturbation, Push
from sim.mechanism import checks
from sim.mechanism.checks import whole_number
from sim.mechanism.short_repr import short_repr

__all__ = ["Disturbances"]


@dataclass(frozen=True)
class Disturbances:
    """A sampler of perturbations: uniform in ranges (low, high), and in the horizontal plane for directions.

    A range of zero width is a constant. The push happens once; its impulse has the sampled size.

    Attributes:
        nv: number of velocities of the robot; the first two are those of its base along x and y.
        velocity: largest initial velocity of the base along x and along y [m/s] (default 0).
        push: range of the impulse of the push [N s] (default (0, 0)).
        push_time: range of the time at which the push begins [s] (default (1, 2)).
        payload: range of the mass added to the first body [kg] (default (0, 0)).
        payload_inertia: moment of inertia added per kg of payload [m^2] (default 0).
        friction: range of the coefficient of friction of all contacts (default None: that of the model).
        slope: range of the angle of the ground, which rises towards any heading [rad] (default (0, 0)).
        delay: time from a command to the moment it acts [s] (default 0).
        noise: standard deviation of the measured state: a number, or (ndx,) [m, rad, m/s, rad/s] (default 0).
    """

    nv: int
    velocity: float = 0.0
    push: tuple[float, float] = (0.0, 0.0)
    push_time: tuple[float, float] = (1.0, 2.0)
    payload: tuple[float, float] = (0.0, 0.0)
    payload_inertia: float = 0.0
    friction: tuple[float, float] | None = None
    slope: tuple[float, float] = (0.0, 0.0)
    delay: float = 0.0
    noise: ArrayLike = 0.0

    __repr__ = short_repr

    def __post_init__(self) -> None:
        call = "Disturbances"
        whole_number(f"{call}(nv)", self.nv)
        if checks.number(f"{call}(velocity=...)", self.velocity, at_least=0.0) and self.nv < 2:
            raise ValueError(f"{call}(velocity=...): expected a robot with nv >= 2, got nv = {self.nv}")
        for name in ("payload_inertia", "delay"):
            checks.number(f"{call}({name}=...)", getattr(self, name), at_least=0.0)
        noise = checks.spread(f"{call}(noise=...)", self.noise, 2 * self.nv)
        if not np.all((noise >= 0.0) & np.isfinite(noise)):
            raise ValueError(f"{call}(noise=...): expected numbers >= 0, got {checks.shown(self.noise)}")
        for name in ("push", "push_time", "payload", "friction", "slope"):
            if (given := getattr(self, name)) is not None or name != "friction":
                low, high = checks.vector(f"{call}({name}=...)", given, 2)
                if not low <= high:
                    raise ValueError(f"{call}({name}=...): expected (low, high) with low <= high, got {given!r}")
                if low < 0.0 and name in ("push", "payload", "friction"):
                    raise ValueError(f"{call}({name}=...): expected numbers >= 0, got {given!r}")
        if np.abs(self.slope).max() >= 0.5 * np.pi:
            raise ValueError(f"{call}(slope=...): expected less than a right angle, got {self.slope!r} rad")

    def __call__(self, rng: np.random.Generator) -> Perturbation:
        """Draw one perturbation.

        The same numbers are drawn whatever the ranges, so that studies with the same seed are paired.

        Args:
            rng: generator of random numbers.

        Returns:
            The perturbation.
        """
        along, across, *parts, heading, grip = rng.uniform(size=8)
        within = [lo + (hi - lo) * r for (lo, hi), r in zip(self._ranges(), parts, strict=True)]
        push, push_time, payload, slope = within
        offset = np.zeros(2 * self.nv)
        if self.velocity:
            offset[self.nv : self.nv + 2] = self.velocity * (2.0 * np.array([along, across]) - 1.0)
        angle = 2.0 * np.pi * heading
        impulse = push * np.array([np.cos(angle), np.sin(angle), 0.0])
        friction = None if self.friction is None else self.friction[0] + (self.friction[1] - self.friction[0]) * grip
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
