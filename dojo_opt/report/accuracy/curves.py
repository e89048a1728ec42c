"""Curves: errors of every engine over its time steps, with the processor time they took, and what they say."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from dojo_opt.report.accuracy.scenes import SAMPLES, Scene
from dojo_opt.report.engines import Engine, Ours, Run, installed
from dojo_opt.report.engines.run import observe
from sim.simulator import Simulator

STEPS = (0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001, 5e-4, 2e-4, 1e-4)
FLOOR = 1e-12  # errors below are rounding, of us and of the reference: neither better nor worse


class Point(NamedTuple):
    """One run of one engine."""

    time_step: float  # [s]
    seconds: float  # processor time
    steps: int
    errors: dict[str, float]
    message: str


Curves = dict[str, list[Point]]  # by the name of the engine


def engines(rounds: int) -> list[Engine]:
    """All orders of ours, solved to rounding, and the peers that are installed."""
    return [*(ours(order, rounds) for order in (2, 4, 6, 8)), *installed()]


def ours(order: int, rounds: int) -> Ours:
    """Solved to rounding: order 2 keeps momentum as its equations are solved; the others hand on what is left over."""
    return Ours(order=order, tolerance=1e-14 if order == 2 else 1e-12, rounds=rounds)


def measure(scene: Scene, engines: Sequence[Engine], steps: Sequence[float], limit: float) -> Curves:
    """Errors of the engines from the largest time step down to the first that would take longer than `limit` [s]."""
    exact = scene.exact()
    curves: Curves = {}
    for engine in engines:
        points: list[Point] = []
        for h in steps:
            if points and points[-1].seconds * points[-1].time_step / h > limit:
                break
            points.append(point(scene, engine, h, exact))
        curves[engine.name] = points
    return curves


def point(scene: Scene, engine: Engine, h: float, exact: Run) -> Point:
    """One run against the reference."""
    args: dict[str, Any] = {"time_step": h, "q": scene.q, "v": scene.v, "duration": scene.duration}
    run = engine.simulate(scene.mechanism, **args, samples=SAMPLES)
    return Point(h, run.seconds, run.steps, scene.errors(run, exact), run.message)


def at_time(points: Sequence[Point], what: str, seconds: float) -> float:
    """Smallest error reached within a processor time, interpolated between time steps on logarithmic axes."""
    good = [p for p in points if np.isfinite(p.errors[what]) and p.seconds > 0.0]
    good.sort(key=lambda p: p.seconds)
    if not good or seconds < good[0].seconds:
        return np.inf
    times = np.log([p.seconds for p in good])
    errors = np.minimum.accumulate(np.log([max(p.errors[what], FLOOR) for p in good]))
    return float(np.exp(np.interp(np.log(seconds), times, errors)))


def ours_over(curves: Curves, peer: str, what: str, at_least: float) -> tuple[float, str]:
    """(largest ratio of our error to the peer's at equal processor time, over the peer's steps >= at_least; where).

    Ours is the best of our orders, whose time steps may differ from the peer's. A step with which the peer is lost
    does not count.
    """
    worst, where = 0.0, "no step of the peer succeeded"
    for p in curves[peer]:
        if p.time_step < at_least or not np.isfinite(p.errors[what]):
            continue
        best = min(at_time(points, what, p.seconds) for name, points in curves.items() if name.startswith("dojo-opt"))
        ratio = best / max(p.errors[what], FLOOR)
        if ratio > worst:
            worst, where = ratio, f"worst at {peer} with {1e3 * p.time_step:g} ms"
    return worst, where


def pieces(scene: Scene, engine: Engine, h: float, count: int, piece: float) -> float:
    """Mean position error [m] after short pieces, each started again from the reference.

    After Erez, Tassa, Todorov (ICRA 2015), so that errors are not amplified by chaos; but against the ODE instead of
    the engine's own limit.
    """
    times = np.linspace(0.0, count * piece, count + 1)
    q, v = scene.reference(scene.q, scene.v, times)
    exact = observe(Simulator(scene.mechanism, time_step=1.0), times, q, v, 0.0, 0)
    errors = []
    for k in range(count):
        run = engine.simulate(scene.mechanism, time_step=h, q=q[k], v=v[k], duration=piece, samples=1)
        lost = len(run.time) < 2
        errors.append(np.inf if lost else np.linalg.norm(run.position[-1] - exact.position[k + 1], axis=-1).max())
    return float(np.mean(errors))
