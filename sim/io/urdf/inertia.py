"""RigidInertia: combined masses, a test of physical consistency, and its repair on request."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.mechanism.pose import Pose
from solvers.types import Floats

BALL_MASS = 1e-3  # [kg] of a repaired body that has no mass
BALL_RADIUS = 0.01  # [m] of the ball whose extent is the least that a repaired body gets
SLACK = 1e-6  # by how much the largest moment may exceed the sum of the others, as Body allows


class RigidInertia(NamedTuple):
    """Mass [kg], centre of mass (3,) [m], and inertia (3, 3) about it [kg m^2], in the axes of some frame."""

    mass: float
    com: Floats
    inertia: Floats

    def seen_from(self, pose: Pose) -> RigidInertia:
        """Inertia in an outer frame in which this frame has the given pose."""
        return RigidInertia(self.mass, pose.at(self.com), pose.rotation @ self.inertia @ pose.rotation.T)


def combined(parts: list[RigidInertia]) -> RigidInertia:
    """One rigid body out of several in the same frame.

    m = sum m_k,   m c = sum m_k c_k,   J = sum J_k + m_k (|d|^2 I - d d^T),   d = c_k - c
    """
    mass = sum(part.mass for part in parts)
    if mass == 0.0:
        com = parts[0].com if parts else np.zeros(3)
    else:
        com = np.sum([part.mass * part.com for part in parts], axis=0) / mass
    inertia = np.zeros((3, 3))
    for part in parts:
        d = part.com - com
        inertia += part.inertia + part.mass * (d @ d * np.eye(3) - np.outer(d, d))
    return RigidInertia(float(mass), com, inertia)


def fault(body: RigidInertia) -> str:
    """Why no rigid body has this inertia; empty when there is nothing wrong."""
    if body.mass == 0.0:
        return "has no mass"
    a, b, c = np.linalg.eigvalsh(body.inertia)
    moments = f"principal moments of inertia {a:.3g}, {b:.3g}, {c:.3g} kg m^2"
    if a <= 0.0:
        return f"has {body.mass:g} kg, but {moments}, which are not all positive"
    if c > (a + b) * (1.0 + SLACK):
        return f"has {moments}, the largest of which exceeds the sum of the others"
    return ""


def repaired(body: RigidInertia) -> RigidInertia:
    """The nearest inertia of a rigid body at least as large as a ball of BALL_RADIUS.

        S = tr(J)/2 I - J        second moments of the mass, >= 0 for whatever is made of matter
        principal values of S raised to m r^2/5, those of the ball;    J = tr(S) I - S

    A body without mass becomes a ball of BALL_MASS.    Wensing, Kim and Slotine 2018 for S >= 0.
    """
    mass = body.mass or BALL_MASS
    inertia = body.inertia if body.mass else np.zeros((3, 3))
    values, axes = np.linalg.eigh(0.5 * np.trace(inertia) * np.eye(3) - inertia)
    values = np.maximum(values, 0.2 * mass * BALL_RADIUS**2)
    moments = (axes * values) @ axes.T
    return RigidInertia(mass, body.com, np.trace(moments) * np.eye(3) - moments)
