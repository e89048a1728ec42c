"""Dexterous manipulation of Jin (arXiv 2408.07855) with hard contact: objects, trials and success are theirs.

Every builder returns a `SuiteTask` for one of 20 given trials, a start and a goal of the object:

    task = dojo.tasks.jin.fingertips("cube", "in-air", trial=3)
    loop = task.run()
    print(task.outcome(loop))

Theirs plans with a quasi-static model, whose contacts are frozen at the measured state and act at a distance, and
lets a servo follow positions. Here the state has velocities, the inputs are forces, and contact is hard.
"""

from typing import TYPE_CHECKING, Any

from dojo_opt.tasks.jin.allegro import allegro
from dojo_opt.tasks.jin.fingertips import fingertips
from dojo_opt.tasks.jin.trifinger import trifinger
from sim.mechanism.checks import no_attribute

__all__ = ["allegro", "fingertips", "trifinger"]


if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        """A task that is not there, with the ones that are."""
        raise no_attribute(__name__, name, __all__)
