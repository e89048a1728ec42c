"""The nearest zero of an error: Newton's method of least norm, with random restarts.

If a linkage lies in one line, its closing joint cannot be moved along that line to first order, and Newton's method
cannot leave that configuration. Random restarts, with a fixed seed and growing distances, are refined by least squares,
which do not diverge. Each root found is moved along the set of roots to the one nearest to the start.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from solvers.types import Floats

Error = Callable[[Floats], Floats]  # (m, k) of m places (m, n)

CLOSED = 1e-11  # [m, rad]
_STEP = 1e-6  # of central differences [m, rad]
_ITERATIONS = 50  # of Newton's method
_MAX_IDLE_ITERATIONS = 12  # in a row, without a smaller error
_MAX_STEP = 0.5  # step of Newton's method [m, rad]
_RANK = 1e-9  # singular values below this share of the largest belong to directions without effect
_FAR = 1.0  # [m, rad] a zero further away than this may not be the nearest
_AROUND = (0.1, 0.4, 1.6)  # standard deviations of the starts [m, rad]
STARTS = 6  # of each of them
_EVALUATIONS = 40  # of least squares from each
_SLOW = 1e-3  # least relative reduction of the sum of squares by a step of least squares
_NEWTON_REACH = 1e-2  # [m, rad] from a minimum above this, no zero is within the reach of Newton's method
_HOMING_STEPS = 30  # along the zeros, towards the start


class Zero(NamedTuple):
    """Where the error is least, (n,), and its largest entry there."""

    d: Floats
    left: float

    @property
    def found(self) -> bool:
        """Whether it is a zero."""
        return self.left < CLOSED


def linearized(error: Error, d: Floats) -> tuple[Floats, Floats]:
    """The error at d (n,), (k,), and its Jacobian (k, n) by central differences: all places in one call."""
    n = len(d)
    steps = np.zeros((2 * n + 1, n))
    steps[1 : n + 1], steps[n + 1 :] = _STEP * np.eye(n), -_STEP * np.eye(n)
    rows = error(d + steps)
    return rows[0], (rows[1 : n + 1] - rows[n + 1 :]).T / (2.0 * _STEP)


def jacobian(error: Error, d: Floats) -> Floats:
    """Of the error at d (n,), (k, n)."""
    return linearized(error, d)[1]


def newton(error: Error, d: Floats) -> Zero:
    """The zero near d (n,), by steps of least norm; the best that was met where there is none."""
    best, idle = Zero(d, np.inf), 0
    for _ in range(_ITERATIONS):
        g, J = linearized(error, d)
        size = float(np.abs(g).max())
        best, idle = (Zero(d, size), 0) if size < best.left else (best, idle + 1)
        if best.found or idle == _MAX_IDLE_ITERATIONS:
            break
        step = np.linalg.lstsq(J, -g, rcond=_RANK)[0]
        d = d + step * min(1.0, _MAX_STEP / max(np.abs(step).max(), 1e-300))
    return best


def nearest(error: Error, n: int, starts: int = STARTS) -> Zero:
    """The nearest zero to d = 0 (n,) among those found; without one, the smallest error.

    starts: how many of each distance.
    """
    best = newton(error, np.zeros(n))
    if best.found and np.abs(best.d).max() < _FAR:
        return best
    zeros = [_led_back(error, best)] if best.found else []
    rng = np.random.default_rng(0)
    for size in _AROUND:
        for _ in range(starts):
            zero = _settled(error, size * rng.normal(size=n))
            best = min(best, zero, key=lambda z: z.left)
            zeros += [_led_back(error, zero)] if zero.found else []
        if zeros:  # of mirror images, whose distances differ by rounding, the first
            return min(zeros, key=lambda z: round(float(np.linalg.norm(z.d)), 6))
    return best


def _settled(error: Error, d: Floats) -> Zero:
    """The zero downhill from d, or the minimum of the sum of squares that is there.

    Towards a zero, the sum falls ever faster. Where it hardly falls, there is a minimum of another kind, which most
    starts of a loop that cannot be closed come to; to continue there would take most of the time.
    """
    from scipy.optimize import least_squares

    last: dict[bytes, Floats] = {}

    def here(y: Floats) -> Floats:
        g, J = linearized(error, y)
        last.clear()
        last[y.tobytes()] = J
        return g

    def slope(y: Floats) -> Floats:
        return last[y.tobytes()] if y.tobytes() in last else jacobian(error, y)

    end = least_squares(here, d, slope, ftol=_SLOW, max_nfev=_EVALUATIONS)
    left = float(np.abs(end.fun).max())
    return Zero(end.x, left) if end.status > 0 and left > _NEWTON_REACH else newton(error, end.x)


def _led_back(error: Error, zero: Zero) -> Zero:
    """A zero at which no direction along the zeros leads towards d = 0.

    d <- the point nearest to 0 of the tangent J (d' - d) = 0 at d, or a part of the way to it, and back to a zero.
    """
    step_size = 1.0
    for _ in range(_HOMING_STEPS):
        J = jacobian(error, zero.d)
        goal = np.linalg.lstsq(J, J @ zero.d, rcond=_RANK)[0]
        nearer = newton(error, zero.d + step_size * (goal - zero.d))
        if nearer.found and np.linalg.norm(nearer.d) < np.linalg.norm(zero.d) - 1e-7:
            zero, step_size = nearer, min(1.0, 2.0 * step_size)
        else:
            step_size *= 0.25
        if step_size < 1e-3:
            break
    return zero
