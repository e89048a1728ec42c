"""The quadruped trots after a gait, with the ground learnt from its standing feet."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt import gaits, models
from dojo_opt.cost import Effort, Tracking
from dojo_opt.gaits.feet import Feet
from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.mpc.controller import MPC
from dojo_opt.mpc.moving_reference import SampledReference
from dojo_opt.planning.options import PLANNED
from dojo_opt.planning.problem import Problem
from sim.mechanism.checks import whole_number
from sim.mechanism.terrain import Terrain
from sim.simulator.simulator import Simulator
from solvers.types import Matrix

__all__ = ["quadruped_mpc"]

_QUADRUPED = {"learn_ground": True, "kappa": 1e-3, "friction": 0.4}


@checked_numbers("tasks")
def quadruped_mpc(
    speed: float = 0.2,
    period: float = 0.48,
    *,
    step_height: float = 0.05,
    damper: float = 0.5,
    terrain: Terrain | None = None,
    substeps: int = 1,
    **settings: Any,
) -> MPC:
    """The quadruped trots: 20 knots of 40 ms, with the ground learnt from the standing feet.

    Its path begins at the origin, along x, where the robot has to start.

    The cost tracks the gait of `gaits.trot` with its torques as reference. Squares of position and attitude of the
    trunk weigh 10, of joint angles 1, of velocities .1 and .01, of the torques 1e-4 per (N m)^2. Torques are limited to
    33.5 N m. Plans are made at a kappa of 1e-3, where the ground acts on feet before they touch it. They assume a
    friction of .4 where the robot's feet have .8: the planned friction is available on slippery ground, too.

    Args:
        speed: forward speed [m/s].
        period: duration of a cycle of the gait [s].
        step_height: lift of a swinging foot [m].
        damper: damper of the joints of model and plant [N m s/rad]. With 0.05 the robot trots, too, but of 20 runs with
            pushes of 5 to 8 N s, payload, low friction and slope at once 5 fell, and none with 0.5.
        terrain: ground that the model knows; its height under the base is added to that of the reference (default None:
            level ground).
        substeps: steps of the model per knot.
        **settings: settings of `dojo.MPC`.

    Returns:
        The controller.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range, or a foot that cannot reach its place.
    """
    knot, horizon, limit = 0.04, 20, 33.5
    substeps = whole_number("tasks.quadruped_mpc(substeps=...)", substeps)
    sim = level = Simulator(models.quadruped(damper=damper), time_step=knot / substeps, kappa=PLANNED)
    fine = gaits.trot(level.replace(time_step=knot / 8), speed=speed, period=period, cycles=1, step_height=step_height)
    advance = sim.difference(fine.x[-1], fine.x[0])
    advance[6:] = 0.0  # joints and velocities come round
    reference: Any = SampledReference(fine.time, fine.x, sim, advance).with_mean_velocities(sim.time_step)
    if terrain is not None:
        sim, reference = sim.replace(mechanism=sim.mechanism.with_terrain(terrain)), _OnTerrain(reference, terrain)
    torque = gaits.trot(level, speed=speed, period=period, cycles=1, step_height=step_height).torques()
    held = SampledReference(
        sim.time_step * np.arange(len(torque) + 1), np.vstack([torque, torque[:1]]), cycle=np.zeros(sim.nu)
    )
    weight = np.array([10.0] * 6 + [1.0] * 12 + [0.1] * 6 + [0.01] * 12)
    times = knot * np.arange(horizon + 1)
    start = reference([0.0])[0]
    problem = Problem(
        sim,
        start if terrain is None else Feet(sim).put_down(start),
        horizon,
        cost=[Tracking(reference(times), weight), Effort(1e-4)],
        control_limits=(-limit, limit),
        substeps=substeps,
        controls0=np.clip(held(times[:-1]), -limit, limit),
        states0=reference(times),
    )
    return MPC(problem, reference={0: reference, 1: held}, **{**_QUADRUPED, **settings})


class _OnTerrain:
    """A reference of states on level ground, raised by the height of the terrain under its base."""

    def __init__(self, level: SampledReference, terrain: Terrain) -> None:
        self._level, self._terrain = level, terrain

    def __call__(self, times: ArrayLike) -> Matrix:
        x = self._level(times)
        x[:, 2] += self._terrain.height(x[:, 0], x[:, 1])
        return x
