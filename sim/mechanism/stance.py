"""Stance: the neutral coordinates of a loaded robot, and how high it stands with them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.mechanism.mechanism import Mechanism
from sim.mechanism.poses import poses
from sim.mechanism.shapes import rotation_matrix

Floats = NDArray[np.float64]

_CLEAR = 1e-9  # [m] above the ground: a gap of zero, or below by rounding, has no interior to start the solver in


def resting(limits: tuple[float, float] | None) -> float:
    """Coordinate of a joint in the neutral state: zero, or the middle of its range when zero is outside of it."""
    if limits is None or limits[0] <= 0.0 <= limits[1]:
        return 0.0
    return 0.5 * (limits[0] + limits[1])


def gaps(mech: Mechanism, q: Floats) -> Floats:
    """(ncontact,) distance of every contact from its ground [m]."""
    at = poses(mech.joints, q)
    return np.array([float(c.gap(at[c.body].at(c.point))) for c in mech.contacts], dtype=np.float64)


def lifted(mech: Mechanism, base: str) -> Floats:
    """Neutral q with the joint `base`, floating in the world, so high that the lowest contact touches its ground."""
    q = np.array(mech.neutral, dtype=np.float64)
    joint = mech.joints[mech.joint_names.index(base)]
    rise = mech.contact_normals[:, 2]
    if np.any(rise > 0.0):
        up = _CLEAR - (gaps(mech, q)[rise > 0.0] / rise[rise > 0.0]).min()
        at = mech.q_slice(base).start
        q[at : at + 3] += up * rotation_matrix(joint.orientation)[2]
    return q
