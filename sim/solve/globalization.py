"""Globalization: the strategies from which the interior point starts, in the order in which they are tried.

The first strategy begins with a known approximation (known_start.py). The others are rescues: an attempt that
ends in a fold of the central path is given up, and the next one starts elsewhere, at another kappa0. Some solutions lie
beyond folds, such as those of legs that jam between a joint limit and the ground.

`STRATEGIES` is the list. `benchmarks/start_strategies.py` counts the solutions that each of them finds
(docs/numbers.md): KNOWN and INCOMING find more than 99 %, every kind of row some, the later rounds hardly any.
`benchmarks/robustness.py` measures the list on 100,000 random extreme states (seeds 0 to 4).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import FeatureChoice, StepOptions
from sim.solve.inequalities import start_inequalities
from sim.solve.step_length import largest_turn
from sim.solve.trial_velocity import set_trial_velocity
from solvers.codes import Code
from solvers.compiler import inlined, kernel
from solvers.types import Vector

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
