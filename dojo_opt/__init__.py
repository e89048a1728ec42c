"""dojo-opt: a differentiable rigid-body simulator with exact contact, and a planner that uses its derivatives.

    import dojo_opt as dojo

    plan = dojo.ilqr(dojo.problems.hop(), verbose=True)
    dojo.plots.trajectory(plan)

Every public name is imported when it is first used, so `import dojo_opt` costs milliseconds and neither compiles nor
loads a plotting library.
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

__all__ = [
    "Body",
    "Box",
    "Capsule",
    "Contact",
    "Cylinder",
    "Input",
    "Joint",
    "Linearization",
    "Mechanism",
    "Plan",
    "Problem",
    "SimulationError",
    "Simulator",
    "Sphere",
    "Status",
    "Trajectory",
    "constraint",
    "cost",
    "equilibrium",
    "gaits",
    "ilqr",
    "models",
    "plots",
    "problems",
    "viewer",
]

# public name -> module that defines it; a name mapped to None is itself a module of dojo_opt
_HOME: dict[str, str | None] = {
    "Body": "sim.parts",
    "Box": "sim.shapes",
    "Capsule": "sim.shapes",
    "Contact": "sim.parts",
    "Cylinder": "sim.shapes",
    "Input": "sim.parts",
    "Joint": "sim.parts",
    "Linearization": "sim.results",
    "Mechanism": "sim.mechanism",
    "Plan": "dojo_opt.plan",
    "Problem": "dojo_opt.problem",
    "SimulationError": "sim.results",
    "Simulator": "sim.simulator",
    "Sphere": "sim.shapes",
    "Status": "solvers.status",
    "Trajectory": "sim.results",
    "constraint": None,
    "cost": None,
    "equilibrium": "dojo_opt.equilibrium",
    "gaits": None,
    "ilqr": "dojo_opt.planner",
    "models": None,
    "plots": None,
    "problems": None,
    "viewer": None,
}

if TYPE_CHECKING:
    from dojo_opt import constraint, cost, gaits, models, plots, problems, viewer
    from dojo_opt.equilibrium import equilibrium
    from dojo_opt.plan import Plan
    from dojo_opt.planner import ilqr
    from dojo_opt.problem import Problem
    from sim.mechanism import Mechanism
    from sim.parts import Body, Contact, Input, Joint
    from sim.results import Linearization, SimulationError, Trajectory
    from sim.shapes import Box, Capsule, Cylinder, Sphere
    from sim.simulator import Simulator
    from solvers.status import Status


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

try:
    __version__ = version("dojo-opt")
except PackageNotFoundError:  # run from a source tree that is not installed
    __version__ = "0+source"


def __getattr__(name: str) -> Any:
    """Import a public name on first use (PEP 562)."""
    if name not in _HOME:
        raise AttributeError(f"module 'dojo_opt' has no attribute {name!r}; it has {', '.join(__all__)}")
    home = _HOME[name]
    value = import_module(f"dojo_opt.{name}") if home is None else getattr(import_module(home), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
