"""The cost of a step of a scene: unknowns, memory, microseconds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dojo_opt.report.interleaved_rounds import interleave
from sim.model.layout import allocate_data, sizes_of
from sim.model.model import Law
from sim.simulator.simulator import Simulator

KNOTS = 50  # steps per call
COST_HEADER = ("", "velocities", "variables", "omitted", "bytes", "iterations", "step us", "gradient us")
_VARIABLES = {Law.IMPACT: 2, Law.NONLINEAR: 4, Law.LINEAR: 12}  # of the interior point, per contact; 2 per limit


@dataclass(frozen=True)
class CostScene:
    """A mechanism in motion."""

    name: str
    simulator: Simulator
    state: NDArray[np.float64]  # (nx,)


class Cost(NamedTuple):
    """The cost of a step of one scene."""

    name: str
    velocities: int  # unknowns of every step
    variables: int  # of limits and active contacts
    far: int  # inactive contacts
    bytes: int  # of the numbers of the mechanism, and of the scratch of one thread
    iterations: float  # per step
    step: NDArray[np.float64]  # (rounds,) [s] of a motion, each step looking from where the one before ended
    knot: NDArray[np.float64]  # (rounds,) [s] a step and its derivatives, along the same motion
    gradient: NDArray[np.float64]  # (rounds,) [s] the derivatives alone
    message: str  # why the motion ended early, or nothing

    @property
    def total(self) -> NDArray[np.float64]:
        """(rounds,) time [s] of a step with its derivatives, as in a planner."""
        return self.step + self.gradient


def costs(scenes: Sequence[CostScene], rounds: int) -> list[Cost]:
    """Costs of all scenes, timed in interleaved rounds; NaN where not even the first step is solved.

    The derivatives alone are a knot less a step that starts, as the one of a knot does, from the next velocity of the
    motion.
    """
    cases: dict[str, Callable[[], Any]] = {}
    paths = []
    for k, scene in enumerate(scenes):
        sim, x = scene.simulator, scene.state
        path = sim.rollout(x, np.zeros((KNOTS, sim.nu)))
        paths.append(path)
        if path.solved_steps:
            us, xs = np.zeros((path.solved_steps, sim.nu)), path.x
            cases[f"step {k}"] = lambda sim=sim, x=x, us=us: sim.rollout_feedback(x, us)  # type: ignore[misc]
            cases[f"known {k}"] = lambda sim=sim, x=x, us=us, xs=xs: sim.rollout_feedback(x, us, xs)  # type: ignore[misc]
            cases[f"knot {k}"] = lambda sim=sim, us=us, xs=xs: sim.linearize_trajectory(xs, us)  # type: ignore[misc]
    seconds = interleave(cases, rounds)
    out = []
    for k, (scene, path) in enumerate(zip(scenes, paths, strict=True)):
        nothing = np.full(rounds, np.nan)
        step, known, knot = (
            seconds.get(f"{part} {k}", nothing) / max(path.solved_steps, 1) for part in ("step", "known", "knot")
        )
        iterations = float(np.mean(path.iterations)) if path.solved_steps else float("nan")
        message = "" if path.success else path.message
        out.append(
            Cost(scene.name, *_sizes(scene, path.solved_steps > 0), iterations, step, knot, knot - known, message)
        )
    return out


def _sizes(scene: CostScene, solved: bool) -> tuple[int, int, int, int]:
    """(velocities, variables, far, bytes) of the first step; none are inactive if it is not solved."""
    sim = scene.simulator
    far = sim.inactive_contacts(scene.state) if solved else ()
    laws = {name: Law(int(law)) for name, law in zip(sim.mechanism.contact_names, sim.model.contact_law, strict=True)}
    near = sum(_VARIABLES[law] for name, law in laws.items() if name not in far)
    near += 2 * len(sim.model.limit_dof)
    carry, *scratch = allocate_data(sizes_of(sim.model))
    size = sum(array.nbytes for array in (*sim.model, *carry, *scratch))
    return sim.nv, near, len(far), size


def cost_row(cost: Cost) -> list[Any]:
    """A line of a table with COST_HEADER."""
    numbers = (cost.velocities, cost.variables, cost.far, cost.bytes, round(cost.iterations, 2))
    return [cost.name, *(str(n) for n in numbers), median_us(cost.step), median_us(cost.gradient)]


def median_us(seconds: Any) -> float:
    """Median, in microseconds."""
    return 1e6 * float(np.median(seconds))


def raw_cost(cost: Cost) -> dict[str, Any]:
    """Every number of a cost, times in microseconds round by round."""
    times = {f"{part}_us": (1e6 * getattr(cost, part)).tolist() for part in ("step", "knot", "gradient")}
    return {
        **cost._asdict(),
        **times,
        "step": median_us(cost.step),
        "knot": median_us(cost.knot),
        "gradient": median_us(cost.gradient),
    }
