"""Footfall: the contact schedule of feet, their footholds, and their swings from one foothold to the next."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from solvers.types import Flags, Floats

_GRID = 512  # points of a period on which the sway of the base is integrated
_ROUND = 1e-9  # of a period: a knot this near to a change of feet belongs to the next phase


@dataclass(frozen=True)
class Footfall:
    """A periodic pattern: foot i is on the ground in the share `duty` of every period from offset[i] on."""

    offset: Floats  # (k,) share of the period at which a foot comes down
    duty: float
    period: float  # [s]
    step_height: float  # [m]
    velocity: complex  # of the base, forward + i sideways, in the axes of its heading [m/s]
    heading_rate: float  # [rad/s]
    foothold: Floats  # (k,) complex, forward + i sideways from the base, in the middle of a stance [m]
    gravity: float = 9.81  # [m/s^2]

    def base(self, t: Any) -> tuple[Any, Any]:
        """(place x + i y, heading) at the times t."""
        psi = self.heading_rate * np.asarray(t, dtype=float)
        if abs(self.heading_rate) < 1e-9:
            return self.velocity * np.asarray(t, dtype=float), psi
        return self.velocity * (np.exp(1j * psi) - 1.0) / (1j * self.heading_rate), psi

    def cycle(self, t: Any) -> tuple[Any, Any]:
        """(number of the step, share of it that is over), (n, k), at the times t (n,)."""
        phase = np.asarray(t)[:, None] / self.period - self.offset + _ROUND
        number = np.floor(phase)
        return number, phase - number

    def contact(self, t: Any) -> Flags:
        """(n, k) whether a foot is on the ground; at its lift-off it still is."""
        return np.asarray(self.cycle(t)[1] <= self.duty + 2.0 * _ROUND)

    def feet(self, t: Any) -> tuple[Any, Floats]:
        """(places x + i y, heights above their lowest), both (n, k)."""
        number, share = self.cycle(t)
        swing = np.clip((share - self.duty) / max(1.0 - self.duty, _ROUND), 0.0, 1.0)
        angle = 0.5 * np.pi * (1.0 - np.cos(np.pi * swing))  # half an ellipse that starts and ends at rest
        now, later = self._foothold(number), self._foothold(number + 1.0)
        return now + 0.5 * (1.0 - np.cos(angle)) * (later - now), self.step_height * np.sin(angle)

    def _foothold(self, number: Any) -> Any:
        """Where foot i stands in its step `number`: below the base in the middle of the stance."""
        place, heading = self.base((number + self.offset + 0.5 * self.duty) * self.period)
        return place + np.exp(1j * heading) * self.foothold

    def sway(self, t: Any, inertia: tuple[float, float, float], tilt: float) -> Floats:
        """(n, 3) height [m], roll and pitch [rad] of the base about their means.

        Every foot on the ground is taken to carry the same constant weight, straight down: twice integrated over a
        period. inertia: mass, about x, about y. tilt: largest angle, to which larger ones are scaled.
        """
        grid = self.period * np.arange(_GRID) / _GRID
        count = self.contact(grid)
        mass, roll, pitch = inertia
        each = self.gravity * mass / (self.duty * len(self.offset))
        force = each * count
        moments = [(force * self.foothold.imag).sum(1), -(force * self.foothold.real).sum(1)]
        second = np.stack([force.sum(1) / mass, moments[0] / roll, moments[1] / pitch], axis=1)
        path = _integral(_integral(second, self.period), self.period)
        peak = np.abs(path[:, 1:]).max()
        path[:, 1:] *= min(1.0, tilt / max(peak, 1e-12))
        wrapped = np.mod(np.asarray(t) / self.period, 1.0)
        ends = np.concatenate([path, path[:1]])
        return np.stack([np.interp(wrapped, np.linspace(0.0, 1.0, _GRID + 1), c) for c in ends.T], axis=1)

    def shift(self, t: Any, height: float) -> Floats:
        """(n,) displacement of the base to the left [m], for two feet, on which a robot balances in turn.

        The periodic motion y of a linear inverted pendulum, y'' = g/height (y - p), over the middle p of the feet on
        the ground: each harmonic of p by the factor w^2 / (w^2 + k^2), w^2 = g/height, without the mean. Where no foot
        is on the ground p is the middle of all.
        """
        count = self.contact(self.period * np.arange(_GRID) / _GRID)
        side = self.foothold.imag - self.foothold.imag.mean()
        middle = (count * side).sum(axis=1) / np.maximum(count.sum(axis=1), 1)
        rate, harmonic = self.gravity / height, 2.0 * np.pi * np.arange(_GRID // 2 + 1) / self.period
        waves = np.fft.rfft(middle) * rate / (rate + harmonic**2)
        waves[0] = 0.0
        path = np.fft.irfft(waves, _GRID)
        wrapped = np.mod(np.asarray(t) / self.period, 1.0)
        return np.interp(wrapped, np.linspace(0.0, 1.0, _GRID + 1), [*path, path[0]])


def _integral(values: Floats, period: float) -> Floats:
    """Periodic integral of samples of one period, mean removed before and after."""
    values = values - values.mean(axis=0)
    total = np.cumsum(values, axis=0) * (period / len(values))
    return total - total.mean(axis=0)
