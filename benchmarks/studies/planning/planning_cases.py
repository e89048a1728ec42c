"""Problems of the planning study, and settings of the planner."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

import dojo_opt as dojo
from dojo_opt.planning.options import CONTINUATION, Stage
from dojo_opt.planning.problem import Problem

NAMES = ("hop", "block right", "block up", "trot")
FAMILIES = (*NAMES, "hop, 5 x 10 ms")
KAPPA_GRAD = (1e-2, 1e-3, 1e-4, 1e-5)  # of plans in one stage


class Setting(NamedTuple):
    """Options of `ilqr`, by name."""

    group: str  # the setting that is varied
    name: str
    options: dict[str, Any]


def finer(problem: Problem, substeps: int) -> Problem:
    """The same problem with knots of `substeps` time steps: same knots, costs, constraints and guess."""
    return Problem(
        problem.sim.replace(time_step=problem.knot_time / substeps),
        problem.start,
        problem.horizon,
        cost=problem.specs[0],
        constraints=problem.specs[1],
        control_limits=problem.control_limits,
        substeps=substeps,
        controls0=problem.controls0,
        states0=problem.states0,
    )


def reference(name: str) -> Problem:
    """One of the four problems with a figure of their plans."""
    makers: dict[str, Callable[[], Problem]] = {
        "hop": dojo.problems.hop,
        "block right": lambda: dojo.problems.block("right"),
        "block up": lambda: dojo.problems.block("up"),
        "trot": dojo.problems.trot,
    }
    return makers[name]()


def time_steps(*, quick: bool) -> dict[str, Problem]:
    """The reference problems over time steps, and the trot that Dojo publishes, with damping 5."""
    problems = {f"{name}, {_steps(p)}": p for name in NAMES for p in [reference(name)]}
    if quick:
        return problems
    for name, substeps in (("hop", 2), ("hop", 5), ("block right", 5), ("block up", 5), ("trot", 2)):
        p = finer(reference(name), substeps)
        problems[f"{name}, {_steps(p)}"] = p
    heavy = dojo.problems.trot(damping=5.0)
    problems[f"trot, damping 5, {_steps(heavy)}"] = heavy
    return dict(sorted(problems.items()))


def _steps(problem: Problem) -> str:
    return f"{problem.substeps} x {1e3 * problem.sim.time_step:g} ms"


def family(name: str, *, quick: bool) -> list[Problem]:
    """Variants of a reference problem, so that luck with one variant decides nothing.

    hop: ten random targets within .6 m; block: friction .3, .5, .8 and .7, 1, 1.5 kg; trot: 0, .2, .4 m/s and damping
    .5, 1.5, 5.
    """
    if name.startswith("hop"):
        targets = np.random.default_rng(0).uniform(-0.6, 0.6, (10, 2))
        substeps = 1 if name == "hop" else 5
        problems = [dojo.problems.hop(target=target, substeps=substeps) for target in targets]
    elif name == "trot":
        problems = [dojo.problems.trot(speed=s, damping=d) for d in (0.5, 1.5, 5.0) for s in (0.2, 0.0, 0.4)]
    else:
        goal = name.removeprefix("block ")
        problems = [dojo.problems.block(goal, friction=f, mass=m) for m in (1.0, 0.7, 1.5) for f in (0.5, 0.3, 0.8)]
    return problems[:2] if quick else problems


def settings(*, quick: bool) -> list[Setting]:
    """The default first, then one change at a time."""
    last = CONTINUATION[-1]

    def stages(*kappas: float, end: tuple[float, float] = last[:2]) -> dict[str, Any]:
        return {"stages": (*(Stage(kappa, kappa) for kappa in kappas), Stage(*end))}

    smooth = tuple(stage.kappa_eval for stage in CONTINUATION[:-1])
    every = [Setting("default", "default", {})]
    every += [Setting("one stage", f"kappa_grad {k:g}", stages(end=(last.kappa_eval, k))) for k in KAPPA_GRAD]
    every += [Setting("soft", f"kappa_eval = kappa_grad = {k:g}", stages(end=(k, k))) for k in (1e-2, 1e-3, 1e-4)]
    schedules = ((3e-3,), (1e-2,), (3e-2,), (1e-1,), (1e-2, 1e-3), (1e-1, 1e-3), (1e-1, 1e-2, 1e-3))
    every += [Setting("schedule", "from " + ", ".join(f"{k:g}" for k in s), stages(*s)) for s in schedules]
    ends = ((last.kappa_eval, 1e-3), (last.kappa_eval, 1e-5), (last.kappa_eval, 1e-6), (1e-4, 1e-4), (1e-8, 1e-4))
    every += [
        Setting("last stage", f"kappa_eval, kappa_grad {e:g}, {g:g}", stages(*smooth, end=(e, g))) for e, g in ends
    ]
    every += [Setting("solver", f"penalty {p:g}", {"penalty": p}) for p in (10.0, 1000.0)]
    every += [Setting("solver", f"tolerance {t:g}", {"tolerance": t}) for t in (1e-2, 1e-4)]
    every += [
        Setting("solver", f"stages end at {d:g}", {"stages": tuple(s._replace(decrease=d) for s in CONTINUATION)})
        for d in (0.1, 0.01)
    ]
    every += [Setting("solver", "gaps reopened", {"on_kappa_change": "gaps"})]
    few = ("default", "kappa_grad 0.0001", "kappa_eval = kappa_grad = 0.001")
    return [setting for setting in every if setting.name in few] if quick else every
