"""Overload: inputs that a plan would need beyond its limits, as a sentence for plans that fail."""

from __future__ import annotations

import numpy as np

from dojo_opt.planning.problem import Problem
from solvers.types import Matrix

_BEYOND = 1.5  # times the limits: inputs of a guess that solved plans do without
_OFTEN = 0.2  # share of the knots
_AT = 1e-6  # of the range of an input: distance from a limit at which it is there


def overload(problem: Problem, us: Matrix) -> str:
    """A sentence on the inputs that are short: those that the guess needs, or those that the plan has at their limits.

    Args:
        problem: the problem.
        us: (T, nu) inputs where the solve ended.

    Returns:
        The sentence, with a space before it; empty where the limits are no reason.
    """
    if problem.control_limits is None or not problem.sim.nu:
        return ""
    names = problem.sim.mechanism.input_names
    ratio = demand(problem)
    if ratio.max() > _BEYOND:
        knot, entry = (int(i) for i in np.unravel_index(ratio.argmax(), ratio.shape))
        return f" The guess needs {ratio.max():.3g} times the limit of input {names[entry]!r} at knot {knot}."
    low, high = problem.control_limits
    room = np.where(np.isfinite(high - low), _AT * (high - low), 0.0)
    full = (us >= high - room) | (us <= low + room)
    knots, most = full.any(axis=1).mean(), names[full.sum(axis=0).argmax()]
    return f" Inputs are at their limits at {knots:.0%} of the knots, most often {most!r}." if knots >= _OFTEN else ""


def demand(problem: Problem) -> Matrix:
    """Inputs (T, nu) of the guess over their limits on that side; 0 where an input has none, or one of zero."""
    us = problem.wanted
    assert problem.control_limits is not None
    low, high = (np.broadcast_to(bound, us.shape) for bound in problem.control_limits)
    bound = np.where(us > 0.0, high, -low)
    return np.divide(np.abs(us), bound, out=np.zeros_like(us), where=(bound > 0.0) & np.isfinite(bound))
