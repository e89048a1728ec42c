"""Contact forces: the least forces inside the friction cones that balance a load.

    min 1/2 |f|^2   such that   A f = r,   f_i in K_i = {(n, t): |t| <= friction n}

The dual problem is smooth and has as many variables as A has rows: with P the projection onto the cones,

    max r.y - 1/2 |P(A^T y)|^2 - eps/2 |y|^2,   f = P(A^T y)

eps makes the maximum unique. Where no forces balance the load, f are those that miss it least.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.mechanism.short_repr import short_repr

Floats = NDArray[np.float64]

__all__ = ["GroundForces", "balanced", "least_forces"]

_EPS = 1e-12  # eps in units of the mean diagonal entry of A A^T
_ITERATIONS = 100
_HALVINGS = 40
_ARMIJO = 1e-4  # share of the predicted decrease that a step must achieve
_BALANCED = 1e-8  # of the largest load: what is left of it where forces balance it


@dataclass(frozen=True)
class GroundForces:
    """Contact forces for an acceleration, and the forces of the joints beside them.

    Attributes:
        names: names of the k contacts.
        forces: (..., k, 3) forces on the robot, world axes [N].
        joint_forces: (..., nv) forces of the joints, M dv + b + g - J^T f [N, N m].
        residual: (...) largest part of the load that no forces inside the cones balance [N, N m].
        success: (...) whether the forces balance the load.
    """

    names: tuple[str, ...]
    forces: Floats
    joint_forces: Floats
    residual: Floats
    success: NDArray[np.bool_]

    __repr__ = short_repr


def least_forces(A: Floats, load: Floats, friction: Floats) -> tuple[Floats, float]:
    """The least forces inside the friction cones that balance a load.

    Args:
        A: (n, k, 3) load per unit of every force; components are normal, and two tangents.
        load: (n,) load r [N, N m].
        friction: (k,) coefficients of friction.

    Returns:
        (forces (k, 3) [N], largest entry of A f - r).
    """
    count, k, _ = A.shape
    if count == 0 or k == 0:
        return np.zeros((k, 3)), float(np.abs(load).max(initial=0.0))
    matrix = A.reshape(count, -1)
    gram = matrix @ matrix.T
    eps = _EPS * max(float(np.trace(gram)) / count, 1e-300)
    y = np.linalg.solve(gram + eps * np.eye(count), load)  # the least forces without cones

    def value(y: Floats) -> float:
        f = _projected(matrix.T @ y, friction)
        return float(0.5 * np.sum(f**2) + 0.5 * eps * y @ y - load @ y)

    now = value(y)
    for _ in range(_ITERATIONS):
        f, slope = _projected(matrix.T @ y, friction), _slope(matrix.T @ y, friction)
        gradient = matrix @ f.ravel() + eps * y - load
        H = np.einsum("nka,kab,mkb->nm", A, slope, A) + eps * np.eye(count)
        step = -np.linalg.solve(H, gradient)
        alpha, decrease = 1.0, float(gradient @ step)
        if decrease >= 0.0:
            break
        for _ in range(_HALVINGS):
            there = value(y + alpha * step)
            if there <= now + _ARMIJO * alpha * decrease:
                break
            alpha *= 0.5
        else:
            break  # rounding is all that is left
        y, now = y + alpha * step, there
    f = _projected(matrix.T @ y, friction)
    return f, float(np.abs(matrix @ f.ravel() - load).max())


def balanced(residual: float, load: Floats) -> bool:
    """Whether forces balance a load up to rounding.

    Args:
        residual: largest part that is left [N, N m].
        load: (n,) load [N, N m].

    Returns:
        Whether they do.
    """
    return residual <= _BALANCED * max(1.0, float(np.abs(load).max(initial=0.0)))


def _projected(forces: Floats, friction: Floats) -> Floats:
    """(k, 3) nearest points of the cones."""
    out = forces.reshape(-1, 3).copy()
    normal, side = out[:, 0].copy(), np.hypot(out[:, 1], out[:, 2])
    sticks, parts = side <= friction * normal, friction * side <= -normal
    slides = ~sticks & ~parts
    along = (normal + friction * side) / (1.0 + friction**2)
    out[parts] = 0.0
    out[slides, 0] = along[slides]
    out[slides, 1:] *= (friction * along / np.where(side > 0.0, side, 1.0))[slides, None]
    return out


def _slope(forces: Floats, friction: Floats) -> Floats:
    """(k, 3, 3) derivatives of the nearest points."""
    at = forces.reshape(-1, 3)
    out = np.zeros((len(at), 3, 3))
    for i, (n, *t) in enumerate(at):
        mu, side = friction[i], float(np.hypot(*t))
        if side <= mu * n:
            out[i] = np.eye(3)
        elif mu * side > -n:
            e = np.array(t) / side
            edge, along = np.array([1.0, *(mu * e)]), (n + mu * side) / (1.0 + mu**2)
            out[i] = np.outer(edge, edge) / (1.0 + mu**2)
            out[i, 1:, 1:] += mu * along / side * (np.eye(2) - np.outer(e, e))
    return out
