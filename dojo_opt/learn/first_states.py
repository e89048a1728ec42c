"""First states: uniform noise around a posture, within the limits of joints, and lifted off level ground."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sim.mechanism.mechanism import Mechanism
from sim.model.state_columns import BodyColumn
from sim.simulator.simulator import Simulator
from solvers.compiler import kernel
from solvers.types import Floats, Integers, Matrix, Vector

__all__ = ["first_states", "least_gap"]

_CLEARANCE = 1e-3  # [m] of lifted first states
_HEIGHT, _QUATERNION = int(BodyColumn.POSITION) + 2, int(BodyColumn.QUATERNION)
_OFFSET = 3  # column of `points`


@kernel
def _reflect(q: Vector, low: Vector, high: Vector) -> None:
    """Coordinates beyond limits, as far within them; at the farther limit, if they would be beyond that."""
    for k in range(q.shape[0]):
        inside = 2.0 * high[k] - q[k] if q[k] > high[k] else 2.0 * low[k] - q[k] if q[k] < low[k] else q[k]
        q[k] = min(max(inside, low[k]), high[k])


@kernel
def _least_height(bodies: Matrix, of: Integers, points: Matrix) -> float:
    """Of points of bodies, the least height minus its offset; infinite without points.

    bodies: rows of BodyColumn;  of: (n,) bodies of the points;  points: (n, 4) body axes, and offset
    """
    least = np.inf
    for k in range(of.shape[0]):
        z = bodies[of[k]]
        w, x, y, s = z[_QUATERNION], z[_QUATERNION + 1], z[_QUATERNION + 2], z[_QUATERNION + 3]
        height = z[_HEIGHT] + 2.0 * (x * s - w * y) * points[k, 0] + 2.0 * (y * s + w * x) * points[k, 1]
        height += (1.0 - 2.0 * (x * x + y * y)) * points[k, 2] - points[k, _OFFSET]
        least = min(least, height)
    return least


def least_gap(mech: Mechanism) -> Callable[[Floats], float]:
    """Distance of the lowest contact from level ground, as all contacts of these models have it, quickly.

    Args:
        mech: the mechanism.

    Returns:
        Function of the coordinates q (nq,) that returns the distance [m]; infinite without contacts.
    """
    if not mech.contacts:
        return lambda q: np.inf
    sim, still = Simulator(mech), np.zeros(mech.nv)
    names = {name: i for i, name in enumerate(mech.body_names)}
    bodies = np.array([names[c.body] for c in mech.contacts], dtype=np.int64)
    offsets = [[c.radius + c.height] for c in mech.contacts]
    points = np.hstack([np.array([c.point for c in mech.contacts], dtype=np.float64), offsets])
    if not np.all(mech.contact_normals == (0.0, 0.0, 1.0)) or any(c.terrain is not None for c in mech.contacts):
        raise ValueError("least_gap: expected contacts with level ground")
    return lambda q: _least_height(sim.maximal(np.concatenate([q, still])), bodies, points)


def first_states(
    mech: Mechanism, height: int, position: float, velocity: Callable[..., Floats], home: Floats | None = None
) -> Callable[..., Floats]:
    """First states: uniform noise of the coordinates, within the limits of joints, and the given one of the velocities.

    Args:
        mech: the mechanism.
        height: number of the coordinate that lifts it, or -1.
        position: largest noise of coordinates [m, rad].
        velocity: function of (generator, nv) that draws velocities (nv,).
        home: (nq,) posture (default None: the neutral one).

    Returns:
        Function of a generator that returns a state (nx,).
    """
    home, quaternions = np.array(mech.neutral if home is None else home, dtype=np.float64), []
    for joint in mech.joints:
        if joint.nrot == 3:
            stop = mech.q_slice(joint.name).stop
            quaternions.append(slice(stop - 4, stop))
    low, high = (np.ascontiguousarray(limits, dtype=np.float64) for limits in mech.coordinate_limits)
    lowest = least_gap(mech)

    def start(rng: np.random.Generator) -> Floats:
        q = home + rng.uniform(-position, position, len(home))
        _reflect(q, low, high)
        for part in quaternions:
            q[part] /= np.linalg.norm(q[part])
        v = velocity(rng, mech.nv)
        q[height] += max(_CLEARANCE - lowest(q), 0.0) if height >= 0 else 0.0
        return np.concatenate([q, v])

    return start
