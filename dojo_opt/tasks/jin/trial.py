"""Trial: where an object starts and where it has to go, as the publication draws them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sim.mechanism import checks
from solvers.rotation import quat_exp, quat_mul
from solvers.types import Vector

__all__ = ["TRIALS", "Trial", "draws", "followed", "pose", "turn", "within"]

TRIALS = 20
_SEED = 100  # of the first trial


class Trial(NamedTuple):
    """Poses of an object, each its place [m] and its quaternion.

    Attributes:
        start: (7,) where it is put down, or dropped from.
        goal: (7,) where it has to go.
    """

    start: Vector
    goal: Vector


def draws(call: str, number: int) -> np.random.RandomState:
    """The random numbers of a trial, in the order in which the publication draws them.

    Args:
        call: the call for messages, such as "tasks.jin.fingertips".
        number: number of the trial.

    Returns:
        NumPy's legacy generator, whose numbers do not change with NumPy's version.

    Raises:
        ValueError: there is no such trial.
    """
    trial = checks.whole_number(f"{call}(trial=...)", number, 0)
    if trial >= TRIALS:
        raise ValueError(f"{call}(trial=...): expected a number from 0 to {TRIALS - 1}, got {trial}")
    return np.random.RandomState(_SEED + trial)


def within(random: np.random.RandomState, half: float, count: int = 1) -> Vector:
    """Numbers between -half and half.

    Args:
        random: the generator.
        half: bound [m, rad].
        count: how many.

    Returns:
        (count,) numbers.
    """
    return np.asarray(2.0 * half * random.rand(count) - half)


def pose(xy: ArrayLike, z: float, quaternion: ArrayLike) -> Vector:
    """A pose.

    Args:
        xy: (2,) place on the table [m].
        z: height [m].
        quaternion: (4,) its turn.

    Returns:
        (7,) pose.
    """
    return np.concatenate([np.asarray(xy), [z], np.asarray(quaternion)])


def turn(axis: ArrayLike, angle: float) -> Vector:
    """The quaternion of a turn.

    Args:
        axis: (3,) axis of any length.
        angle: angle [rad].

    Returns:
        (4,) quaternion.
    """
    x, y, z = angle / np.linalg.norm(np.asarray(axis)) * np.asarray(axis, dtype=np.float64)
    return np.array(quat_exp(x, y, z))


def followed(*turns: Vector) -> Vector:
    """The quaternion of several turns about fixed axes, the last one first.

    Args:
        *turns: (4,) quaternions.

    Returns:
        (4,) their product.
    """
    out = turns[0]
    for other in turns[1:]:
        out = np.array(quat_mul(*out, *other))
    return out
