"""Settings of the planner, each on all variants of a problem: success rate and run time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.studies.planning.planners import PlanOutcome, ours
from benchmarks.studies.planning.planning_cases import Setting
from dojo_opt.planning.problem import Problem

TRUE = 5e-3  # violation of a plan replayed on hard contact; a plan with more exploits soft contact
GOOD = 1.1  # times the least cost that any setting found: another local minimum costs more
_ITERATIONS = 100


class Score(NamedTuple):
    """One setting on one family."""

    problem: str
    setting: Setting
    variants: int
    solved: int  # converged, constraints met
    true: int  # of these, also when replayed
    good: int  # of these, near the best
    iterations: float  # median over all
    excess: float  # median of replayed cost / best - 1 of the true ones
    seconds: float  # median over all, processor time


def score(name: str, problems: Sequence[Problem], outcomes: Sequence[tuple[Setting, list[PlanOutcome]]]) -> list[Score]:
    """Scores of all settings, by the costs of replays on hard contact, against the best of each variant."""
    costs = np.array([[o.hard[0] if _true(o) else np.inf for o in found] for _, found in outcomes])
    best = costs.min(axis=0)
    scores = []
    for (setting, found), cost in zip(outcomes, costs, strict=True):
        true = np.isfinite(cost)
        excess = cost[true] / best[true] - 1.0
        scores.append(
            Score(
                name,
                setting,
                len(problems),
                sum(o.success for o in found),
                int(np.sum(true)),
                int(np.sum(excess <= GOOD - 1.0)),
                float(np.median([o.iterations for o in found])),
                float(np.median(excess)) if len(excess) else np.nan,
                float(np.median([o.seconds for o in found])),
            )
        )
    return scores


def run(problems: Sequence[Problem], setting: Setting) -> list[PlanOutcome]:
    """One setting on all variants."""
    return [ours(problem, setting.name, max_iterations=_ITERATIONS, **setting.options) for problem in problems]


def _true(outcome: PlanOutcome) -> bool:
    return outcome.success and outcome.hard[1] <= TRUE  # false for NaN
