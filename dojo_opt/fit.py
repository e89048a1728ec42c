"""Fit: how well a guess of states goes with each stage of a continuation."""

from __future__ import annotations

from typing import Any

import numpy as np

from dojo_opt.line_search import Iterate
from dojo_opt.options import Stage
from sim.horizon import Horizon

_GOOD = 2.0  # times the least sum of squared gaps


def first_fit(horizon: Horizon, now: Iterate, stages: tuple[Stage, ...]) -> tuple[int, tuple[float, Any] | None]:
    """The smoothest stage at which a guess fits nearly as well as at any, and (smoothing, derivatives) there.

    A good reference leaves small gaps at a hard contact and large ones at a smooth one, where contact begins above
    the ground; to smooth it first would only lead away from it. A poor one fits nowhere, and needs all the stages.
    """
    fits = []
    for stage in stages:
        linear = horizon.linearize(now.x, now.u, stage.kappa_eval)
        gaps = horizon.gaps(linear, now.x)
        fits.append((float(np.sum(gaps**2)) if not np.any(linear.status) else np.inf, linear))
    best = min(misfit for misfit, _ in fits)
    if best == np.inf:
        return 0, None
    chosen = next(i for i, (misfit, _) in enumerate(fits) if misfit <= _GOOD * best)
    return chosen, (stages[chosen].kappa_eval, fits[chosen][1])
