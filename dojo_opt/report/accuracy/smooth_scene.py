"""A motion without contact: its start, its duration, and a reference from continuous time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dojo_opt.report.accuracy.reference import TreeReference
from dojo_opt.report.engine import Run, observe
from sim.dynamics.maximal_energy import rotated
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator
from solvers.types import Floats

SAMPLES = 10  # equal parts of a duration: whole steps for every time step of the study


@dataclass(frozen=True)
class SmoothScene:
    """One motion, and the measure of its errors."""

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


def smooth(mechanism: Mechanism, q: Floats, v: Floats, duration: float) -> SmoothScene:
    """Any mechanism without contacts and limits."""
    mech = without_contact(mechanism)
    floating = mech.joints[0].kind == "floating" and not np.any(np.asarray(mech.gravity))
    scale = max(kinetic_energy(mech, q, v), 1e-300)
    return SmoothScene(mech.name, mech, q, v, duration, scale, floating, TreeReference(model_of(mech)).run)


def without_contact(mechanism: Mechanism) -> Mechanism:
    """The mechanism without contacts, collisions and limits."""
    joints = [replace(joint, limits=None) for joint in mechanism.joints]
    return replace(mechanism, contacts=(), collisions=(), joints=joints)


def not_in_reference(mechanism: Mechanism) -> str:
    """The first element of a mechanism, contacts aside, that `TreeReference` does not support; empty if none."""
    model = model_of(replace(mechanism, contacts=(), collisions=()))
    swings = [mechanism.joint_names[i] for i in np.flatnonzero(model.joint_nrot == 2)]
    for feature, names in (
        ("loop", [joint.name for joint in mechanism.loops]),
        ("gear", [gear.name for gear in mechanism.gears]),
        ("joint with two rotations", swings),
    ):
        if names:
            return f"{feature} ({', '.join(map(repr, names))})"
    return ""


def model_of(mech: Mechanism) -> Any:
    """The arrays of a mechanism."""
    return Simulator(mech, time_step=1.0).model


def kinetic_energy(mech: Mechanism, q: Floats, v: Floats) -> float:
    """Kinetic energy at (q, v) [J]."""
    sim = Simulator(mech, time_step=1.0)
    still = observe(sim, np.zeros(1), q[None], 0.0 * v[None], 0.0, 0).energy[0]
    return float(observe(sim, np.zeros(1), q[None], v[None], 0.0, 0).energy[0] - still)
