"""Bounds checks: NUMBA_BOUNDSCHECK=1 finds reads and writes of kernels outside an array, before its start too."""

from __future__ import annotations

import numpy as np
import pytest

import dojo_opt as dojo
from support.fork_server import forked

PROGRAM = """
import numpy as np
from solvers.compiler import kernel
from solvers.lanes import load, spread, store, total

@kernel
def _entry(a, i):
    return a[i]

@kernel
def _row(A, i, j):
    row = A[i]
    return row[j]

@kernel
def _pair(A, i, j):
    return A[i, j]

@kernel
def _write(a, i):
    a[i] = 1.0
    return 0.0

@kernel
def _caller(a, i):
    return _entry(a, i)

@kernel
def _lanes(A, i, j):
    return total(load(A, i, j))

@kernel
def _keep(A, i, j):
    store(A, i, j, spread(1.0))
    return 0.0

@kernel
def _last(A):
    return A[-1, -2] + A[-1][-1]

A = np.arange(12.0).reshape(3, 4)
wide = np.arange(24.0).reshape(3, 8)
part = A.ravel()[4:8]
for call in (
    lambda: _entry(part, -1), lambda: _entry(part, 4), lambda: _row(A, -1, 0), lambda: _row(A, 0, -1),
    lambda: _pair(A, 0, 4), lambda: _pair(A, 0, -1), lambda: _pair(A, -3, 0), lambda: _pair(A, 3, 0),
    lambda: _write(part, -1), lambda: _caller(part, -1),
    lambda: _lanes(wide[1:], 0, -1), lambda: _lanes(wide, 3, 0), lambda: _keep(wide[1:], -1, 0),
):
    try:
        print("read", call())
    except IndexError as error:
        print(error)
print(_last(A), _entry(part, 3), _row(A, 2, 3), _pair(A, 2, 3), _lanes(wide, 1, 0))
"""


@pytest.mark.slow
@pytest.mark.parametrize("plain", ["0", "1"])
def test_a_negative_index_that_is_not_written_as_a_number_is_refused(plain):
    *errors, last = forked(PROGRAM, NUMBA_BOUNDSCHECK="1", DOJO_OPT_PLAIN_NUMBA=plain).splitlines()
    errors, lanes = errors[:-3], errors[-3:]
    assert lanes == 3 * ["lanes that begin outside their matrix"]
    assert last == "21.0 7.0 11.0 11.0 92.0"
    if plain == "1":  # Numba's own look at bounds, and the one at negative indices
        assert {*errors} == {"index is out of bounds", "index that is negative"} and len(errors) == 10
        return
    names = "_entry _entry _row _row _pair _pair _pair _pair _write _entry".split()
    assert [error.split(":")[0] for error in errors] == [f"kernel {name}" for name in names]
    assert "index outside A, axis 1, or negative" in errors[4] and "axis 0" in errors[6]


@pytest.mark.parametrize("boundscheck", [True, False])
def test_a_users_function_counts_negative_indices_from_the_end(boundscheck):
    """As Numba does, with checks and without; -1 is no literal here."""

    @dojo.jit(boundscheck=boundscheck)
    def last(x, u, out):
        i = u.shape[0] - 2
        out[i] = 10.0 * x[i] + x[i - 1]

    x, out = np.arange(8.0), np.zeros(3)
    last(x[2:6], np.zeros(1), out[1:])
    assert list(out) == [0.0, 0.0, 54.0]


def test_a_users_function_is_refused_an_index_before_the_begin():
    @dojo.jit
    def before(x, u, out):
        out[0] = x[-1 - x.shape[0]]

    with pytest.raises(IndexError):
        before(np.arange(8.0)[4:], np.zeros(1), np.zeros(1))
