"""Static single assignment: every assignment of a kernel gets a variable of its own, as by Numba's pass.

Numba goes through all blocks twice for each variable that is assigned more than once, a fortieth of a cold start. Here
only the blocks that assign or read it are rewritten. The result is the same.
"""

from __future__ import annotations

from collections import defaultdict
from typing import Any

from numba.core import ir, ssa
from numba.core.analysis import compute_cfg_from_blocks

__all__ = ["reconstruct_single_assignment"]


def reconstruct_single_assignment(blocks: dict[int, Any]) -> dict[int, Any]:
    """Rename variables, with phi nodes where several assignments reach a block.

    Source: Choi, Sarkar and Schonberg, Incremental computation of static single assignment form, 1996, as Numba has it.

    Args:
        blocks: those of a function in Numba's representation, by label.

    Returns:
        The new blocks, in the same order.
    """
    blocks = dict(blocks)
    graph = compute_cfg_from_blocks(blocks)
    assigned, read = _places(blocks)
    frontiers, variables = ssa._iterated_domfronts(graph), ssa._CacheListVars()
    for name in _to_rename(assigned, read, graph.dominators()):
        fresh, definitions = ssa._fresh_vars(_chosen(blocks, set(assigned[name])), name)
        blocks.update(fresh)
        states = ssa._make_states(blocks)
        states.update(varname=name, defmap=definitions, cfg=graph, phimap=defaultdict(list))
        states["phi_locations"] = ssa._compute_phi_locations(frontiers, definitions)
        places = _chosen(blocks, read[name].union(assigned[name]))
        blocks.update(ssa._run_block_rewrite(places, states, ssa._FixSSAVars(variables)))
        for label, nodes in states["phimap"].items():
            blocks[label].body = nodes + blocks[label].body
    return blocks


def _chosen(blocks: dict[int, Any], labels: set[int]) -> dict[int, Any]:
    return {label: block for label, block in blocks.items() if label in labels}


def _places(blocks: dict[int, Any]) -> tuple[dict[str, list[int]], dict[str, set[int]]]:
    """The blocks that assign a variable, once for each assignment, and those that read it, by name."""
    assigned: dict[str, list[int]] = defaultdict(list)
    read: dict[str, set[int]] = defaultdict(set)
    for label, block in blocks.items():
        for statement in block.body:
            target = None
            if isinstance(statement, ir.Assign):
                target = statement.target.name
                assigned[target].append(label)
            for variable in statement.list_vars():
                if variable.name != target:
                    read[variable.name].add(label)
    return assigned, read


def _to_rename(assigned: dict[str, list[int]], read: dict[str, set[int]], dominators: dict[int, set[int]]) -> list[str]:
    """Variables with several assignments, and those read where their assignment need not have come before."""
    several = [name for name, labels in assigned.items() if len(labels) > 1]
    once = [name for name in read if len(assigned.get(name, ())) <= 1]
    return several + [
        name for name in once if any(dominators[label].isdisjoint(assigned.get(name, ())) for label in read[name])
    ]
