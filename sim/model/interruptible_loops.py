"""LoopClock: loops over steps return to Python every few hundredths of a second, so that it can handle Ctrl-C.

A signal waits until Python runs again. So a call of a long loop is made in pieces: a kernel stops at the first step
after its deadline and returns its progress; Python resumes it from there, with all that the step before left in its
Data, so that the result is the same to the last bit.

    for _ in pieces(settings, steps):
        done = roll(..., settings, ..., done)
        if done == steps: break

Between two pieces a time limit holds, too: in `with ends_at(time)`, loops of this thread end with TimeUp after it.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from math import inf
from time import perf_counter

from sim.model.data import Data
from sim.model.record_columns import LoopClock, StepSetting
from solvers.compiler import PAUSE, kernel, seconds
from solvers.types import Vector

__all__ = ["TimeUp", "ends_at", "is_due", "pieces", "rows", "note_deadline"]

_LOOK = 64.0  # work between two readings of the clock; one costs about a tenth of the smallest step
_ROWS = 64  # of the first piece
_ONE = (None,)
_DEADLINE = int(StepSetting.DEADLINE)  # NumPy takes three times as long with the member of an enum


class TimeUp(Exception):
    """The time of `ends_at` has passed within a loop, whose progress is lost."""


class _Limit(threading.local):
    """The time when loops of this thread end, as in time.perf_counter() [s]."""

    end = inf


_LIMIT = _Limit()


@contextmanager
def ends_at(end: float) -> Iterator[None]:
    """A context whose loops, of this thread, raise TimeUp after the time `end`, as in time.perf_counter() [s]."""
    before, _LIMIT.end = _LIMIT.end, min(end, _LIMIT.end)
    try:
        yield
    finally:
        _LIMIT.end = before


def pieces(settings: Vector, steps: int) -> Iterable[None]:
    """Deadlines for the pieces of a call with a given number of steps; a single step has none."""
    return _ONE if steps <= 1 else _pieces(settings)


def _pieces(settings: Vector) -> Iterator[None]:
    while True:
        if perf_counter() > _LIMIT.end:
            raise TimeUp
        settings[_DEADLINE] = seconds() + PAUSE
        yield


def rows(count: int) -> Iterable[slice]:
    """Rows 0 to `count` in pieces that take about as long, for loops over rows that have nothing to do with another."""
    return (slice(0, count),) if count <= _ROWS else _rows(count)


def _rows(count: int) -> Iterator[slice]:
    first, size = 0, _ROWS
    while first < count:
        begin = perf_counter()
        yield slice(first, min(first + size, count))
        first += size
        size = max(1, min(2 * size, int(size * PAUSE / max(perf_counter() - begin, 1e-9))))


@kernel
def note_deadline(data: Data, settings: Vector) -> None:
    """Note the deadline."""
    data.loop_clock[LoopClock.DEADLINE] = settings[StepSetting.DEADLINE]


@kernel
def is_due(data: Data, effort: float) -> bool:
    """Whether it is time to go back to Python, after a step of that effort: its iterations, and columns solved for."""
    data.loop_clock[LoopClock.EFFORT] += effort + 1.0  # robots at rest take no iterations
    if data.loop_clock[LoopClock.EFFORT] < _LOOK:
        return False
    data.loop_clock[LoopClock.EFFORT] = 0.0
    return seconds() > data.loop_clock[LoopClock.DEADLINE]
