"""Coefficients of the steps of order 4, 6 and 8."""

from __future__ import annotations

import numpy as np
import pytest

from sim.integrators.tableau import tableau
from support.smooth_mechanisms import ORDERS


def trees(size: int) -> list[tuple]:
    """Rooted trees with this number of nodes, as sorted tuples of the trees below the root."""
    if size == 1:
        return [()]
    parts = {()}
    for _ in range(size - 1):  # hang one more leaf anywhere
        parts = {tuple(sorted(t)) for old in parts for t in _grown(old)}
    return sorted(parts)


def _grown(tree: tuple) -> list[tuple]:
    below = [(*tree[:k], new, *tree[k + 1 :]) for k in range(len(tree)) for new in _grown(tree[k])]
    return [tuple(sorted(t)) for t in ((*tree, ()), *below)]


def _size(tree: tuple) -> int:
    return 1 + sum(map(_size, tree))


def _density(tree: tuple) -> int:
    return _size(tree) * int(np.prod([_density(t) for t in tree], dtype=int))


def _weight(tree: tuple, a: np.ndarray) -> np.ndarray:
    out = np.ones(len(a))
    for t in tree:
        out = out * (a @ _weight(t, a))
    return out


@pytest.mark.parametrize("order", ORDERS)
def test_coefficients_meet_the_order_conditions(order: int) -> None:
    """Sum of b_i over every rooted tree is 1 over its density (Butcher): 200 conditions for order 8."""
    a, b = tableau(order)
    assert np.all(np.triu(a) == 0.0)
    for size in range(1, order + 1):
        for tree in trees(size):
            assert abs(b @ _weight(tree, a) - 1.0 / _density(tree)) < 1e-13, tree
    assert any(abs(b @ _weight(tree, a) - 1.0 / _density(tree)) > 1e-7 for tree in trees(order + 1))
