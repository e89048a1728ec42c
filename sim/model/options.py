"""Options, Guess, Goal, Outcome: what a step is asked for, and how it ended."""

from __future__ import annotations

from typing import NamedTuple

from solvers.status import Status
from solvers.types import Vector


class Options(NamedTuple):
    """Settings of a step."""

    h: float  # time step [s]
    kappa: float  # central-path parameter [N s m]
    tolerance: float  # largest residual [N s, m, m/s], times the scale of the momenta
    max_iterations: int


class Guess(NamedTuple):
    """Where a step may start to look for its solution; how good a guess it is, is found out."""

    velocity: Vector  # (nv,) of v25
    impulses: bool  # work holds the impulses of the step before


class Goal(NamedTuple):
    """What a Newton step of the interior point aims at."""

    kappa: float  # target of the complementarity products
    share: float  # part of the equality residuals to remove
    corrected: float  # part of the second-order term of the affine step in `cone_step` to subtract


class Outcome(NamedTuple):
    """How a step ended."""

    status: int
    iterations: int
    residual: float  # largest equality residual
    violation: float  # largest |product - kappa| of complementary pairs


# Work.pair_free: elements of the shapes in contact are chosen where an attempt starts; anew at every pose; or where it
# starts, with those that pressed kept beside them
AT_START, AT_EVERY_POSE, BESIDE_KEPT = 0, 1, 2

# what a solution says of them: they are those that touch; others overlap; a point has gone through the other shape; and
# whatever touches, the step gained energy
PLACED, OVERLAPPING, ASTRAY, WOUND_UP = 0, 1, 2, 3

# forms of a contact law in a matrix: as it stands; linear in the slip of what sticks; soft enough for its digits
PLAIN, LINEAR, SOFT = 0, 1, 2

FAILED = Outcome(int(Status.NO_PROGRESS), 0, 1e300, 1e300)
