"""A quadruped that finds its gait, given a velocity and one pose."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt import models
from dojo_opt.cost import Effort, ResidualCost, Slip, Tracking
from dojo_opt.gaits.equilibrium import equilibrium
from dojo_opt.gaits.feet import Feet
from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.mpc.controller import MPC
from dojo_opt.planning.options import Options, Stage
from dojo_opt.planning.problem import Problem
from sim.mechanism import checks
from sim.mechanism.mechanism import Mechanism
from sim.model.state_columns import BaseState
from sim.simulator.simulator import Simulator
from solvers.types import Matrix, Vector

__all__ = ["GaitWeights", "Lead", "free_gait_mpc"]

_HORIZON, _ITERATIONS = 20, 3  # knots, per tick: with two iterations, 2 of 40 robots at .6 m/s fall when pushed
_KAPPA = 1e-2  # [N s m] at 3e-3 and below the robot leans forward and stands: no gradient lifts a foot
_POSE = (20.0, 20.0, 80.0, 10.0, 10.0, 10.0)  # [1/m^2], [1/rad^2] of the trunk; joints weigh 1
_SETTLING = 30.0  # weights of coordinates over those of their rates
_END = 10.0  # times the weights, at the end
_SERVO = 40.0, 1.0  # [N m/rad], [N m s/rad]
_DIAGONAL = ((0, 3), (1, 2))  # legs in the order of the inputs
_LEAD, _AHEAD = 0.35, 1.0  # [m], [s] with .35 m a robot that is asked for .6 m/s walks at .45 to .5
_CAREFUL = 0.75  # share of the friction that plans assume: with half of it a robot on a slope expects to creep
_LEG = 3  # inputs of a leg: hip, thigh and calf


class GaitWeights(NamedTuple):
    """Weights of the costs of a gait.

    Attributes:
        pose: factor of those of the trunk (default 1).
        effort: of torques [1/(N m)^2] (default 2e-4).
        slip: of the speed of feet near the ground [1/(m/s)^2] (default 3).
        near: height that counts as near [m] (default .03).
        alike: of differences of torques between diagonal legs [1/(N m)^2] (default .01).
    """

    pose: float = 1.0
    effort: float = 2e-4
    slip: float = 3.0
    near: float = 0.03
    alike: float = 1e-2


_WEIGHTS = GaitWeights()


class Lead:
    """One pose that moves at a commanded velocity, and waits for a robot that falls behind.

    It is the same at all knots of a horizon, and at most `lead` ahead of where the robot is measured.

    Args:
        pose: (nx,) nominal state, whose base looks along x.
        velocity: (3,) velocity of the base forward and to the left, and rate of its heading [m/s, m/s, rad/s].
        lead: largest distance [m].

    Raises:
        ValueError: for a velocity of the wrong shape, or a distance that is not positive.
    """

    def __init__(self, pose: Vector, velocity: ArrayLike, lead: float) -> None:
        self.velocity = checks.array("Lead(velocity)", velocity, (3,))
        self.lead = checks.number("Lead(lead)", lead, above=0.0)
        self._pose = pose.copy()
        self.reset()

    def reset(self) -> None:
        """Begin anew, where the robot is measured next."""
        self._time = np.inf
        self._begin(self._pose)

    def _begin(self, x: Vector) -> None:
        """Begin where the base of the state x (nx,) is."""
        self._place = np.array(x[:2])
        w, _, _, z = x[BaseState.QUATERNION]
        self._heading = float(2.0 * np.arctan2(z, w))

    def anchor(self, time: float, x: Vector) -> None:
        """Move on.

        Args:
            time: beginning of the horizon [s].
            x: (nx,) state there.
        """
        if time < self._time:
            self._begin(x)
            self._time = time
        elapsed, self._time = time - self._time, time
        c, s = np.cos(self._heading), np.sin(self._heading)
        forward, left, turn = elapsed * self.velocity
        ahead = self._place + (c * forward - s * left, s * forward + c * left) - x[:2]
        self._place = x[:2] + ahead * min(1.0, self.lead / max(self.lead, float(np.hypot(*ahead))))
        self._heading += turn

    def __call__(self, times: ArrayLike) -> Matrix:
        """The target.

        Args:
            times: (n,) times [s].

        Returns:
            (n, nx) states, all the same.
        """
        row = self._pose.copy()
        row[:2] = self._place
        row[BaseState.QUATERNION] = np.cos(0.5 * self._heading), *row[BaseState.VECTOR][:2], np.sin(0.5 * self._heading)
        return np.tile(row, (np.size(times), 1))


@checked_numbers("tasks")
def free_gait_mpc(
    velocity: ArrayLike = (0.3, 0.0, 0.0),
    *,
    robot: Mechanism | None = None,
    lead: float | None = None,
    knot: float = 0.025,
    weights: GaitWeights = _WEIGHTS,
    **settings: Any,
) -> MPC:
    """A quadruped walks at a commanded velocity without a given gait, footholds or swings: 20 knots of 25 ms at 40 Hz.

    The reference is one standing pose that moves forward, see `Lead`. Squares of the trunk's position weigh 20, of its
    height 80, of its rotation 10, of joint angles 1, rates a thirtieth of that, all of them ten times as much at the
    end; torques weigh 2e-4, the slip of feet near the ground 3, differences of torques between diagonal legs .01.
    Costs are those of Kim et al. 2023 (arXiv 2312.08961), but for a slip that weighs three times as much, and no term
    for long swings. Plans make three iterations per tick, at a kappa of .01, where contact acts at a distance of a
    centimetre; this smoothing lets a foot leave the ground. Servos follow them on the plant, whose contact is hard.
    Plans assume three quarters of the friction. The slope of the ground is estimated from the stance feet, and the pose
    follows it.

    Args:
        velocity: (3,) velocity forward and to the left, and rate of the heading [m/s, m/s, rad/s].
        robot: a mechanism with the joints and inputs of `models.quadruped` (default None: that).
        lead: largest distance from the robot to the pose that it follows [m] (default None: that of one second, and .35
            at least).
        knot: length of a knot [s].
        weights: weights of the costs.
        **settings: settings of `dojo.MPC`.

    Returns:
        The controller; `tasks.plant(mpc)` is a plant for it.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument of the wrong shape or out of range, or a robot with other inputs.
    """
    sim = Simulator(models.quadruped() if robot is None else robot, time_step=knot, kappa=_KAPPA)
    if sim.nu != 4 * _LEG or sim.nv != 6 + sim.nu:
        raise ValueError(
            f"tasks.free_gait_mpc(robot=...): expected a floating base and 12 driven joints, got {robot!r}"
        )
    pose = Feet(sim).put_down(sim.neutral())
    weight = np.array([*(weights.pose * np.array(_POSE)), *np.ones(sim.nu)])
    running = np.concatenate([weight, weight / _SETTLING])
    cost = [
        Tracking(pose, np.vstack([np.tile(running, (_HORIZON, 1)), _END * running])),
        Effort(weights.effort),
        Slip(weight=weights.slip, near=weights.near),
        _alike(sim, weights.alike),
    ]
    problem = Problem(sim, pose, _HORIZON, cost=cost, controls0=equilibrium(sim, pose)[1])
    command = checks.array("tasks.free_gait_mpc(velocity)", velocity, (3,))
    ahead = max(_LEAD, _AHEAD * float(np.hypot(*command[:2]))) if lead is None else lead
    usual: dict[str, Any] = {"iterations": _ITERATIONS, "kappa": _KAPPA, "servo": _SERVO}
    usual |= {"learn_ground": "slope", "friction": _CAREFUL * min(c.friction for c in sim.mechanism.contacts)}
    usual |= {"first": Options(stages=(Stage(_KAPPA, _KAPPA),))}
    return MPC(problem, reference={0: Lead(pose, command, ahead)}, **{**usual, **settings})


def _alike(sim: Simulator, weight: float) -> ResidualCost:
    """sum_t w |u_a - u_b|^2 over the thighs and calves of diagonal legs a and b."""
    rows = np.zeros((2 * len(_DIAGONAL), sim.nu))
    for i, (a, b) in enumerate(_DIAGONAL):
        for k in (1, 2):
            rows[2 * i + k - 1, [_LEG * a + k, _LEG * b + k]] = 1.0, -1.0
    count, nu, ndx = len(rows), sim.nu, sim.ndx

    def difference(x, u, out):  # type: ignore[no-untyped-def]
        for i in range(count):
            out[i] = 0.0
            for j in range(nu):
                out[i] += rows[i, j] * u[j]

    def slope(x, u, out):  # type: ignore[no-untyped-def]
        for i in range(count):
            out[i, :] = 0.0
            for j in range(nu):
                out[i, ndx + j] = rows[i, j]

    return ResidualCost(difference, count, weight, slope, knots=range(_HORIZON))
