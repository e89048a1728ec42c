"""Lanes load, keep and store the values of the rows; six rows of lanes as wrenches."""

import numpy as np

from solvers.compiler import local_kernel
from solvers.lanes import (
    LANES,
    at_least,
    dot_lanes,
    keep,
    load,
    lowest,
    minus_outer,
    plus,
    plus_outer,
    put,
    root,
    six,
    spread,
    store,
    whole,
)


@local_kernel
def _arithmetic(A, bits, f):
    x, y = load(A, 0, 3), load(A, 1, 0)
    store(A, 2, 1, f * x + y * x - spread(2.0))
    store(A, 3, 0, keep(bits, y))


@local_kernel
def _rows(S, P):
    w = six(P, 0, 0)
    x = dot_lanes(S, 0, 1, w)
    put(P, 6, 0, plus_outer(w, S[1], x))
    put(P, 12, 0, minus_outer(plus(w, w), S[1], x))


@local_kernel
def _roots(A, bound):
    x, y = load(A, 0, 0), load(A, 1, 0)
    store(A, 2, 0, root(at_least(x, bound)) / y)
    A[3, 0] = lowest(x)


def both(kernel, *arguments):
    """The arguments after the compiled kernel; the Python function has to leave the same values."""
    copies = [[a.copy() if isinstance(a, np.ndarray) else a for a in arguments] for _ in range(2)]
    kernel(*copies[0])
    kernel.py_func(*copies[1])
    for a, b in zip(*copies, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-14, atol=1e-14)
    return copies[0]


def test_roots_quotients_and_bounds(rng):
    A = rng.normal(size=(4, LANES))
    out, bound = both(_roots, A, 0.1)
    assert out[3, 0] == A[0].min()
    np.testing.assert_allclose(out[2], np.sqrt(np.maximum(A[0], 0.1)) / A[1], rtol=1e-14)


def test_arithmetic(rng):
    A = rng.normal(size=(4, 2 * LANES))
    out, bits, f = both(_arithmetic, A, 0b01001101, 1.7)
    x, y = A[0, 3 : 3 + LANES], A[1, :LANES]
    np.testing.assert_allclose(out[2, 1 : 1 + LANES], f * x + y * x - 2.0, rtol=1e-14)
    chosen = np.array([bits >> k & 1 for k in range(LANES)], dtype=bool)
    np.testing.assert_array_equal(out[3, :LANES], np.where(chosen, y, 0.0))
    np.testing.assert_array_equal(out[2, [0, *range(1 + LANES, 2 * LANES)]], A[2, [0, *range(1 + LANES, 2 * LANES)]])


def test_masked_lanes_may_hold_anything():
    A = np.full((4, 2 * LANES), np.nan)
    A[1, 0] = 3.0
    out = A.copy()
    _arithmetic(out, 1, 0.0)
    np.testing.assert_array_equal(out[3, :LANES], np.r_[3.0, np.zeros(LANES - 1)])


def test_six_rows(rng):
    S, P = rng.normal(size=(2, 7)), rng.normal(size=(18, LANES))
    out = P.copy()
    _rows(S, out)
    w = P[:6]
    x = S[0, 1:] @ w
    np.testing.assert_allclose(out[6:12], w + np.outer(S[1, :6], x), rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(out[12:], 2.0 * w - np.outer(S[1, :6], x), rtol=1e-13, atol=1e-13)


def test_whole():
    assert [whole(n) for n in (0, 1, LANES - 1, LANES, LANES + 1)] == [0, LANES, LANES, LANES, 2 * LANES]
