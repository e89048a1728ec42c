"""Durations of problems as numbers of knots."""

from __future__ import annotations

from sim.mechanism import checks


def whole_knots(call: str, duration: float, knot: float, least: int) -> int:
    """The number of knots [s] that is nearest to a duration [s].

    ValueError: it is not above 0, or fewer than `least`, the phases of the motion.
    """
    duration = checks.number(call, duration, above=0.0)
    count = round(min(duration / knot, 1e300))
    if count < least:
        raise ValueError(
            f"{call}: expected {least} knots of {knot:g} s at least, {least * knot:g} s, got {duration:g} s"
        )
    return count
