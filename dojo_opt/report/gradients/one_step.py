"""(A, B) of one step: how far each way to get it is from the derivative of the same step, and what it costs.

Every engine is judged by its own step, at the state that its own motion has led to: what is measured here is how
exactly a derivative is computed, not how exact the contact is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import dojo_opt as dojo
from dojo_opt.report import mujoco_scene
from dojo_opt.report.clock import interleave
from dojo_opt.report.gradients import drake_step
from dojo_opt.report.gradients.differences import Stepper, extrapolated, relative_error
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator

Vector = NDArray[np.float64]

KAPPAS = (1e-2, 1e-3, 1e-4, 1e-6, 1e-8)
EPS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
DIFFERENCED = 1e-6  # the kappa at which our step is differenced: that of our simulations
MUJOCO_EPS = 1e-6  # what MuJoCo's documentation uses
TIGHT = (
    1e-13  # tolerance of steps that are differenced: at 1e-8 neighbours stop at other iterations, and differ by that
)
_KNOTS, _BATCHES, _CALLS = 50, 5, 10  # Jacobians per clocked call: ours and MuJoCo's, by differences of ours, Drake's

IMPLICIT, TIGHTLY = "implicit", "implicit, solved to 1e-13"
FORWARD, CENTRED = "differences, one-sided", "differences, centred"
AUTODIFF = "AutoDiffXd, by the state alone"
MUJOCO_FORWARD, MUJOCO_CENTRED = "mjd_transitionFD, one-sided", "mjd_transitionFD, centred"


Cases = dict[str, tuple[Callable[[], Any], int]]  # what is clocked, and how many Jacobians it computes


class Scene(NamedTuple):
    """A state to differentiate at: where `steps` steps from `start` lead."""

    name: str
    sim: Simulator
    start: Vector
    u: Vector
    steps: int
    integrator: str  # of MuJoCo: the one that holds the scene


class Point(NamedTuple):
    """One way to get a Jacobian."""

    method: str
    kappa: float | None  # None: not ours
    eps: float | None  # None: not by differences
    error: float  # relative
    doubt: float  # of the reference
    microseconds: float  # a step and its Jacobian, or all steps that are differenced


def scenes() -> list[Scene]:
    """A sliding block, a standing hopper, a landing quadruped two of whose feet slide."""
    block = Simulator(dojo.models.block(friction=0.3), time_step=0.01)
    hop = dojo.problems.hop()
    robot = Simulator(dojo.models.quadruped(spring=80.0, damper=4.0), time_step=0.02)
    drop = robot.rollout(robot.neutral(), np.zeros((200, robot.nu)), throw=True).x[-1].copy()
    drop[2] += 0.1
    drop[robot.nq] = 1.0
    slide = block.start(block.neutral()[:7], [3.0 * np.cos(np.pi / 6), 3.0 * np.sin(np.pi / 6), 0, 0, 0, 0])
    return [
        Scene("block, sliding", block, slide, np.zeros(3), 10, "discrete"),
        Scene("hopper, standing", hop.sim.replace(time_step=0.01), hop.start, hop.controls0[0], 50, "discrete"),
        Scene("quadruped, landing", robot, drop, np.zeros(robot.nu), 8, "discrete"),
    ]


def scene_of(mechanism: Mechanism) -> Scene:
    """A mechanism half a second after it is let go in its neutral state."""
    sim = Simulator(mechanism, time_step=0.01)
    return Scene(mechanism.name, sim, sim.neutral(), np.zeros(sim.nu), 50, "discrete")


def measure(scene: Scene, rounds: int) -> tuple[list[Point], list[str]]:
    """All ways, and notes. Others' where they are installed and can represent the mechanism.

    SimulationError: the scene cannot be stepped.
    """
    points, cases = _ours(scene)
    notes = []
    peers: list[tuple[str, str, Callable[[Scene], tuple[list[Point], Cases]]]] = [("MuJoCo", "mujoco", _mujoco)]
    peers += [(f"Drake {name.lower()}", "pydrake", partial(_drake, name)) for name in drake_step.APPROXIMATIONS]
    for name, package, peer in peers:
        if find_spec(package) is None:
            continue
        try:
            found, clocked = peer(scene)
        except (ValueError, RuntimeError) as error:
            notes.append(f"{scene.name}: without {name}: {str(error).split('. ')[0]}")
        else:
            points += found
            cases |= clocked
    clocks = interleave({name: run for name, (run, _) in cases.items()}, rounds)
    each = {name: 1e6 * float(np.median(s)) / cases[name][1] for name, s in clocks.items()}
    return [p._replace(microseconds=each[f"{p.method} {p.kappa}"]) for p in points], notes


def _ours(scene: Scene) -> tuple[list[Point], Cases]:
    """The implicit function theorem at every kappa, differences at one."""
    x = scene.sim.rollout(scene.start, np.tile(scene.u, (scene.steps, 1)), throw=True).x[-1]
    hard = scene.sim.ncontact > 0 or len(scene.sim.model.limit_dof) > 0
    points: list[Point] = []
    cases: Cases = {}
    for kappa in KAPPAS if hard else (DIFFERENCED,):
        sim = scene.sim.replace(kappa=kappa)
        tight = sim.replace(tolerance=TIGHT)
        reference = extrapolated(Stepper(tight, x, scene.u).jacobian)
        for name, solved in ((IMPLICIT, sim), (TIGHTLY, tight)):
            error = relative_error(np.concatenate(solved.linearize(x, scene.u, kappa=kappa), axis=1), reference.value)
            points.append(Point(name, kappa, None, error, reference.doubt, np.nan))
            cases[f"{name} {kappa}"] = _implicit(solved, x, scene.u), _KNOTS
        if kappa == DIFFERENCED:
            points += _differences(tight, x, scene.u, reference)
            for name, centred in ((FORWARD, False), (CENTRED, True)):
                cases[f"{name} {kappa}"] = _batch(tight, x, scene.u, centred=centred), _BATCHES
    return points, cases


def loads(scene: Scene) -> Vector:
    """Normal forces [N] of the contacts that carry at least a hundredth of the weight."""
    if not scene.sim.ncontact:
        return np.zeros(0)
    forces = scene.sim.rollout(scene.start, np.tile(scene.u, (scene.steps + 1, 1)), throw=True).contacts.normal_force
    weight = float(np.sum(scene.sim.model.body_mass) * np.linalg.norm(scene.sim.model.gravity))
    return np.asarray(forces[-1][forces[-1] > 0.01 * weight])


def smoothed(scene: Scene, kappas: Sequence[float] = KAPPAS) -> list[float]:
    """Relative difference of (A, B) at each kappa from that at a hundredth of the last."""
    x = scene.sim.rollout(scene.start, np.tile(scene.u, (scene.steps, 1)), throw=True).x[-1]
    sim = scene.sim.replace(tolerance=TIGHT)
    levels = [np.concatenate(sim.linearize(x, scene.u, kappa=kappa), axis=1) for kappa in (*kappas, 1e-2 * kappas[-1])]
    return [relative_error(level, levels[-1]) for level in levels[:-1]]


def _differences(sim: Simulator, x: Vector, u: Vector, reference: Any) -> list[Point]:
    stepper = Stepper(sim, x, u)
    points = []
    for name, centred in ((FORWARD, False), (CENTRED, True)):
        for eps in EPS:
            error = relative_error(stepper.jacobian(eps, centred=centred), reference.value)
            points.append(Point(name, sim.kappa, eps, error, reference.doubt, np.nan))
    return points


def _implicit(sim: Simulator, x: Vector, u: Vector) -> Callable[[], Any]:
    xs, us = np.tile(x, (_KNOTS, 1)), np.tile(u, (_KNOTS, 1))
    return lambda: sim.linearize_trajectory(xs, us, kappa=sim.kappa)


def _batch(sim: Simulator, x: Vector, u: Vector, *, centred: bool) -> Callable[[], Any]:
    xs, us = Stepper(sim, x, u).points(MUJOCO_EPS, centred=centred)
    xs, us = np.tile(xs, (_BATCHES, 1)), np.tile(us, (_BATCHES, 1))[:, None]
    return lambda: sim.rollout_batch(xs, us)


def _mujoco(scene: Scene) -> tuple[list[Point], Cases]:
    """MuJoCo's own differences, against their own extrapolation with a solver that converges to round-off."""
    import mujoco

    model = mujoco_scene.load(scene.sim.model, scene.sim.time_step, integrator=scene.integrator)
    data = mujoco_scene.state(model, scene.start)
    data.ctrl[:] = scene.u
    mujoco.mj_step(model, data, scene.steps)
    n, m = 2 * model.nv, model.nu
    A, B = np.zeros((n, n)), np.zeros((n, m))

    def jacobian(eps: float, centred: bool) -> Vector:
        mujoco.mjd_transitionFD(model, data, eps, centred, A, B if m else None, None, None)
        return np.concatenate([A, B], axis=1)

    default = model.opt.tolerance, model.opt.iterations
    model.opt.tolerance, model.opt.iterations = 0.0, 500
    reference = extrapolated(lambda eps: jacobian(eps, True))
    model.opt.tolerance, model.opt.iterations = default
    points: list[Point] = []
    cases: Cases = {}
    for name, centred in ((MUJOCO_FORWARD, False), (MUJOCO_CENTRED, True)):
        for eps in EPS:
            error = relative_error(jacobian(eps, centred), reference.value)
            points.append(Point(name, None, eps, error, reference.doubt, np.nan))

        def clocked(centred: bool = centred) -> None:
            for _ in range(_KNOTS):
                jacobian(MUJOCO_EPS, centred)

        cases[f"{name} None"] = clocked, _KNOTS
    return points, cases


def _drake(approximation: str, scene: Scene) -> tuple[list[Point], Cases]:
    """Drake's automatic differentiation, against the extrapolated differences of its update.

    RuntimeError: a step of Drake's does not converge.
    """
    step = drake_step.DrakeStep(scene.sim.model, scene.sim.time_step, approximation)
    step.settle(scene.start, scene.u, scene.steps)
    jacobian, reference = step.autodiff(), step.reference()
    name = f"Drake {approximation.lower()}, {AUTODIFF}"
    point = Point(name, None, None, relative_error(jacobian(), reference.value), reference.doubt, np.nan)

    def clocked() -> None:
        for _ in range(_CALLS):
            jacobian()

    return [point], {f"{name} None": (clocked, _CALLS)}
