"""The start of a step near its solution, from the steps before: `known_start` chooses one."""

from __future__ import annotations

from typing import NamedTuple

from sim.contact.active_contacts import lands
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import Guess, StepOptions
from sim.solve.inequalities import (
    keep_inequalities,
    move_inequalities,
    resume_inequalities,
    start_inequalities,
    total_impulse,
)
from sim.solve.merit import residuals
from sim.solve.prediction import predict, predictable
from sim.solve.trial_velocity import INFEASIBLE, set_trial_velocity
from solvers.compiler import inlined, kernel
from solvers.types import Vector

_AT_REST = 0.1  # residual at kappa, over that on the central path of kappa0, of a guess that may start at kappa
_RESUMED = 3e-4  # [N s m] least kappa of a start near the impulses of the step before
_BALANCED = 0.3  # residual with these impulses, over that near them, of a motion that may start at kappa
_AHEAD = 1e-2  # share of the tolerance for the first iteration from a line: how fast errors fall is not known yet
_GOES_ON = 0.1  # residual with these impulses, over their sum, of a motion that keeps them


class KnownStart(NamedTuple):
    """The start of the strategies KNOWN, whose iterate is in `data`."""

    found: bool  # otherwise the list begins with UNKNOWN
    kappa: float  # of the central path on which it is
    balance: tuple[float, float]  # residuals there
    share: float  # of the tolerance, within which its first iteration has to end
    tentative: bool  # given up before it moves if the first Newton step leaves the cones: other contacts press


@kernel
def known_start(
    model: Model, data: Data, options: StepOptions, inputs: tuple[Vector, Vector, Vector], guess: Guess
) -> KnownStart:
    """The first of these that is near the solution, with its iterate in `data`:

        ahead       on a line through the last two velocities, with the impulses of the step before
        warm        at the guess, with the impulses of the step before
        predicted   at the prediction of the linearised step (prediction.py)
        resumed     near these impulses, on the central path of a larger kappa
        at kappa    at the guess, with the impulses kappa / gap: a robot at rest

    inputs: (q, v, u)
    """
    q, v, u = inputs
    h = options.h
    kappa = options.kappa
    if data.active_count[0] + model.limit_dof.shape[0] + model.dry_dof.shape[0] == 0:  # without a central path
        if set_trial_velocity(model, data, h, q, guess.velocity, 1.0):
            return KnownStart(True, kappa, residuals(model, data, h, q, v, u), 1.0, False)
        return KnownStart(False, kappa, INFEASIBLE, 1.0, False)
    keep_inequalities(model, data)
    if guess.impulses and data.active_count[0] == data.active_ground_count[0]:  # pairs may have other points now
        if predictable(model, data):
            start = warm_or_predicted(model, data, options, inputs, guess.velocity)
            if start.found:
                return start
        return warm_or_resumed(model, data, options, inputs, guess.velocity)
    return at_kappa(model, data, options, inputs, guess.velocity)


@inlined
def warm_or_predicted(
    model: Model, data: Data, options: StepOptions, inputs: tuple[Vector, Vector, Vector], velocity: Vector
) -> KnownStart:
    """At kappa: with the impulses of the step before where they all but balance, otherwise as predicted.

    While the same contacts press, velocities change smoothly: a line through the last two often saves an iteration,
    or the prediction.
    """
    if continues_in_contact(model, data, inputs[1], velocity):
        balance = with_last_impulses(model, data, options, inputs, data.carry.next_velocity)
        if balance[0] < _GOES_ON * total_impulse(model, data) and not lands(model, data):
            return KnownStart(True, options.kappa, balance, _AHEAD, True)
    balance = with_last_impulses(model, data, options, inputs, velocity)
    if balance[0] <= _GOES_ON * total_impulse(model, data):
        return KnownStart(True, options.kappa, balance, 1.0, True)
    return predicted(model, data, options, inputs, balance)


@kernel
def after_tentative(
    model: Model, data: Data, options: StepOptions, inputs: tuple[Vector, Vector, Vector], velocity: Vector
) -> KnownStart:
    """The prediction, where a line or a guess was tentative: the impulses of the step before are still kept."""
    balance = with_last_impulses(model, data, options, inputs, velocity)
    return predicted(model, data, options, inputs, balance)


@inlined
def predicted(
    model: Model, data: Data, options: StepOptions, inputs: tuple[Vector, Vector, Vector], balance: tuple[float, float]
) -> KnownStart:
    """As predicted from the impulses of the step before, whose residuals are `balance`."""
    if balance[0] < 1e300:
        balance = predict(model, data, options, inputs)
    return KnownStart(balance[0] < 1e300, options.kappa, balance, 1.0, False)


@inlined
def continues_in_contact(model: Model, data: Data, v: Vector, velocity: Vector) -> bool:
    """Whether the step follows another one, touches the ground, and has no better guess than its incoming velocity v.

    The first step of a motion has other inputs than the one before: its change of velocity says nothing of the next.
    Next to pairs of bodies, a start further away might end in another solution.
    """
    same = data.carry.steps[0] > 1 and data.active_count[0] > 0 and model.pair_kind.shape[0] == 0
    for d in range(v.shape[0]):
        same = same and velocity[d] == v[d]
    return same


@inlined
def with_last_impulses(
    model: Model, data: Data, options: StepOptions, inputs: tuple[Vector, Vector, Vector], velocity: Vector
) -> tuple[float, float]:
    """Residuals at a velocity with the impulses of the step before."""
    q, v, u = inputs
    if not set_trial_velocity(model, data, options.h, q, velocity, 1.0):
        return INFEASIBLE
    move_inequalities(model, data, 0.0)
    return residuals(model, data, options.h, q, v, u)


@inlined
def warm_or_resumed(
    model: Model, data: Data, options: StepOptions, inputs: tuple[Vector, Vector, Vector], velocity: Vector
) -> KnownStart:
    """With the impulses of the step before: the gap of a pressing contact changes much, its impulse does not.

    At kappa itself where they all but balance; otherwise near them and the gaps, on the path of a larger kappa.
    """
    q, v, u = inputs
    h = options.h
    if not set_trial_velocity(model, data, h, q, velocity, 1.0):
        return KnownStart(False, options.kappa, INFEASIBLE, 1.0, False)
    kappa = max(options.kappa, _RESUMED)
    resume_inequalities(model, data, h, kappa, False)
    away, _ = residuals(model, data, h, q, v, u)
    move_inequalities(model, data, 0.0)
    last = residuals(model, data, h, q, v, u)
    if last[0] < _BALANCED * away:
        return KnownStart(True, options.kappa, last, 1.0, False)
    resume_inequalities(model, data, h, kappa, False)
    return KnownStart(True, kappa, residuals(model, data, h, q, v, u), 1.0, False)


@inlined
def at_kappa(
    model: Model, data: Data, options: StepOptions, inputs: tuple[Vector, Vector, Vector], velocity: Vector
) -> KnownStart:
    """At the guess with the impulses kappa / gap, where they all but balance.

    Next to pairs of bodies at the incoming velocity, whatever the guess: their features are chosen at the start, and a
    step has one solution.
    """
    q, v, u = inputs
    h = options.h
    kappa = options.kappa
    if not set_trial_velocity(model, data, h, q, v, 1.0):
        return KnownStart(False, kappa, INFEASIBLE, 1.0, False)
    start_inequalities(model, data, h, kappa, 1.0)
    usual, _ = residuals(model, data, h, q, v, u)
    placed = True  # most guess the incoming velocity: there already
    for d in range(v.shape[0]):
        placed = placed and velocity[d] == v[d]
    placed = placed or data.active_count[0] > data.active_ground_count[0]
    if not placed and not set_trial_velocity(model, data, h, q, velocity, 1.0):
        return KnownStart(False, kappa, INFEASIBLE, 1.0, False)
    start_inequalities(model, data, h, kappa, 0.0)
    hard = residuals(model, data, h, q, v, u)
    return KnownStart(hard[0] < _AT_REST * usual, kappa, hard, 1.0, False)
