"""Raibert's hopper hops along the ground."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt import models
from dojo_opt.cost import Effort, Tracking
from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.mpc.controller import MPC
from dojo_opt.mpc.settings import OPTIONS
from dojo_opt.planning.options import PLANNED
from dojo_opt.planning.problem import Problem
from sim.mechanism import checks
from sim.mechanism.checks import whole_number
from sim.model.state_columns import BaseState
from sim.simulator.simulator import Simulator
from solvers.types import Matrix, Vector

__all__ = ["Hopping", "hopper_mpc"]

_GRAVITY = 9.81  # [m/s^2]
_LEG = BaseState.JOINTS  # its length
_ACROSS, _UPWARD, _SPIN, _LEG_RATE = slice(8, 10), 10, slice(11, 14), 14  # columns of velocities
_HOPPER = replace(
    OPTIONS, multiple_shooting_below=1.0
)  # after a push most rollouts are lost, and gaps would stay open for ticks


class Hopping:
    """Reference states of a hopper that hops on the spot or along the ground, as a function of time.

        stance  of `stance` [s]:  z = z0 - d sin(pi s / stance),  the foot stands half-way along the path of the body
        flight  of 2 v / g:       z = z0 + v s - g s^2 / 2,       the foot swings ahead,  v = sqrt(2 g height)

    d = v stance / pi makes the velocity continuous. The body moves at a constant horizontal velocity throughout. It
    leans as the line from the foot to it does: the leg is fixed to it, and a body kept upright drags its foot.

    Args:
        start: (15,) state of the hopper that stands upright, heading along x.
        velocity: (2,) horizontal velocity of the body [m/s].
        height: height of the hop over the standing robot [m].
        stance: duration of the contact [s].

    Raises:
        ValueError: for an argument of the wrong shape or out of range, or a body that is not upright.
    """

    def __init__(self, start: ArrayLike, velocity: ArrayLike, height: float, stance: float) -> None:
        self.start = checks.array("Hopping(start)", start, (15,))
        turn = self.start[BaseState.QUATERNION]
        if np.abs(turn - (1.0, 0.0, 0.0, 0.0)).max() > 1e-9:
            raise ValueError(f"Hopping(start): expected an upright body that heads along x, got {turn}")
        self.velocity = np.array(checks.vector("Hopping(velocity)", velocity, 2))
        self.height = checks.number("Hopping(height)", height, above=0.0)
        self.stance = checks.number("Hopping(stance)", stance, above=0.0)
        self.speed = float(np.sqrt(2.0 * _GRAVITY * height))  # vertical, at lift-off
        self.period = stance + 2.0 * self.speed / _GRAVITY
        self._forward = float(np.hypot(*self.velocity))
        way = self.velocity / self._forward if self._forward else np.zeros(2)
        self._axis = np.array([-way[1], way[0], 0.0])  # about which it leans forward

    def __call__(self, times: Vector) -> Matrix:
        """(n, 15) states at the times (n,) [s]."""
        times = np.asarray(times, dtype=np.float64)
        x = np.tile(self.start, (len(times), 1))
        phase = np.mod(times, self.period)
        stands = phase < self.stance
        dip = -self.speed * self.stance / np.pi * np.sin(np.pi * phase / self.stance)
        flight = phase - self.stance
        rise = np.where(stands, dip, self.speed * flight - 0.5 * _GRAVITY * flight**2)
        vertical = np.where(stands, -self.speed * np.cos(np.pi * phase / self.stance), self.speed - _GRAVITY * flight)
        above, upward = self.start[_LEG] + np.where(stands, rise, 0.0), np.where(stands, vertical, 0.0)
        ahead, forward = np.where(stands, self._carried(phase), self._swung(flight))
        leg = np.hypot(above, ahead)
        lean = 0.5 * np.arctan2(ahead, above)
        x[:, :2] += self.velocity * times[:, None]
        x[:, 2] += rise
        x[:, 3], x[:, BaseState.VECTOR] = np.cos(lean), np.outer(np.sin(lean), self._axis)
        x[:, _LEG] = leg
        x[:, _ACROSS] = self.velocity
        x[:, _UPWARD] = vertical
        x[:, _SPIN] = np.outer((forward * above - ahead * upward) / leg**2, self._axis)
        x[:, _LEG_RATE] = (above * upward + ahead * forward) / leg
        return x

    def _carried(self, phase: Vector) -> Matrix:
        """(2, n) how far the body is ahead of its foot in stance [m], and how fast it gets ahead [m/s]."""
        return np.stack([self._forward * (phase - 0.5 * self.stance), np.full_like(phase, self._forward)])

    def _swung(self, flight: Vector) -> Matrix:
        """`_carried` in flight: the cubic that joins the end of a stance with the beginning of the next."""
        length = self.period - self.stance
        s = flight / length
        first, swing = 0.5 * self._forward * self.stance, self._forward * length
        ahead = first * (1.0 + s**2 * (4.0 * s - 6.0)) + swing * s * (1.0 + s * (2.0 * s - 3.0))
        return np.stack([ahead, (12.0 * first * s * (s - 1.0) + swing * (1.0 + 6.0 * s * (s - 1.0))) / length])


@checked_numbers("tasks")
def hopper_mpc(
    velocity: ArrayLike = (0.2, 0.0), height: float = 0.25, stance: float = 0.2, *, substeps: int = 5, **settings: Any
) -> MPC:
    """Raibert's hopper hops along the ground: 20 knots of 50 ms. Its path begins at the origin, where it has to start.

    Squares of position weigh 100, attitude 20 (yaw 1), leg 15, velocities along x and y 4, the others .01, impulses
    .001 per (N s)^2. Inputs are limited to 50 N m, 50 N m, 500 N.

    After a push in flight, a small weight of the leg lets it reach down early. The weight of the velocity keeps the
    body from leaning further than friction allows on the way back. With ten times the weight of impulses and a tenth of
    the weight of positions, hops are 40 mm too low.

    Args:
        velocity: (2,) horizontal velocity of the body [m/s].
        height: height of the hop [m].
        stance: duration of the contact [s].
        substeps: steps of the model per knot.
        **settings: settings of `dojo.MPC`.

    Returns:
        The controller.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument of the wrong shape or out of range.
    """
    knot, horizon = 0.05, 20
    substeps = whole_number("tasks.hopper_mpc(substeps=...)", substeps)
    sim = Simulator(models.raiberthopper(), time_step=knot / substeps, kappa=PLANNED)
    start = sim.neutral()
    weight = np.array([100.0, 100.0, 100.0, 20.0, 20.0, 1.0, 15.0, 4.0, 4.0] + [0.01] * 5)
    limits = np.array([50.0, 50.0, 500.0])
    problem = Problem(
        sim,
        start,
        horizon,
        cost=[Tracking(start, weight), Effort(1e-3 * knot**2)],
        control_limits=(-limits, limits),
        substeps=substeps,
        controls0=np.array([0.0, 0.0, 9.81 * sim.mechanism.bodies[0].mass]),
    )
    return MPC(problem, reference=Hopping(start, velocity, height, stance), **{"options": _HOPPER, **settings})
