"""Each kind of joint against its expected behaviour.

momentum     largest change of the angular momentum of a free body with another on a sprung joint [N m s]
energy       order in h of the energy error of the same pair without dampers
limits       largest excess over the stops, or the cone, of a body pushed against them; 1 if it reaches none [m, rad]
spring       k (q - rest) = u at rest under an input u; k sin(angle) = u for a quaternion; relative error
damper       a body thrown with momentum p stops after p / d; relative error
input        momentum after an input u for a time T is u T, of a screw its share; relative error
derivatives  of a step of the first pair with stops, by state and input, against central differences; relative error
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from sim.mechanism.body import Body
from sim.mechanism.input import Input
from sim.mechanism.joint import KINDS, Joint
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator
from solvers.types import Floats

BARS = {
    "momentum": 1e-9,
    "energy": 1.8,  # at least
    "limits": 1e-9,
    "spring": 1e-6,
    "damper": 1e-6,
    "input": 1e-9,
    "derivatives": 1e-6,
}
SPRING, DAMPER, INERTIA = 20.0, 5.0, 0.4
PITCH = {"screw": 1.5}  # [m/rev]
STOP = 0.3  # [m, rad] on either side; twice this for a cone


def check(kind: str) -> dict[str, float | None]:
    """All measures; None where a kind has no coordinate for one."""
    measures: dict[str, Callable[[str], float | None]] = {
        "momentum": momentum,
        "energy": energy,
        "limits": limits,
        "spring": spring,
        "damper": damper,
        "input": push,
        "derivatives": derivatives,
    }
    rigid = sum(KINDS[kind]) == 0
    within = ("momentum", "energy", "derivatives")
    return {name: None if rigid and name not in within else measure(kind) for name, measure in measures.items()}


def pair(kind: str, *, damper: float = 0.3, stops: bool = False) -> Mechanism:
    """A floating body without symmetry, and another on a sprung joint with skewed offsets; no gravity."""
    rng = np.random.default_rng(list(KINDS).index(kind))
    plain = sum(KINDS[kind]) if KINDS[kind][1] < 3 else KINDS[kind][0]
    quaternion = KINDS[kind][1] == 3
    joint = Joint(
        kind,
        "base",
        "tip",
        "joint",
        parent_point=rng.normal(size=3) / 3.0,
        child_point=rng.normal(size=3) / 3.0,
        axis=rng.normal(size=3),
        spring=0.0 if kind == "floating" else SPRING,
        damper=damper,
        limits=[(-STOP, STOP)] * plain + [None] * (3 if quaternion else 0) if stops and plain else None,
        cone=2.0 * STOP if stops and quaternion else None,
        pitch=PITCH.get(kind, 0.0),
    )
    skewed = np.array([[0.2, 0.02, 0.01], [0.02, 0.3, 0.03], [0.01, 0.03, 0.4]])
    bodies = [Body("base", 2.0, skewed), Body("tip", 1.0, 0.5 * skewed)]
    inputs = [Input("joint", dof=d) for d in range(sum(KINDS[kind]))]
    return Mechanism(bodies, [Joint("floating", None, "base"), joint], inputs=inputs, gravity=(0, 0, 0))


def alone(kind: str, **options: float) -> Mechanism:
    """A ball of 1 kg on a joint at its centre, an input on every coordinate; no gravity."""
    inputs = [Input("joint", dof=d) for d in range(sum(KINDS[kind]))]
    options["pitch"] = PITCH.get(kind, 0.0)
    joint = Joint(kind, None, "ball", "joint", axis=(1.0, 2.0, -0.5), **options)  # type: ignore[arg-type]
    return Mechanism([Body("ball", 1.0, np.full(3, INERTIA))], [joint], inputs=inputs, gravity=(0, 0, 0))


def moving(sim: Simulator, speed: float, spread: float = 0.1) -> tuple[Floats, Floats]:
    """(q, v) near the neutral state."""
    rng = np.random.default_rng(7)
    x = sim.integrate(sim.neutral(), np.concatenate([spread * rng.normal(size=sim.nv), np.zeros(sim.nv)]))
    return x[: sim.nq], speed * rng.normal(size=sim.nv)


def momentum(kind: str) -> float:
    """See above."""
    sim = Simulator(_free(pair(kind)), time_step=0.01, tolerance=1e-12)
    x = sim.state_from_velocity(*moving(sim, 1.0))
    angular = sim.momentum(sim.rollout(x, np.zeros((100, sim.nu)), throw=True).x)[1]
    return float(np.abs(angular - angular[0]).max())


def energy(kind: str) -> float:
    """See above; infinite where the error is rounding."""
    errors = []
    for h in (0.02, 0.01):
        sim = Simulator(_free(pair(kind, damper=0.0)), time_step=h, tolerance=1e-12)
        t = sim.rollout(sim.state_from_velocity(*moving(sim, 0.7)), np.zeros((round(0.6 / h), sim.nu)), throw=True)
        values = sim.energy(t.x)
        errors.append(float(np.abs(values - values[0]).max()))
    return float(np.log2(errors[0] / errors[1])) if errors[1] > 1e-11 else float("inf")


def _free(mech: Mechanism) -> Mechanism:
    """Without a damper on the base."""
    base, joint = mech.joints
    return replace(mech, joints=[replace(base, damper=0.0), joint])


def limits(kind: str) -> float:
    """See above."""
    ntrans, nrot = KINDS[kind]
    plain = ntrans + (nrot if nrot < 3 else 0)
    stops = [(-STOP, STOP)] * plain + [None] * (ntrans + nrot - plain)
    joint = replace(
        alone(kind).joints[0], limits=stops if plain else None, cone=2.0 * STOP if nrot == 3 else None, damper=0.1
    )
    sim = Simulator(replace(alone(kind), joints=[joint]), time_step=0.02, kappa=1e-8)
    worst = -1.0
    for d in range(sim.nv):
        for side in (-1.0, 1.0):
            us = np.tile(side * np.eye(sim.nv)[d], (100, 1))
            q = sim.rollout(sim.state_from_velocity(sim.neutral()[: sim.nq], 3.0 * us[0]), us, throw=True).x[
                :, : sim.nq
            ]
            excess = float((_tilt(joint, q[:, ntrans:]) - 2.0 * STOP if d >= plain else np.abs(q[:, d]) - STOP).max())
            about_axis = d >= plain and abs(np.asarray(joint.axis)[d - plain]) > 0.999
            worst = max(worst, 1.0 if excess < -0.01 and not about_axis else excess)
    return worst


def _tilt(joint: Joint, q: Floats) -> Floats:
    """Angle between the axes of child and parent for quaternions (n, 4)."""
    axis = np.asarray(joint.axis) / np.linalg.norm(joint.axis)
    cross = np.cross(q[:, 1:], axis)
    turned = axis + 2.0 * (q[:, :1] * cross + np.cross(q[:, 1:], cross))
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(axis, turned), axis=1), turned @ axis))


def spring(kind: str) -> float | None:
    """See above; None for floating joints, which have no springs."""
    if kind == "floating":
        return None
    sim = Simulator(alone(kind, spring=SPRING, damper=DAMPER), time_step=0.05)
    ntrans, nrot = KINDS[kind]
    worst = 0.0
    for d in range(sim.nv):
        u = 4.0 * np.eye(sim.nv)[d]
        q = sim.rollout(sim.neutral(), np.tile(u, (400, 1)), throw=True).x[-1, : sim.nq]
        turned = nrot == 3 and d >= ntrans
        held = np.sin(2.0 * np.arcsin(np.linalg.norm(q[ntrans + 1 :]))) if turned else q[d]
        worst = max(worst, abs(SPRING * float(held) / 4.0 - 1.0))
    return worst


def damper(kind: str) -> float:
    """See above."""
    sim = Simulator(alone(kind, damper=DAMPER), time_step=0.02, tolerance=1e-12)
    ntrans, nrot = KINDS[kind]
    worst = 0.0
    for d in range(sim.nv):
        v = 0.7 * np.eye(sim.nv)[d]
        x = sim.rollout(sim.state_from_velocity(sim.neutral()[: sim.nq], v), np.zeros((400, sim.nu)), throw=True).x[-1]
        way = np.linalg.norm(sim.difference(x, sim.neutral())[: sim.nv])
        mass = 1.0 if d < ntrans else INERTIA + sim.mechanism.joints[0].lead ** 2
        worst = max(worst, abs(float(way) * DAMPER / (0.7 * mass) - 1.0))
    return worst


def push(kind: str) -> float:
    """See above."""
    sim = Simulator(alone(kind), time_step=0.01, tolerance=1e-12)
    worst = 0.0
    for d in range(sim.nv):
        us = np.tile(np.eye(sim.nv)[d], (50, 1))
        linear, angular = sim.momentum(sim.rollout(sim.neutral(), us, throw=True).x[-1])
        gained = np.linalg.norm(linear if d < KINDS[kind][0] else angular)
        start = np.linalg.norm(sim.momentum(sim.neutral())[1])
        share = INERTIA / (INERTIA + sim.mechanism.joints[0].lead ** 2)  # a screw spends the rest on the way ahead
        worst = max(worst, abs((float(gained) - float(start)) / (0.5 * share) - 1.0))
    return worst


def derivatives(kind: str) -> float:
    """See above."""
    sim = Simulator(pair(kind, stops=True), time_step=0.02, kappa=1e-4, tolerance=3e-14)
    x = np.concatenate(moving(sim, 0.5))
    u = 0.3 * np.random.default_rng(8).normal(size=sim.nu)
    now = sim.step(x, u, throw=True).x
    A, B = sim.linearize(x, u)

    def moved(d: Floats) -> Floats:
        step = sim.step(sim.integrate(x, d[: sim.ndx]), u + d[sim.ndx :], throw=True)
        return np.asarray(sim.difference(step.x, now))

    return relative_error(np.hstack([A, B]), moved)


def relative_error(J: Floats, function: Callable[[Floats], Floats]) -> float:
    """Largest error of J over its largest entry, against the better of two five-point differences, column by column."""
    error = np.full(J.shape[1], np.inf)
    for e in (3e-3, 3e-4):
        for k, way in enumerate(e * np.eye(J.shape[1])):
            slope = 8.0 * (function(way) - function(-way)) - function(2.0 * way) + function(-2.0 * way)
            error[k] = min(error[k], float(np.abs(slope / (12.0 * e) - J[:, k]).max()))
    return float(error.max() / np.abs(J).max())
