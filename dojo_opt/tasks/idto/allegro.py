"""A hand of four fingers turns a ball on its palm."""

from __future__ import annotations

from typing import Any

import numpy as np

from dojo_opt.tasks.idto.allegro_ball import BallTurn, turning
from dojo_opt.tasks.suite import SuiteTask

__all__ = ["allegro"]

_NOMINAL = {
    "outer": (-0.1, 1.0, 1.0, 1.0),
    "thumb": (0.6, 1.9, 1.0, 1.0),
    "middle": (0.0, 0.7, 1.0, 1.0),
    "inner": (0.1, 1.0, 1.0, 1.0),
}  # [rad] of the publication, whose fingers are up to 7.2 mm inside the ball
_OPEN = {
    "outer": (-0.1, 0.86, 1.0, 1.0),
    "thumb": (0.6, 1.9, 0.95, 1.0),
    "middle": (0.0, 0.57, 1.0, 1.0),
    "inner": (0.1, 0.86, 1.0, 1.0),
}  # [rad] of the start, which touches nothing
_TASK = BallTurn(
    name="idto.allegro",
    opened=_OPEN,
    nominal=_NOMINAL,
    closing=False,
    gravity=-9.81,
    grip=0.7,  # plans with all of it squeeze the ball out
    stops=False,
    spread=0.03,
    end=(1.0, 100.0, 10.0, 10.0),
    smoothing=((1e-4, 1e-4), (1e-5, 1e-5)),
    reach=(0.05, np.inf),
    shrinkage=6e-4,  # the gap of a contact that presses by .3 N at the kappa of the plans
    rescued=True,
)


def allegro(**settings: Any) -> SuiteTask:
    """Turn a ball in place by 90 degrees about the vertical: 40 knots of 50 ms at 10 Hz.

    A run of 10 s is a success when the ball ends within 15 degrees of its goal and stays above z = 50 mm throughout.
    The fingers start opened, without contact; those of the publication start up to 7.2 mm inside the ball. The limit of
    the thumb is moved to fit its start. Plans know the friction of the palm, .18, where those of the publication count
    on 1, and assume .7 of the fingers' 1: plans that count on all of it squeeze the ball until it slips out. Contacts
    beyond 20 mm do not act on them. Plans find the ball .6 mm thinner than it is, and a tick whose plan is rejected
    starts again from rollouts.

    Args:
        **settings: settings of `dojo.MPC`, instead of the ones of the task.

    Returns:
        The task.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range.
    """
    return turning(_TASK, settings)
