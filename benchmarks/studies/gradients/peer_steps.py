"""(A, B) of one step by MuJoCo's differences and Drake's automatic differentiation; and the scenes of the study."""

from __future__ import annotations

from functools import partial
from importlib.util import find_spec

import numpy as np

import dojo_opt as dojo
from benchmarks.engines import mujoco_scene
from benchmarks.studies.gradients import drake_step
from dojo_opt.report.gradients.differences import extrapolated, relative_error
from dojo_opt.report.gradients.one_step import (
    CLOCKED_EPS,
    EPS,
    KNOTS,
    Cases,
    JacobianPoint,
    Peer,
    StepScene,
    Vector,
)
from sim.simulator.simulator import Simulator

INTEGRATOR = "discrete"  # MuJoCo's only integrator that holds the scenes
_CALLS = 10  # Jacobians of Drake's per clocked call
AUTODIFF = "AutoDiffXd, by the state alone"
MUJOCO_FORWARD, MUJOCO_CENTERED = "mjd_transitionFD, one-sided", "mjd_transitionFD, centred"


def installed_steps() -> list[Peer]:
    """The installed engines with measurable Jacobians."""
    peers: list[Peer] = [("MuJoCo", _mujoco)] if find_spec("mujoco") is not None else []
    if find_spec("pydrake") is not None:
        peers += [(f"Drake {name.lower()}", partial(_drake, name)) for name in drake_step.APPROXIMATIONS]
    return peers


def scenes() -> list[StepScene]:
    """A sliding block, a standing hopper, and a landing quadruped with two sliding feet."""
    block = Simulator(dojo.models.block(friction=0.3), time_step=0.01)
    hop = dojo.problems.hop()
    robot = Simulator(dojo.models.quadruped(spring=80.0, damper=4.0), time_step=0.02)
    drop = robot.rollout(robot.neutral(), np.zeros((200, robot.nu)), throw=True).x[-1].copy()
    drop[2] += 0.1
    drop[robot.nq] = 1.0
    slide = block.state_from_velocity(
        block.neutral()[:7], [3.0 * np.cos(np.pi / 6), 3.0 * np.sin(np.pi / 6), 0, 0, 0, 0]
    )
    return [
        StepScene("block, sliding", block, slide, np.zeros(3), 10),
        StepScene("hopper, standing", hop.sim.replace(time_step=0.01), hop.start, hop.controls0[0], 50),
        StepScene("quadruped, landing", robot, drop, np.zeros(robot.nu), 8),
    ]


def _mujoco(scene: StepScene) -> tuple[list[JacobianPoint], Cases]:
    """MuJoCo's own differences, against their own extrapolation with a solver that converges to round-off."""
    import mujoco

    model = mujoco_scene.load(scene.sim.model, scene.sim.time_step, integrator=INTEGRATOR)
    data = mujoco_scene.state(model, scene.start)
    data.ctrl[:] = scene.u
    mujoco.mj_step(model, data, scene.steps)
    n, m = 2 * model.nv, model.nu
    A, B = np.zeros((n, n)), np.zeros((n, m))

    def jacobian(eps: float, centered: bool) -> Vector:
        mujoco.mjd_transitionFD(model, data, eps, centered, A, B if m else None, None, None)
        return np.concatenate([A, B], axis=1)

    default = model.opt.tolerance, model.opt.iterations
    model.opt.tolerance, model.opt.iterations = 0.0, 500
    reference = extrapolated(lambda eps: jacobian(eps, True))
    model.opt.tolerance, model.opt.iterations = default
    points: list[JacobianPoint] = []
    cases: Cases = {}
    for name, centered in ((MUJOCO_FORWARD, False), (MUJOCO_CENTERED, True)):
        for eps in EPS:
            error = relative_error(jacobian(eps, centered), reference.value)
            points.append(JacobianPoint(name, None, eps, error, reference.doubt, np.nan))

        def clocked(centered: bool = centered) -> None:
            for _ in range(KNOTS):
                jacobian(CLOCKED_EPS, centered)

        cases[f"{name} None"] = clocked, KNOTS
    return points, cases


def _drake(approximation: str, scene: StepScene) -> tuple[list[JacobianPoint], Cases]:
    """Drake's automatic differentiation, against the extrapolated differences of its update.

    RuntimeError: a step of Drake's does not converge.
    """
    step = drake_step.DrakeStep(scene.sim.model, scene.sim.time_step, approximation)
    step.settle(scene.start, scene.u, scene.steps)
    jacobian, reference = step.autodiff(), step.reference()
    name = f"Drake {approximation.lower()}, {AUTODIFF}"
    point = JacobianPoint(name, None, None, relative_error(jacobian(), reference.value), reference.doubt, np.nan)

    def clocked() -> None:
        for _ in range(_CALLS):
            jacobian()

    return [point], {f"{name} None": (clocked, _CALLS)}
