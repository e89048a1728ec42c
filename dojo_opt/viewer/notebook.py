"""A motion inside a notebook."""

from __future__ import annotations

from html import escape
from typing import Any

from dojo_opt.viewer.animation import html_of
from dojo_opt.viewer.motion import motion

_HEIGHT = 420  # [pixels]
_LARGEST = 8_000_000  # [letters] of a page: more would make a notebook slow to open


def inline_html(result: Any) -> str:
    """The animation of a result as a frame of its own, which needs no file and no network.

    Args:
        result: Trajectory, Plan or ClosedLoop; or a Mechanism, which stands in its neutral state.

    Returns:
        HTML; "" for an animation that is too large for a notebook, which `viewer.save_html` writes.

    Raises:
        TypeError: the result is none of these.
        ValueError: the result does not know its simulator.
        SimulationError: a step of a plan cannot be solved again, for its forces.
    """
    text = html_of(motion(result), shown={"ghost": True})
    if len(text) > _LARGEST:
        return ""
    return f'<iframe srcdoc="{escape(text)}" style="width: 100%; height: {_HEIGHT}px; border: 0"></iframe>'
