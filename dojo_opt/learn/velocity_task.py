"""Robots with four legs that keep a commanded velocity: forwards, sideways, and turning."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.learn.randomization import Randomization
from dojo_opt.learn.task import Task
from dojo_opt.models.quadruped import quadruped as default_quadruped
from dojo_opt.planning.residual import jit
from sim.io.urdf.load import load_urdf
from sim.mechanism import checks
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.mechanism import Mechanism
from sim.model.state_columns import BaseState
from sim.simulator.simulator import Simulator
from solvers.types import Floats

__all__ = ["WALKING", "go2", "quadruped", "velocity_error"]

_TIME_STEP, _SUBSTEPS = 0.01, 2  # [s], per action
_KAPPA = 1e-4  # [N s m]
_HOLD = 100  # actions of 20 ms: a new command every 2 s
_PUSH = (0.3, 0.3, 0.1, 0.3, 0.3, 0.3)  # of a floating base [m/s, rad/s]
_TURN, _JOINTS = BaseState.QUATERNION.start, BaseState.JOINTS  # columns of a state, for kernels
_WIDTH = 0.1  # [m/s, rad/s] errors beyond count linearly
_GO2 = "example-robot-data"  # the package with its file
_GO2_FOOT = 0.022  # radius of Go2's feet [m], which its file has as meshes
_GO2_STANCE = {"hip": 0.0, "thigh": 0.8, "calf": -1.5}  # [rad]

# Models on which policies of quadrupeds learn: slippery and rough ground, heavier and lighter bodies, pushes.
WALKING = Randomization(
    values={"friction:*": (0.4, 1.0)},
    factors={"mass": (0.9, 1.2), "damper": (0.8, 1.2)},
    substeps=(2, 2, 3),
    kappa=(1e-4, 10.0**-2.5),
    noise=0.02,
    by_row=False,
    pushes=(2.0, _PUSH),
)


@jit
def in_body(q, x, y, z):  # type: ignore[no-untyped-def]
    """R(q)^T (x, y, z) of a unit quaternion (w, x, y, z), as three numbers: arrays would be allocated."""
    w, a, b, c = q[0], -q[1], -q[2], -q[3]
    tx, ty, tz = 2.0 * (b * z - c * y), 2.0 * (c * x - a * z), 2.0 * (a * y - b * x)
    return x + w * tx + b * tz - c * ty, y + w * ty + c * tx - a * tz, z + w * tz + a * ty - b * tx


@jit
def upright(x):  # type: ignore[no-untyped-def]
    """Cosine of the angle between the vertical axis of a floating base and the vertical."""
    q = x[_TURN:_JOINTS]
    return 1.0 - 2.0 * (q[1] ** 2 + q[2] ** 2)


@jit
def distance(error, width):  # type: ignore[no-untyped-def]
    """|error|, smooth within the width, and 0 at 0."""
    return np.sqrt(error * error + width * width) - width


def _observation(nq: int, home: tuple[float, ...]) -> Callable[..., Any]:
    """Direction of gravity and velocities as the trunk sees them, angles from the stance, their rates, the command."""
    joints = nq - BaseState.JOINTS

    def observation(x, out):  # type: ignore[no-untyped-def]
        q = x[_TURN:_JOINTS]
        out[0], out[1], out[2] = in_body(q, 0.0, 0.0, 1.0)
        out[3], out[4], out[5] = in_body(q, x[nq], x[nq + 1], x[nq + 2])
        for k in range(3):
            out[6 + k] = x[nq + 3 + k]
            out[9 + k] = x[2 * nq - 1 + k]
        for k in range(joints):
            out[12 + k] = x[_JOINTS + k] - home[k]
            out[12 + joints + k] = x[nq + 6 + k]

    return observation


def _reward(nq: int, height: float) -> Callable[..., Any]:
    """Minus smooth distances from the command, unwanted motion of the trunk, and effort."""
    width = _WIDTH

    def reward(x, a, after):  # type: ignore[no-untyped-def]
        q = after[_TURN:_JOINTS]
        vx, vy, vz = in_body(q, after[nq], after[nq + 1], after[nq + 2])
        command = after[2 * nq - 1 :]
        total = -distance(np.hypot(vx - command[0], vy - command[1]), width)
        total -= 0.5 * distance(after[nq + 5] - command[2], width)
        total -= 0.5 * vz**2 + 0.02 * (after[nq + 3] ** 2 + after[nq + 4] ** 2)
        ux, uy, _ = in_body(q, 0.0, 0.0, 1.0)
        total -= 2.0 * (ux**2 + uy**2) + 20.0 * (after[2] - height) ** 2
        for i in range(a.shape[0]):
            total -= 0.01 * a[i] ** 2
        for i in range(nq + 6, 2 * nq - 1):
            total -= 2e-4 * after[i] ** 2
        return total

    return reward


def _ends(height: float) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Where an episode ends: low, or tilted by more than about 60 degrees; and the probability that it does not."""
    low = 0.5 * height

    def terminated(x):  # type: ignore[no-untyped-def]
        return not (x[2] > low and upright(x) > 0.5)

    def survival_probability(x):  # type: ignore[no-untyped-def]
        return 1.0 / ((1.0 + np.exp((low - x[2]) / 0.02)) * (1.0 + np.exp((0.5 - upright(x)) / 0.06)))

    return terminated, survival_probability


def velocity_error(x: ArrayLike, command: ArrayLike) -> Floats:
    """Velocity of a floating base as it sees it, less the commanded one: forwards, to the left, and turning.

    Args:
        x: (..., nx) states of a robot with a floating base and hinges.
        command: (..., 3) [m/s, m/s, rad/s].

    Returns:
        (..., 3) errors [m/s, m/s, rad/s].
    """
    states = np.asarray(x, dtype=np.float64)
    nq = (states.shape[-1] + 1) // 2
    w, a = states[..., BaseState.SCALAR], -states[..., BaseState.VECTOR]
    v = states[..., nq : nq + 3]
    t = 2.0 * np.cross(a, v)
    own = v + w * t + np.cross(a, t)
    seen = np.concatenate([own[..., :2], states[..., nq + 5 : nq + 6]], axis=-1)
    out: Floats = seen - np.asarray(command, dtype=np.float64)
    return out


def quadruped(
    mechanism: Mechanism | None = None,
    *,
    fastest: ArrayLike = (1.0, 0.5, 1.0),
    stiffness: float = 40.0,
    damping: float = 1.0,
    reach: float = 0.5,
) -> Task:
    """Keep a velocity: 36 observations, 12 actions, 0.02 s each.

    Actions move the targets of position servos about the angles of the neutral state, whose torques stay within the
    limits of the robot's inputs. An episode ends where the robot falls; the command changes every two seconds.
    `policy.commanded((0.5, 0.0, 0.0))` is a controller.

    Args:
        mechanism: a robot with a floating base and hinges, as from `load_urdf`; its neutral state stands (default None:
            `dojo.models.quadruped()`).
        fastest: (3,) bounds of the command: forwards, to the left [m/s], and turning [rad/s].
        stiffness: of the servos [N m/rad].
        damping: of the servos [N m s/rad].
        reach: of the targets, to both sides of the neutral angles [rad].

    Returns:
        The task.

    Raises:
        ValueError: the robot has another base or other joints, inputs for some of them only or more than one for a
            joint, limits of effort on one side, or a number is out of range.
    """
    call = "quadruped"
    mech = default_quadruped() if mechanism is None else mechanism
    limits = np.array(checks.vector(f"{call}(fastest=...)", fastest, 3))
    base, *legs = mech.joints
    if base.nv != 6 or not legs or any(joint.nv != 1 for joint in legs):
        raise ValueError(f"{call}(mechanism): expected a floating base and hinges, got {mech!r}")
    efforts = _efforts(call, mech)
    servos = [
        Input(joint.name, servo="position", stiffness=stiffness, damping=damping, force_limits=effort)
        for joint, effort in zip(legs, efforts, strict=True)
    ]
    mech = replace(mech, inputs=servos)
    home, nq = np.array(mech.neutral, dtype=np.float64), mech.nq
    angles = home[_JOINTS:]
    terminated, survival_probability = _ends(float(home[2]))

    def start(rng: np.random.Generator) -> Floats:
        q = home.copy()
        q[2] += 0.01
        angle = rng.uniform(-np.pi, np.pi)
        q[BaseState.QUATERNION] = np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle)
        q[_JOINTS:] += rng.uniform(-0.05, 0.05, nq - _JOINTS)
        return np.concatenate([q, 0.1 * rng.standard_normal(mech.nv)])

    return Task(
        Simulator(mech, time_step=_TIME_STEP, kappa=_KAPPA), _SUBSTEPS, _observation(nq, tuple(angles)), 2 * nq - 2,
        _reward(nq, float(home[2])), angles - reach, angles + reach, start, terminated, survival=1.0, steps=500,
        name=mech.name, survival_probability=survival_probability, commands=3,
        command=lambda rng: rng.uniform(-limits, limits), hold=_HOLD,
        settings={
            "epochs": 1400, "environments": 32, "horizon": 24, "rate": 2e-3, "evaluations": 5, "episodes": 16,
            "randomization": WALKING,
        },
    )  # fmt: skip


def _efforts(call: str, mech: Mechanism) -> list[tuple[float, float]]:
    """Limits of the force of each hinge, those of the inputs of the robot: none where these have none."""
    names = [joint.name for joint in mech.joints[1:]]
    inputs = list(mech.inputs or ())
    given = [part.joint for part in inputs]
    if not given:
        return [(-np.inf, np.inf)] * len(names)
    if sorted(map(str, given)) != sorted(names):
        lacking = ", ".join(sorted(map(repr, set(names) - set(given)))) or "one input for each joint"
        raise ValueError(f"{call}(mechanism): expected an input for every hinge, and nothing else; check {lacking}")
    parts = {str(part.joint): part for part in inputs}
    found = [parts[name].force_limits if parts[name].servo else parts[name].limits for name in names]
    out = [(float(low), float(high)) for low, high in found]
    for name, limits in zip(names, out, strict=True):
        if np.isfinite(limits[0]) != np.isfinite(limits[1]):
            raise ValueError(f"{call}(mechanism): {name!r}: expected limits on both sides or on none, got {limits}")
    return out


def go2(urdf: str | Path | None = None, **options: Any) -> Task:
    """Keep a velocity with Unitree's Go2: `quadruped` with its URDF file, whose feet are balls here.

    Args:
        urdf: path of the file (default None: that of the package example-robot-data,
            `pip install "dojo-opt[robots]"`).
        **options: arguments of `quadruped`: fastest, stiffness, damping, reach.

    Returns:
        The task.

    Raises:
        ImportError: without a path and the package.
        OSError: the file does not exist.
    """
    legs = ("FL", "FR", "RL", "RR")
    feet = [Contact(f"{leg}_foot", radius=_GO2_FOOT, name=f"{leg}_foot") for leg in legs]
    neutral = {f"{leg}_{part}_joint": angle for leg in legs for part, angle in _GO2_STANCE.items()}
    mech = load_urdf(_go2_file() if urdf is None else urdf, contacts=feet, neutral=neutral)
    return quadruped(mech, **options)


def _go2_file() -> Path:
    """Go2's URDF file in the package example-robot-data."""
    try:
        files = distribution(_GO2).files or []
        return Path(str(next(file for file in files if file.name == "go2.urdf").locate()))
    except (PackageNotFoundError, StopIteration):
        raise ImportError('go2 reads a URDF file: pip install "dojo-opt[robots]", or go2(urdf=...)') from None
