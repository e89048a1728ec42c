"""Gradient of a touch-down: d(velocity after the step)/d(height before it), for several kappa and for MuJoCo.

A ball of 1 kg falls at 1 m/s towards the ground; one step of 20 ms. Where the step does not reach the ground the
gradient of a hard contact is 0. Where it does, v+ = -height / h: the step ends exactly on the ground, and the gradient
is -1/h. At the height z* between the two, the central path

    m (v+ - v_free) s = kappa,   s = z + h v+         gives   dv+/dz = -1/2h  for every kappa,

and it blends the two answers over a length sqrt(kappa h / m).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import dojo_opt as dojo
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator
from solvers.types import Vector

H, SPEED, RADIUS, GRAVITY = 0.02, 1.0, 0.1, 9.81
TOUCH = H * (SPEED + GRAVITY * H)  # [m] height from which the step just reaches the ground
KAPPAS = (1e-2, 1e-3, 1e-4, 1e-6)
_TOLERANCE = 1e-11

_BALL = """<mujoco><option timestep="{h}" cone="elliptic"/><worldbody>
<geom type="plane" size="5 5 .1" solref="{solref}" solimp="{solimp}"/>
<body pos="0 0 {radius}"><freejoint/>
<geom type="sphere" size="{radius}" mass="1" solref="{solref}" solimp="{solimp}"/></body></worldbody></mujoco>"""
# its manual: with solimp[0] = 0 contact switches on smoothly
MUJOCO = {
    "MuJoCo, default": ("0.02 1", "0.9 0.95 0.001 0.5 2"),
    "MuJoCo, solimp[0] = 0": ("0.02 1", "0 0.95 0.001 0.5 2"),
    "MuJoCo, solimp[0] = 0 over 10 mm": (f"{2 * H} 1", "0 0.95 0.01 0.5 2"),
}


class Curve(NamedTuple):
    """One way through the touch-down."""

    label: str
    kappa: float | None  # None: not ours
    velocity: Vector  # after the step [m/s]
    gradient: Vector  # d velocity / d height [1/s]


def ball() -> Mechanism:
    """A ball of 1 kg and the ground."""
    body = dojo.Body("ball", 1.0, inertia=np.full(3, 0.4 * RADIUS**2))
    contact = dojo.Contact("ball", radius=RADIUS)
    return dojo.Mechanism([body], [dojo.Joint("floating", None, "ball")], [contact])


def ours(heights: Vector, kappa: float) -> Curve:
    """By the implicit function theorem; heights: of the lowest point."""
    sim = Simulator(ball(), time_step=H, kappa=kappa, tolerance=_TOLERANCE)
    xs = np.tile(np.r_[0.0, 0.0, RADIUS, 1.0, np.zeros(5), -SPEED, np.zeros(3)], (len(heights), 1))
    xs[:, 2] += heights
    linear = sim.linearize_trajectory(xs, np.zeros((len(xs), sim.nu)), kappa=kappa)
    if np.any(linear.status):
        raise RuntimeError(f"report gradients: touch-down at kappa {kappa:g} is not solved")
    return Curve(f"dojo-opt, kappa {kappa:g}", kappa, linear.x_next[:, 9], linear.A[:, 8, 2])


def mujoco_ball(heights: Vector, label: str) -> Curve:
    """The same by mj_step and mjd_transitionFD (centred, eps 1e-6)."""
    import mujoco

    solref, solimp = MUJOCO[label]
    model = mujoco.MjModel.from_xml_string(_BALL.format(h=H, radius=RADIUS, solref=solref, solimp=solimp))
    data, A = mujoco.MjData(model), np.zeros((12, 12))
    velocity, gradient = np.empty_like(heights), np.empty_like(heights)
    for i, height in enumerate(heights):
        mujoco.mj_resetData(model, data)
        data.qpos[2], data.qvel[2] = RADIUS + height, -SPEED
        mujoco.mjd_transitionFD(model, data, 1e-6, 1, A, None, None, None)
        mujoco.mj_step(model, data)
        velocity[i], gradient[i] = data.qvel[2], A[8, 2]
    return Curve(label, None, velocity, gradient)
