"""A humanoid that steps in a cadence, and finds the places of its feet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt import models
from dojo_opt.cost import Effort, Slip, Tracking
from dojo_opt.gaits.biped import over_its_feet
from dojo_opt.gaits.equilibrium import equilibrium
from dojo_opt.gaits.legs import Legs
from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.mpc.controller import MPC
from dojo_opt.planning.options import Options, Stage
from dojo_opt.planning.problem import Problem
from dojo_opt.tasks.free_gait import Lead
from sim.mechanism import checks
from sim.model.state_columns import BaseState
from sim.simulator.simulator import Simulator
from solvers.types import Matrix, Vector

__all__ = ["SteppingPose", "humanoid_mpc"]

# in units of the height and weight of a quadruped, see `Legs`: the weights of Atlas are those of the docstring
_KNOT, _HORIZON, _ITERATIONS, _KAPPA = 0.0227, 20, 2, 1.5e-3  # [s], knots, per tick, [N s m]
_PERIOD, _SWING = 24, 0.4  # knots, share of the period
_PLACE, _HEIGHT, _TURN, _ANGLE = 100.0, 1000.0, 30.0, 1.0  # of lengths and angles
_SPEED, _SPIN, _RATE = 31.0, 0.33, 0.011  # of their rates
_END = 10.0  # times the weights, at the end
_EFFORT, _SLIP, _NEAR = 2e-3, 100.0, 0.01
_DAMPER = 0.12  # share of the usual damper of a gait
# [rad] with .7 a Talos at .6 m/s slides one foot instead of lifting it, and is too slow, and a G1 that stands seldom
# steps when it is pushed; with 1.6 it falls more often
_BEND = 1.3
_LEAD = 0.04  # [m] with .05, or with .032 and a G1 at .6 m/s, robots fall more often
_HARD = 0.1  # of the kappa of plans: the equilibrium whose torques are the reference
_UPRIGHT, _ABOUT = np.eye(4)[[0, 3]]  # quaternions: no turn, half a turn about z
_CAREFUL = 0.75  # share of the friction that plans assume


class SteppingPose(Lead):
    """A pose that moves at a commanded velocity, and bends its legs in turn.

    The pose is at most `lead` ahead of where the robot is measured, and moves on along the horizon. The bend of a leg
    rises and falls within its swing as sin^2; no place of a foot is given.

    Args:
        pose: (nx,) nominal state, whose base looks along x.
        velocity: (3,) velocity of the base forward and to the left, and rate of its heading [m/s, m/s, rad/s].
        lead: largest distance [m].
        bends: (2, nx) change of the pose per radian that the one and the other leg is bent.
        cadence: duration of two steps [s], share of it that a leg swings, and largest bend [rad].

    Raises:
        ValueError: for an argument of the wrong shape or out of range.
    """

    def __init__(
        self, pose: Vector, velocity: ArrayLike, lead: float, bends: Matrix, cadence: tuple[float, float, float]
    ) -> None:
        self.bends = checks.array("SteppingPose(bends)", bends, (2, pose.size))
        period, swing, bend = cadence
        self.period = checks.number("SteppingPose(cadence): period", period, above=0.0)
        self.swing = checks.number("SteppingPose(cadence): swing", swing, above=0.0)
        self.bend = checks.number("SteppingPose(cadence): bend", bend, at_least=0.0)
        super().__init__(pose, velocity, lead)

    def __call__(self, times: ArrayLike) -> Matrix:
        """The pose.

        Args:
            times: (n,) times [s].

        Returns:
            (n, nx) states.
        """
        t = np.asarray(times, dtype=np.float64)
        ahead = t - (self._time if np.isfinite(self._time) else t[:1])
        out = np.tile(self._pose, (t.size, 1))
        heading, nq = self._heading + ahead * self.velocity[2], self._pose.size // 2 + 1
        speed = complex(*self.velocity[:2]) * np.exp(1j * heading)
        out[:, 0] = self._place[0] + ahead * speed.real
        out[:, 1] = self._place[1] + ahead * speed.imag
        out[:, BaseState.QUATERNION] = np.outer(np.cos(0.5 * heading), _UPRIGHT) + np.outer(
            np.sin(0.5 * heading), _ABOUT
        )
        out[:, nq], out[:, nq + 1], out[:, nq + 5] = speed.real, speed.imag, self.velocity[2]
        for leg, row in enumerate(self.bends):
            phase = (t / self.period + 0.5 * leg) % 1.0
            out += np.outer(self.bend * np.sin(np.pi * np.minimum(phase / self.swing, 1.0)) ** 2, row)
        return out


@checked_numbers("tasks")
def humanoid_mpc(
    velocity: ArrayLike = (0.3, 0.0, 0.0),
    *,
    robot: Any = None,
    feet: Sequence[str] | Mapping[str, float] | None = None,
    stance: Any = None,
    period: float | None = None,
    bend: float = _BEND,
    damping: float | None = None,
    **settings: Any,
) -> MPC:
    """A humanoid stands, walks and catches itself at a commanded velocity, with its steps timed and not placed.

    The reference is one standing pose that moves on and bends its legs in turn, see `SteppingPose`. Where the feet go
    follows from the model. Plans have 20 knots, of 39 ms for Atlas, and two iterations per tick. For Atlas squares of
    the place of the pelvis weigh 11, of its height 110, of its rotation 30, of joint angles 1; of their rates 10, 10,
    1 and .03; all of them ten times as much at the end. The slip of feet near the ground weighs 34, torques 1e-6
    around those of the stance. Other robots have these weights in units of their height and weight. Plans are made at
    a kappa of .11 N s m for Atlas: there the ground acts on feet centimetres before they touch it, and with half of it
    the robot falls more often. With a tenth of the weight of the slip it walks as fast, and slides its feet. Plans
    assume three quarters of the friction, and torques within the limits of the inputs. Their gains act on the plant,
    whose contact is hard.

    Args:
        velocity: (3,) velocity forward and to the left, and rate of the heading [m/s, m/s, rad/s].
        robot: a mechanism on two feet, on a floating base that looks along x, or its simulator (default None:
            `models.atlas`).
        feet: names of contacts, bodies or links, see `tasks.legged_mpc` (default None: found).
        stance: coordinates of the stance by joint (default None: found).
        period: duration of two steps [s] (default None: 24 knots).
        bend: largest bend of a swinging leg [rad]; 0 stands.
        damping: least damper of the joints of model and plant [N m s/rad] (default None: 5 for Atlas).
        **settings: settings of `dojo.MPC`.

    Returns:
        The controller; `tasks.plant(mpc)` is a plant for it.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range, or a robot without two legs.
    """
    call = "tasks.humanoid_mpc"
    legs = Legs(models.atlas() if robot is None else robot, feet, damping=damping, stance=stance, share=_DAMPER)
    if not legs.biped:
        raise ValueError(f"{call}(robot=...): expected a robot on two feet, got {', '.join(legs.feet)}")
    size, slow = legs.size, legs.size**0.5
    knot, kappa = 1e-3 * round(1e3 * _KNOT * slow), _KAPPA * legs.torque * slow
    sim = legs.simulator(knot, kappa)
    pose = over_its_feet(sim)
    held = equilibrium(sim.replace(kappa=_HARD * kappa), pose)[1]
    running = _weights(legs, sim)
    cost = [
        Tracking(pose, np.vstack([np.tile(running, (_HORIZON, 1)), _END * running])),
        Effort(_EFFORT / legs.torque**2, reference=held),
        Slip(weight=_SLIP / size, near=_NEAR * size),
    ]
    cycle = _PERIOD * knot if period is None else checks.number(f"{call}(period=...)", period, above=0.0)
    bends = np.pad(legs.bends(), ((0, 0), (0, sim.nv)))
    command = checks.array(f"{call}(velocity)", velocity, (3,))
    march = SteppingPose(pose, command, _LEAD * size, bends, (cycle, _SWING, bend))
    problem = Problem(sim, pose, _HORIZON, cost=cost, controls0=np.clip(held, *sim.mechanism.input_limits))
    usual: dict[str, Any] = {"iterations": _ITERATIONS, "kappa": kappa, "patience": 3}
    usual |= {"friction": _CAREFUL * min(contact.friction for contact in sim.mechanism.contacts)}
    usual |= {"first": Options(stages=(Stage(kappa, kappa),))}
    return MPC(problem, reference={0: march}, **{**usual, **settings})


def _weights(legs: Legs, sim: Simulator) -> Vector:
    """(ndx,) weights of squares, in units of the robot's height and time."""
    joints, size = np.ones(sim.nv - 6), legs.size
    place, speed = _PLACE / size**2, _SPEED / size
    pose = [place, place, _HEIGHT / size**2, *np.full(3, _TURN), *_ANGLE * joints]
    rates = [*np.full(3, speed), *np.full(3, _SPIN * size), *_RATE * size * joints]
    return np.array([*pose, *rates])
