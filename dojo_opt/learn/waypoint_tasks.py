"""Waypoints: a quadrotor, an underwater vehicle and a mobile platform go to points that change after a while."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from dojo_opt.learn.task import Task
from dojo_opt.learn.velocity_task import distance, in_body, upright
from dojo_opt.models.quadrotor import quadrotor as quadrotor_model
from dojo_opt.models.uuv import uuv as uuv_model
from dojo_opt.models.youbot import youbot as youbot_model
from dojo_opt.planning.residual import jit
from sim.mechanism.input import Input
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator
from solvers.types import Floats

__all__ = ["quadrotor", "uuv", "youbot"]

_TURN, _VELOCITY, _SPIN, _GOAL = 3, 7, 10, 13  # first columns of a rigid body's state with its waypoint
_WIDTH = 0.1  # [m] distances beyond count linearly
_ROLLING = 20.0  # of the platform [N s/m, N m s/rad]
_SURVIVAL = 3.0  # per action: more than the way to any waypoint costs
_QUICK: dict[str, Any] = {
    "epochs": 300, "environments": 32, "horizon": 24, "rate": 2e-3, "costate": 1e3, "evaluations": 3, "episodes": 8,
}  # fmt: skip


@jit
def way(x, y, z):  # type: ignore[no-untyped-def]
    """Length of a vector."""
    return np.sqrt(x * x + y * y + z * z)


@jit
def _rest_of_way(x):  # type: ignore[no-untyped-def]
    """Distance of a rigid body from its waypoint."""
    goal = x[_GOAL:]
    return way(x[0] - goal[0], x[1] - goal[1], x[2] - goal[2])


def _seen(x, out):  # type: ignore[no-untyped-def]
    """As a rigid body sees them: the way to the waypoint, the vertical, its velocity, its angular velocity."""
    q, v, w, goal = x[_TURN:_VELOCITY], x[_VELOCITY:_SPIN], x[_SPIN:_GOAL], x[_GOAL:]
    out[0], out[1], out[2] = in_body(q, goal[0] - x[0], goal[1] - x[1], goal[2] - x[2])
    out[3], out[4], out[5] = in_body(q, 0.0, 0.0, 1.0)
    out[6], out[7], out[8] = in_body(q, v[0], v[1], v[2])
    out[9], out[10], out[11] = w[0], w[1], w[2]


def _arrives(rest: float, effort: float) -> Callable[..., Any]:
    """Minus the smooth distance from the waypoint, the turning, and the actions' distance from those at rest."""
    width = _WIDTH

    def reward(x, a, after):  # type: ignore[no-untyped-def]
        w = after[_SPIN:_GOAL]
        total = -distance(_rest_of_way(after), width) - 0.02 * (w[0] ** 2 + w[1] ** 2 + w[2] ** 2)
        for i in range(a.shape[0]):
            total -= effort * (a[i] - rest) ** 2
        return total

    return reward


def _body(mech: Mechanism, height: float, time_step: float, low: float, high: float, **fields: Any) -> Task:
    """The task of one rigid body that goes to points within a metre of a point so high above the ground."""

    def start(rng: np.random.Generator) -> Floats:
        q = np.array(mech.neutral, dtype=np.float64)
        q[:3] = rng.uniform(-1.0, 1.0, 3) + (0.0, 0.0, height)
        turn = rng.uniform(-0.2, 0.2, 3)
        q[3:] = np.array([1.0, *(0.5 * turn)]) / np.hypot(1.0, 0.5 * np.linalg.norm(turn))
        return np.concatenate([q, 0.2 * rng.standard_normal(6)])

    def command(rng: np.random.Generator) -> Floats:
        return rng.uniform(-1.0, 1.0, 3) + (0.0, 0.0, height)

    sim = Simulator(mech, time_step=time_step, kappa=1e-4)
    n = sim.nu
    return Task(
        sim, 2, _seen, 12, low=np.full(n, low), high=np.full(n, high), start=start, commands=3, command=command,
        settings=_QUICK, **fields,
    )  # fmt: skip


def quadrotor() -> Task:
    """Fly to waypoints: 12 observations, 4 actions from no thrust to twice that of hovering, 0.02 s each.

    The waypoint, within a metre of (0, 0, 2), changes every three seconds. An episode of ten seconds ends early where
    the quadrotor tilts by a right angle, touches the ground, or is five metres away.

    Returns:
        The task.
    """
    mech = quadrotor_model()
    weight = 9.81 * sum(body.mass for body in mech.bodies)

    def terminated(x):  # type: ignore[no-untyped-def]
        return _rest_of_way(x) > 5.0 or x[2] < 0.1 or upright(x) < 0.0

    return _body(
        mech, 2.0, 0.01, 0.0, 0.5 * weight, reward=_arrives(0.0, 0.02), terminated=terminated, survival=_SURVIVAL,
        steps=500, hold=150, name="QuadrotorWaypoint",
    )  # fmt: skip


def uuv() -> Task:
    """Swim to waypoints: 12 observations, 6 actions of up to 10 N of thrust, 0.05 s each.

    The waypoint, within a metre of (0, 0, 2), changes every five seconds.

    Returns:
        The task.
    """
    return _body(
        uuv_model(), 2.0, 0.025, -10.0, 10.0, reward=_arrives(0.0, 0.02), steps=300, hold=100, name="UuvWaypoint"
    )


def youbot() -> Task:
    """Drive to waypoints: 5 observations, 3 actions of up to 50 N and 10 N m on the platform, 0.05 s each.

    Springs hold the arm upright, and a damper on the platform takes the place of its wheels' resistance. The waypoint,
    within a metre of the origin, changes every five seconds; the heading is free.

    Returns:
        The task.
    """
    full = youbot_model(spring=200.0, damper=5.0)
    joints = [replace(joint, damper=_ROLLING) if joint.name == "base" else joint for joint in full.joints]
    mech = replace(full, joints=joints, inputs=[Input("base", dof=d) for d in range(3)])
    nq = mech.nq
    width = _WIDTH

    def observation(x, out):  # type: ignore[no-untyped-def]
        c, s = np.cos(x[2]), np.sin(x[2])
        dx, dy = x[2 * nq] - x[0], x[2 * nq + 1] - x[1]
        out[0], out[1] = c * dx + s * dy, c * dy - s * dx
        out[2], out[3] = c * x[nq] + s * x[nq + 1], c * x[nq + 1] - s * x[nq]
        out[4] = x[nq + 2]

    def reward(x, a, after):  # type: ignore[no-untyped-def]
        total = -distance(way(after[0] - after[2 * nq], after[1] - after[2 * nq + 1], 0.0), width)
        total -= 0.02 * after[nq + 2] ** 2
        for i in range(a.shape[0]):
            total -= 0.02 * a[i] ** 2
        return total

    def start(rng: np.random.Generator) -> Floats:
        q = np.array(mech.neutral, dtype=np.float64)
        q[:3] = rng.uniform(-1.0, 1.0, 3)
        return np.concatenate([q, np.zeros(mech.nv)])

    most = np.array([50.0, 50.0, 10.0])
    return Task(
        Simulator(mech, time_step=0.025, kappa=1e-4), 2, observation, 5, reward, -most, most, start, steps=300,
        name="YoubotWaypoint", commands=2, command=lambda rng: rng.uniform(-1.0, 1.0, 2), hold=100, settings=_QUICK,
    )  # fmt: skip
