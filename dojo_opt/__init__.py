"""dojo-opt: a differentiable rigid-body simulator with exact contact, and a planner that uses its derivatives.

    import dojo_opt as dojo

    plan = dojo.ilqr(dojo.problems.hop(), verbose=True)
    dojo.plots.trajectory(plan)

Every public name is imported when it is first used, so `import dojo_opt` costs milliseconds and neither compiles nor
loads a plotting library. The names and their homes are listed in `__init__.pyi`, once for Python, editors and mypy.
"""

from __future__ import annotations

import ast
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any


def _homes() -> dict[str, str]:
    """Public name -> module that defines it, read from `__init__.pyi`; a module of dojo_opt itself -> dojo_opt."""
    stub = ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    imports = [node for node in stub.body if isinstance(node, ast.ImportFrom) and node.module]
    return {alias.name: str(node.module) for node in imports for alias in node.names}


_RENAMED = {"Sampled": "SampledReference", "kernel": "jit"}  # old name -> new name, until version 0.2
_HOME = _homes()
__all__ = sorted(_HOME)  # noqa: PLE0605


def _check_own(name: str) -> None:
    """Raise an ImportError when Python would find somebody else's top-level package `name` instead of ours."""
    own = Path(__file__).resolve().parent.parent / name / "__init__.py"
    try:
        spec = find_spec(name)
    except ValueError:  # a module put into sys.modules by hand has no spec
        spec = None
    found = spec.origin if spec else None
    if spec and found is None:  # a folder without __init__.py
        found = next(iter(spec.submodule_search_locations or []), None)
    if found is None or Path(found).resolve() != own:
        found = found or "nothing (or a module made by hand)"
        raise ImportError(
            f"dojo_opt needs its own package {name!r} in {own.parent}, but Python finds {found}. Rename or move "
            f"that file, or take its folder off sys.path (the working directory comes first)."
        )


_check_own("sim")
_check_own("solvers")


def _inline_html(result: Any) -> str:
    """The animation of a result in a notebook; its modules are imported when something is drawn."""
    from dojo_opt.viewer.notebook import inline_html

    return inline_html(result)


def _register_drawing() -> None:
    """Results draw themselves with the viewer: `sim`, below it, does not know it."""
    from sim import register_drawing  # which loads no other module

    register_drawing(_inline_html)


_register_drawing()


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version  # which takes longer than all the rest here

    try:
        return version("dojo-opt")
    except PackageNotFoundError:  # run from a source tree that is not installed
        return "0+source"


def __getattr__(name: str) -> Any:
    """Import a public name on first use (PEP 562)."""
    if name in _RENAMED:
        from sim.mechanism.renamed import warn_renamed

        warn_renamed(f"dojo.{name}", f"dojo.{_RENAMED[name]}")
        return __getattr__(_RENAMED[name])
    if name == "__version__":
        globals()[name] = _version()
        return globals()[name]
    if name.startswith("_"):  # tools ask every object for such names, pytest a dozen times per module of tests
        raise AttributeError(f"module 'dojo_opt' has no attribute {name!r}")
    if name not in _HOME:
        from sim.mechanism.checks import no_attribute

        raise no_attribute(__name__, name, __all__)
    home = _HOME[name]
    value = import_module(f"dojo_opt.{name}") if home == "dojo_opt" else getattr(import_module(home), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
