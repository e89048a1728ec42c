"""LU factors of sparse blocks against NumPy."""

import numpy as np
import pytest

from solvers.block_lu import Nodes, block_lu_factor, block_lu_solve
from solvers.lanes import LANES

pytestmark = pytest.mark.kernel

SIZES = (3, 6, 1, 6, 0, 4)  # rows of the nodes


def dense(linked, rng):
    """A matrix with the pattern of the linked nodes, rows scaled to one, and its places in columns of LANES."""
    row = np.concatenate([[0], np.cumsum(SIZES)])
    A = np.zeros((row[-1], row[-1]))
    for i in range(len(SIZES)):
        for j in range(len(SIZES)):
            if i == j or linked[i, j]:
                block = np.s_[row[i] : row[i + 1], row[j] : row[j + 1]]
                A[block] = rng.normal(size=A[block].shape) + (5.0 * np.eye(SIZES[i]) if i == j else 0.0)
    columns = np.concatenate([LANES * m + np.arange(n) for m, n in enumerate(SIZES)])
    return A / np.abs(A).max(axis=1, keepdims=True), row, columns


def filled(linked):
    """The pattern with its fill, and the intervals of the nodes behind each."""
    linked = linked.copy()
    spans = np.zeros((len(linked), len(linked) + 2), dtype=np.int64)
    for m in range(len(linked)):
        behind = [j for j in range(m + 1, len(linked)) if linked[m, j]]
        linked[np.ix_(behind, behind)] = True
        for j in behind:
            if j - 1 not in behind:
                spans[m, 1 + 2 * spans[m, 0]] = j
                spans[m, 0] += 1
            spans[m, 2 * spans[m, 0]] = j + 1
    return linked, spans


def spread(A, columns):
    """A with its columns where the nodes have theirs."""
    out = np.zeros((len(A), LANES * len(SIZES)))
    out[:, columns] = A
    return out


@pytest.mark.parametrize("density", [0.0, 0.3, 0.6, 1.0])
def test_sparse_systems(density):
    rng = np.random.default_rng(7)
    exchanged = 0
    for _ in range(10):
        linked = rng.random((len(SIZES), len(SIZES))) < density
        linked |= linked.T
        A, row, columns = dense(linked, rng)
        nodes = Nodes(len(SIZES), row, filled(linked)[1])
        T, pivots, X = spread(A, columns), np.zeros((len(A), 2)), rng.normal(size=(len(A), LANES))
        B = X.copy()
        assert block_lu_factor(T, pivots, nodes, 1e-300) == len(A)
        block_lu_solve(T, pivots, nodes, len(A), X)
        np.testing.assert_allclose(A @ X, B, atol=1e-11)
        exchanged += np.count_nonzero(pivots)
    assert exchanged > 0


def test_the_rank_of_one_node():
    rng = np.random.default_rng(3)
    A = rng.normal(size=(7, 4)) @ rng.normal(size=(4, 7))
    nodes = Nodes(1, np.array([0, 7]), np.zeros((1, 3), dtype=np.int64))
    T, pivots = np.hstack([A, np.zeros((7, 1))]), np.zeros((7, 2))
    assert block_lu_factor(T, pivots, nodes, 1e-10) == 4
    X = np.repeat(A @ rng.normal(size=(7, 1)), LANES, axis=1)
    B = X.copy()
    block_lu_solve(T, pivots, nodes, 4, X)
    np.testing.assert_allclose(A @ X, B, atol=1e-11)
    assert np.count_nonzero(X[:, 0]) == 4


@pytest.mark.parametrize("corner", [0.0, 1e-9, np.nan, np.inf])
def test_nodes_that_have_to_be_pivoted_together_are_given_up(corner):
    nodes = Nodes(2, np.array([0, 1, 2]), np.array([[1, 1, 2], [0, 0, 0]]))
    T = np.zeros((2, 2 * LANES))
    T[0, 0], T[0, LANES], T[1, 0], T[1, LANES] = corner, 1.0, 1.0, 1.0
    assert block_lu_factor(T, np.zeros((2, 2)), nodes, 1e-300) == -1


@pytest.mark.parametrize("entry", [np.nan, np.inf])
def test_entries_beside_the_diagonal_that_are_not_finite_are_found(entry):
    nodes = Nodes(2, np.array([0, 1, 2]), np.array([[1, 1, 2], [0, 0, 0]]))
    for row, column in ((0, LANES), (1, 0)):
        T = np.zeros((2, 2 * LANES))
        T[0, 0] = T[1, LANES] = 1.0
        T[row, column] = entry
        with np.errstate(invalid="ignore"):  # 0 times infinity, where the kernel runs uncompiled
            assert block_lu_factor(T, np.zeros((2, 2)), nodes, 1e-300) == -1
