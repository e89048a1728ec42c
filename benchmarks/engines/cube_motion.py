"""CubeMotion: a predicted toss of the real cube, of another engine."""

from __future__ import annotations

from typing import NamedTuple

from solvers.types import Floats

__all__ = ["CubeMotion"]


class CubeMotion(NamedTuple):
    """A prediction, as cube.py judges it."""

    x: Floats  # (T + 1, 13)
    success: bool
