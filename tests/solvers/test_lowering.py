"""Arrays and numbers behave in kernels as in Python, although the compiler writes some of their instructions itself."""

from __future__ import annotations

import os
from enum import IntEnum
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from solvers.compiler import Field, kernel, local_kernel, record, table
from solvers.types import Matrix, Vector

pytestmark = pytest.mark.kernel


@kernel
def _negative(a, i, out):
    """Indices from the end, written as numbers, combined with others, of an entry and of a row."""
    row = a[-1]
    out[0] = a[i, -2]
    out[1] = row[i]
    out[-1] = a[i][i]
    out[2] = a[i - 1, i]


@kernel
def _variable_index(a, i, out):
    """An index kept in a variable does not change with its parts."""
    at = (i, i + 1)
    i += 1
    out[0] = a[at]
    out[1] = a[i, 0]
    if out[0] > 0.0:
        at = (0, 0)
    out[2] = a[at]


@kernel
def _deep(c, t, out):
    """Rows and entries of three dimensions, their shapes, strides and sizes."""
    page = c[t]
    row = c[t, 1]
    out[0] = page[1, 2] + row[3] + c[t, 0, 1]
    out[1] = page.shape[0] * 100 + row.shape[0] * 10 + page.size
    out[2] = page.strides[0] + row.strides[0]
    for k in range(row.shape[0]):
        row[k] += k
    tail = row[1:]
    tail[0] = 7.0


@kernel
def _ranges(n, m, k, out):
    """Ranges up and down, with steps of more than one and steps that are not written as numbers, left early, chosen."""
    for i in range(n):
        out[0] += i
    for i in range(m, n, 3):
        out[0] += 7 * i
    for i in range(n, m, -1):
        out[1] += 5 * i
    for i in range(n, m, -2):
        out[1] += 11 * i
    for i in range(m, n, k):
        out[2] += 13 * i
    for i in range(n):
        if i == 3:
            break
        for j in range(i):
            if j == 1:
                continue
            out[3] += i - j
    else:
        out[3] += 1000
    chosen = range(n) if m > 0 else range(m, n)
    for i in chosen:
        out[3] += 17 * i
    out[2] += len(range(m, n))


class _Column(IntEnum):
    """Names of columns."""

    FIRST = 0
    THIRD = 2


@kernel
def _named(a, i, out):
    """Columns by name, of an entry, of an entry of a row, and of the result."""
    out[_Column.FIRST] = a[i, _Column.THIRD]
    row = a[i]
    row[_Column.FIRST] += 2.0
    out[_Column.THIRD] = row[_Column.FIRST] + a[i, _Column.FIRST]


@kernel
def _mixed(n, x, counts, out):
    """Whole numbers among reals, and reals cut to whole numbers."""
    counts[0] = 7.9
    counts[1] += n
    out[0] = n
    out[1] = n / 2
    out[2] = x * n - counts[1]
    out[n] = 2 * counts[0] + (n > x)


@kernel
def _compared(x, y, out):
    """Every comparison with NaN is false, except `!=`."""
    out[0] = 1.0 * (x < y) + 2.0 * (x <= y) + 4.0 * (x > y) + 8.0 * (x >= y)
    out[1] = 1.0 * (x == y) + 2.0 * (x != y)
    out[2] = x / y


@kernel
def _loop(a, out):
    """Variables of several blocks, and one that a loop ends with."""
    best = -1
    for i in range(a.shape[0]):
        row = a[i]
        if row[0] > 0.0:
            best = i
            kept = row
        if best >= 0:
            out[0] += kept[1]
    out[1] = best
    out[2] = a[max(best, 0), 1]


class _Two(NamedTuple):
    """A record of two arrays."""

    x: Matrix  # (3, 4)
    y: Vector  # (4,)


_two_at = record(_Two, [Field("x", False, 4), Field("y", False, None)])


@kernel
def _add(a, b):
    """The same memory, maybe, by other names."""
    for k in range(a.shape[0]):
        a[k] += b[0]


@kernel
def _met(at, i, j, out):
    """Rows of a field are written and read in turns, by their own names and by those of other kernels."""
    two = _two_at(at)
    a, b, y = two.x[i], two.x[j], two.y
    for k in range(4):
        a[k] = y[k] + b[0]
        y[k] = a[k] + two.x[i, 0]
        two.x[j, k] += a[0]
    _add(a, b)
    _add(two.x[j], y)
    out[0], out[1] = a[0] + b[1], two.x[i, 3] + y[2]
    _add(y, two.x[i])
    out[2] = y[0] + y[3]


def _matrix() -> np.ndarray:
    return np.arange(12.0).reshape(3, 4) - 5.0


def _cube() -> np.ndarray:
    return np.arange(24.0).reshape(2, 3, 4)


_CASES = [
    (_negative, lambda: (_matrix(), 2)),
    (_negative, lambda: (_matrix(), 1)),
    (_variable_index, lambda: (_matrix(), 1)),
    (_variable_index, lambda: (_matrix(), 0)),
    (_named, lambda: (_matrix(), 1)),
    (_deep, lambda: (_cube(), 1)),
    (_deep, lambda: (_cube(), 0)),
    (_mixed, lambda: (3, 2.5, np.arange(4))),
    (_mixed, lambda: (0, 2.5, np.arange(4))),
    (_compared, lambda: (1.0, np.nan)),
    (_compared, lambda: (np.float64(1.0), np.float64(-0.0))),
    (_compared, lambda: (2.0, 2.0)),
    (_loop, lambda: (_matrix(),)),
    (_loop, lambda: (-_matrix(),)),
    *(
        (_ranges, lambda n=n, m=m, k=k: (n, m, k))
        for n in (-3, 0, 1, 5, 10)
        for m in (-4, 0, 3, 12)
        for k in (1, 2, -1)
    ),
]


@pytest.mark.parametrize(("kernel_", "arguments"), _CASES)
def test_the_same_as_in_python(kernel_, arguments):
    ours, theirs = arguments(), arguments()
    out, expected = np.zeros(4), np.zeros(4)
    with np.errstate(divide="ignore"):  # of Python, and of a kernel that runs uncompiled
        kernel_(*ours, out)
        getattr(kernel_, "py_func", kernel_)(*theirs, expected)
    assert np.array_equal(out, expected, equal_nan=True)
    for a, b in zip(ours, theirs, strict=True):
        assert np.array_equal(a, b, equal_nan=True)


@pytest.mark.parametrize(("i", "j"), [(0, 1), (1, 1), (2, 0)])
def test_rows_of_a_field_may_be_one(i, j):
    """The compiler takes no two fields of a record for the same memory, but rows of one."""
    results = []
    for run in (_met, getattr(_met, "py_func", _met)):
        two, out = _Two(_matrix(), np.arange(4.0)), np.zeros(3)
        run(table(two), i, j, out)
        results.append(np.concatenate([two.x.ravel(), two.y, out]))
    assert np.array_equal(*results)


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="looks at compiled code")
@pytest.mark.skipif(
    os.environ.get("DOJO_OPT_PLAIN_NUMBA", "0") not in ("", "0"), reason="Numba asks whether indices are negative"
)
def test_columns_by_name_take_the_instructions_of_numbers():
    def by_number(a, i):
        return a[i, 2]

    def by_name(a, i):
        return a[i, _Column.THIRD]

    code = []
    for func in (by_number, by_name):
        compiled = local_kernel(func).entry
        compiled(_matrix(), 1)
        (text,) = compiled.inspect_llvm().values()
        code.append({word: text.count(word) for word in (" icmp ", " select ", " add ", " load ")})
    assert code[0] == code[1]


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="looks at compiled code")
@pytest.mark.skipif(os.environ.get("DOJO_OPT_PLAIN_NUMBA", "0") not in ("", "0"), reason="Numba writes sixty")
def test_a_loop_over_a_range_takes_few_instructions_before_it_is_optimized():
    def total(n: int) -> int:
        found = 0
        for i in range(n):
            found += i
        return found

    form = local_kernel(total).inner
    form.compile((numba.types.int64,))
    (code,) = form.overloads.values()
    module = code.library._get_module_for_linking()
    blocks = [[*block.instructions] for f in module.functions for block in f.blocks]
    assert sum(map(len, blocks)) <= 25
    assert not any(i.opcode in ("srem", "sdiv") for block in blocks for i in block)


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="looks at compiled code")
@pytest.mark.skipif(os.environ.get("DOJO_OPT_PLAIN_NUMBA", "0") not in ("", "0"), reason="Numba writes four rounds")
@pytest.mark.parametrize(("rounds", "written"), [("a.shape[0]", 1), ("3", 3)])
def test_rounds_of_a_loop_are_written_side_by_side_only_where_their_number_is_known(rounds: str, written: int):
    names: dict[str, Any] = {}
    exec(f"def product(a):\n    x = a[0]\n    for i in range({rounds}):\n        x *= a[i]\n    return x", names)
    compiled = local_kernel(names["product"]).entry
    assert compiled(np.array([2.0, 3.0, 4.0])) == 48.0
    (text,) = compiled.inspect_llvm().values()
    assert text.count(" fmul ") == written
