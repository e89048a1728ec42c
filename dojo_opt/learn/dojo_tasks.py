"""Tasks of Dojo: an ant for random search, and a quadruped whose gait is sampled (Howell et al. 2022)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.learn.task import Task
from dojo_opt.learn.velocity_task import upright
from dojo_opt.models.ant import ant as ant_model
from dojo_opt.models.quadruped import quadruped as quadruped_model
from sim.mechanism import checks
from sim.mechanism.input import Input
from sim.model.state_columns import BaseState
from sim.simulator.simulator import Simulator
from solvers.types import Floats

__all__ = ["ant_ars", "quadruped_sampling", "sampled_gait"]

_TURN, _JOINTS = BaseState.QUATERNION.start, BaseState.JOINTS  # columns of a state, for kernels
_ANT_STEP = 0.05  # [s]
_MOST = 150.0  # [N m] torque of the ant's hinges
_GAINS = (100.0, 80.0, 60.0), (5.0, 4.0, 3.0)  # of hip, thigh, calf [N m/rad, N m s/rad]
_REACH = 1.0  # of the quadruped's targets, to both sides of its stance [rad]
_CYCLE = 0.2 * np.pi  # of the gait's clock: radians per step of 10 ms and unit of frequency
_LEGS = {"FR": 0, "FL": 1, "RR": 1, "RL": 0}  # of the model, in its order; diagonal legs move together


def ant_ars() -> Task:
    """Dojo's ant for augmented random search: 37 observations, 8 actions of up to 150 N m, 0.05 s each.

        observation   x (28,) and y, attitude as a rotation vector; normal impulses of the nine contacts, up to 1 N s
        reward        2 dx/h + .05 - .05 |a|^2 - 5e-4 sum of the squares of the impulses, up to 1 N s each
        end           the torso is lower than .2 m or higher than 1 m

    Hinges have springs of 25 N m/rad and dampers of 50 N m s/rad. Dojo's search is `ars(task, epochs=100,
    directions=6, best=6, rate=0.02, noise=0.03)`; it clips every reward to [-1, 1], which `ars` does not.

    Returns:
        The task.
    """
    mech = ant_model(spring=25.0, damper=50.0)
    nq, nx, h = mech.nq, mech.nq + mech.nv, _ANT_STEP

    def observation(x, out):  # type: ignore[no-untyped-def]
        turn = x[_TURN:_JOINTS]
        w, length = turn[0], np.sqrt(turn[1] ** 2 + turn[2] ** 2 + turn[3] ** 2)
        rate = 2.0 if length < 1e-9 else 2.0 * np.arctan2(length, w) / length
        for k in range(3):
            out[k], out[3 + k] = x[k], rate * turn[1 + k]
        for k in range(_JOINTS, nx):
            out[k - 1] = x[k]
        for g in range((x.shape[0] - nx) // 6):
            out[nx - 1 + g] = min(max(h * x[nx + 6 * g + 2], -1.0), 1.0)

    def reward(x, a, after):  # type: ignore[no-untyped-def]
        total = 2.0 * (after[0] - x[0]) / h + 0.05
        for i in range(a.shape[0]):
            total -= 0.05 * a[i] ** 2
        for g in range((x.shape[0] - nx) // 6):
            total -= 5e-4 * min(max(h * after[nx + 6 * g + 2], -1.0), 1.0) ** 2
        return total

    def terminated(x):  # type: ignore[no-untyped-def]
        return not 0.2 <= x[2] <= 1.0

    def start(rng: np.random.Generator) -> Floats:
        q = np.array(mech.neutral, dtype=np.float64)
        q[7:] += 0.05 * rng.standard_normal(nq - 7)
        q[2] += 0.05
        return np.concatenate([q, np.zeros(mech.nv)])

    limits = np.full(8, _MOST)
    return Task(
        Simulator(mech, time_step=h, kappa=1e-4), 1, observation, nx - 1 + len(mech.contact_names), reward, -limits,
        limits, start, terminated, steps=150, name="AntArs", touch=tuple((name,) for name in mech.contact_names),
    )  # fmt: skip


def quadruped_sampling() -> Task:
    """Dojo's quadruped, whose gait is sampled: 36 observations, 12 actions, 0.01 s each.

    The model takes steps of 1 ms. Actions move the targets of position servos by up to one radian about the stance:
    hip 100 N m/rad and 5 N m s/rad, thigh 80 and 4, calf 60 and 3. The reward is the distance forwards; an episode of
    two seconds ends early where the robot tilts by a right angle or is lower than half its height. Dojo samples the
    five numbers of `sampled_gait`.

    Returns:
        The task.
    """
    mech = quadruped_model()
    _, *hinges = mech.joints
    servos = [
        Input(joint.name, servo="position", stiffness=_GAINS[0][k % 3], damping=_GAINS[1][k % 3])
        for k, joint in enumerate(hinges)
    ]
    mech = replace(mech, inputs=servos)
    home, nq = np.array(mech.neutral, dtype=np.float64), mech.nq
    low = 0.5 * float(home[2])

    def observation(x, out):  # type: ignore[no-untyped-def]
        for k in range(2, x.shape[0]):
            out[k - 2] = x[k]

    def reward(x, a, after):  # type: ignore[no-untyped-def]
        return after[0] - x[0]

    def terminated(x):  # type: ignore[no-untyped-def]
        return not (x[2] > low and upright(x) > 0.0)

    def start(rng: np.random.Generator) -> Floats:
        q = home.copy()
        q[_JOINTS:] += rng.uniform(-0.02, 0.02, nq - _JOINTS)
        q[2] += 0.01
        return np.concatenate([q, np.zeros(mech.nv)])

    return Task(
        Simulator(mech, time_step=1e-3, kappa=1e-5), 10, observation, 2 * nq - 3, reward, home[_JOINTS:] - _REACH,
        home[_JOINTS:] + _REACH, start, terminated, steps=200, name="QuadrupedSampling",
    )  # fmt: skip


def sampled_gait(task: Task, parameters: ArrayLike) -> Floats:
    """Actions of a trot: cosines of time about a posture, those of the calves a quarter of a period ahead.

        thigh = a_thigh cos(f .2 pi k + leg pi) + m_thigh,   calf = a_calf cos(f .2 pi k + leg pi - pi/2) + m_calf

    Args:
        task: `quadruped_sampling()`.
        parameters: (5,) frequency f per 0.1 s, and amplitudes and means of thigh and calf [rad]:
            (f, a_thigh, m_thigh, a_calf, m_calf).

    Returns:
        (steps, 12) actions in [-1, 1].

    Raises:
        ValueError: not five numbers.
    """
    f, a_thigh, m_thigh, a_calf, m_calf = checks.vector("sampled_gait(parameters)", parameters, 5)
    clock = f * _CYCLE * np.arange(1, task.steps + 1)
    targets = np.zeros((task.steps, 12))
    for k, side in enumerate(_LEGS.values()):
        phase = clock + np.pi * side
        targets[:, 3 * k + 1] = a_thigh * np.cos(phase) + m_thigh
        targets[:, 3 * k + 2] = a_calf * np.cos(phase - 0.5 * np.pi) + m_calf
    middle, half = 0.5 * (task.high + task.low), 0.5 * (task.high - task.low)
    return np.clip((targets - middle) / half, -1.0, 1.0)
