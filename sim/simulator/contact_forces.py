"""Contact forces: the least forces inside the friction cones that balance a load.

    min 1/2 |f|^2   such that   A f = r,   f_i in K_i = {(n, t): |t| <= friction n}

The dual problem is smooth and has as many variables as A has rows: with P the projection onto the cones,

    max r.y - 1/2 |P(A^T y)|^2 - eps/2 |y|^2,   f = P(A^T y)

eps makes the maximum unique. Where no forces balance the load, f are those that miss it least.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.mechanism.short_repr import short_repr
from solvers.types import Floats

__all__ = ["GroundForces", "balanced", "least_forces"]

_EPS = 1e-12  # eps in units of the mean diagonal entry of A A^T
_FIRST, _FALL = 1e-2, 1e-2  # the same where Newton's method does not get there at once, and its factor until it does
_MISSED = 1e-3  # of the load: with more left at _ENOUGH, no forces balance it
_ENOUGH = 1e-6  # eps for which forces that miss the load are the best to six digits
_ITERATIONS = 25
_HALVINGS = 20
_FINE = 1e4  # times the least gradient: where a line search that finds nothing has arrived
_ROUNDING = 1e-13  # of the load: a gradient that ends the iterations
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
    unit = max(float(np.trace(gram)) / count, 1e-300)
    y = np.linalg.solve(gram + _EPS * unit * np.eye(count), load)  # the least forces without cones
    dual = _Dual(A, matrix, load, friction, _ROUNDING * max(float(np.abs(load).max()), 1e-300))
    y, solved = dual.descend(y, _EPS * unit)
    f, missed = dual.forces(y if solved else dual.follow(unit))
    if balanced(missed, load):
        return f, missed
    acting = matrix @ f.ravel()  # f is known to about 1e-4 within the cones; its best multiple exactly
    f *= max(float(acting @ load), 0.0) / max(float(acting @ acting), 1e-300)
    return f, float(np.abs(matrix @ f.ravel() - load).max())


class _Dual(NamedTuple):
    """The dual problem, and Newton's method with a line search for it."""

    A: Floats
    matrix: Floats
    load: Floats
    friction: Floats
    enough: float  # of the gradient

    def forces(self, y: Floats) -> tuple[Floats, float]:
        """(P(A^T y) (k, 3), largest entry of A f - r)."""
        f = _projected(self.matrix.T @ y, self.friction)
        return f, float(np.abs(self.matrix @ f.ravel() - self.load).max())

    def follow(self, unit: float) -> Floats:
        """The minimum from that for large eps: y is about 1/eps where no forces balance the load, or hardly any."""
        y, eps = np.zeros(len(self.load)), _FIRST
        largest = float(np.abs(self.load).max())
        while True:
            y = self.descend(y, eps * unit)[0]
            if eps <= _EPS or (eps <= _ENOUGH and self.forces(y)[1] > _MISSED * largest):
                return y
            further = y / _FALL
            eps *= _FALL
            if self.value(further, eps * unit) < self.value(y, eps * unit):
                y = further

    def value(self, y: Floats, eps: float) -> float:
        """1/2 |P(A^T y)|^2 + eps/2 |y|^2 - r.y"""
        f = _projected(self.matrix.T @ y, self.friction)
        return float(0.5 * np.sum(f**2) + 0.5 * eps * y @ y - self.load @ y)

    def descend(self, y: Floats, eps: float) -> tuple[Floats, bool]:
        """(minimum from y, whether it was reached)."""
        count, now = len(self.load), self.value(y, eps)
        for _ in range(_ITERATIONS):
            forces = self.matrix.T @ y
            slope = _slope(forces, self.friction)
            gradient = self.matrix @ _projected(forces, self.friction).ravel() + eps * y - self.load
            if np.abs(gradient).max() <= self.enough:
                return y, True
            half = np.einsum("nka,kab->nkb", self.A, slope).reshape(count, -1)
            step = -np.linalg.solve(half @ self.matrix.T + eps * np.eye(count), gradient)
            alpha, decrease = 1.0, float(gradient @ step)
            if decrease >= 0.0:
                return y, True
            for _ in range(_HALVINGS):
                there = self.value(y + alpha * step, eps)
                if there <= now + _ARMIJO * alpha * decrease:
                    break
                alpha *= 0.5
            else:
                return y, bool(np.abs(gradient).max() <= _FINE * self.enough)  # rounding is all that is left
            y, now = y + alpha * step, there
        return y, False


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
    n, t = at[:, 0], at[:, 1:]
    side = np.hypot(t[:, 0], t[:, 1])
    sticks, slides = side <= friction * n, (side > friction * n) & (friction * side > -n)
    out = np.where(sticks[:, None, None], np.eye(3), 0.0)
    e, mu = t[slides] / side[slides, None], friction[slides]
    edge = np.column_stack([np.ones(len(e)), mu[:, None] * e])
    along = (n[slides] + mu * side[slides]) / (1.0 + mu**2)
    out[slides] = edge[:, :, None] * edge[:, None, :] / (1.0 + mu**2)[:, None, None]
    out[slides, 1:, 1:] += (mu * along / side[slides])[:, None, None] * (np.eye(2) - e[:, :, None] * e[:, None, :])
    return out
