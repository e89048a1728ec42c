"""(A, B) of one step: the error of each method against the derivative of the same step, and its cost.

Every engine is judged by its own step, at the state of its own motion: the study measures the accuracy
of derivatives, not that of contact.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from dojo_opt.report.gradients.differences import Stepper, extrapolated, relative_error
from dojo_opt.report.interleaved_rounds import interleave
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator
from solvers.types import Vector

KAPPAS = (1e-2, 1e-3, 1e-4, 1e-6, 1e-8)
EPS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
DIFFERENCED = 1e-6  # the kappa at which our step is differenced: that of our simulations
CLOCKED_EPS = 1e-6  # step size of the differences that are clocked
TIGHT = (
    1e-13  # tolerance of steps that are differenced: at 1e-8 neighbours stop at other iterations, and differ by that
)
KNOTS, _BATCHES = 50, 5  # Jacobians per clocked call: implicit, by differences

IMPLICIT, TIGHTLY = "implicit", "implicit, solved to 1e-13"
FORWARD, CENTERED = "differences, one-sided", "differences, centred"


Cases = dict[str, tuple[Callable[[], Any], int]]  # timed call, and the number of Jacobians that it computes


class StepScene(NamedTuple):
    """A state to differentiate at: where `steps` steps from `start` lead."""

    name: str
    sim: Simulator
    start: Vector
    u: Vector
    steps: int


class JacobianPoint(NamedTuple):
    """One way to get a Jacobian."""

    method: str
    kappa: float | None  # None: not ours
    eps: float | None  # None: not by differences
    error: float  # relative
    doubt: float  # of the reference
    microseconds: float  # a step and its Jacobian, or all steps that are differenced


Peer = tuple[str, Callable[[StepScene], tuple[list[JacobianPoint], Cases]]]  # an engine: its name, and its measurement


def scene_of(mechanism: Mechanism) -> StepScene:
    """A mechanism half a second after it is let go in its neutral state."""
    sim = Simulator(mechanism, time_step=0.01)
    return StepScene(mechanism.name, sim, sim.neutral(), np.zeros(sim.nu), 50)


def measure(scene: StepScene, rounds: int, peers: Sequence[Peer] = ()) -> tuple[list[JacobianPoint], list[str]]:
    """Error and cost of all ways to the Jacobian.

    Args:
        scene: The state to differentiate at.
        rounds: Clocked calls of each way.
        peers: Other engines, each with its name.

    Returns:
        The ways, and a note for every peer that cannot represent the scene.

    Raises:
        SimulationError: The scene cannot be stepped.
    """
    points, cases = _ours(scene)
    notes = []
    for name, peer in peers:
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


def _ours(scene: StepScene) -> tuple[list[JacobianPoint], Cases]:
    """The implicit function theorem at every kappa, differences at one."""
    x = scene.sim.rollout(scene.start, np.tile(scene.u, (scene.steps, 1)), throw=True).x[-1]
    hard = scene.sim.ncontact > 0 or len(scene.sim.model.limit_dof) > 0
    points: list[JacobianPoint] = []
    cases: Cases = {}
    for kappa in KAPPAS if hard else (DIFFERENCED,):
        sim = scene.sim.replace(kappa=kappa)
        tight = sim.replace(tolerance=TIGHT)
        reference = extrapolated(Stepper(tight, x, scene.u).jacobian)
        for name, solved in ((IMPLICIT, sim), (TIGHTLY, tight)):
            error = relative_error(np.concatenate(solved.linearize(x, scene.u, kappa=kappa), axis=1), reference.value)
            points.append(JacobianPoint(name, kappa, None, error, reference.doubt, np.nan))
            cases[f"{name} {kappa}"] = _implicit(solved, x, scene.u), KNOTS
        if kappa == DIFFERENCED:
            points += _differences(tight, x, scene.u, reference)
            for name, centered in ((FORWARD, False), (CENTERED, True)):
                cases[f"{name} {kappa}"] = _batch(tight, x, scene.u, centered=centered), _BATCHES
    return points, cases


def loads(scene: StepScene) -> Vector:
    """Normal forces [N] of the contacts that carry at least a hundredth of the weight."""
    if not scene.sim.ncontact:
        return np.zeros(0)
    forces = scene.sim.rollout(scene.start, np.tile(scene.u, (scene.steps + 1, 1)), throw=True).contacts.normal_force
    weight = float(np.sum(scene.sim.model.body_mass) * np.linalg.norm(scene.sim.model.gravity))
    return np.asarray(forces[-1][forces[-1] > 0.01 * weight])


def smoothed(scene: StepScene, kappas: Sequence[float] = KAPPAS) -> list[float]:
    """Relative difference of (A, B) at each kappa from that at a hundredth of the last."""
    x = scene.sim.rollout(scene.start, np.tile(scene.u, (scene.steps, 1)), throw=True).x[-1]
    sim = scene.sim.replace(tolerance=TIGHT)
    levels = [np.concatenate(sim.linearize(x, scene.u, kappa=kappa), axis=1) for kappa in (*kappas, 1e-2 * kappas[-1])]
    return [relative_error(level, levels[-1]) for level in levels[:-1]]


def _differences(sim: Simulator, x: Vector, u: Vector, reference: Any) -> list[JacobianPoint]:
    stepper = Stepper(sim, x, u)
    points = []
    for name, centered in ((FORWARD, False), (CENTERED, True)):
        for eps in EPS:
            error = relative_error(stepper.jacobian(eps, centered=centered), reference.value)
            points.append(JacobianPoint(name, sim.kappa, eps, error, reference.doubt, np.nan))
    return points


def _implicit(sim: Simulator, x: Vector, u: Vector) -> Callable[[], Any]:
    xs, us = np.tile(x, (KNOTS, 1)), np.tile(u, (KNOTS, 1))
    return lambda: sim.linearize_trajectory(xs, us, kappa=sim.kappa)


def _batch(sim: Simulator, x: Vector, u: Vector, *, centered: bool) -> Callable[[], Any]:
    xs, us = Stepper(sim, x, u).points(CLOCKED_EPS, centered=centered)
    xs, us = np.tile(xs, (_BATCHES, 1)), np.tile(us, (_BATCHES, 1))[:, None]
    return lambda: sim.rollout_batch(xs, us)
