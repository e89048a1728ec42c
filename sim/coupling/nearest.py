"""The nearest zero of an error: Newton's method of least norm, begun again from elsewhere where that ends nowhere.

Where a linkage lies in one line, its closing joint cannot be moved along that line to first order, and no step of
Newton's method leads out of there. Other starts, drawn with a fixed seed around the first and further away as long as
nothing is found, are led towards the zeros by least squares, which do not diverge; and every zero that is found is led
back along the zeros to the one that is nearest there.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Error = Callable[[Floats], Floats]

CLOSED = 1e-11  # [m], and as much of an angle
_STEP = 1e-6  # of central differences [m, rad]
_ITERATIONS = 50  # of Newton's method
_IDLE = 12  # of them in a row that bring nothing
_LONGEST = 0.5  # step of Newton's method [m, rad]
_RANK = 1e-9  # singular values below this share of the largest belong to directions without effect
_FAR = 1.0  # [m, rad] a zero further away than this may not be the nearest
_AROUND = (0.1, 0.4, 1.6)  # standard deviations of the starts [m, rad]
_STARTS = 6  # of each of them
_EVALUATIONS = 40  # of least squares from each
_BACK = 30  # steps along the zeros


class Zero(NamedTuple):
    """Where the error is least, (n,), and its largest entry there."""

    d: Floats
    left: float

    @property
    def found(self) -> bool:
        """Whether it is a zero."""
        return self.left < CLOSED


def jacobian(error: Error, d: Floats) -> Floats:
    """Of the error at d, (m, n), by central differences."""
    return np.array([error(d + e) - error(d - e) for e in _STEP * np.eye(len(d))]).T / (2.0 * _STEP)


def newton(error: Error, d: Floats) -> Zero:
    """The zero near d (n,), by steps of least norm; the best that was met where there is none."""
    best, idle = Zero(d, np.inf), 0
    for _ in range(_ITERATIONS):
        g = error(d)
        size = float(np.abs(g).max())
        best, idle = (Zero(d, size), 0) if size < best.left else (best, idle + 1)
        if best.found or idle == _IDLE:
            break
        step = np.linalg.lstsq(jacobian(error, d), -g, rcond=_RANK)[0]
        d = d + step * min(1.0, _LONGEST / max(np.abs(step).max(), 1e-300))
    return best


def nearest(error: Error, n: int) -> Zero:
    """The zero nearest to d = 0 (n,) of those that are found; the least error that was met where there is none."""
    best = newton(error, np.zeros(n))
    if best.found and np.abs(best.d).max() < _FAR:
        return best
    zeros = [_led_back(error, best)] if best.found else []
    rng = np.random.default_rng(0)
    for size in _AROUND:
        for _ in range(_STARTS):
            zero = newton(error, _settled(error, size * rng.normal(size=n)))
            best = min(best, zero, key=lambda z: z.left)
            zeros += [_led_back(error, zero)] if zero.found else []
        if zeros:  # of mirror images, whose distances differ by rounding, the first
            return min(zeros, key=lambda z: round(float(np.linalg.norm(z.d)), 6))
    return best


def _settled(error: Error, d: Floats) -> Floats:
    """Where the sum of squares of the error has a minimum, downhill from d."""
    from scipy.optimize import least_squares

    return np.asarray(least_squares(error, d, lambda y: jacobian(error, y), max_nfev=_EVALUATIONS).x)


def _led_back(error: Error, zero: Zero) -> Zero:
    """A zero at which no direction along the zeros leads towards d = 0.

    d <- the point nearest to 0 of the tangent J (d' - d) = 0 at d, or a part of the way to it, and back to a zero.
    """
    share = 1.0
    for _ in range(_BACK):
        J = jacobian(error, zero.d)
        goal = np.linalg.lstsq(J, J @ zero.d, rcond=_RANK)[0]
        nearer = newton(error, zero.d + share * (goal - zero.d))
        if nearer.found and np.linalg.norm(nearer.d) < np.linalg.norm(zero.d) - 1e-7:
            zero, share = nearer, min(1.0, 2.0 * share)
        else:
            share *= 0.25
        if share < 1e-3:
            break
    return zero
