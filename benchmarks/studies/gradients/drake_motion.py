"""Drake: derivatives of whole motions by its automatic differentiation (AutoDiffXd), carried from step to step."""

from __future__ import annotations

import numpy as np

from benchmarks.studies.gradients.drake_step import DrakeStep
from benchmarks.studies.gradients.sliding import SETTLE, Derivative, SlidingMotion, derivative
from benchmarks.studies.gradients.touchdown import RADIUS, SPEED, Curve, H, Vector, ball
from sim.simulator.simulator import Simulator

CARRIED = "AutoDiffXd, carried"


def carried(motion: SlidingMotion, time_step: float, approximation: str) -> Derivative:
    """The motion of one AutoDiffXd, the force or the speed, from Drake's own state of rest; NaN where a step fails."""
    from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff

    sim = Simulator(motion.mechanism, time_step=time_step)
    step = DrakeStep(sim.model, time_step, approximation)
    step.settle(sim.neutral(), np.zeros(sim.nu), round(SETTLE / time_step))
    position, velocity = step.place(0)
    along = np.zeros(len(step.x))
    along[velocity] = motion.direction
    force = along[-sim.nv :] if motion.pulled else np.zeros(sim.nv)
    slope = 0.0 * along if motion.pulled else along

    def run() -> tuple[float, float]:
        update = step.differentiable(InitializeAutoDiff(motion.value * force, force[:, None]).ravel())
        x = InitializeAutoDiff(step.x + motion.value * slope, slope[:, None]).ravel()
        try:
            for _ in range(round(motion.duration / time_step)):
                x = update(x)
        except RuntimeError:  # its solver did not converge
            return np.nan, np.nan
        way = ExtractValue(x).ravel()[position] - step.x[position]
        return float(way @ motion.direction), float(ExtractGradient(x)[position, 0] @ motion.direction)

    return derivative(f"Drake {approximation.lower()}", CARRIED, None, motion, time_step, run)


def touchdown(heights: Vector, approximation: str) -> Curve:
    """The falling ball of touchdown.py: one step, differentiated by the height."""
    from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff

    step = DrakeStep(Simulator(ball(), time_step=H).model, H, approximation)
    step.settle(np.r_[0.0, 0.0, RADIUS, 1.0, np.zeros(5), -SPEED, np.zeros(3)], np.zeros(0), 0)
    position, velocity = step.place(0)
    seed = np.zeros((len(step.x), 1))
    seed[position.stop - 1] = 1.0
    update = step.differentiable(InitializeAutoDiff(np.zeros(6), np.zeros((6, 1))).ravel())
    speeds, gradient = np.full(len(heights), np.nan), np.full(len(heights), np.nan)
    for i, height in enumerate(heights):
        x = update(InitializeAutoDiff(step.x + height * seed[:, 0], seed).ravel())
        speeds[i], gradient[i] = ExtractValue(x).ravel()[velocity][2], ExtractGradient(x)[velocity, 0][2]
    return Curve(f"Drake {approximation.lower()}", None, speeds, gradient)
