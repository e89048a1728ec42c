"""Report `timing`: microseconds per step and gradient, per link of a chain, per planner iteration; with peers.

One core, processor time, whole horizons per call so that no Python is inside the clock. Every case runs once per
round; times are medians over the rounds, ratios medians of the ratios taken round by round.

A gradient's time is the time of `linearize_trajectory` per knot minus the time of a step: a linearised knot solves its
step, at the same kappa, and then differentiates it. At all knots the scene stands still. A step's initial guess is the
next knot, which then holds no more information than the current velocity: iterations equal those of the rollout.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

import dojo_opt as dojo
from benchmarks.engines import mujoco_scene
from benchmarks.studies.timing.planning_time import add_planning
from benchmarks.studies.timing.robot_times import add_robots
from dojo_opt.gaits.equilibrium import equilibrium
from dojo_opt.report.interleaved_rounds import interleave, ratio, slope
from dojo_opt.report.result import Report, Row
from dojo_opt.report.study import Progress
from sim.simulator.simulator import Simulator
from solvers.compiler import threads
from solvers.types import Vector

KNOTS = 50  # steps per call: long enough to hide the call, short enough to stay where the scene starts
LINKS = (10, 20, 50, 100, 200)
FD_STEP = 1e-6  # of mjd_transitionFD, one-sided: the cheap variant


class Bars(NamedTuple):
    """Bars of one scene."""

    step: float | None = None  # [us]
    gradient: float | None = None  # [us]
    over_step: float | None = None  # most steps of MuJoCo in the time of one of ours
    under_jacobian: float | None = None  # least gradients in the time of one Jacobian of MuJoCo


@dataclass(frozen=True)
class TimingStudy:
    """All scenes; quick takes 3 rounds instead of 60."""

    quick: bool = False

    def run(self, progress: Progress) -> Report:
        """Measure."""
        report = Report("Time on one core")
        report.summary = (
            "Processor time of whole horizons, medians over interleaved rounds; ratios are taken round by round."
        )
        rounds = 3 if self.quick else 60
        parts: dict[str, Callable[[], None]] = {
            "hopper": lambda: _hopper(report, rounds),
            "quadruped": lambda: _quadruped(report, rounds),
            "landing": lambda: _landing(report, rounds),
            "Atlas": lambda: _atlas(report, rounds),
            "robots": lambda: add_robots(report, quick=self.quick),
            "chains": lambda: _chains(report, rounds),
            "planning": lambda: add_planning(report, quick=self.quick),
        }
        with threads(1):
            for measure in progress(list(parts.items()), "timing"):
                measure()
        _batch(report, rounds)
        report.notes.append("step, gradient: microseconds of processor time; iterations: Newton iterations per step")
        if find_spec("mujoco") is None:
            report.notes.append('without MuJoCo; pip install "dojo-opt[bench]" for the ratios')
        return report


def _hopper(report: Report, rounds: int) -> None:
    hop = dojo.problems.hop()
    _scene(report, "hopper", hop.sim, hop.start, hop.controls0[0], rounds, Bars(7.0, 4.0))


def _quadruped(report: Report, rounds: int) -> None:
    for h in (0.01, 0.02, 0.05):
        sim, start = _standing(h)
        bars = Bars(22.0, 13.0, 1.5, 25.0)
        _scene(report, f"quadruped, {1e3 * h:.0f} ms", sim, start, np.zeros(sim.nu), rounds, bars)
    sim, start = _standing(0.02, limits=True)
    _scene(report, "the same with 24 limits, 20 ms", sim, start, np.zeros(sim.nu), rounds, Bars())


def _standing(time_step: float, *, limits: bool = False) -> tuple[Simulator, Vector]:
    """A quadruped of 13 bodies, and the state in which its sprung joints hold it on its four feet."""
    mechanism = dojo.models.quadruped(spring=80.0, damper=4.0, limits=limits)
    sim = Simulator(mechanism, time_step=time_step)  # at rest for this time step: at another it still moves
    x = _solved("quadruped", sim.rollout(sim.neutral(), np.zeros((round(4.0 / time_step), sim.nu)))).x[-1]
    return sim, np.ascontiguousarray(x)


def _atlas(report: Report, rounds: int) -> None:
    """Atlas on eight balls under its soles, its joints sprung. No ratios: MuJoCo does not hold it at this time step."""
    sim = Simulator(dojo.models.atlas(spring=1e4, damper=500.0), time_step=0.01)
    x, u = equilibrium(sim)
    _scene(report, "Atlas, 10 ms", sim, x, u, rounds, Bars(120.0, 100.0), peer=False)


def _scene(
    report: Report, name: str, sim: Simulator, x: Vector, u: Vector, rounds: int, bars: Bars, *, peer: bool = True
) -> None:
    """Rows of one mechanism that holds still: step, gradient, and, with a peer, their ratios to MuJoCo's."""
    us = np.tile(u, (KNOTS, 1))
    x = np.ascontiguousarray(_solved(name, sim.rollout(x, us)).x[-1])  # settled to the last digit
    trajectory = _solved(name, sim.rollout(x, us))
    xs = np.tile(x, (KNOTS, 1))
    cases: dict[str, Callable[[], Any]] = {
        "step": lambda: sim.rollout(x, us),
        "step and gradient": lambda: sim.linearize_trajectory(xs, us, kappa=sim.kappa),
    }
    twin = peer and find_spec("mujoco") is not None
    if twin:
        cases |= _mujoco_cases(sim, x, u)
    seconds = {case: s / KNOTS for case, s in interleave(cases, rounds).items()}
    seconds["gradient"] = seconds["step and gradient"] - seconds["step"]
    report.details[name] = {case: (1e6 * s).tolist() for case, s in seconds.items()}
    report.details[name]["iterations"] = np.asarray(trajectory.iterations).tolist()

    def row(case: str, bar: float | None = None, note: str = "") -> Row:
        return Row(f"{name}: {case}", 1e6 * float(np.median(seconds[case])), "us", bar, note=note)

    iterations = f"{np.mean(trajectory.iterations):.2f} iterations"
    report.rows += [row("step", bars.step, iterations), row("gradient", bars.gradient), row("step and gradient")]
    if twin:
        steps = ratio(seconds["step"], seconds["mj_step"])
        gradients = ratio(seconds["mjd_transitionFD"], seconds["gradient"])
        report.rows += [
            row("mj_step"),
            row("mjd_transitionFD"),
            Row(f"{name}: step / mj_step", steps, "", bars.over_step),
            Row(f"{name}: mjd_transitionFD / gradient", gradients, "", bars.under_jacobian, at_least=True),
        ]


def _landing(report: Report, rounds: int) -> None:
    """The quadruped dropped from 0.1 m, one second: contacts open and close, where standing repeats one solution."""
    sim, x = _standing(0.02)
    x[2] += 0.1
    us = np.zeros((KNOTS, sim.nu))
    iterations = _solved("landing", sim.rollout(x, us)).iterations
    cases: dict[str, Callable[[], Any]] = {"step": lambda: sim.rollout(x, us)}
    if find_spec("mujoco") is not None:
        cases["mj_step"] = _mujoco_cases(sim, x, us[0])["mj_step"]
    seconds = {case: s / KNOTS for case, s in interleave(cases, rounds).items()}
    report.details["landing"] = {case: (1e6 * s).tolist() for case, s in seconds.items()}
    note = f"{np.mean(iterations):.2f} iterations, at most {np.max(iterations)}"
    report.rows.append(Row("quadruped, landing: step", 1e6 * float(np.median(seconds["step"])), "us", note=note))
    if "mj_step" in seconds:
        steps = ratio(seconds["step"], seconds["mj_step"])
        report.rows.append(Row("quadruped, landing: step / mj_step", steps, ""))


def _mujoco_cases(sim: Simulator, x: Vector, u: Vector) -> dict[str, Callable[[], Any]]:
    """KNOTS steps, and KNOTS finite-difference Jacobians where those steps end, of the same mechanism in MuJoCo.

    Its "discrete" integrator: the others lose the springs of the standing quadruped at these time steps.
    """
    import mujoco

    model = mujoco_scene.load(sim.model, sim.time_step, integrator="discrete")
    data = mujoco_scene.state(model, x)
    full = mujoco.mjtState.mjSTATE_INTEGRATION
    start = np.empty(mujoco.mj_stateSize(model, full))
    data.ctrl[:] = u
    mujoco.mj_getState(model, data, start, full)
    settled = mujoco_scene.state(model, x)
    settled.ctrl[:] = u
    mujoco.mj_step(model, settled, KNOTS)
    if not np.all(np.abs(settled.qpos[:2] - x[:2]) < 0.05):
        raise RuntimeError(f"report timing: MuJoCo does not hold the scene, base moved to {settled.qpos[:3]}")
    A, B = np.empty((2 * model.nv, 2 * model.nv)), np.empty((2 * model.nv, model.nu))

    def steps() -> None:
        mujoco.mj_setState(model, data, start, full)
        mujoco.mj_step(model, data, KNOTS)

    def jacobians() -> None:
        for _ in range(KNOTS):
            mujoco.mjd_transitionFD(model, settled, FD_STEP, False, A, B, None, None)

    return {"mj_step": steps, "mjd_transitionFD": jacobians}


def _chains(report: Report, rounds: int) -> None:
    """Hanging n-link pendulums tilted by 0.05 rad at the top: time per Newton iteration against the links."""
    cases: dict[str, Callable[[], Any]] = {}
    iterations = {}
    for n in LINKS:
        sim = Simulator(dojo.models.npendulum(n), time_step=0.01)
        x = sim.neutral()
        x[0] += 0.05
        us = np.zeros((KNOTS, sim.nu))
        iterations[n] = float(np.sum(_solved(f"chain of {n}", sim.rollout(x, us)).iterations))
        cases[str(n)] = lambda sim=sim, x=x, us=us: sim.rollout(x, us)  # type: ignore[misc]
    seconds = interleave(cases, rounds)
    per_iteration = np.array([1e6 * float(np.median(seconds[str(n)])) / iterations[n] for n in LINKS])
    report.details["chains"] = {
        "links": list(LINKS),
        "us_per_iteration": per_iteration.tolist(),
        "iterations_per_step": [iterations[n] / KNOTS for n in LINKS],
    }
    for n, t in zip(LINKS, per_iteration, strict=True):
        note = f"{iterations[n] / KNOTS:.2f} iterations, {t * iterations[n] / KNOTS:.4g} us per step"
        report.rows.append(Row(f"chain of {n}: iteration per link", t / n, "us", 0.3, note=note))
    report.rows.append(Row("chains: log-log slope", slope(np.array(LINKS), per_iteration), "", 1.1, note="10 to 200"))


def _batch(report: Report, rounds: int) -> None:
    """Rollouts of 64 quadrupeds on two threads against one, by wall-clock time."""
    if int(os.environ.get("NUMBA_NUM_THREADS", os.cpu_count() or 1)) < 2:
        report.notes.append("batch: omitted, since there is one core or NUMBA_NUM_THREADS is 1")
        return
    sim, start = _standing(0.02)
    x = np.tile(start, (64, 1))
    us = np.zeros((64, KNOTS, sim.nu))

    def on(count: int) -> Callable[[], Any]:
        def run() -> None:
            with threads(count):
                sim.rollout_batch(x, us)

        return run

    seconds = interleave({"1": on(1), "2": on(2)}, rounds, clock=time.perf_counter)
    report.details["batch"] = {k: s.tolist() for k, s in seconds.items()}
    speedup = ratio(seconds["1"], seconds["2"])
    report.rows.append(Row("batch: two threads over one", speedup, "", 1.7, at_least=True, note="64 quadrupeds"))


def _solved(name: str, trajectory: Any) -> Any:
    """The trajectory, or an error, because the time of a failed step is meaningless."""
    if not trajectory.success:
        raise RuntimeError(f"report timing: {name}: step {trajectory.solved_steps} ended with {trajectory.status!r}")
    return trajectory
