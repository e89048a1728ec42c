"""Motion: what plots and viewer show of a trajectory or a plan, in world coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from sim.mechanism import Mechanism
from sim.model import Vector
from sim.shapes import rotation_matrix

Array = Vector


@dataclass(frozen=True)
class Motion:
    """Poses of the bodies and forces of the contacts over time."""

    mechanism: Mechanism
    time: Array  # (T + 1,) [s]
    x: Array  # (T + 1, nx)
    u: Array  # (T, nu) [N, N m]
    position: Array  # (T + 1, nbody, 3) [m]
    quaternion: Array  # (T + 1, nbody, 4)
    contact_time: Array  # (N,) end of each simulation step [s]
    contact_force: Array  # (N, ncontact, 3) mean over the step: normal, and two tangents [N]

    def points(self, body: int, point: Any) -> Array:
        """Path (T + 1, 3) of a point given in the axes of a body, from its centre of mass [m]."""
        R = np.array([rotation_matrix(q) for q in self.quaternion[:, body]])
        return np.asarray(self.position[:, body] + R @ np.asarray(point, dtype=np.float64))


def motion(result: Any) -> Motion:
    """Motion of a Trajectory, or of a plan; the contact forces of a plan are those of its steps, solved once more."""
    sim = result.simulator
    x = np.asarray(result.x, dtype=np.float64)
    z = np.array([sim.maximal(row) for row in x])
    contact_time, force = _contact_forces(result)
    return Motion(
        mechanism=sim.mechanism,
        time=np.asarray(result.time),
        x=x,
        u=np.asarray(result.u, dtype=np.float64),
        position=z[:, :, 0:3],
        quaternion=z[:, :, 6:10],
        contact_time=contact_time,
        contact_force=force,
    )


def _contact_forces(result: Any) -> tuple[Array, Array]:
    """End of every simulation step, and its mean contact forces; a knot of a plan may span several steps."""
    sim = result.simulator
    steps = getattr(result, "substeps", 1)
    forces = np.zeros((len(result.u) * steps, sim.ncontact, 3))
    for knot, u in enumerate(result.u):
        x = result.x[knot]
        for k in range(steps):
            step = sim.step(x, u)
            x = step.x
            forces[knot * steps + k] = step.contacts.force
    return sim.time_step * np.arange(1, len(forces) + 1), forces
