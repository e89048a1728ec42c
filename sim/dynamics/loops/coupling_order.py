"""The order in which active couplings and gears are eliminated, and their connections: nodes of solvers/block_lu.py.

An impulse moves the trees of its two bodies and no others. So the equations of a coupling have the impulses of those
that share a tree with it, and of further ones by fill. The next to be eliminated is the one that meets the fewest
others: of a tower the topmost pair, or the lowest, so that its cost is that of its height. Order and links last
until other couplings are active.

Redundant constraints are found by pivots over all rows. Where there are loops or gears, one node holds all of them.
"""

from __future__ import annotations

from sim.dynamics.elimination_tree import Tree
from sim.model.data import Data
from sim.model.model import Model
from solvers.compiler import kernel


@kernel
def coupled_bodies(model: Model, k: int) -> tuple[int, int]:
    """The bodies of coupling k, or of gear k less the number of couplings; -1 for the world."""
    count = model.coupling_body.shape[0]
    if k < count:
        return model.coupling_body[k, 0], model.coupling_body[k, 1]
    return model.dof_body[model.gear_dof[k - count, 0]], model.dof_body[model.gear_dof[k - count, 1]]


@kernel
def is_apart(model: Model) -> bool:
    """Whether couplings are eliminated one by one: those of contacts alone."""
    return model.loop_ntrans.shape[0] + model.gear_dof.shape[0] == 0


@kernel
def moved_tree(model: Model, k: int, side: int) -> Tree:
    """The trees that impulses of coupling or gear k move: first and second, or all at once where rows are not apart.

    Empty where there is none. Directions of loops that bifurcate reach further than their bodies.
    """
    if not is_apart(model):
        return Tree(0, model.body_parent.shape[0] if side == 0 else 0, -1)
    a, b = coupled_bodies(model, k)
    first = model.body_root[a]
    root = first if side == 0 else (model.body_root[b] if b >= 0 else -1)
    if root < 0 or (side == 1 and root == first):
        return Tree(0, 0, -1)
    return Tree(root, model.tree_end[root], root)


@kernel
def order_couplings(model: Model, data: Data) -> int:
    """Update couple_order, the number of couplings and couple_linked, if other couplings are active now."""
    pairs = model.coupling_body.shape[0] - model.loop_ntrans.shape[0]
    changed = False
    n = 0
    for k in range(data.couple_seen.shape[0]):
        live = data.coupling_live[k] if k < pairs else 1
        changed = changed or live != data.couple_seen[k]
        data.couple_seen[k] = live
        n += live
    if changed:
        n = 0
        for k in range(data.couple_seen.shape[0]):
            if data.couple_seen[k] == 1:
                data.couple_order[n] = k
                n += 1
        if is_apart(model):
            _link(model, data, n)
            _order_by_degree(data, n)
    return n


@kernel
def _link(model: Model, data: Data, n: int) -> None:
    """couple_linked and couple_degree of the first n in couple_order: those that share a tree."""
    for i in range(n):
        data.couple_degree[i] = 0
    for i in range(n):
        a, b = moved_tree(model, data.couple_order[i], 0).root, moved_tree(model, data.couple_order[i], 1).root
        data.couple_linked[i, i] = 1
        for j in range(i):
            c, d = moved_tree(model, data.couple_order[j], 0).root, moved_tree(model, data.couple_order[j], 1).root
            meet = (a >= 0 and (a == c or a == d)) or (b >= 0 and (b == c or b == d))
            data.couple_linked[i, j] = data.couple_linked[j, i] = 1 if meet else 0
            if meet:
                data.couple_degree[i] += 1
                data.couple_degree[j] += 1


@kernel
def _order_by_degree(data: Data, n: int) -> None:
    """The one with the fewest links first; those that it is linked to are linked to one another from then on."""
    for m in range(n):
        best = m
        for j in range(m + 1, n):
            if data.couple_degree[j] < data.couple_degree[best]:
                best = j
        if data.couple_degree[best] == n - 1 - m:  # so are all that are left
            return
        _exchange(data, m, best, n)
        for i in range(m + 1, n):
            if data.couple_linked[m, i] == 0:
                continue
            data.couple_degree[i] -= 1
            for j in range(m + 1, i):
                if data.couple_linked[m, j] == 1 and data.couple_linked[i, j] == 0:
                    data.couple_linked[i, j] = data.couple_linked[j, i] = 1
                    data.couple_degree[i] += 1
                    data.couple_degree[j] += 1


@kernel
def _exchange(data: Data, i: int, j: int, n: int) -> None:
    """Places i and j change."""
    if i == j:
        return
    data.couple_order[i], data.couple_order[j] = data.couple_order[j], data.couple_order[i]
    data.couple_degree[i], data.couple_degree[j] = data.couple_degree[j], data.couple_degree[i]
    linked = data.couple_linked
    for k in range(n):
        linked[i, k], linked[j, k] = linked[j, k], linked[i, k]
    for k in range(n):
        linked[k, i], linked[k, j] = linked[k, j], linked[k, i]


@kernel
def set_nodes(data: Data, n: int, whole: bool) -> None:
    """Nodes of the n couplings in their order, or a single one of all rows."""
    data.node_count[0] = 1 if whole else n
    data.node_row[0] = 0
    if whole:
        data.node_row[1] = data.couple_start[n]
        data.node_span[0, 0] = 0
        return
    for m in range(n):
        data.node_row[m + 1] = data.couple_start[m + 1]
        span = data.node_span[m]
        count = 0
        for j in range(m + 1, n):
            if data.couple_linked[m, j] == 0:
                continue
            if j == m + 1 or data.couple_linked[m, j - 1] == 0:
                span[1 + 2 * count] = j
                count += 1
            span[2 * count] = j + 1
        span[0] = count
