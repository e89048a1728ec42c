"""A hand of four fingers turns a ball below its palm."""

from __future__ import annotations

from typing import Any

import numpy as np

from dojo_opt.tasks.idto.allegro_ball import BallTurn, turning
from dojo_opt.tasks.suite import SuiteTask

__all__ = ["allegro_upside_down"]

_NOMINAL = {
    "outer": (-0.2, 1.4, 0.6, 0.7),
    "thumb": (0.3, 1.5, 1.0, 1.0),
    "middle": (0.0, 0.7, 1.0, 1.0),
    "inner": (0.1, 1.0, 1.0, 1.0),
}  # [rad] of the publication, whose fingers are up to 7.2 mm inside the ball
_OPEN = {
    "outer": (-0.2, 1.33, 0.6, 0.7),
    "thumb": (0.3, 1.5, 0.94, 1.0),
    "middle": (0.0, 0.61, 1.0, 1.0),
    "inner": (0.1, 0.86, 1.0, 1.0),
}  # [rad] of the start, which touches nothing
_TASK = BallTurn(
    name="idto.allegro_upside_down",
    opened=_OPEN,
    nominal=_NOMINAL,
    closing=True,  # the ball falls out of an open hand
    gravity=9.81,
    grip=1.0,
    stops=True,
    spread=0.01,
    end=(0.01, 10.0, 1e-3, 1.0),
    smoothing=((1e-5, 1e-5),),  # at 1e-4 the ball falls out of the first guess
    reach=(-np.inf, 0.13),
    squeeze=1.0,  # at 0, plans hold the ball no harder than they must
    shrinkage=6e-4,  # the gap of a contact that presses by .3 N at the kappa of the plans
    rescued=True,
)


def allegro_upside_down(**settings: Any) -> SuiteTask:
    """Turn a ball in place by 90 degrees about the vertical, held from above: 40 knots of 50 ms at 10 Hz.

    Hand and weights are those of the publication, which plans this task once and does not close the loop: rate, servos
    and plant here are those of `allegro`, and the goal stands still, where its goal turns over 2 s. Gravity points from
    the palm to the fingertips. A run of 10 s is a success when the ball ends within 15 degrees of its goal and stays
    within z = 130 mm of the palm's frame throughout. The fingers start .1 to 1 mm off the ball; those of the
    publication start up to 7.2 mm inside it. Plans count on all of the friction of the fingers. Torques cost nothing
    where each finger presses on the ball by 1 N, twice the weight of the ball; those of the publication do at zero.
    Plans find the ball .6 mm thinner than it is, and a tick whose plan is rejected starts again from rollouts.

    Args:
        **settings: settings of `dojo.MPC`, instead of the ones of the task.

    Returns:
        The task.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range.
    """
    return turning(_TASK, settings)
