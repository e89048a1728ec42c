"""Motions with dampers: errors of order 2 from step to step, compared with other engines at the same steps.

A damper that acts on the velocity at the end of a step makes a method of first order, whatever it is otherwise.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import dojo_opt as dojo
from benchmarks.engines import PhysicsEngine
from dojo_opt.report.accuracy.error_curves import ours
from dojo_opt.report.accuracy.smooth_scene import SAMPLES, SmoothScene, smooth
from dojo_opt.report.engine import Run
from dojo_opt.report.result import Cell, Report, Row, Table

_STEPS = (0.02, 0.01, 0.005, 0.0025, 0.00125, 0.000625)  # [s]
_PEER = "MuJoCo Euler"


def pendulum() -> SmoothScene:
    """One link with a damper of 0.3 N m s/rad."""
    return replace(smooth(dojo.models.pendulum(damper=0.3), np.array([1.0]), np.array([0.5]), 1.0), name="hinge")


def arm(damper: float) -> SmoothScene:
    """The arm Panda, thrown from its ready pose."""
    mech = dojo.models.panda(damper=damper)
    v = np.random.default_rng(0).normal(size=9) * np.r_[np.ones(7), 0.05, 0.05]
    return replace(smooth(mech, np.array(mech.neutral), v, 0.5), name=f"Panda, {damper:g} N m s/rad")


def legs() -> SmoothScene:
    """A quadruped in space; dampers of 0.5 N m s/rad act on its legs."""
    mech = dojo.models.quadruped(damper=0.5, gravity=(0.0, 0.0, 0.0))
    v = np.random.default_rng(1).normal(size=18)
    return replace(smooth(mech, np.array(mech.neutral), v, 0.5), name="quadruped in space")


def dampers(report: Report, everyone: list[PhysicsEngine], quick: bool) -> None:
    """Order of convergence, and errors relative to the peer's."""
    peers = [engine for engine in everyone if not engine.name.startswith("dojo-opt")]
    rows: list[list[Cell]] = []
    scenes = [pendulum()] if quick else [pendulum(), arm(0.5), arm(5.0), legs()]
    for scene in scenes:
        exact, errors = scene.exact(), {}
        for engine in [ours(2, 1), *peers]:
            errors[engine.name] = np.array([_error(scene, engine, h, exact) for h in _STEPS])
            rows.append([scene.name, engine.name, *errors[engine.name]])
        mine = errors["dojo-opt"]
        order = float(np.log2(mine[-2] / mine[-1]))
        name = f"dampers, {scene.name}"
        report.rows.append(Row(f"{name}: order at the smallest steps", order, "", 1.8, at_least=True))
        if _PEER in errors:
            worst = float(np.max(mine / errors[_PEER]))
            report.rows.append(Row(f"{name}: error over that of {_PEER}, largest", worst, "", 1.0))
    header = ["motion", "engine", *(f"{1e3 * h:g} ms" for h in _STEPS)]
    report.tables.append(Table("Position error with dampers at equal steps [m]", header, rows))


def _error(scene: SmoothScene, engine: PhysicsEngine, h: float, exact: Run) -> float:
    """Largest distance of a body from the reference [m]; infinite where the run ended early or the engine refused."""
    start = {"q": scene.q, "v": scene.v}
    try:
        run = engine.simulate(scene.mechanism, time_step=h, duration=scene.duration, samples=SAMPLES, **start)
    except ValueError:
        return np.inf
    return float(scene.errors(run, exact)["position"])
