"""StaticMotions: the motions of a robot at rest along which nothing but its contacts can hold it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.mechanism.joint import WORLD
from sim.simulator.simulator import Simulator
from solvers.types import Floats

__all__ = ["StaticMotions", "input_map", "pushes"]

_STEP = 1e-4  # of the differences of the closed states, which are right to 1e-12
_PROJECTED = 0.5  # singular values of a projection are 0, or 1 and more
_DRIVEN = 1e-9  # of the largest effect of an input


def input_map(sim: Simulator) -> Floats:
    """(nv, nu) generalised forces per unit of every input on a joint; those on bodies, such as pushes, have none."""
    out = np.zeros((sim.nv, sim.nu))
    for k, part in enumerate(sim.mechanism.inputs or ()):
        if part.joint is None:
            continue
        out[sim.mechanism.v_slice(part.joint).start + part.dof, k] = part.gain
    return out


def pushes(sim: Simulator) -> NDArray[np.bool_]:
    """(nu,) whether inputs are forces on a body that moves and turns freely in space or in a plane."""
    free = {
        joint.name: joint.ntrans
        for joint in sim.mechanism.joints
        if joint.parent == WORLD and joint.ntrans > 1 and joint.nrot
    }
    parts = sim.mechanism.inputs or ()
    return np.array([part.joint in free and part.dof < free[part.joint] for part in parts], dtype=bool)


class StaticMotions(NamedTuple):
    """Bases of the motions at a state.

    A load f on the coordinates is held if f has no part along `loose`: the forces of loops and gears do no work along
    `allowed`, and inputs none along `loose`.
    """

    inputs: Floats  # (nv, nu) generalised forces per unit of every input
    allowed: Floats  # (nv, k) that loops and gears allow
    loose: Floats  # (nv, m) those of them that no input drives

    @classmethod
    def at(cls, sim: Simulator, x: Floats, idle: NDArray[np.bool_] | None = None) -> StaticMotions:
        """Motions at a state (nx,) whose loops are closed.   idle: (nu,) inputs that are zero (default None: none)."""
        B, mech = input_map(sim), sim.mechanism
        if idle is not None:
            B[:, idle] = 0.0
        if not (mech.loops or mech.gears):
            return cls(B, np.eye(sim.nv), np.eye(sim.nv)[:, ~B.any(axis=1)])
        steps = _STEP * np.eye(sim.nv, sim.ndx)
        ahead, back = (np.array([sim.close(y) for y in sim.integrate(x, s)]) for s in (steps, -steps))
        projection = sim.difference(ahead, back)[:, : sim.nv].T / (2.0 * _STEP)
        columns, sizes, _ = np.linalg.svd(projection)
        allowed = columns[:, sizes > _PROJECTED]
        work = allowed.T @ B
        rows, sizes, _ = np.linalg.svd(work)
        rank = int((sizes > _DRIVEN * max(1.0, np.abs(B).max(initial=0.0))).sum())
        return cls(B, allowed, allowed @ rows[:, rank:])

    def move(self, sim: Simulator, x: Floats, by: Floats) -> Floats:
        """The state after a motion by (nv,), its loops closed."""
        moved = sim.integrate(x, np.concatenate([by, np.zeros(sim.nv)]))
        return np.asarray(sim.close(moved) if self.allowed.shape[1] < sim.nv else moved)

    def left(self, load: Floats) -> Floats:
        """(m,) the part of a load (nv,) that neither inputs nor loops hold."""
        return np.asarray(self.loose.T @ load)

    def holding(self, load: Floats) -> Floats:
        """(nu,) the least inputs that hold a load (nv,), as far as inputs can."""
        return np.asarray(np.linalg.lstsq(self.allowed.T @ self.inputs, self.allowed.T @ load, rcond=None)[0])
