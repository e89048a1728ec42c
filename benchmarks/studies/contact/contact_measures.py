"""Measures of the contact study: numbers of one engine on one scene; NaN where the engine stopped early."""

from __future__ import annotations

from math import cos, nan, sin

import numpy as np

from benchmarks.engines import PhysicsEngine, Run
from benchmarks.studies.contact import contact_scenes as scenes
from benchmarks.studies.contact.contact_scenes import Scene
from dojo_opt.report.run_measures import complete, gaps, penetration
from solvers.types import Floats

Numbers = dict[str, float]

DIRECTIONS = np.deg2rad([0.0, 11.3, 30.0, 45.0, 90.0, 135.0, 200.0, 300.0])


def sliding(engine: PhysicsEngine, time_step: float, directions: Floats = DIRECTIONS) -> Numbers:
    """Worst over the directions, relative to the distance v^2/(2 mu g):

    stop      error of the stopping distance         spread   longest minus shortest
    lateral   distance off the line                  lift     highest lowest corner [m]
    """
    stops, laterals, lifts, seconds = [], [], [], []
    rest = scenes.standing().run(engine, time_step)
    stands = np.r_[rest.position[-1, 0], rest.quaternion[-1, 0]]
    for angle in directions:
        scene = scenes.sliding(float(angle), stands)
        run = scene.run(engine, time_step)
        if not complete(run):
            return dict.fromkeys(("stop", "spread", "lateral", "lift", "us_per_step"), nan)
        x, y, _ = run.position[-1, 0] - run.position[0, 0]
        stops.append((cos(angle) * x + sin(angle) * y) / scenes.STOP)
        laterals.append(abs(cos(angle) * y - sin(angle) * x) / scenes.STOP)
        lifts.append(gaps(scene.mechanism, run).min(axis=1).max())
        seconds.append(1e6 * run.seconds / run.steps)
    worst = max(stops, key=lambda stop: abs(stop - 1.0)) - 1.0
    numbers = {"stop": worst, "spread": max(stops) - min(stops), "lateral": max(laterals), "lift": max(lifts)}
    return {**numbers, "us_per_step": float(np.median(seconds))}


def creep(engine: PhysicsEngine, time_step: float, duration: float = 10.0) -> Numbers:
    """drift [m] of the block on the slope, and the speed of its creep after the first tenth of the time [m/s]."""
    run = scenes.on_slope(duration).run(engine, time_step)
    if not complete(run):
        return {"drift": nan, "speed": nan}
    along = run.position[:, 0, 0]
    tenth = len(along) // 10
    return {"drift": abs(along[-1] - along[0]), "speed": (along[-1] - along[tenth]) / (run.time[-1] - run.time[tenth])}


def _fall(scene: Scene, run: Run) -> Numbers:
    if not complete(run):
        return {"depth": nan, "rest": nan, "rebound": nan}
    rest = float(-gaps(scene.mechanism, run)[-1].min())
    return {"depth": penetration(scene.mechanism, run), "rest": rest, "rebound": float(run.velocity[:, 0, 2].max())}


def ball_drop(engine: PhysicsEngine, time_step: float) -> Numbers:
    """Deepest and last penetration [m] of the ball dropped from 1 m, and its fastest way up [m/s]."""
    scene = scenes.ball_drop()
    return _fall(scene, scene.run(engine, time_step))


def box_drop(engine: PhysicsEngine, time_step: float) -> Numbers:
    """The same of the box on a corner; it may rise where the corners push it over."""
    scene = scenes.box_drop()
    return _fall(scene, scene.run(engine, time_step))


def ball_impact(engine: PhysicsEngine, time_step: float) -> Numbers:
    """The same of the ball at 100 m/s."""
    scene = scenes.ball_impact(time_step)
    return _fall(scene, scene.run(engine, time_step))


def box_impact(engine: PhysicsEngine, time_step: float) -> Numbers:
    """The same of the box at 100 m/s, while it tumbles."""
    scene = scenes.box_impact(time_step)
    return _fall(scene, scene.run(engine, time_step))


def pushed(engine: PhysicsEngine, time_step: float) -> float:
    """Error of the displacement of the cube under the ramp of force [m]; the answer is analytic."""
    run = scenes.ramp(time_step).run(engine, time_step)
    return float(run.position[-1, 0, 0] - scenes.ramp_displacement()) if complete(run) else nan


def torso(engine: PhysicsEngine, time_step: float) -> Floats:
    """Height of the trunk of the dropped quadruped, (21,) [m]."""
    run = scenes.robot_drop().run(engine, time_step)
    return run.position[:, 0, 2] if complete(run) else np.full(21, nan)


def inconsistency(engine: PhysicsEngine, time_steps: list[float], reference: float) -> list[float]:
    """Mean distance of the tossed cube from the same engine at the time step `reference` [m], per time step."""
    scene = scenes.toss()
    exact = scene.run(engine, reference)
    out = []
    for time_step in time_steps:
        run = scene.run(engine, time_step)
        same = complete(run) and complete(exact)
        out.append(float(np.linalg.norm(run.position - exact.position, axis=2).mean()) if same else nan)
    return out
