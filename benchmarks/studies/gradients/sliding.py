"""Derivatives of whole motions with friction, against analytic answers.

A block of 1 kg, half a metre wide, stands on the ground (friction .5) and is pulled by a force F for a second:

    x = 0 below the threshold mu m g,    x = (F - mu m g) t^2 / 2 m,  dx/dF = t^2 / 2 m  above it

and slides with v0 = 3 m/s along an axis, or at 30 degrees to it, until friction (.3) has stopped it:

    x = v0^2 / 2 mu g,    dx/dv0 = v0 / mu g

Ours are chained from (A, B) of every step, others are differences of the whole motion, ours and MuJoCo's are both;
Drake differentiates automatically in addition (drake_motion.py).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

import dojo_opt as dojo
from benchmarks.engines import PhysicsEngine, mujoco_scene
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator
from solvers.types import Vector

MASS, GRAVITY = 1.0, 9.81
STICK, SLIDE = 0.5, 0.3  # friction
SPEED = 3.0  # [m/s]
PULL, GLIDE = 1.0, 1.5  # [s]
CHAINED = "(A, B) chained"
CHAINED_EPS = 1e-6  # of mjd_transitionFD, centred
SETTLE = 1.0  # [s] in which a soft contact takes its load


class SlidingMotion(NamedTuple):
    """One derivative: of the way along `direction` by a force along it [N], or by the speed along it [m/s]."""

    name: str
    mechanism: Mechanism
    direction: Vector  # (3,)
    pulled: bool  # by a force, else it slides from a speed
    value: float  # of the force or the speed
    duration: float  # [s]
    exact: float
    scale: float  # errors are relative to it: the derivative once the block slides


class Derivative(NamedTuple):
    """An engine's derivative."""

    engine: str
    how: str
    kappa: float | None
    motion: str
    time_step: float
    way: float  # [m]
    value: float
    exact: float
    error: float  # relative to the scale of the motion
    seconds: float  # processor time


def motions() -> list[SlidingMotion]:
    """Pulled at .9, 1.1 and 1.5 times the threshold; sliding at 0 and 30 degrees."""
    threshold = STICK * MASS * GRAVITY
    stuck, slider = (dojo.models.block(mass=MASS, friction=mu) for mu in (STICK, SLIDE))
    x, oblique = np.array([1.0, 0.0, 0.0]), np.array([np.cos(np.pi / 6), np.sin(np.pi / 6), 0.0])
    gain = PULL**2 / (2.0 * MASS)
    pulls = [
        SlidingMotion(f"dx/dF at {f:g} of the threshold", stuck, x, True, f * threshold, PULL, gain * (f > 1.0), gain)
        for f in (0.9, 1.1, 1.5)
    ]
    slope = SPEED / (SLIDE * GRAVITY)
    slides = [
        SlidingMotion(f"d(stop)/dv0 at {angle} degrees", slider, along, False, SPEED, GLIDE, slope, slope)
        for angle, along in ((0, x), (30, oblique))
    ]
    return [*pulls, *slides]


def chained(motion: SlidingMotion, time_step: float, kappa: float) -> Derivative:
    """Ours:  S_0 = dx_0/dp,  S_t+1 = A_t S_t + B_t du/dp,  (A, B) at the states of one rollout."""
    sim = Simulator(motion.mechanism, time_step=time_step, kappa=kappa)
    x, us = _start(sim, motion, motion.value)

    def run() -> tuple[float, float]:
        xs = sim.rollout(x, us, throw=True).x
        linear = sim.linearize_trajectory(xs, us, kappa=kappa)
        if np.any(linear.status):
            raise RuntimeError(f"report gradients: {motion.name}: a step of {time_step:g} s cannot be differentiated")
        S = _start_slope(sim, motion)
        for A, B in zip(linear.A, linear.B, strict=True):
            S = A @ S + (B @ motion.direction if motion.pulled else 0.0)
        return float((xs[-1, :3] - xs[0, :3]) @ motion.direction), float(S[:3] @ motion.direction)

    return derivative("dojo-opt", CHAINED, kappa, motion, time_step, run)


def ours_differenced(motion: SlidingMotion, time_step: float, eps: float, kappa: float) -> Derivative:
    """Ours by differences, the reference for `chained`."""
    sim = Simulator(motion.mechanism, time_step=time_step, kappa=kappa)

    def way(p: float) -> float:
        xs = sim.rollout(*_start(sim, motion, p), throw=True).x
        return float((xs[-1, :3] - xs[0, :3]) @ motion.direction)

    return derivative("dojo-opt", f"differences of {eps:g}", kappa, motion, time_step, _central(way, motion, eps))


def differenced(engine: PhysicsEngine, motion: SlidingMotion, time_step: float, eps: float) -> Derivative:
    """Any other engine, from its own state of rest."""
    sim = Simulator(motion.mechanism, time_step=time_step)
    still = np.zeros(sim.nv), np.zeros(sim.nu)
    rest = _end(engine, motion, time_step, sim.neutral()[: sim.nq], *still, SETTLE)

    def way(p: float) -> float:
        v, u = np.zeros(sim.nv), np.zeros(sim.nu)
        (u if motion.pulled else v)[:3] = p * motion.direction
        end = _end(engine, motion, time_step, rest, v, u, motion.duration)
        return float((end - rest)[:3] @ motion.direction)

    return derivative(engine.name, f"differences of {eps:g}", None, motion, time_step, _central(way, motion, eps))


def mujoco_chained(motion: SlidingMotion, time_step: float, integrator: str) -> Derivative:
    """MuJoCo: the recursion of `chained` with (A, B) of mjd_transitionFD, centred."""
    import mujoco

    sim = Simulator(motion.mechanism, time_step=time_step)
    model = mujoco_scene.load(sim.model, time_step, integrator=integrator)
    data = mujoco_scene.state(model, sim.neutral())
    mujoco.mj_step(model, data, round(SETTLE / time_step))
    rest = data.qpos.copy()
    n = 2 * model.nv
    A, B = np.zeros((n, n)), np.zeros((n, model.nu))

    _, us = _start(sim, motion, motion.value)
    data.ctrl[:] = us[0]

    def run() -> tuple[float, float]:
        data.qpos[:], data.qvel[:], data.qacc_warmstart[:] = rest, 0.0, 0.0
        S = _start_slope(sim, motion)
        if not motion.pulled:
            data.qvel[:3] = motion.value * motion.direction
        for _ in us:
            mujoco.mjd_transitionFD(model, data, CHAINED_EPS, True, A, B, None, None)
            mujoco.mj_step(model, data)
            S = A @ S + (B @ motion.direction if motion.pulled else 0.0)
        return float((data.qpos - rest)[:3] @ motion.direction), float(S[:3] @ motion.direction)

    with np.errstate(over="ignore", invalid="ignore"):
        return derivative(f"MuJoCo {integrator}", "mjd_transitionFD chained", None, motion, time_step, run)


def _start(sim: Simulator, motion: SlidingMotion, p: float) -> tuple[Vector, Vector]:
    """The state, standing or sliding, and the inputs of all steps."""
    us = np.zeros((round(motion.duration / sim.time_step), sim.nu))
    if motion.pulled:
        us[:, :3] = p * motion.direction
        return sim.neutral(), us
    return sim.state_from_velocity(sim.neutral()[: sim.nq], [*(p * motion.direction), 0.0, 0.0, 0.0]), us


def _start_slope(sim: Simulator, motion: SlidingMotion) -> Vector:
    """dx_0/dp: of the velocity of a translation, its direction."""
    S = np.zeros(sim.ndx)
    if not motion.pulled:
        S[sim.nv : sim.nv + 3] = motion.direction
    return S


def _end(
    engine: PhysicsEngine, motion: SlidingMotion, h: float, q: Vector, v: Vector, u: Vector, duration: float
) -> Vector:
    """Pose at the end, that is, the coordinates of the block; NaN when the engine stopped early."""
    run = engine.simulate(motion.mechanism, time_step=h, q=q, v=v, duration=duration, samples=1, inputs=u)
    if run.message:
        return np.full(len(q), np.nan)
    return np.concatenate([run.position[-1, 0], run.quaternion[-1, 0]])


def _central(way: Callable[[float], float], motion: SlidingMotion, eps: float) -> Callable[[], tuple[float, float]]:
    """(way, its central difference)."""
    p = motion.value
    return lambda: (way(p), (way(p + eps) - way(p - eps)) / (2.0 * eps))


def derivative(
    engine: str, how: str, kappa: float | None, motion: SlidingMotion, h: float, run: Callable[[], tuple[float, float]]
) -> Derivative:
    """Result of `run`, which returns (way, derivative), with its processor time."""
    start = time.process_time()
    way, value = run()
    seconds = time.process_time() - start
    error = abs(value - motion.exact) / motion.scale
    return Derivative(engine, how, kappa, motion.name, h, way, value, motion.exact, error, seconds)
