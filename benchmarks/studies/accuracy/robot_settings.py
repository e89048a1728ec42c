"""The time step and kappa that robots of the toolkit need, found as `dojo-opt report accuracy ROBOT.urdf` does."""

from __future__ import annotations

from collections.abc import Callable

from dojo_opt import models
from dojo_opt.report.accuracy import robot_accuracy as robot
from dojo_opt.report.accuracy.starting_pose import start
from dojo_opt.report.result import Cell, Report, Table
from sim.mechanism.mechanism import Mechanism

ROBOTS: dict[str, Callable[[], Mechanism]] = {
    "raiberthopper": models.raiberthopper,
    "walker": models.walker,
    "halfcheetah": models.halfcheetah,
    "ant": models.ant,
    "quadruped": models.quadruped,
    "humanoid": models.humanoid,
}


def recommendations(report: Report, quick: bool) -> None:
    """One line per robot; quick takes the first only."""
    rows: list[list[Cell]] = []
    for name, build in list(ROBOTS.items())[: 1 if quick else None]:
        mechanism = build()
        best, trials, target, own, _ = robot.advise(mechanism, *start(mechanism), quick)
        error, asked = 1e3 * best.error, 1e3 * target
        rows.append([name, mechanism.nv, 1e3 * best.time_step, best.kappa, error, asked, best.realtime, 1e3 * own])
        report.details.setdefault("robots", {})[name] = [{**vars(t), "realtime": t.realtime} for t in trials]
    header = ["", "dofs", "time step, ms", "kappa", "error, mm", "asked for, mm", "times real time", "converged to, mm"]
    note = (
        "The largest time step, then the largest kappa, with the requested error after 0.1 s: 1 mm, or twice the "
        "error of the converged motion itself. Passive robots start in the air with random joint velocities of "
        "1 rad/s and land. For your robot: dojo-opt report accuracy ROBOT.urdf."
    )
    report.tables.insert(0, Table("Recommended time step and kappa, with contacts and limits", header, rows, note))
