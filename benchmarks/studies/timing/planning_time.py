"""Rows of report `timing` about planning: iterations of iLQR, ticks of MPC, and the times of peers for the same gait.

An iteration's time is the time of a whole solve divided by its iterations. It includes rejected iterations and the
changes from one smoothing to the next. Peers solve in the same rounds, each until its own stopping rule ends it.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from typing import Any

import numpy as np

import dojo_opt as dojo
from benchmarks.engines.crocoddyl_trot import CrocoddylTrot
from benchmarks.engines.mujoco_ilqr import MujocoIlqr
from dojo_opt.planning.problem import Problem
from dojo_opt.plant.tick import milliseconds
from dojo_opt.report.interleaved_rounds import interleave
from dojo_opt.report.result import Cell, Report, Row, Table

CROCODDYL, PIN = "3.2.1", "4.0.0"  # compatible wheels: with other versions crocoddyl ends the process


def add_planning(report: Report, *, quick: bool) -> None:
    """All rows; quick takes 2 rounds instead of 15 (7 for the trot and its peers), and 0.4 s of closed loop, not 6."""
    _hop(report, 2 if quick else 15)
    _trot(report, 2 if quick else 7)
    _ticks(report, 0.4 if quick else 6.0)


def _hop(report: Report, rounds: int) -> None:
    """The hopper of `dojo.problems.hop()`."""
    problem = dojo.problems.hop()
    plan = dojo.ilqr(problem)
    seconds = interleave({"hop": lambda: dojo.ilqr(problem)}, rounds)["hop"]
    per_iteration = 1e3 * float(np.median(seconds)) / plan.nit
    report.details["planner"] = {"seconds": seconds.tolist(), "iterations": plan.nit, "knots": len(plan.u)}
    note = f"{len(plan.u)} knots, {plan.nit} iterations, {1e3 * float(np.median(seconds)):.3g} ms per solve"
    report.rows.append(Row("hopper: iLQR iteration", per_iteration, "ms", 0.8, note=note))


def _trot(report: Report, rounds: int) -> None:
    """The quadruped of `dojo.problems.trot()`, and the peers that are installed."""
    problem = dojo.problems.trot()
    plan = dojo.ilqr(problem)
    if not plan.success:
        raise RuntimeError(f"report timing: the trot is not planned: {plan.message}")
    cases: dict[str, Callable[[], Any]] = {"ours": lambda: dojo.ilqr(problem)}
    iterations, costs, notes = {"ours": plan.nit}, {"ours": plan.fun}, {"ours": ""}
    for name, prepare in (("mujoco", _mujoco), ("crocoddyl", _crocoddyl)):
        missing = _missing(name)
        if missing:
            report.notes.append(missing)
        else:
            cases[name], iterations[name], costs[name], notes[name] = prepare(problem)
    seconds = interleave(cases, rounds)
    each = {name: 1e3 * s / iterations[name] for name, s in seconds.items()}
    report.details["trot"] = {
        name: {"seconds": s.tolist(), "iterations": iterations[name], "cost": costs[name]}
        for name, s in seconds.items()
    }

    def row(name: str, label: str, bar: float | None = None) -> Row:
        whole = 1e3 * float(np.median(seconds[name]))
        note = (
            f"{problem.horizon} knots, {iterations[name]} iterations, {whole:.3g} ms per solve, cost {costs[name]:.3g}"
        )
        return Row(f"quadruped trot: {label}", float(np.median(each[name])), "ms", bar, note=note + notes[name])

    lines: list[list[Cell]] = []
    for name in cases:
        over = float(np.median(each[name] / each["ours"]))
        lines.append([name, iterations[name], float(np.median(each[name])), over, costs[name]])
    header = ("planner", "iterations", "ms per iteration", "iteration / ours", "cost")
    report.tables.append(Table("Planners of the trot", header, lines))
    report.rows.append(row("ours", "iLQR iteration", 5.0))
    for name, label in (("mujoco", "MuJoCo + NumPy iteration"), ("crocoddyl", "crocoddyl iteration, contacts given")):
        if name in each:
            over = float(np.median(each[name] / each["ours"]))
            report.rows += [row(name, label), Row(f"quadruped trot: {label} / ours", over, "")]


def _missing(package: str) -> str:
    """The reason for omitting a peer; empty when it takes part."""
    if package == "mujoco":
        return "" if find_spec("mujoco") is not None else "trot: without MuJoCo"
    if find_spec("crocoddyl") is None:
        return 'trot: without crocoddyl; pip install "dojo-opt[crocoddyl]"'
    try:
        found = version("crocoddyl"), version("pin")
    except PackageNotFoundError as error:
        return f"trot: without crocoddyl, whose version is not known: {error}"
    fits = found == (CROCODDYL, PIN)
    return "" if fits else f"trot: without crocoddyl, it has to be {CROCODDYL} with pin {PIN}, not {found}"


def _mujoco(problem: Problem) -> tuple[Callable[[], Any], int, float, str]:
    """Solve by MuJoCo's finite differences and NumPy; iterations; cost; a description."""
    solver = MujocoIlqr(problem)
    solution = solver.solve()
    if max(solution.violation, solution.gap) > 1e-3:
        raise RuntimeError(f"report timing: MuJoCo's trot ends with a violation of {solution.violation:.2g}")
    note = f", {solver.substeps} steps of {1e3 * solver.time_step:.3g} ms per knot"
    return solver.solve, solution.iterations, solution.cost, note


def _crocoddyl(problem: Problem) -> tuple[Callable[[], Any], int, float, str]:
    """Solve by FDDP with the contact sequence given; iterations; cost; a description."""
    trot = CrocoddylTrot(problem)
    iterations = trot.solve()
    if not trot.solver.isFeasible:
        raise RuntimeError(f"report timing: crocoddyl's trot is not feasible after {iterations} iterations")
    return trot.solve, iterations, float(trot.solver.cost), ", FDDP, one thread"


def _ticks(report: Report, duration: float) -> None:
    """Ticks of `dojo.tasks.quadruped_mpc`, one iteration each, while its plant with steps of 2 ms trots."""
    mpc = dojo.tasks.quadruped_mpc()
    loop = dojo.closed_loop(mpc, dojo.tasks.plant(mpc, 2e-3), duration)
    if not loop.survived:
        raise RuntimeError(f"report timing: the closed loop ends: {loop.message}")
    ticks = milliseconds(mpc.log, cpu=True)
    report.details["ticks"] = ticks.tolist()
    note = f"{mpc.problem.horizon} knots, one iteration, {len(ticks)} ticks"
    report.rows += [
        Row("quadruped MPC: tick, median", float(np.median(ticks)), "ms", 3.0, note=note),
        Row("quadruped MPC: tick, 99 %", float(np.percentile(ticks, 99)), "ms"),
    ]
