"""Smooth probabilities of survival."""

from __future__ import annotations

import numpy as np

from dojo_opt.planning.residual import jit

__all__ = ["within"]


@jit
def within(value, low, high, width):  # type: ignore[no-untyped-def]
    """1 well between two bounds, 1/2 on them, 0 outside, over a few widths: a smooth probability of survival."""
    return 1.0 / ((1.0 + np.exp((low - value) / width)) * (1.0 + np.exp((value - high) / width)))
