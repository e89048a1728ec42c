"""Two arms tilt a box between them."""

from __future__ import annotations

from typing import Any

import numpy as np

from dojo_opt.tasks.idto.jaco_box import Turning, turning
from dojo_opt.tasks.suite import SuiteTask

__all__ = ["dual_jaco"]

_TASK = Turning(
    name="idto.dual_jaco",
    sides={"left_": 0.27, "right_": -0.27},
    angles=(1.57, 2.0, 0.0, 5.0, -1.0, 4.2, 0.0, 1.57, 2.0, 0.0, 5.0, 1.0, 4.2, 0.0),
    start=(0.5, 0.0, 0.08),
    goal=(0.5, 0.0, 0.1),
    quaternion=(0.7, 0.3, 0.0, 0.0),
    horizon=20,
    iterations=2,
    friction=0.2,
    effort=0.001,
    velocities=0.1,
    angles_at_the_end=0.1,
    angle=10.0,
    distance=np.inf,
    held=1.0,
)


def dual_jaco(**settings: Any) -> SuiteTask:
    """Tilt a box by 46 degrees about x and hold it: 20 knots of 50 ms and two iterations per tick, at 20 Hz.

    One thing is added to the publication's cost: the squared distance of each arm's stub from the box weighs 10 per
    m^2; without it, neither arm moves. Plans assume a friction of .2, as those of the publication, where the plant has
    .5. The servos are in the model, as in `jaco_ball`.

    A run of 5 s is a success when the box stays within 10 degrees of its goal for 1 s. Its place does not count: the
    box stands on an edge.

    Args:
        **settings: settings of `dojo.MPC`, instead of the ones of the task.

    Returns:
        The task.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range.
    """
    return turning(_TASK, settings)
