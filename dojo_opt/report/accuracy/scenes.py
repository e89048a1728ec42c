"""Scenes without contact, each with a start, a duration, and a reference from continuous time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import dojo_opt as dojo
from dojo_opt.report.accuracy.reference import Motion, pendulum
from dojo_opt.report.engines import Run
from dojo_opt.report.engines.run import observe
from sim.dynamics.bodies import rotated
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator

Floats = NDArray[np.float64]

SAMPLES = 10  # equal parts of a duration: whole steps for every time step of the study


@dataclass(frozen=True)
class Scene:
    """One motion, and how its errors are told."""

    name: str
    mechanism: Mechanism
    q: Floats
    v: Floats
    duration: float  # [s]
    scale: float  # of energy errors [J]
    floating: bool  # momentum is conserved
    reference: Callable[[Floats, Floats, Floats], tuple[Floats, Floats]]  # (q, v, times) -> (q, v) at the times

    def exact(self) -> Run:
        """The reference at the samples."""
        times = np.linspace(0.0, self.duration, SAMPLES + 1)
        q, v = self.reference(self.q, self.v, times)
        return observe(Simulator(self.mechanism, time_step=1.0), times, q, v, 0.0, 0)

    def errors(self, run: Run, exact: Run) -> dict[str, Any]:
        """Largest errors over the samples; infinite where the run ended early.

        position [m] and attitude [rad] of any body, energy over its scale, momenta over the sum of the sizes of those
        of the bodies at the start.
        """
        n = len(exact.time)
        if len(run.time) < n:
            lost = dict.fromkeys(("position", "attitude", "energy"), np.inf)
            return lost | (dict.fromkeys(("momentum", "angular"), np.inf) if self.floating else {})
        sign = np.sign(np.sum(run.quaternion * exact.quaternion, axis=-1, keepdims=True))
        turn = 2.0 * np.linalg.norm(run.quaternion - sign * exact.quaternion, axis=-1)
        errors = {
            "position": np.linalg.norm(run.position - exact.position, axis=-1).max(),
            "attitude": turn.max(),
            "energy": np.abs(run.energy - exact.energy[0]).max() / self.scale,
        }
        if self.floating:
            sizes = self._sizes(exact)
            for name, part, size in zip(("momentum", "angular"), (slice(0, 3), slice(3, 6)), sizes, strict=True):
                errors[name] = np.abs(run.momentum[:, part] - exact.momentum[0, part]).max() / size
        return {name: float(value) for name, value in errors.items()}

    def _sizes(self, exact: Run) -> tuple[float, float]:
        """Sums over the bodies of |m v| and of |x x m v + J w| at the start."""
        model = Simulator(self.mechanism, time_step=1.0).model
        p = model.body_mass[:, None] * exact.velocity[0, :, :3]
        spin = np.einsum("bij,bj->bi", model.body_inertia.reshape(-1, 3, 3), exact.velocity[0, :, 3:])
        angular = np.cross(exact.position[0], p) + rotated(exact.quaternion[0], spin)
        linear = float(np.linalg.norm(p, axis=1).sum())
        return (linear if linear > 0.0 else 1.0), float(np.linalg.norm(angular, axis=1).sum())


def free_body(duration: float) -> Scene:
    """S1: an asymmetric body about its middle axis, which is unstable, at 5 rad/s."""
    body = dojo.Body("body", 1.0, (0.1, 0.2, 0.3))
    mech = dojo.Mechanism([body], [dojo.Joint("floating", None, "body")], gravity=(0, 0, 0), name="free body")
    q, v = np.array(mech.neutral, dtype=np.float64), np.array([0.0, 0.0, 0.0, 0.01, 5.0, 0.01])
    return Scene("free body", mech, q, v, duration, _kinetic(mech, q, v), True, Motion(_model(mech)).run)


def tree(duration: float) -> Scene:
    """S2: thirteen bodies, a trunk with four legs of three hinges, 15.84 J of random motion in space."""
    mech = replace(dojo.models.quadruped(damper=0.0, limits=False, gravity=(0, 0, 0)), contacts=(), name="tree")
    rng = np.random.default_rng(1)
    q = np.array(mech.neutral, dtype=np.float64)
    q[:3] = 0.0
    q[7:] += 0.3 * rng.normal(size=12)
    v = rng.normal(size=18)
    v *= np.sqrt(15.84 / _kinetic(mech, q, v))
    return Scene("tree of 13 bodies", mech, q, v, duration, 15.84, True, Motion(_model(mech)).run)


def chain(links: int) -> Scene:
    """S5: a pendulum of 2 m and 2 kg in all, released from the horizontal, for one second."""
    mech = dojo.models.npendulum(links, length=2.0 / links, mass=2.0 / links, width=0.01)
    q = np.zeros(links)
    q[0] = 0.5 * np.pi
    model = _model(mech)

    def exact(q: Floats, v: Floats, times: Floats) -> tuple[Floats, Floats]:
        return pendulum(model, q, v, times)

    return Scene(f"pendulum of {links}", mech, q, np.zeros(links), 1.0, 2.0 * 9.81 * 2.0, False, exact)


def smooth(mechanism: Mechanism, q: Floats, v: Floats, duration: float) -> Scene:
    """Any mechanism without contacts and limits."""
    mech = without_contact(mechanism)
    floating = mech.joints[0].kind == "floating" and not np.any(np.asarray(mech.gravity))
    scale = max(_kinetic(mech, q, v), 1e-300)
    return Scene(mech.name, mech, q, v, duration, scale, floating, Motion(_model(mech)).run)


def without_contact(mechanism: Mechanism) -> Mechanism:
    """The same without contacts, collisions and limits."""
    joints = [replace(joint, limits=None) for joint in mechanism.joints]
    return replace(mechanism, contacts=(), collisions=(), joints=joints)


def not_in_reference(mechanism: Mechanism) -> str:
    """What `Motion` does not represent of a mechanism without contacts; empty if it is all there."""
    model = _model(replace(mechanism, contacts=(), collisions=()))
    swings = [mechanism.joint_names[i] for i in np.flatnonzero(model.joint_nrot == 2)]
    for what, names in (
        ("loop", [joint.name for joint in mechanism.loops]),
        ("gear", [gear.name for gear in mechanism.gears]),
        ("joint with two rotations", swings),
    ):
        if names:
            return f"{what} ({', '.join(map(repr, names))})"
    return ""


def _model(mech: Mechanism) -> Any:
    return Simulator(mech, time_step=1.0).model


def _kinetic(mech: Mechanism, q: Floats, v: Floats) -> float:
    sim = Simulator(mech, time_step=1.0)
    still = observe(sim, np.zeros(1), q[None], 0.0 * v[None], 0.0, 0).energy[0]
    return float(observe(sim, np.zeros(1), q[None], v[None], 0.0, 0).energy[0] - still)
