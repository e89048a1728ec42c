"""Receding horizon: the states and inputs beyond the end of a plan, and the multipliers of the shifted constraints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dojo_opt.mpc.moving_reference import References
from dojo_opt.mpc.policy import Policy
from dojo_opt.planning.term import PickTerm, StateTerm, Term
from solvers.types import Matrix

__all__ = ["shift_multipliers", "tail"]


def tail(policy: Policy, references: References, count: int) -> tuple[Matrix, Matrix]:
    """States (count, nx) and inputs (count, nu) of knots beyond the end of a plan.

    The last ones, moved along with their references; states without one go where the last input takes them, as far as
    steps are solved that are not divided.
    """
    sim, end = policy.sim, policy.time + policy.knot_time * len(policy.u)
    us = np.repeat(policy.u[-1:], count, axis=0)
    rows = references.rows(PickTerm, end - policy.knot_time, count + 1)
    if rows is not None:
        us = us + rows[1:] - rows[0]
    rows = references.rows(StateTerm, end, count + 1)
    if rows is not None:
        return sim.integrate(rows[1:], sim.difference(policy.x[-1], rows[0])), us
    return sim.horizon(1, policy.substeps).coast(policy.x[-1], us)[1:], us  # divided steps would take their time


def shift_multipliers(constraints: Sequence[Term], knots: float) -> None:
    """Multipliers of constraints on consecutive knots move along with the horizon; those of a single knot stay."""
    n, f = int(knots), knots - int(knots)
    for term in constraints:
        rows = len(term.knots)
        if rows > 1 and np.all(np.diff(term.knots) == 1):
            first = np.minimum(np.arange(rows) + n, rows - 1)
            after = np.minimum(first + 1, rows - 1)
            term.slope[:] = (1.0 - f) * term.slope[first] + f * term.slope[after]
