"""LU factors of sparse blocks, with full pivoting in each block: systems whose rank may be part of the answer.

Unknowns come in nodes, eliminated in turn. A node has a block of its own on the diagonal, and blocks in the rows and
columns of some nodes behind it, those of its span; the pattern is symmetric and includes the fill. A system of one node
is dense, and its rank is found by its pivots.

    P (A_mm) Q = L U       C := L^-1 P C  of the columns behind,  R := R Q U^-1  of the rows behind,  A' -= R C

Pivots of one node see nothing of the others, so the terms that an elimination adds are watched: where they are far
larger than the entries, rounding would be, too, and the factors are given up.
"""

from __future__ import annotations

from typing import NamedTuple

from solvers.compiler import kernel
from solvers.lanes import LANES, load, spread, store, total
from solvers.types import IntegerMatrix, Integers, Matrix

_GROWTH = 1e4  # bound of the terms that a pivot adds to a matrix whose rows are scaled to one


class Nodes(NamedTuple):
    """The nodes of a matrix. Columns of node m begin at m LANES, so several nodes have at most LANES rows each."""

    size: int
    row: Integers  # (size + 1,) first row of each node
    span: IntegerMatrix  # (size, 1 + 2 i) number of intervals of nodes behind; first and one past the last of each


@kernel
def block_lu_factor(A: Matrix, pivots: Matrix, nodes: Nodes, least: float) -> int:
    """A := its factors; returns the rank, or -1 if an entry is not finite or several nodes cannot be pivoted apart.

    A: (n, LANES size), or (n, at least n) of one node; rows scaled to one, zero between the columns of the nodes.
    pivots: (n, 2) row and column exchanged at each elimination; least: a smaller pivot counts as zero.
    """
    rank = 0
    for m in range(nodes.size):
        first, n = int(nodes.row[m]), int(nodes.row[m + 1] - nodes.row[m])
        found = _factor_node(A, pivots, first, n, LANES * m, least)
        if found < 0 or (found < n and nodes.size > 1):
            return -1
        rank += found
        if nodes.span[m, 0] > 0:
            _columns_behind(A, pivots, nodes, m)
            _rows_behind(A, pivots, nodes, m)
            if not _terms_bounded(A, nodes, m):
                return -1
            _subtract_terms(A, nodes, m)
    return rank


@kernel
def _factor_node(A: Matrix, pivots: Matrix, first: int, n: int, left: int, least: float) -> int:
    """The block of a node, rows from `first` and columns from `left` on; returns its rank, or -1 as above."""
    for r in range(first, first + n):
        for c in range(left, left + n):
            if not abs(A[r, c]) < 1e300:
                return -1
    for k in range(n):
        best = 0.0
        row = k
        col = k
        for r in range(k, n):
            a = A[first + r]
            for c in range(k, n):
                if abs(a[left + c]) > best:
                    best = abs(a[left + c])
                    row = r
                    col = c
        if best < least:
            return k
        pivots[first + k, 0] = row
        pivots[first + k, 1] = col
        p = A[first + k]
        if row != k:
            for c in range(left, left + n):
                p[c], A[first + row, c] = A[first + row, c], p[c]
        if col != k:
            for r in range(first, first + n):
                A[r, left + k], A[r, left + col] = A[r, left + col], A[r, left + k]
        for r in range(first + k + 1, first + n):
            a = A[r]
            f = a[left + k] / p[left + k]
            a[left + k] = f
            for c in range(left + k + 1, left + n):
                a[c] -= f * p[c]
    return n


@kernel
def _columns_behind(A: Matrix, pivots: Matrix, nodes: Nodes, m: int) -> None:
    """C := L^-1 P C"""
    first, n = nodes.row[m], nodes.row[m + 1] - nodes.row[m]
    for s in range(nodes.span[m, 0]):
        for node in range(nodes.span[m, 1 + 2 * s], nodes.span[m, 2 + 2 * s]):
            c = LANES * node
            for k in range(n):
                _exchange(A, first + k, first + int(pivots[first + k, 0]), c)
            for k in range(n):
                x = load(A, first + k, c)
                for r in range(first + k + 1, first + n):
                    store(A, r, c, load(A, r, c) - A[r, LANES * m + k] * x)


@kernel
def _exchange(A: Matrix, i: int, j: int, c: int) -> None:
    """Rows i and j change places, in the LANES columns from c on."""
    if i != j:
        x = load(A, i, c)
        store(A, i, c, load(A, j, c))
        store(A, j, c, x)


@kernel
def _rows_behind(A: Matrix, pivots: Matrix, nodes: Nodes, m: int) -> None:
    """R := R Q U^-1"""
    first, n, left = nodes.row[m], nodes.row[m + 1] - nodes.row[m], LANES * m
    for s in range(nodes.span[m, 0]):
        for r in range(nodes.row[nodes.span[m, 1 + 2 * s]], nodes.row[nodes.span[m, 2 + 2 * s]]):
            a = A[r]
            for k in range(n):
                col = int(pivots[first + k, 1])
                a[left + k], a[left + col] = a[left + col], a[left + k]
            for k in range(n):
                x = a[left + k]
                for j in range(k):
                    x -= a[left + j] * A[first + j, left + k]
                a[left + k] = x / A[first + k, left + k]


@kernel
def _terms_bounded(A: Matrix, nodes: Nodes, m: int) -> bool:
    """Whether |column k of R| |row k of C| is bounded for all pivots k of a node; False if one is not finite."""
    for k in range(nodes.row[m + 1] - nodes.row[m]):
        below = 0.0
        across = spread(0.0)
        for s in range(nodes.span[m, 0]):
            begin, end = nodes.span[m, 1 + 2 * s], nodes.span[m, 2 + 2 * s]
            for r in range(nodes.row[begin], nodes.row[end]):
                below += A[r, LANES * m + k] * A[r, LANES * m + k]
            for node in range(begin, end):
                x = load(A, nodes.row[m] + k, LANES * node)
                across = across + x * x
        if not below * total(across) < _GROWTH * _GROWTH:
            return False
    return True


@kernel
def _subtract_terms(A: Matrix, nodes: Nodes, m: int) -> None:
    """A' -= R C"""
    first, n, left = nodes.row[m], nodes.row[m + 1] - nodes.row[m], LANES * m
    for s in range(nodes.span[m, 0]):
        for r in range(nodes.row[nodes.span[m, 1 + 2 * s]], nodes.row[nodes.span[m, 2 + 2 * s]]):
            for t in range(nodes.span[m, 0]):
                for node in range(nodes.span[m, 1 + 2 * t], nodes.span[m, 2 + 2 * t]):
                    x = load(A, r, LANES * node)
                    for k in range(n):
                        x = x - A[r, left + k] * load(A, first + k, LANES * node)
                    store(A, r, LANES * node, x)


@kernel
def block_lu_solve(A: Matrix, pivots: Matrix, nodes: Nodes, rank: int, B: Matrix) -> None:
    """B (n, LANES) := a solution of A X = B, with the unknowns of one node beyond its rank at zero."""
    for m in range(nodes.size):
        first, n, left = nodes.row[m], nodes.row[m + 1] - nodes.row[m], LANES * m
        used = rank if nodes.size == 1 else n
        for k in range(used):
            _exchange(B, first + k, first + int(pivots[first + k, 0]), 0)
        for k in range(1, used):
            _subtract_rows(A, first + k, left, k, B, first)
        for s in range(nodes.span[m, 0]):
            for r in range(nodes.row[nodes.span[m, 1 + 2 * s]], nodes.row[nodes.span[m, 2 + 2 * s]]):
                _subtract_rows(A, r, left, n, B, first)
    for m in range(nodes.size - 1, -1, -1):
        _solve_node_back(A, pivots, nodes, m, rank, B)


@kernel
def _subtract_rows(A: Matrix, r: int, left: int, n: int, B: Matrix, first: int) -> None:
    """B[r] -= A[r, left : left + n] B[first : first + n]"""
    x = load(B, r, 0)
    for k in range(n):
        x = x - A[r, left + k] * load(B, first + k, 0)
    store(B, r, 0, x)


@kernel
def _solve_node_back(A: Matrix, pivots: Matrix, nodes: Nodes, m: int, rank: int, B: Matrix) -> None:
    """The unknowns of a node, those behind it known."""
    first, n, left = nodes.row[m], nodes.row[m + 1] - nodes.row[m], LANES * m
    for k in range(n):
        for s in range(nodes.span[m, 0]):
            for node in range(nodes.span[m, 1 + 2 * s], nodes.span[m, 2 + 2 * s]):
                behind = nodes.row[node]
                _subtract_rows(A, first + k, LANES * node, nodes.row[node + 1] - behind, B, behind)
    used = rank if nodes.size == 1 else n
    for r in range(first + used, first + n):
        store(B, r, 0, spread(0.0))
    for k in range(used - 1, -1, -1):
        x = load(B, first + k, 0)
        for j in range(k + 1, used):
            x = x - A[first + k, left + j] * load(B, first + j, 0)
        store(B, first + k, 0, (1.0 / A[first + k, left + k]) * x)
    for k in range(used - 1, -1, -1):
        _exchange(B, first + k, first + int(pivots[first + k, 1]), 0)
