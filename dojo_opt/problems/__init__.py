"""Ready-made planning problems: hops, swing-ups, gaits, leaps and flips on legs, reaching and pushing with arms."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dojo_opt.problems.classics import block, hop, swingup
from dojo_opt.problems.flips import backflip
from dojo_opt.problems.humanoid_leaps import humanoid_leap
from dojo_opt.problems.leaps import leap
from dojo_opt.problems.legged import jump, stand_up, trot, walk
from dojo_opt.problems.locomotion import bound, follow, pace, turn
from dojo_opt.problems.push import push
from dojo_opt.problems.reach import reach
from sim.mechanism.checks import no_attribute

__all__ = [
    "backflip",
    "block",
    "bound",
    "follow",
    "hop",
    "humanoid_leap",
    "jump",
    "leap",
    "pace",
    "push",
    "reach",
    "stand_up",
    "swingup",
    "trot",
    "turn",
    "walk",
]


if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        """A name that is not there, with the ones that are."""
        raise no_attribute(__name__, name, __all__)
