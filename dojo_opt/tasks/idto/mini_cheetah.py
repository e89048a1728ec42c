"""A quadruped walks on, with no gait given and joint angles that cost nothing on the way."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from dojo_opt.gaits.equilibrium import equilibrium
from dojo_opt.mpc.controller import MPC
from dojo_opt.mpc.moving import Onward
from dojo_opt.planning.options import Options, Stage
from dojo_opt.planning.problem import Problem
from dojo_opt.plant.loop import ClosedLoop
from dojo_opt.tasks.idto.assembly import FileLink, assembled, from_com
from dojo_opt.tasks.suite import SuiteTask, lifted, quadratic, servo_effort, timed
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.parts import Contact, Input
from sim.mechanism.terrain import Terrain
from sim.simulator.simulator import Simulator

__all__ = ["mini_cheetah"]

_KNOT, _HORIZON, _RATE = 0.05, 20, 60.0  # [s], knots, [Hz]
_WAY, _LOW, _TILT = 3.2, 0.15, 0.5  # [m] in 10 s, [m] and [rad] of the trunk
_STANCE = (0.0, -0.8, 1.6)  # [rad] abduction, hip, knee
_EFFORT = (18.0, 18.0, 26.0)  # [N m]
_KAPPA = 5e-3  # [N s m] harder contact stands or falls, and from 1e-2 the robot hovers without a step
_SERVO = 50.0, 2.0  # [N m/rad], [N m s/rad]
_LEGS = {"fl": (1.0, 1.0), "fr": (1.0, -1.0), "hl": (-1.0, 1.0), "hr": (-1.0, -1.0)}


def mechanism(friction: float, terrain: Terrain | None = None, servos: bool = False) -> Mechanism:
    """The robot of 8.25 kg with feet of 17.5 mm: masses of the publication's Python variant, which are mirrored.

    Args:
        friction: coefficient of friction of the feet.
        terrain: the ground (default None: level).
        servos: whether its joints have the servos of the controller (default False).

    Returns:
        The mechanism, which stands.
    """
    links = [FileLink("trunk", None, 3.3, (0.0, 0.0, 0.0), (0.012677, 0.017298, 0.024475), "floating")]
    for leg, (front, left) in _LEGS.items():
        turn = front * left  # of both diagonals
        abduction = (0.00024813, 0.00054315, 0.00045809, -turn * 7.3074e-5, 0.0, 0.0)
        thigh = (0.0019421, 0.0017224, 0.00066017, 0.0, 0.0, left * 8.4495e-5)
        shank = (0.00034489, 0.00034717, 5.7021e-6, 0.0, 0.0, -1.1541e-6)
        across, limits = (0.0, -1.0, 0.0), (-2.6, 2.6)
        links += [
            FileLink(
                f"{leg}_abduction",
                "trunk",
                0.54,
                (-front * 0.020141, left * 0.0031566, 0.0),
                abduction,
                pos=(front * 0.19, left * 0.049, 0.0),
                axis=(1.0, 0.0, 0.0),
                limits=(-1.6, 1.6),
            ),
            FileLink(
                f"{leg}_thigh",
                f"{leg}_abduction",
                0.634,
                (0.0, left * 0.00010106, -0.015538),
                thigh,
                pos=(0.0, left * 0.062, 0.0),
                axis=across,
                limits=limits,
            ),
            FileLink(
                f"{leg}_shank",
                f"{leg}_thigh",
                0.064,
                (0.00019682, 0.00087559, -0.089454),
                shank,
                pos=(0.0, 0.0, -0.209),
                axis=across,
                limits=limits,
            ),
        ]
    bodies, joints = assembled(links)
    if servos:
        joints = [joints[0], *(replace(joint, spring=_SERVO[0], damper=_SERVO[1]) for joint in joints[1:])]
    feet = [
        Contact(
            f"{leg}_shank",
            from_com(links, f"{leg}_shank", (0.0, 0.0, -0.19)),
            0.0175,
            friction,
            name=f"{leg}_foot",
            terrain=terrain,
        )
        for leg in _LEGS
    ]
    parts = ("abduction", "thigh", "shank")
    neutral: dict[str, Any] = {"trunk": (0.0, 0.0, 0.29, 1.0, 0.0, 0.0, 0.0)}
    neutral |= {f"{leg}_{part}": angle for leg in _LEGS for part, angle in zip(parts, _STANCE, strict=True)}
    inputs = [
        Input(f"{leg}_{part}", limits=(-np.inf, np.inf) if servos else (-effort, effort))
        for leg in _LEGS
        for part, effort in zip(parts, _EFFORT, strict=True)
    ]
    return Mechanism(bodies, joints, feet, inputs, name="mini_cheetah", neutral=neutral)


def mini_cheetah(*, speed: float = 0.4, terrain: Terrain | None = None, **settings: Any) -> SuiteTask:
    """Walk along x at .4 m/s: 20 knots of 50 ms at 60 Hz. Nothing tells it which foot to lift, or when.

    A run of 10 s is a success when the trunk gets 3.2 m far (in proportion at other speeds) and stays above .15 m, with
    its roll and pitch below .5 rad. Left out are the trunk's contacts: a robot that lies has failed before. The start
    touches the ground, which that of the publication is 5.5 mm inside of.

    Args:
        speed: speed of the nominal motion [m/s].
        terrain: the ground, which the controller knows (default None: level).
        **settings: settings of `dojo.MPC`, instead of the ones of the task.

    Returns:
        The task.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range.
    """
    sim = Simulator(mechanism(1.0, terrain, servos=True), time_step=_KNOT, kappa=_KAPPA)
    own = mechanism(2.0 / 3.0, terrain)
    begin = sim.neutral()
    start = lifted(sim, begin, 2)
    goal = begin.copy()
    goal[0] = speed * _KNOT * _HORIZON
    target = Onward(sim, begin, goal, _KNOT * _HORIZON, anchored=[0, 1])
    joints, quat = np.zeros(12), 0.25  # squares of four numbers are a quarter of those of the rotation vector
    rates = np.concatenate([np.ones(6), np.full(12, 0.1)])
    running = np.concatenate([np.full(3, 10.0), np.full(3, quat), joints])
    end = np.concatenate([np.full(3, 10.0), np.full(3, 10.0 * quat), joints + 1.0])
    cost = [
        quadratic(begin, _KNOT, _HORIZON, (running, rates), (end, rates)),
        servo_effort(sim, own, _KNOT * 0.01, _HORIZON),
    ]
    problem = Problem(sim, start, _HORIZON, cost=cost, controls0=equilibrium(sim, start)[1])
    given = timed(_RATE) | {"servo": own, "gain_scale": 0.0}
    given |= {"kappa": _KAPPA, "iterations": 3}
    given |= {"first": Options(stages=(Stage(_KAPPA, _KAPPA),))}
    mpc = MPC(problem, reference=target, **{**given, **settings})
    model = Simulator(own, time_step=1e-3, kappa=1e-8)
    spread = np.array([0.05, 0.05, 0.01, 0.05, 0.05, 0.05] + [0.1] * 12 + [0.1] * 18)
    judge = _Walked(_WAY * speed / 0.4)
    return SuiteTask("idto.mini_cheetah", mpc, model, start, 10.0, spread, judge, _RATE, rise=2)


class _Walked:
    """Whether the robot gets `far` [m] on its feet."""

    def __init__(self, far: float) -> None:
        self._far = far

    def __call__(self, loop: ClosedLoop) -> tuple[bool, dict[str, float]]:
        w, x, y, z = loop.x[:, 3:7].T
        roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x**2 + y**2))
        pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
        way, low = float(loop.x[-1, 0] - loop.x[0, 0]), float(loop.x[:, 2].min())
        tilt = float(max(np.abs(roll).max(), np.abs(pitch).max()))
        return way >= self._far and low > _LOW and tilt < _TILT, {"way [m]": way, "lowest [m]": low, "tilt [rad]": tilt}
