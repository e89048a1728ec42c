"""Axes and frames that follow from one direction: of free and fixed translations, and of contacts."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from sim.mechanism.joint import Joint
from sim.mechanism.shapes import rotation_matrix
from solvers.types import Floats

_ROUNDED = 1e-9  # parts of a unit vector below it are rounding


def translation_axes(ntrans: int, axis: ArrayLike) -> Floats:
    """Free translations as rows of a (3, 3) matrix, zero below: along the axis, across it, or x, y, z."""
    out = np.zeros((3, 3))
    unit = np.asarray(axis, dtype=np.float64)
    if ntrans == 3:
        out[:] = np.eye(3)
    elif ntrans == 1:
        out[0] = unit
    elif ntrans == 2:
        first, second = (e for k, e in enumerate(np.eye(3)) if k != np.argmax(np.abs(unit)))
        out[0] = _normalized(first - unit * (unit @ first))
        out[1] = _normalized(second - unit * (unit @ second) - out[0] * (out[0] @ second))
    return out


def fixed_axes(joint: Joint) -> Floats:
    """Orthonormal directions along which a joint does not move, (3 - ntrans, 3), joint frame."""
    free = translation_axes(joint.ntrans, joint.axis)[: joint.ntrans]
    return np.linalg.svd(free, full_matrices=True)[2][joint.ntrans :] if joint.ntrans else np.eye(3)


def upward_rates(joint: Joint, rotation: Floats) -> Floats:
    """(ntrans,) rates of the translations that move a joint's child straight up, in metres per metre; zero if none do.

    rotation: (3, 3) of the parent.
    """
    up = (rotation @ rotation_matrix(joint.orientation))[2]  # in the joint frame
    rates = translation_axes(joint.ntrans, joint.axis)[: joint.ntrans] @ up
    rates = np.where(np.abs(rates) > _ROUNDED, rates, 0.0)
    return rates if abs(float(rates @ rates) - 1.0) < _ROUNDED else np.zeros(joint.ntrans)


def contact_frame(normal: ArrayLike) -> Floats:
    """Rows n, t1, t2 of a right-handed frame: t1 along x (along y for a normal near x), t2 = n x t1."""
    n = np.asarray(normal, dtype=np.float64)
    along = np.array([1.0, 0.0, 0.0]) if abs(n[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    t1 = _normalized(along - n * (n @ along))
    return np.array([n, t1, np.cross(n, t1)])


def _normalized(a: Floats) -> Floats:
    return np.asarray(a / np.linalg.norm(a))
