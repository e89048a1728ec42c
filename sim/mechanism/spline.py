"""Cubic B-splines: coefficients through heights on a grid, values and derivatives for many points at once.

Compiled code reads the same coefficients in height_field.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from solvers.types import Floats


def spline_coefficients(heights: ArrayLike) -> Floats:
    """(nx + 2, ny + 2) coefficients of the cubic B-spline through heights (nx, ny); not-a-knot at the edges."""
    return spline_coefficients_along(spline_coefficients_along(np.asarray(heights, dtype=np.float64), 0), 1)


def spline_coefficients_along(values: Floats, axis: int) -> Floats:
    """Coefficients along one axis of an array, which gets longer by two."""
    rows = np.moveaxis(values, axis, 0)
    ends = np.zeros((2, rows[0].size))
    out = np.linalg.solve(_collocation(len(rows)), np.concatenate([rows.reshape(len(rows), -1), ends]))
    return np.ascontiguousarray(np.moveaxis(out.reshape(-1, *rows.shape[1:]), 0, axis))


def spline_gradient(rows: Floats) -> Floats:
    """(n, nx, ny) gradients by the heights, from those by the coefficients (n, nx + 2, ny + 2)."""
    across, along = (np.linalg.inv(_collocation(n - 2))[:, : n - 2] for n in rows.shape[1:])
    return np.asarray(across.T @ rows @ along)


def _collocation(n: int) -> Floats:
    """(n + 2, n + 2): values at the grid lines, then the conditions at both edges.

    Four lines and more: no jump of the third derivative at the second line. Fewer: as straight as they can be.
    """
    A = np.zeros((n + 2, n + 2))
    for k in range(n):
        A[k, k : k + 3] = 1 / 6, 4 / 6, 1 / 6
    end = [1.0, -4.0, 6.0, -4.0, 1.0] if n >= 4 else [1.0, -2.0, 1.0] if n > 1 else [1.0, -1.0]
    A[n, : len(end)] = end
    A[n + 1, n + 2 - len(end) :] = end
    return A


def spline(coefficients: Floats, s: Floats, t: Floats) -> tuple[Floats, Floats, Floats]:
    """(F, F_s, F_t) of a cubic B-spline at grid coordinates; see height_field.py."""
    bs, ds, rows = spline_basis(s, coefficients.shape[0])
    bt, dt, columns = spline_basis(t, coefficients.shape[1])
    c = coefficients[rows[..., :, None], columns[..., None, :]]
    across, slopes = _sum_last(c, bt[..., None, :]), _sum_last(c, dt[..., None, :])
    return _sum_last(bs, across), _sum_last(ds, across), _sum_last(bs, slopes)


def spline_values(coefficients: Floats, s: Floats, t: Floats) -> Floats:
    """F of `spline` alone, in half the time."""
    bs, _, rows = spline_basis(s, coefficients.shape[0])
    bt, _, columns = spline_basis(t, coefficients.shape[1])
    c = coefficients[rows[..., :, None], columns[..., None, :]]
    return _sum_last(bs, _sum_last(c, bt[..., None, :]))


def _sum_last(a: Floats, b: Floats) -> Floats:
    """Sums of products along the last axis: with two operands einsum is several times as fast as with three."""
    return np.asarray(np.einsum("...i,...i->...", a, b))


def spline_shares(shape: tuple[int, ...], s: Floats, t: Floats) -> Any:
    """(number of points, nx ny) shares of the coefficients, `shape` (nx, ny), in F at grid coordinates; sparse."""
    from scipy.sparse import csr_array

    bs, _, rows = spline_basis(s.ravel(), shape[0])
    bt, _, columns = spline_basis(t.ravel(), shape[1])
    index = rows[:, :, None] * shape[1] + columns[:, None, :]
    points = np.broadcast_to(np.arange(len(index))[:, None, None], index.shape)
    weights = bs[:, :, None] * bt[:, None, :]
    return csr_array((weights.ravel(), (points.ravel(), index.ravel())), shape=(len(index), shape[0] * shape[1]))


def spline_basis(s: Floats, count: int) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Weights of four coefficients, their derivatives, and which coefficients they are."""
    s = np.clip(s, -4.0, count + 2.0)
    i = np.floor(s)
    t = s - i
    u = 1.0 - t
    b = [u**3 / 6, (4 + t * t * (3 * t - 6)) / 6, (4 + u * u * (3 * u - 6)) / 6, t**3 / 6]
    d = [-0.5 * u * u, t * (1.5 * t - 2), -u * (1.5 * u - 2), 0.5 * t * t]
    index = np.clip(i.astype(np.int64)[..., None] + np.arange(4), 0, count - 1)
    return np.stack(b, axis=-1), np.stack(d, axis=-1), index
