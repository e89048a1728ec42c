"""Closed-loop reference tasks: an MPC with its reference, ready to run on a plant."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dojo_opt import gaits, models
from dojo_opt.cost import Effort, Tracking
from dojo_opt.gaits.feet import Feet
from dojo_opt.mpc.controller import MPC
from dojo_opt.mpc.moving import Sampled
from dojo_opt.mpc.settings import OPTIONS
from dojo_opt.planning.options import PLANNED
from dojo_opt.planning.problem import Problem
from dojo_opt.plant.plant import Plant
from sim.mechanism import checks
from sim.mechanism.checks import nearest, whole_number
from sim.mechanism.terrain import Terrain
from sim.simulator.simulator import Simulator

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

__all__ = ["Hopping", "hopper_mpc", "plant", "quadruped_mpc"]

_GRAVITY = 9.81  # [m/s^2]
_QUADRUPED = {"learn_ground": True, "kappa": 1e-3, "friction": 0.4}
_HOPPER = replace(OPTIONS, shooting=1.0)  # after a push most rollouts are lost, and gaps would stay open for ticks


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
        if np.abs(self.start[3:7] - (1.0, 0.0, 0.0, 0.0)).max() > 1e-9:
            raise ValueError(f"Hopping(start): expected an upright body that heads along x, got {self.start[3:7]}")
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
        above, upward = self.start[7] + np.where(stands, rise, 0.0), np.where(stands, vertical, 0.0)
        ahead, forward = np.where(stands, self._carried(phase), self._swung(flight))
        leg = np.hypot(above, ahead)
        lean = 0.5 * np.arctan2(ahead, above)
        x[:, :2] += self.velocity * times[:, None]
        x[:, 2] += rise
        x[:, 3], x[:, 4:7] = np.cos(lean), np.outer(np.sin(lean), self._axis)
        x[:, 7] = leg
        x[:, 8:10] = self.velocity
        x[:, 10] = vertical
        x[:, 11:14] = np.outer((forward * above - ahead * upward) / leg**2, self._axis)
        x[:, 14] = (above * upward + ahead * forward) / leg
        return x

    def _carried(self, phase: Vector) -> Matrix:
        """(2, n) how far the body is ahead of its foot in stance [m], and how fast it gets ahead [m/s]."""
        return np.stack([self._forward * (phase - 0.5 * self.stance), np.full_like(phase, self._forward)])

    def _swung(self, flight: Vector) -> Matrix:
        """The same in flight, by the cubic that goes on as stance ends and ends as stance begins."""
        length = self.period - self.stance
        s = flight / length
        first, swing = 0.5 * self._forward * self.stance, self._forward * length
        ahead = first * (1.0 + s**2 * (4.0 * s - 6.0)) + swing * s * (1.0 + s * (2.0 * s - 3.0))
        return np.stack([ahead, (12.0 * first * s * (s - 1.0) + swing * (1.0 + 6.0 * s * (s - 1.0))) / length])


def hopper_mpc(
    velocity: ArrayLike = (0.2, 0.0), height: float = 0.25, stance: float = 0.2, *, substeps: int = 5, **settings: Any
) -> MPC:
    """Raibert's hopper hops along the ground: 20 knots of 50 ms.

    Squares of position weigh 100, attitude 20 (yaw 1), leg 15, velocities along x and y 4, the others .01, impulses
    .001 per (N s)^2. Inputs are limited to 50 N m, 50 N m, 500 N.

    A push in flight costs more until the foot is down: a light leg weight lets it reach down early. The weight on the
    velocity keeps the body from leaning further than friction holds on the way back. Impulses that weigh ten times as
    much, beside positions that weigh a tenth, are spared at the top of the hop: it is 40 mm too low then.

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

    The cost tracks the gait of `gaits.trot` with its torques as reference. Squares of position and attitude of the
    trunk weigh 10, of joint angles 1, of velocities .1 and .01, of the torques 1e-4 per (N m)^2. Torques are limited to
    33.5 N m. Plans are made at a kappa of 1e-3, where feet feel the ground before they touch it. They count on a
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
    reference: Any = Sampled(fine.time, fine.x, sim, advance).over(sim.time_step)
    if terrain is not None:
        sim, reference = sim.replace(mechanism=sim.mechanism.on(terrain)), _OnTerrain(reference, terrain)
    torque = gaits.trot(level, speed=speed, period=period, cycles=1, step_height=step_height).torques()
    held = Sampled(sim.time_step * np.arange(len(torque) + 1), np.vstack([torque, torque[:1]]), cycle=np.zeros(sim.nu))
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

    def __init__(self, level: Sampled, terrain: Terrain) -> None:
        self._level, self._terrain = level, terrain

    def __call__(self, times: ArrayLike) -> Matrix:
        x = self._level(times)
        x[:, 2] += self._terrain.height(x[:, 0], x[:, 1])
        return x


def plant(mpc: MPC, time_step: float = 1e-3, kappa: float = 1e-8, **perturbation: Any) -> Plant:
    """The plant of an MPC: the simulator of its problem with a time step and kappa of its own, perturbed.

    Args:
        mpc: the controller.
        time_step: time step of the plant [s].
        kappa: central-path parameter of the plant [N s m].
        **perturbation: fields of `dojo.Perturbation` by name.

    Returns:
        The plant, which starts where the problem does.

    Raises:
        TypeError: `mpc` is not an MPC, or for an unknown field.
        ValueError: for an argument out of range.
    """
    if not isinstance(mpc, MPC):
        raise TypeError(f"tasks.plant(mpc): expected an MPC, got {mpc!r}")
    return Plant(mpc.nominal.replace(time_step=time_step, kappa=kappa), mpc.start, **perturbation)


if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        """A name that is not there, with the ones that are."""
        raise AttributeError(f"dojo_opt.tasks has no {name!r}; there are {', '.join(__all__)}{nearest(name, __all__)}")
