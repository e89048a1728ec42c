"""Globalization: the strategies from which the interior point starts, in the order in which they are tried.

The first strategy begins with a known approximation (`known_start`). The others are rescues: an attempt that
ends in a fold of the central path is given up, and the next one starts elsewhere, at another kappa0. Some solutions lie
beyond folds, such as those of legs that jam between a joint limit and the ground.

`STRATEGIES` is the list. `benchmarks/start_strategies.py` counts the solutions that each of them finds: KNOWN and
INCOMING find more than 99 %, and every row, also in the last rounds, finds some. `benchmarks/robustness.py` measures
the list on 100,000 random extreme states (seeds 0 to 4).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.contact.active_contacts import lands
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import FeatureChoice, Guess, StepOptions
from sim.solve.inequalities import (
    keep_inequalities,
    move_inequalities,
    resume_inequalities,
    start_inequalities,
    total_impulse,
)
from sim.solve.merit import residuals
from sim.solve.prediction import predict, predictable
from sim.solve.step_length import largest_turn
from sim.solve.trial_velocity import INFEASIBLE, set_trial_velocity
from solvers.codes import Code
from solvers.compiler import inlined, kernel
from solvers.types import Vector

_AT_REST = 0.1  # residual at kappa, over that on the central path of kappa0, of a guess that may start at kappa
_RESUMED = 3e-4  # [N s m] least kappa of a start near the impulses of the step before
_BALANCED = 0.3  # residual with these impulses, over that near them, of a motion that may start at kappa
_AHEAD = 1e-2  # share of the tolerance for the first iteration from a line: how fast errors fall is not known yet
_GOES_ON = 0.1  # residual with these impulses, over their sum, of a motion that keeps them
_GROWTH = 3.0  # of kappa0, from one strategy to the next
_GROWTHS = 8  # strategies after which kappa0 is reset
_GOLDEN = 0.6180339887498949
_BEYOND = 2.0  # [rad] from a fold to a start on its other side


class Start(Code):
    """Where an attempt starts."""

    KNOWN = 0  # with the iterate of `known_start`
    INCOMING = 1  # at the incoming velocity, on the central path of kappa0
    FRACTION = 2  # at a fraction of the incoming velocity
    BEYOND_FOLD = 3  # beyond the end of the last attempt, along its Newton step
    BEHIND_FOLD = 4  # before it, against its Newton step
    LAST_ITERATE = 5  # where the last attempt ended


class Strategy(NamedTuple):
    """How one attempt starts and iterates."""

    start: int  # Start
    continuation: bool = False  # friction smoothing is led down step by step; otherwise it follows the normal impulses
    undamped: bool = False  # take the Newton direction as it is, also beyond folds
    features: int = int(FeatureChoice.ONCE)
    replace_features: bool = False  # the first repetition drops the previous features; later ones keep those that press
    overlap: bool = False  # accept small overlaps in features that would have to pull
    on_corners: bool = False  # only where feet have corners, and the attempt before made no progress
    velocity_fraction: float = 1.0  # of the incoming velocity
    growth: float = 1.0  # of kappa0


_EVERY_POSE = int(FeatureChoice.EVERY_POSE)
_FIRST = (
    # most steps end here
    Strategy(Start.KNOWN, replace_features=True),
    # where a foot rocks, which of its corners stick changes within a step: friction at kappa jams on that; on a
    # smoother law the impulses of the step before, or of the last attempt, are still near the solution
    Strategy(Start.KNOWN, continuation=True, replace_features=True, on_corners=True),
    # the usual start of a step of which nothing is known
    Strategy(Start.INCOMING, replace_features=True),
    # with friction tied to the impulses thin cones jam; from here on its smoothing is lowered by continuation
    Strategy(Start.FRACTION, continuation=True, features=_EVERY_POSE, replace_features=True),
    # attempts end at folds, where the null vector of the Newton matrix leads to the other side
    Strategy(Start.BEHIND_FOLD, continuation=True, features=_EVERY_POSE),
    # shapes that slide from one feature to another within the step overlap a little in whatever was active before
    Strategy(Start.FRACTION, continuation=True, overlap=True),
    Strategy(Start.BEYOND_FOLD, continuation=True, overlap=True),
    Strategy(Start.FRACTION, continuation=True, features=_EVERY_POSE, overlap=True),
    Strategy(Start.BEHIND_FOLD, continuation=True, features=_EVERY_POSE, overlap=True),
)
_ROUND = (
    # some solutions lie beyond folds, and with a damped friction Newton's method only creeps towards them; with a
    # kappa0 of 1 N s m and more, friction that follows the impulses finds hard impacts more often than continuation
    Strategy(Start.FRACTION, undamped=True, overlap=True),
    Strategy(Start.BEYOND_FOLD, continuation=True, undamped=True, overlap=True),
    # the same with damped directions, and features that are chosen at every pose
    Strategy(Start.FRACTION, features=_EVERY_POSE, overlap=True),
    Strategy(Start.BEHIND_FOLD, continuation=True, features=_EVERY_POSE, overlap=True),
)
_ROUNDS = 13
UNKNOWN = 2  # the first strategy of a step of which nothing is known


def _numbered(k: int, strategy: Strategy) -> Strategy:
    """Strategy k of the list: shares advance by the golden ratio, modulo 1, and kappa0 grows."""
    place = k - UNKNOWN
    fraction = _GOLDEN * (place - 1) % 1.0 if strategy.start == Start.FRACTION else 1.0
    return strategy._replace(velocity_fraction=fraction, growth=_GROWTH ** (place % _GROWTHS) if place >= 0 else 1.0)


STRATEGIES = tuple(_numbered(k, s) for k, s in enumerate(_FIRST + _ROUNDS * _ROUND))
ATTEMPTS = len(STRATEGIES)

# one array per field: constants of compiled code
_START = np.array([s.start for s in STRATEGIES], dtype=np.int64)
_CONTINUATION = np.array([s.continuation for s in STRATEGIES], dtype=np.int64)
_UNDAMPED = np.array([s.undamped for s in STRATEGIES], dtype=np.int64)
_FEATURES = np.array([s.features for s in STRATEGIES], dtype=np.int64)
_REPLACE_FEATURES = np.array([s.replace_features for s in STRATEGIES], dtype=np.int64)
_OVERLAP = np.array([s.overlap for s in STRATEGIES], dtype=np.int64)
_ON_CORNERS = np.array([s.on_corners for s in STRATEGIES], dtype=np.int64)
_FRACTION = np.array([s.velocity_fraction for s in STRATEGIES])
_KAPPA_GROWTH = np.array([s.growth for s in STRATEGIES])


class KnownStart(NamedTuple):
    """The start of the strategies KNOWN, whose iterate is in `data`."""

    found: bool  # otherwise the list begins with UNKNOWN
    kappa: float  # of the central path on which it is
    balance: tuple[float, float]  # residuals there
    share: float  # of the tolerance, within which its first iteration has to end


@kernel
def strategy(k: int) -> Strategy:
    """Strategy k of the list."""
    return Strategy(
        _START[k],
        _CONTINUATION[k] != 0,
        _UNDAMPED[k] != 0,
        _FEATURES[k],
        _REPLACE_FEATURES[k] != 0,
        _OVERLAP[k] != 0,
        _ON_CORNERS[k] != 0,
        _FRACTION[k],
        _KAPPA_GROWTH[k],
    )


@kernel
def from_last_iterate(s: Strategy) -> Strategy:
    """The repetition of a strategy with other features: from where it ended, on the path of the usual kappa0."""
    return Strategy(Start.LAST_ITERATE.value, False, False, s.features, s.replace_features, s.overlap, False, 1.0, 1.0)


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
            return KnownStart(True, kappa, residuals(model, data, h, q, v, u), 1.0)
        return KnownStart(False, kappa, INFEASIBLE, 1.0)
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
            return KnownStart(True, options.kappa, balance, _AHEAD)
    balance = with_last_impulses(model, data, options, inputs, velocity)
    if balance[0] < 1e300 and balance[0] > _GOES_ON * total_impulse(model, data):
        balance = predict(model, data, options, inputs)
    return KnownStart(balance[0] < 1e300, options.kappa, balance, 1.0)


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
        return KnownStart(False, options.kappa, INFEASIBLE, 1.0)
    kappa = max(options.kappa, _RESUMED)
    resume_inequalities(model, data, h, kappa, False)
    away, _ = residuals(model, data, h, q, v, u)
    move_inequalities(model, data, 0.0)
    last = residuals(model, data, h, q, v, u)
    if last[0] < _BALANCED * away:
        return KnownStart(True, options.kappa, last, 1.0)
    resume_inequalities(model, data, h, kappa, False)
    return KnownStart(True, kappa, residuals(model, data, h, q, v, u), 1.0)


@inlined
def at_kappa(
    model: Model, data: Data, options: StepOptions, inputs: tuple[Vector, Vector, Vector], velocity: Vector
) -> KnownStart:
    """At the guess with the impulses kappa / gap, where they all but balance."""
    q, v, u = inputs
    h = options.h
    kappa = options.kappa
    if not set_trial_velocity(model, data, h, q, v, 1.0):
        return KnownStart(False, kappa, INFEASIBLE, 1.0)
    start_inequalities(model, data, h, kappa, 1.0)
    usual, _ = residuals(model, data, h, q, v, u)
    placed = True  # most guess the incoming velocity: there already
    for d in range(v.shape[0]):
        placed = placed and velocity[d] == v[d]
    if not placed and not set_trial_velocity(model, data, h, q, velocity, 1.0):
        return KnownStart(False, kappa, INFEASIBLE, 1.0)
    start_inequalities(model, data, h, kappa, 0.0)
    hard = residuals(model, data, h, q, v, u)
    return KnownStart(hard[0] < _AT_REST * usual, kappa, hard, 1.0)


@inlined
def start_on_path(model: Model, data: Data, options: StepOptions, q: Vector, v: Vector, s: Strategy) -> float:
    """Start of a strategy that is not KNOWN, on the central path of its kappa0; returns kappa0, or 0 where that fails.

    At a fold the Newton matrix is all but singular, and its null vector, the last Newton step, leads to the other side.
    """
    if s.start == Start.INCOMING or s.start == Start.FRACTION:
        placed = set_trial_velocity(model, data, options.h, q, v, s.velocity_fraction)
    else:
        if s.start == Start.LAST_ITERATE:
            for d in range(v.shape[0]):
                data.dnu[d] = data.nu[d]
        else:
            ahead = min(_BEYOND / largest_turn(data), 100.0)
            if s.start == Start.BEHIND_FOLD:
                ahead = -ahead
            for d in range(v.shape[0]):
                data.dnu[d] = data.nu[d] + ahead * data.dnu[d]
        placed = set_trial_velocity(model, data, options.h, q, data.dnu, 1.0)
    if not placed:
        return 0.0
    return start_inequalities(model, data, options.h, options.kappa, s.growth)
