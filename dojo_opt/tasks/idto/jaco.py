"""An arm turns a box onto its side."""

from __future__ import annotations

from typing import Any

from dojo_opt.tasks.idto.jaco_box import Turning, turning
from dojo_opt.tasks.suite import SuiteTask

__all__ = ["jaco"]

_TASK = Turning(
    name="idto.jaco",
    sides={"": 0.27},
    angles=(1.57, 1.7, 0.0, 4.8, 0.0, 4.5, 0.0),
    start=(0.5, 0.1, 0.08),
    goal=(0.5, -0.1, 0.08),
    quaternion=(1.0, 1.0, 0.0, 0.0),
    horizon=40,
    iterations=1,
    friction=0.4,
    effort=0.01,
    velocities=1.0,
    angles_at_the_end=0.0,
    angle=15.0,
    distance=0.03,
    held=0.5,
)


def jaco(**settings: Any) -> SuiteTask:
    """Turn a box by 90 degrees about x, and move it by .2 m: 40 knots of 50 ms at 20 Hz.

    The arm tips the box over its edge. One thing is added to the publication's cost: the squared distance of the arm's
    stub from the box weighs 10 per m^2; without it, the arm takes 3 s to reach the box. Plans assume a friction of .4,
    where the plant has .5: plans that count on all of it slip off the box, and with .3 it cannot be tipped. The box is
    a cuboid that stands on its corners, where plans of the publication have nine balls. The servos are in the model, as
    in `jaco_ball`.

    A run of 5 s is a success when the box stays within 15 degrees and 30 mm of its goal for .5 s.

    Args:
        **settings: settings of `dojo.MPC`, instead of the ones of the task.

    Returns:
        The task.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range.
    """
    return turning(_TASK, settings)
