"""Quaternions (w, x, y, z) in plain NumPy: any leading axes, real or complex (for complex-step derivatives)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
_NEXT, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])  # axes after each axis, and before it


def cross(a: Array, b: Array) -> Array:
    """a x b on the last axis."""
    return a.take(_NEXT, -1) * b.take(_LAST, -1) - a.take(_LAST, -1) * b.take(_NEXT, -1)


def dot(a: Array, b: Array) -> Array:
    """a . b on the last axis, which stays with length 1; no conjugation."""
    return np.sum(a * b, axis=-1, keepdims=True)


def mul(p: Array, q: Array) -> Array:
    """Hamilton product p q."""
    p0, pv, q0, qv = p[..., :1], p[..., 1:], q[..., :1], q[..., 1:]
    return np.concatenate((p0 * q0 - dot(pv, qv), p0 * qv + q0 * pv + cross(pv, qv)), axis=-1)


def conj(q: Array) -> Array:
    """Inverse of a unit quaternion."""
    return np.concatenate((q[..., :1], -q[..., 1:]), axis=-1)


def rotate(q: Array, v: Array) -> Array:
    """R(q) v."""
    t = 2.0 * cross(q[..., 1:], v)
    return v + q[..., :1] * t + cross(q[..., 1:], t)


def matrix(q: Array) -> Array:
    """R(q), shape (..., 3, 3)."""
    return np.stack([rotate(q, e) for e in np.eye(3)], axis=-1)


def exp(phi: Array) -> Array:
    """Quaternion (cos(a/2), sin(a/2) axis) of the rotation vector phi = a axis [rad]."""
    a2 = dot(phi, phi) / 4.0
    small = np.abs(a2) < 1e-6
    a = np.sqrt(np.where(small, 1.0, a2))
    sinc = np.where(small, 1.0 - a2 / 6.0 + a2 * a2 / 120.0, np.sin(a) / a)
    cos = np.where(small, 1.0 - a2 / 2.0 + a2 * a2 / 24.0 - a2**3 / 720.0, np.cos(a))
    return np.concatenate((cos, sinc * phi / 2.0), axis=-1)


def log(q: Array) -> Array:
    """Rotation vector of q, of length below pi: 2 atan(|s| / c) s / |s|, after q -> -q where c < 0."""
    q = np.where(np.real(q[..., :1]) < 0.0, -q, q)
    ratio = q[..., 1:] / q[..., :1]
    t2 = dot(ratio, ratio)
    small = np.abs(t2) < 1e-6
    t = np.sqrt(np.where(small, 1.0, t2))
    scale = np.where(small, 1.0 - t2 / 3.0 + t2 * t2 / 5.0 - t2**3 / 7.0, np.arctan(t) / t)
    return 2.0 * ratio * scale
