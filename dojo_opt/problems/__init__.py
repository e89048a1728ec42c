"""Reference problems, ready to solve: a hop, a pushed block, swing-ups, and the gaits and leaps of a quadruped."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dojo_opt.problems.classics import block, hop, swingup
from dojo_opt.problems.leaps import leap
from dojo_opt.problems.locomotion import bound, follow, jump, pace, trot, turn, walk
from sim.checks import nearest

__all__ = ["block", "bound", "follow", "hop", "jump", "leap", "pace", "swingup", "trot", "turn", "walk"]


if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        """A name that is not there, with the ones that are."""
        raise AttributeError(
            f"dojo_opt.problems has no {name!r}; there are {', '.join(__all__)}{nearest(name, __all__)}"
        )
