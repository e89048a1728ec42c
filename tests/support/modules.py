"""The modules of the packages: their syntax trees, imports, and circles of imports."""

from __future__ import annotations

import ast
from collections import defaultdict
from functools import cache
from pathlib import Path

from support.programs import PACKAGES

ROOT = Path(__file__).resolve().parents[2]

__all__ = ["ROOT", "circles", "imports", "module_name", "modules"]


@cache
def modules() -> dict[Path, ast.Module]:
    """Every module with its syntax tree. Not at import: each worker of pytest-xdist imports this file."""
    return {file: ast.parse(file.read_text()) for package in PACKAGES for file in (ROOT / package).rglob("*.py")}


def module_name(file: Path) -> str:
    name = ".".join(file.relative_to(ROOT).with_suffix("").parts)
    return name.removesuffix(".__init__")


def imports() -> dict[str, set[str]]:
    """Modules by module, of every import: also under TYPE_CHECKING and inside functions."""
    known = {module_name(file) for file in modules()}
    out: dict[str, set[str]] = defaultdict(set)
    for file, tree in modules().items():
        here = module_name(file)
        for node in ast.walk(tree):
            names: list[str] = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.module:
                names = [
                    inner if (inner := f"{node.module}.{alias.name}") in known else node.module for alias in node.names
                ]
            out[here] |= {name for name in names if name in known and name != here}
    return out


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Strongly connected components of more than one module (Tarjan)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(v: str) -> None:
        index[v] = low[v] = len(index)
        stack.append(v)
        for w in graph.get(v, ()):
            if w not in index:
                visit(w)
                low[v] = min(low[v], low[w])
            elif w in stack:
                low[v] = min(low[v], index[w])
        if low[v] == index[v]:
            component = [stack.pop()]
            while component[-1] != v:
                component.append(stack.pop())
            if len(component) > 1:
                found.append(sorted(component))

    for v in sorted(graph):
        if v not in index:
            visit(v)
    return found
