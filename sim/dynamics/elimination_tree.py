"""The elimination of one tree alone, with LANES right-hand sides: impulses on a few bodies leave the rest still."""

from __future__ import annotations

from typing import NamedTuple

from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import JointFactor
from solvers.compiler import kernel
from solvers.lanes import dot_lanes, load, plus, plus_outer, put, six, spread, store, zeros
from solvers.lu import lu_solve_lanes
from solvers.types import Matrix


class Tree(NamedTuple):
    """Bodies that move together."""

    begin: int
    end: int  # one past the last
    root: int  # body_root of the tree, whose bodies others may lie between; -1 for all bodies that can move


@kernel
def in_tree(model: Model, tree: Tree, i: int) -> bool:
    """Whether body i, of those from begin to end, is one of the tree."""
    return model.body_root[i] == tree.root or (tree.root < 0 and model.body_root[i] >= 0)


@kernel
def clear_tree(model: Model, tree: Tree, X: Matrix, c: int) -> None:
    """X[:, c : c + LANES] = 0 of a tree."""
    for i in range(tree.begin, tree.end):
        if in_tree(model, tree, i):
            for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
                store(X, d, c, spread(0.0))


@kernel
def clear_twists(tree: Tree, P: Matrix) -> None:
    """P = 0 of the bodies of a tree."""
    for i in range(tree.begin, tree.end):
        put(P, 6 * i, 0, zeros())


@kernel
def solve_tree(model: Model, data: Data, tree: Tree, X: Matrix, c: int, P: Matrix) -> None:
    """X := H^-1 (X - S2^T P) of a tree, P := the twists of its bodies.

    X: (nv, ...) columns c to c + LANES; P: (6 nbody, LANES), wrenches that act on the bodies with a minus.
    """
    for i in range(tree.end - 1, tree.begin - 1, -1):
        if not in_tree(model, tree, i):
            continue
        d0 = model.body_vadr[i]
        n = model.body_vadr[i + 1] - d0
        q = model.body_parent[i]
        w = six(P, 6 * i, 0)
        for d in range(d0, d0 + n):
            store(X, d, c, load(X, d, c) - dot_lanes(data.S2, d, 0, w))
        if n == 1:
            store(X, d0, c, data.D[i, JointFactor.INVERSE] * load(X, d0, c))
        elif n > 1:
            lu_solve_lanes(data.D[i], n, int(data.D[i, JointFactor.SWAPS]), X, d0, c)
        if q >= 0 and model.body_root[q] >= 0:
            for d in range(d0, d0 + n):
                w = plus_outer(w, data.U[d], load(X, d, c))
            put(P, 6 * q, 0, plus(six(P, 6 * q, 0), w))
    for i in range(tree.begin, tree.end):
        if in_tree(model, tree, i):
            _come_down(model, data, i, X, c, P)


@kernel
def _come_down(model: Model, data: Data, i: int, X: Matrix, c: int, P: Matrix) -> None:
    """Body i, after its parent: X -= L V_parent, V = V_parent + S3nu X."""
    d0, end, q = model.body_vadr[i], model.body_vadr[i + 1], model.body_parent[i]
    V = zeros()
    if q >= 0 and model.body_root[q] >= 0:
        V = six(P, 6 * q, 0)
        for d in range(d0, end):
            store(X, d, c, load(X, d, c) - dot_lanes(data.L, d, 0, V))
    for d in range(d0, end):
        V = plus_outer(V, data.S3nu[d], load(X, d, c))
    put(P, 6 * i, 0, V)
