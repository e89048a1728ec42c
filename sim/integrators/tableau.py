"""Explicit Runge-Kutta methods of order 4, 6 and 8: coefficients, and stability limits."""

from __future__ import annotations

from functools import cache

import numpy as np

from solvers.types import Floats


@cache
def tableau(order: int) -> tuple[Floats, Floats]:
    """(a (s, s), b (s,)) of the method of an order.

    4  the classical one, of 4 stages (Kutta 1901)
    6  Verner's, of 7 that count (SIAM J. Numer. Anal. 15, 1978); Butcher's of 1964 feeds energy into vibrations
    8  Dormand and Prince's, of 12, as in DOP853 (Hairer, Norsett, Wanner, Solving ODEs I, 1993), read from SciPy

    Tried and slower by a factor of 3 to 4 for the same error: compositions of the variational step (5, 9, 15
    intervals) and Gauss methods, both of which bound the energy over any time instead.
    """
    if order == 8:
        from scipy.integrate import DOP853

        return np.ascontiguousarray(DOP853.A[:12, :12]), np.array(DOP853.B)
    if order == 4:
        return _filled((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)), np.array([1 / 6, 1 / 3, 1 / 3, 1 / 6])
    a = _filled(
        (),
        (1 / 6,),
        (4 / 75, 16 / 75),
        (5 / 6, -8 / 3, 5 / 2),
        (-165 / 64, 55 / 6, -425 / 64, 85 / 96),
        (-8263 / 15000, 124 / 75, -643 / 680, -81 / 250, 2484 / 10625),
        (3501 / 1720, -300 / 43, 297275 / 52632, -319 / 2322, 24068 / 84065, 3850 / 26703),
    )
    return a, np.array([3 / 40, 0.0, 875 / 2244, 23 / 72, 264 / 1955, 125 / 11592, 43 / 616])


@cache
def embedded() -> tuple[Floats, Floats]:
    """Weights (s + 1,) of the rates of the stages of order 8 and of its end: less orders 5 and 3, from SciPy."""
    from scipy.integrate import DOP853

    return np.array(DOP853.E5), np.array(DOP853.E3)


def _filled(*rows: tuple[float, ...]) -> Floats:
    """The square matrix with these beginnings of its rows."""
    return np.array([[*row, *[0.0] * (len(rows) - len(row))] for row in rows])


@cache
def stable(order: int) -> float:
    """Stability limits of |h lambda| along the negative real and the imaginary axis: |1 + z b (I - z a)^-1 1| <= 1."""
    a, b = tableau(order)
    one, far = np.ones(len(b)), np.inf
    for direction in (-1.0, 1j):
        for size in np.arange(0.05, 20.0, 0.05):
            z = direction * size
            if abs(1.0 + z * (b @ np.linalg.solve(np.eye(len(b)) - z * a, one))) > 1.0 + 1e-4:
                far = min(far, size - 0.05)
                break
    return float(far)
