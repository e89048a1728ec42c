"""Curves: errors of every engine over its time steps, with their processor times, and their comparison."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from dojo_opt.report.accuracy.smooth_scene import SAMPLES, SmoothScene
from dojo_opt.report.dojo_engine import Ours
from dojo_opt.report.engine import PhysicsEngine, Run, observe
from sim.simulator.simulator import Simulator
from solvers.types import Floats

STEPS = (0.1, 0.05, 0.025, 0.02, 0.01, 0.005, 0.0025, 0.002, 0.001, 5e-4, 2.5e-4, 2e-4, 1e-4)  # [s] whole parts of .1
BETWEEN = (0.2, 0.1 / 3)  # [s] for ours of higher order besides: points at the times of a peer's largest steps
FLOOR = 1e-12  # errors below are rounding, of us and of the reference: neither better nor worse; see `floors`
LOST = 1.0  # of the energy, relative to all there is: such a run is lost, reported or not


class CurvePoint(NamedTuple):
    """One run of one engine."""

    time_step: float  # [s]
    seconds: float  # processor time
    steps: int
    errors: dict[str, float]
    message: str


Curves = dict[str, list[CurvePoint]]  # by the name of the engine


def engines(rounds: int, peers: Sequence[PhysicsEngine] = ()) -> list[PhysicsEngine]:
    """All orders of ours, solved to rounding, and the peers."""
    return [*(ours(order, rounds) for order in (2, 4, 6, 8)), *peers]


def ours(order: int, rounds: int) -> Ours:
    """Solved to rounding: order 2 keeps momentum as each of its steps is solved; the others have nothing to solve."""
    return Ours(order=order, tolerance=1e-14, rounds=rounds)


def measure(scene: SmoothScene, engines: Sequence[PhysicsEngine], steps: Sequence[float], limit: float) -> Curves:
    """Errors of the engines from the largest time step down to the first that would take longer than `limit` [s].

    Engines take turns at every step, so that a busy minute of the machine hits all of them alike. Ours of order 2,
    whose momentum has a bar at every step, runs with all of them where momentum is conserved.
    """
    exact = scene.exact()
    curves: Curves = {engine.name: [] for engine in engines}
    between = [h for h in BETWEEN if abs(scene.duration / (SAMPLES * h) % 1.0 - 0.5) > 0.5 - 1e-9]
    for h in sorted({*between, *steps}, reverse=True):
        for engine in engines:
            points, order = curves[engine.name], engine.order if isinstance(engine, Ours) else 0
            if h not in steps and order <= 2:
                continue
            every = order == 2 and scene.floating
            if every or not points or points[-1].seconds * points[-1].time_step / h <= limit:
                points.append(point(scene, engine, h, exact))
    return curves


def point(scene: SmoothScene, engine: PhysicsEngine, h: float, exact: Run) -> CurvePoint:
    """One run against the reference; one that the engine refuses has infinite errors, and the reason."""
    args: dict[str, Any] = {"time_step": h, "q": scene.q, "v": scene.v, "duration": scene.duration}
    try:
        run = engine.simulate(scene.mechanism, **args, samples=SAMPLES)
    except ValueError as error:
        return CurvePoint(h, 0.0, 0, scene.errors(exact._replace(time=exact.time[:0]), exact), str(error))
    errors, message = scene.errors(run, exact), run.message
    if not errors["energy"] < LOST:
        errors, message = dict.fromkeys(errors, np.inf), message or f"energy off by {errors['energy']:.2g} of all"
    return CurvePoint(h, run.seconds, run.steps, errors, message)


def floors(scene: SmoothScene) -> dict[str, float]:
    """Errors that count as equal: FLOOR, or the effect of one rounding of the start, if that is larger."""
    moved = replace(scene, q=np.nextafter(scene.q, np.inf), v=np.nextafter(scene.v, np.inf))
    return {quantity: max(FLOOR, error) for quantity, error in scene.errors(moved.exact(), scene.exact()).items()}


def at_time(points: Sequence[CurvePoint], quantity: str, seconds: float, floor: float = FLOOR) -> float:
    """Smallest error reached within a processor time, interpolated between time steps on logarithmic axes."""
    good = [p for p in points if np.isfinite(p.errors[quantity]) and p.seconds > 0.0]
    good.sort(key=lambda p: p.seconds)
    if not good or seconds < good[0].seconds:
        return np.inf
    times = np.log([p.seconds for p in good])
    errors = np.minimum.accumulate(np.log([max(p.errors[quantity] / floor, 1.0) for p in good]))
    return float(floor * np.exp(np.interp(np.log(seconds), times, errors)))


def ratios(curves: Curves, peer: str, quantity: str, floor: float = FLOOR) -> dict[float, float]:
    """Our error over the peer's at equal processor time, by time step of the peer [s].

    Ours is the best of our orders, whose time steps may differ from the peer's; infinite where all of them take longer.
    Steps with which the peer is lost are omitted. Errors below `floor` count as that.
    """
    mine = [points for name, points in curves.items() if name.startswith("dojo-opt")]
    return {
        p.time_step: min(at_time(points, quantity, p.seconds, floor) for points in mine)
        / max(p.errors[quantity], floor)
        for p in curves[peer]
        if np.isfinite(p.errors[quantity])
    }


def worst(over: dict[float, float], at_least: float) -> tuple[float, str]:
    """(largest ratio for steps of the peer from `at_least` upward, for which of its steps ours is better)."""
    judged = {h: ratio for h, ratio in over.items() if h >= at_least}
    better = [f"{1e3 * h:g}" for h, ratio in sorted(judged.items()) if ratio <= 1.0]
    note = f"ours is better at steps of RK4 of {', '.join(better)} ms" if better else "at no step of RK4"
    return max(judged.values(), default=0.0), note if len(better) < len(judged) else "at every step of RK4"


class Cut(NamedTuple):
    """A motion cut into pieces that each start again on the reference.

    After Erez, Tassa, Todorov (ICRA 2015), so that errors are not amplified by chaos; but against the ODE instead of
    the engine's own limit.
    """

    scene: SmoothScene
    piece: float  # [s]
    q: Floats  # (count + 1, nq)
    v: Floats  # (count + 1, nv)
    position: Floats  # (count + 1, nbody, 3) [m]

    def error(self, engine: PhysicsEngine, h: float) -> float:
        """Largest distance of a body from the reference at the end of a piece, mean over the pieces [m]."""
        errors = []
        for k in range(len(self.q) - 1):
            args: dict[str, Any] = {"time_step": h, "q": self.q[k], "v": self.v[k], "duration": self.piece}
            run = engine.simulate(self.scene.mechanism, **args, samples=1)
            lost = len(run.time) < 2
            errors.append(np.inf if lost else np.linalg.norm(run.position[-1] - self.position[k + 1], axis=-1).max())
        return float(np.mean(errors))


def cut(scene: SmoothScene, count: int, piece: float) -> Cut:
    """The reference of the scene in `count` pieces."""
    times = np.linspace(0.0, count * piece, count + 1)
    q, v = scene.reference(scene.q, scene.v, times)
    exact = observe(Simulator(scene.mechanism, time_step=1.0), times, q, v, 0.0, 0)
    return Cut(scene, piece, q, v, exact.position)
