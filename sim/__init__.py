"""Rigid-body simulation with contact: mechanisms, time steps and their derivatives. Imports `solvers` only.

Results draw themselves in notebooks by a function that a package above registers here, where it costs no import.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

__all__ = ["drawn", "register_drawing"]

_registered: list[Callable[[Any], str]] = []  # the last one draws


def register_drawing(draw: Callable[[Any], str]) -> None:
    """Let a function draw motions and mechanisms.

    Args:
        draw: result -> HTML; it may raise ImportError, TypeError, ValueError or RuntimeError for what it cannot draw.
    """
    _registered.append(draw)


def drawn(result: Any) -> str:
    """HTML for a notebook.

    Args:
        result: a motion or a mechanism.

    Returns:
        Its animation; "" where no drawing is installed, or there is nothing to draw.
    """
    if not _registered:
        return ""
    try:
        return _registered[-1](result)
    except (ImportError, TypeError, ValueError, RuntimeError):
        return ""
