"""StepOptions, Guess, NewtonTarget, Outcome: the request of a step, and its outcome."""

from __future__ import annotations

from typing import NamedTuple

from solvers.codes import Code
from solvers.status import Status
from solvers.types import Vector


class StepOptions(NamedTuple):
    """Settings of a step."""

    h: float  # time step [s]
    kappa: float  # central-path parameter [N s m]
    tolerance: float  # largest residual [N s, m, m/s], times the scale of the momenta
    max_iterations: int
    gain: float  # largest energy that a solution may gain, of those that change in the step (energy_balance.py)
    loss: float  # largest that it may lose where nothing dissipates, likewise
    cutoff: float  # stiffness over mass of far contacts (far_contacts.py), 0: none is far
    left: float  # part of the overlaps of shapes where it begins that a step may leave


class Guess(NamedTuple):
    """Where a step may start to look for its solution; how good a guess it is, is found out."""

    velocity: Vector  # (nv,) of v25
    impulses: bool  # the Data holds the impulses of the step before


class NewtonTarget(NamedTuple):
    """The target of a Newton step of the interior point."""

    kappa: float  # target of the complementarity products
    gap_fraction: float  # part of the equality residuals to remove
    corrected: float  # part of the second-order term of the affine step in `cone_step` to subtract


class Outcome(NamedTuple):
    """How a step ended."""

    status: int
    iterations: int
    residual: float  # largest equality residual
    violation: float  # largest |product - kappa| of complementary pairs


class FeatureChoice(Code):
    """When the active features of two shapes are chosen: the faces, edges and corners that are in contact."""

    ONCE = 0  # where an attempt starts
    EVERY_POSE = 1  # anew at every iterate
    WITH_PREVIOUS = 2  # where an attempt starts, beside the previous features that pressed


class Verdict(Code):
    """The verdict of the energy balance and the shapes on a solution of the equations."""

    VALID = 0
    OVERLAPPING = 1  # in features that were not active
    TUNNELED = 2  # a point has passed through the other shape, or a collision gave energy
    ENERGY_GAIN = 3  # the step gained energy


class LawForm(Code):
    """Forms of a contact law in a matrix."""

    PLAIN = 0  # as it stands
    STICKING = 1  # linear in the slip of contacts that stick
    SOFT = 2  # softened to limit rounding, for derivatives


FAILED = Outcome(int(Status.NO_PROGRESS), 0, 1e300, 1e300)
