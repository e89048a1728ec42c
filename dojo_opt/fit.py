"""Fit: how well a guess of states goes with each stage of a continuation."""

from __future__ import annotations

from typing import Any

import numpy as np

from dojo_opt.line_search import Iterate
from dojo_opt.options import Stage
from sim.horizon import Horizon

_GOOD = 2.0  # times the least sum of squared gaps


def first_fit(horizon: Horizon, now: Iterate, stages: tuple[Stage, ...]) -> tuple[int, tuple[float, Any] | None]:
    """The smoothest stage down to which a guess fits nearly as well as at harder ones, and (smoothing, derivatives).

    A good reference leaves small gaps at a hard contact and large ones at a smooth one, where contact begins above
    the ground; to smooth it first would only lead away from it. A poor one fits nowhere, and needs all the stages.
    """
    best, chosen, known = np.inf, 0, None
    for i in range(len(stages) - 1, -1, -1):
        linear = horizon.linearize(now.x, now.u, stages[i].kappa_eval)
        misfit = np.inf if np.any(linear.status) else float(np.sum(horizon.gaps(linear, now.x) ** 2))
        if misfit <= _GOOD * best and misfit < np.inf:
            chosen, known = i, (stages[i].kappa_eval, linear)
        elif best < np.inf:
            break
        best = min(best, misfit)
    return chosen, known
