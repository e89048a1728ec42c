"""The modules of the packages: their syntax trees, each parsed and walked once; imports, and circles of imports."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from functools import cache
from pathlib import Path
from typing import TypeVar

from support.programs import PACKAGES

ROOT = Path(__file__).resolve().parents[2]
Node = TypeVar("Node", bound=ast.AST)

__all__ = [
    "ROOT",
    "Node",
    "circles",
    "code_of",
    "files_of",
    "imports",
    "last_name",
    "module_name",
    "modules",
    "nodes_of",
    "source_of",
    "tree_of",
]


@cache
def files_of(*places: str) -> tuple[Path, ...]:
    """The Python files below folders of the repository."""
    return tuple(file for place in places for file in sorted((ROOT / place).rglob("*.py")))


@cache
def source_of(file: Path) -> str:
    return file.read_text(encoding="utf-8")


_NO_CODE = re.compile(r"""'''.*?'''|\"{3}.*?\"{3}|'(?:\\.|[^'\\\n])*'|"(?:\\.|[^"\\\n])*"|\#[^\n]*""", re.DOTALL)


@cache
def code_of(file: Path) -> str:
    """A source without strings and comments; Python's own tokens take forty times as long."""
    return _NO_CODE.sub("", source_of(file))


@cache
def tree_of(file: Path) -> ast.Module:
    return ast.parse(source_of(file))


def modules() -> dict[Path, ast.Module]:
    """Every module of the packages with its syntax tree."""
    return {file: tree_of(file) for file in files_of(*PACKAGES)}


@cache
def _by_kind(file: Path) -> dict[type, list[ast.AST]]:
    """Nodes of a module by their kind, in the order of `ast.walk`: a walk takes twice as long as parsing."""
    found: dict[type, list[ast.AST]] = defaultdict(list)
    for node in ast.walk(tree_of(file)):
        found[type(node)].append(node)
    return found


def nodes_of(file: Path, kind: type[Node]) -> list[Node]:
    """Nodes of one kind in a module."""
    return _by_kind(file).get(kind, [])  # type: ignore[return-value]


def last_name(node: ast.expr) -> str:
    """c of the expressions c and a.b.c; nothing of others."""
    return node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""


def module_name(file: Path) -> str:
    name = ".".join(file.relative_to(ROOT).with_suffix("").parts)
    return name.removesuffix(".__init__")


def imports() -> dict[str, set[str]]:
    """Modules by module, of every import: also under TYPE_CHECKING and inside functions."""
    known = {module_name(file) for file in modules()}
    out: dict[str, set[str]] = defaultdict(set)
    for file in modules():
        here = module_name(file)
        names = [alias.name for node in nodes_of(file, ast.Import) for alias in node.names]
        for node in nodes_of(file, ast.ImportFrom):
            for alias in node.names if node.module else ():
                names.append(inner if (inner := f"{node.module}.{alias.name}") in known else str(node.module))
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
