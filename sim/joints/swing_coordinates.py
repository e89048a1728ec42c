"""Coordinates of joints with two rotations (swing.py) from the rotations of their children."""

from __future__ import annotations

from math import pi, sqrt

from sim.model import Model
from sim.rotation import Quat, Vec3, quat_log
from solvers.compiler import kernel


@kernel
def swing_of(r: Quat, near: Vec3) -> Vec3:
    """The rotation vector t of the rotation r that is nearest to another one: of angle up to 2 pi."""
    t = quat_log(r[0], r[1], r[2], r[3])
    n = sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2])
    dot = t[0] * near[0] + t[1] * near[1] + t[2] * near[2]
    if n > 0.0 and dot < n * (n - pi):  # |t (1 - 2 pi/n) - near| < |t - near|
        k = 1.0 - 2.0 * pi / n
        return k * t[0], k * t[1], k * t[2]
    return t


@kernel
def swing_component(model: Model, i: int, k: int, t: Vec3) -> float:
    """p_k = V_k . t"""
    V = model.joint_swing_axes[i, 3 * k : 3 * k + 3]
    return V[0] * t[0] + V[1] * t[1] + V[2] * t[2]
