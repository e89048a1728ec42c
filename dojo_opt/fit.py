"""Fit: which stage of a continuation a guess of states begins with, and which others where that one fails."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from dojo_opt.line_search import Iterate
from dojo_opt.objective import Objective
from dojo_opt.options import Stage
from sim.simulator.horizon import Horizon

_GOOD = 2.0  # times the least sum of squared gaps
_REST = 1e-9  # [m, rad] from one knot to the next: what rests
_ASKED = 1e-6  # [m, rad, m/s, rad/s] step of Newton's method: what is asked to move


class Fit(NamedTuple):
    """How a guess goes with the stages of a continuation."""

    firsts: tuple[int, ...]  # the stage to begin with, then those to begin with where the ones before failed
    known: tuple[float, Any] | None = None  # smoothing, and derivatives there, that were needed to find out


def fit(horizon: Horizon, objective: Objective, sim: Any, now: Iterate, stages: tuple[Stage, ...]) -> Fit:
    """The stages to begin with.

    The first is the smoothest down to which a guess fits nearly as well as at harder ones. A good reference leaves
    small gaps at a hard contact and large ones at a smooth one, where contact begins above the ground; to smooth it
    first would only lead away from it. A poor one fits nowhere, and needs all the stages. So does one in which a joint
    rests that has to move: it fits at a hard contact because nothing happens there, and says nothing of how contact
    moves that joint, which is what smooth stages find out.
    """
    count = len(stages)
    if count == 1:
        return Fit((0,))
    if idle(objective, sim, now):
        return Fit(tuple(range(count)))
    best, chosen, known = np.inf, 0, None
    for i in range(count - 1, -1, -1):
        linear = horizon.linearize(now.x, now.u, stages[i].kappa_eval)
        misfit = np.inf if np.any(linear.status) else float(np.sum(horizon.gaps(linear, now.x) ** 2))
        if misfit <= _GOOD * best and misfit < np.inf:
            chosen, known = i, (stages[i].kappa_eval, linear)
        elif best < np.inf:
            break
        best = min(best, misfit)
    return Fit((chosen, *range(chosen)), known)


def idle(objective: Objective, sim: Any, now: Iterate) -> bool:
    """Whether a joint rests in the states from the second on, though it starts elsewhere or the objective moves it."""
    start, *_ = steps = np.abs(sim.difference(now.x[1:], now.x[:-1]))[:, : sim.nv]
    objective.expand(now.x, now.u)
    slope = np.abs(objective.g[1:, : sim.ndx])
    bend = np.abs(objective.H[1:].diagonal(axis1=1, axis2=2)[:, : sim.ndx])
    asked = np.any(slope > _ASKED * bend, axis=0)
    asked = asked[: sim.nv] | asked[sim.nv :] | (start > _ASKED)
    rests = np.all(steps[1:] <= _REST, axis=0)
    first = 0
    for joint in sim.mechanism.joints:
        dofs = slice(first, first := first + joint.nv)
        if rests[dofs].all() and asked[dofs].any():
            return True
    return False
