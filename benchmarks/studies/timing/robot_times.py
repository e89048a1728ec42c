"""Rows of report `timing` about robots under random inputs: a step and its gradient, as in Table V of the Dojo paper.

A thousand steps of 10 ms from the neutral state, each with new random inputs, uniform within a third of the motors'
limits: with the full limits an A1 turns its joints five times faster than its motors can. Ours solves a step once
and differentiates it at its solution (`Simulator.linearize_rollout`); MuJoCo takes `mjd_transitionFD`, one-sided, and a
step. Its humanoid has two hinges where ours has an orbital joint.

Dojo's figures were measured by its authors (arXiv 2203.00806v5, Table V, Intel i9-10885H), with 12 contacts on the A1.
Its steps end at complementarity products of 1e-4, its default; ours at a kappa of 1e-9 or so. Both are measured.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

from benchmarks.engines import mujoco_scene
from benchmarks.engines.mujoco_warnings import quiet
from dojo_opt import models
from dojo_opt.report.interleaved_rounds import interleave, ratio
from dojo_opt.report.result import Report, Row
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator
from solvers.types import Vector

STEPS, TIME_STEP = 1000, 0.01
OVER_DOJO = 50.0  # bar: times faster than Dojo's figure
DOJO_KAPPA = 1e-4  # [N s m]
FD_STEP = 1e-6


class TimedRobot(NamedTuple):
    """One line of the table."""

    name: str
    build: Callable[[], Mechanism]
    low: Vector | float  # of the inputs [N, N m]
    high: Vector | float
    dojo: float  # a step and its gradient in Dojo [us]
    over_dojo: float | None  # bars
    over_mujoco: float


def robots() -> list[TimedRobot]:
    """The four robots of Table V; the quadrotor is a Pelican, like Dojo's model, not an X2."""
    hinges = np.array([40.0, 40.0, 40.0, *[40.0, 40.0, 120.0, 80.0, 20.0, 10.0, 10.0, 10.0] * 2])  # gym's, ankles 20
    panda = np.array([87.0] * 4 + [12.0] * 3 + [70.0] * 2)
    hover = 1.04 * 9.81 / 4
    return [
        TimedRobot("humanoid", models.humanoid, -hinges / 3, hinges / 3, 1750.0, OVER_DOJO, 10.0),
        TimedRobot("A1", lambda: models.quadruped(contacts="all"), -33.5 / 3, 33.5 / 3, 5235.0, OVER_DOJO, 10.0),
        TimedRobot("Panda", models.panda, -panda / 3, panda / 3, 1159.0, OVER_DOJO, 1.0),
        TimedRobot("quadrotor", models.quadrotor, 2 / 3 * hover, 4 / 3 * hover, 807.0, None, 1.0),
    ]


def add_robots(report: Report, *, quick: bool) -> None:
    """All rows; quick takes 100 steps and one round instead of 1000 and five."""
    for robot in robots():
        _robot(report, robot, STEPS // 10 if quick else STEPS, 1 if quick else 5)


def _robot(report: Report, robot: TimedRobot, steps: int, rounds: int) -> None:
    """Rows of one robot."""
    sim = Simulator(robot.build(), time_step=TIME_STEP)
    smooth = sim.replace(kappa=DOJO_KAPPA)
    x = sim.neutral()
    us = np.random.default_rng(5).uniform(robot.low, robot.high, (steps, sim.nu))
    trajectory = sim.rollout(x, us, throw=True)
    cases: dict[str, Callable[[], Any]] = {
        "step": lambda: sim.rollout(x, us),
        "step and gradient": lambda: sim.linearize_rollout(x, us),
        "step and gradient, kappa 1e-4": lambda: smooth.linearize_rollout(x, us),
    }
    if find_spec("mujoco") is not None:
        cases["MuJoCo's step and FD"] = _mujoco(sim, x, us)
    seconds = {case: s / steps for case, s in interleave(cases, rounds).items()}
    name = f"{robot.name}, random inputs"
    report.details[name] = {
        **{case: (1e6 * s).tolist() for case, s in seconds.items()},
        "iterations": np.asarray(trajectory.iterations).tolist(),
    }
    counts = f"{np.mean(trajectory.iterations):.2f} iterations, at most {np.max(trajectory.iterations)}"
    report.rows.append(Row(f"{name}: step", _us(seconds["step"]), "us", note=counts))
    theirs = seconds.get("MuJoCo's step and FD")
    for hardness in ("", ", kappa 1e-4"):
        ours = seconds[f"step and gradient{hardness}"]
        report.rows += [
            Row(f"{name}{hardness}: step and gradient", _us(ours), "us"),
            Row(
                f"{name}{hardness}: Dojo's figure / ours",
                robot.dojo / _us(ours),
                "",
                robot.over_dojo,
                at_least=True,
                note=f"Dojo {robot.dojo:.0f} us, on its authors' machine",
            ),
        ]
        if theirs is not None:
            over = ratio(theirs, ours)
            report.rows.append(Row(f"{name}{hardness}: MuJoCo / ours", over, "", robot.over_mujoco, at_least=True))
    if theirs is not None:
        report.rows.append(Row(f"{name}: MuJoCo's step and FD", _us(theirs), "us"))


def _us(seconds: Vector) -> float:
    """Median [us]."""
    return 1e6 * float(np.median(seconds))


def _mujoco(sim: Simulator, x: Vector, us: Any) -> Callable[[], None]:
    """The same steps, and a finite-difference Jacobian before each, in MuJoCo."""
    import mujoco

    model = mujoco_scene.load(sim.model, sim.time_step, hinges=True, integrator="implicitfast")
    A, B = np.empty((2 * model.nv, 2 * model.nv)), np.empty((2 * model.nv, model.nu))

    def run() -> None:
        data = mujoco_scene.state(model, x)
        with quiet():
            for u in us:
                data.ctrl[:] = u
                mujoco.mjd_transitionFD(model, data, FD_STEP, False, A, B, None, None)
                mujoco.mj_step(model, data)

    return run
