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
    "ClosedLoop",
    "Collision",
    "Contact",
    "Cylinder",
    "Disturbances",
    "Environment",
    "Gear",
    "HalfSpace",
    "Input",
    "Interrupted",
    "Joint",
    "Linearization",
    "MPC",
    "Mechanism",
    "MjcfMechanism",
    "MjcfWarning",
    "Options",
    "ParameterSpace",
    "Parameters",
    "Perturbation",
    "Plan",
    "Plant",
    "Polytope",
    "Problem",
    "Push",
    "Reactions",
    "Sampled",
    "SimulationError",
    "Simulator",
    "Sphere",
    "Stage",
    "Status",
    "StepResult",
    "String",
    "Terrain",
    "Trajectory",
    "UrdfError",
    "UrdfMechanism",
    "UrdfWarning",
    "bridges",
    "closed_loop",
    "constraint",
    "cost",
    "equilibrium",
    "gaits",
    "ilqr",
    "kernel",
    "load_mjcf",
    "load_urdf",
    "models",
    "monte_carlo",
    "plots",
    "problems",
    "report",
    "tasks",
    "tracking_gains",
    "viewer",
]

# public name -> module that defines it; a name mapped to None is itself a module of dojo_opt
_HOME: dict[str, str | None] = {
    "Body": "sim.parts",
    "Box": "sim.shapes",
    "Capsule": "sim.shapes",
    "ClosedLoop": "dojo_opt.plant.loop",
    "Collision": "sim.collisions",
    "Contact": "sim.parts",
    "Cylinder": "sim.shapes",
    "Disturbances": "dojo_opt.plant.disturbances",
    "Environment": "dojo_opt.environment",
    "Gear": "sim.gear",
    "HalfSpace": "sim.shapes",
    "Input": "sim.parts",
    "Interrupted": "sim.results",
    "Joint": "sim.parts",
    "Linearization": "sim.results",
    "MPC": "dojo_opt.mpc.controller",
    "Mechanism": "sim.mechanism",
    "MjcfMechanism": "sim.mjcf",
    "MjcfWarning": "sim.mjcf",
    "Options": "dojo_opt.options",
    "ParameterSpace": "dojo_opt.parameter_space",
    "Parameters": "sim.parameters.parameters",
    "Perturbation": "dojo_opt.plant.perturbation",
    "Plan": "dojo_opt.plan",
    "Plant": "dojo_opt.plant.plant",
    "Polytope": "sim.polytope",
    "Problem": "dojo_opt.problem",
    "Push": "dojo_opt.plant.perturbation",
    "Reactions": "sim.reactions",
    "Sampled": "dojo_opt.mpc.moving",
    "SimulationError": "sim.results",
    "Simulator": "sim.simulator",
    "Sphere": "sim.shapes",
    "Stage": "dojo_opt.options",
    "Status": "solvers.status",
    "StepResult": "sim.results",
    "String": "sim.shapes",
    "Terrain": "sim.terrain.terrain",
    "Trajectory": "sim.results",
    "UrdfError": "sim.urdf.xml",
    "UrdfMechanism": "sim.urdf.report",
    "UrdfWarning": "sim.urdf.report",
    "bridges": None,
    "closed_loop": "dojo_opt.plant.loop",
    "constraint": None,
    "cost": None,
    "equilibrium": "dojo_opt.rest",
    "gaits": None,
    "ilqr": "dojo_opt.planning.ilqr",
    "kernel": "dojo_opt.residual",
    "load_mjcf": "sim.mjcf",
    "load_urdf": "sim.urdf.load",
    "models": None,
    "monte_carlo": "dojo_opt.plant.study",
    "plots": None,
    "problems": None,
    "report": None,
    "tasks": None,
    "tracking_gains": "dojo_opt.tracking",
    "viewer": None,
}

if TYPE_CHECKING:
    from dojo_opt import bridges, constraint, cost, gaits, models, plots, problems, report, tasks, viewer
    from dojo_opt.environment import Environment
    from dojo_opt.mpc.controller import MPC
    from dojo_opt.mpc.moving import Sampled
    from dojo_opt.options import Options, Stage
    from dojo_opt.parameter_space import ParameterSpace
    from dojo_opt.plan import Plan
    from dojo_opt.planning.ilqr import ilqr
    from dojo_opt.plant.disturbances import Disturbances
    from dojo_opt.plant.loop import ClosedLoop, closed_loop
    from dojo_opt.plant.perturbation import Perturbation, Push
    from dojo_opt.plant.plant import Plant
    from dojo_opt.plant.study import monte_carlo
    from dojo_opt.problem import Problem
    from dojo_opt.residual import kernel
    from dojo_opt.rest import equilibrium
    from dojo_opt.tracking import tracking_gains
    from sim.collisions import Collision
    from sim.gear import Gear
    from sim.mechanism import Mechanism
    from sim.mjcf import MjcfMechanism, MjcfWarning, load_mjcf
    from sim.parameters.parameters import Parameters
    from sim.parts import Body, Contact, Input, Joint
    from sim.polytope import Polytope
    from sim.reactions import Reactions
    from sim.results import Interrupted, Linearization, SimulationError, StepResult, Trajectory
    from sim.shapes import Box, Capsule, Cylinder, HalfSpace, Sphere, String
    from sim.simulator import Simulator
    from sim.terrain.terrain import Terrain
    from sim.urdf.load import load_urdf
    from sim.urdf.report import UrdfMechanism, UrdfWarning
    from sim.urdf.xml import UrdfError
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
        from difflib import get_close_matches

        close = get_close_matches(name, __all__, n=1)
        hint = f"did you mean {close[0]!r}?" if close else f"it has {', '.join(__all__)}"
        raise AttributeError(f"module 'dojo_opt' has no attribute {name!r}; {hint}")
    home = _HOME[name]
    value = import_module(f"dojo_opt.{name}") if home is None else getattr(import_module(home), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
