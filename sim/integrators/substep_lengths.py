"""Lengths of the next sub-steps: what a step that was kept or refused says of them. Lengths are columns of Clock."""

from __future__ import annotations

from math import sqrt

from sim.integrators.contact_events import NEVER
from sim.integrators.substeps import Clock
from solvers.compiler import kernel
from solvers.types import Vector

_SAFE, _MOST, _LEAST = 0.95, 5.0, 0.2  # shares of a length: of the best one, and limits
_FAR = 0.1  # error over allowed of a step that is much too short
_AGAIN = 0.5  # most of a length that was refused a second time at a node
_RISES = 1.25  # share of the longest length after each step that was kept
_TRIES = 4.0  # lengths 5, 25, ... times the shortest that are tried in turn, where that misses the accuracy
_STALLED = 0.5  # error of an impact over that in a longer step
_SLIGHT, _LARGE = 0.1, 1.0  # errors of impacts, in accuracies
_PRESSED = 8.0  # error over allowed of a step of order 2 in contact, over that of the same step of order 4
_SOON = 0.01  # share of a length: contacts that stop sliding before are not waited for
_UP_TO, _NEARLY, _HALF_WAY = 0.98, 16.0, 0.5  # of the time to an impact; where impacts are so much shorter than it


@kernel
def next_length(h: float, ratio: float, before: float, order: float) -> float:
    """h times .95 r^-.7/k r0^.4/k, between 1/5 and 5: Gustafsson's controller for errors per length of order k."""
    r, r0 = max(ratio, 1e-12), min(max(before, 1e-4), 1.0)
    return h * min(_MOST, max(_LEAST, _SAFE * r ** (-0.7 / order) * r0 ** (0.4 / order)))


@kernel
def longer(h: float, ratio: float, before: float, order: float) -> float:
    """`next_length`, or that of half the error allowed where this is far away, as behind an impact."""
    length = next_length(h, ratio, before, order)
    if ratio > _FAR:
        return length
    return max(length, h * min(_MOST, (0.5 / max(ratio, 1e-12)) ** (1.0 / order)))


@kernel
def shorter(h: float, ratio: float, order: float) -> float:
    """h times .9 r^-1/k, at least h/10: the length at which a step that was refused has the error allowed."""
    return h * max(0.1, 0.9 * ratio ** (-1.0 / order))


@kernel
def _power(clock: Vector) -> float:
    """The power of the length with which the estimate of the step just tried, over its length, grows."""
    return 4.0 if clock[Clock.ORDER] == 6.0 else 2.0


@kernel
def _straight(clock: Vector, h: float, ratio: float, length: float) -> float:
    """The length, at most the longest with order 4 after a step of order 4, or that with order 2 where this is longer:
    its error over allowed is 8 times as large.
    """
    if clock[Clock.ORDER] != 4.0 or clock[Clock.ROUGH] == 0.0:
        return length
    rough = h * sqrt(0.5 / (_PRESSED * max(ratio, 1e-12)))
    return min(length, max(_SAFE * h / clock[Clock.ROUGH], rough))


@kernel
def lengthen(clock: Vector, h: float, ratio: float, shortest: float) -> None:
    """After a step of order 2 to 6 with an error that is allowed.

    Impacts come in cascades: the step behind one is as short as that. A length without a solution is not tried again
    before lengths have risen to it.
    """
    length = _straight(clock, h, ratio, longer(h, ratio, clock[Clock.SHORT_RATIO], _power(clock)))
    clock[Clock.RECENT], clock[Clock.SHORT_RATIO], clock[Clock.MISSES] = h, max(ratio, 1e-4), 0.0
    clock[Clock.SHORT] = max(length, clock[Clock.SHORT] if h < 0.99 * clock[Clock.SHORT] else shortest)
    if clock[Clock.HIT] > 0.0:
        clock[Clock.SHORT] = h
    clock[Clock.CEILING] *= _RISES
    clock[Clock.SHORT] = min(clock[Clock.SHORT], max(clock[Clock.CEILING], h))


@kernel
def lengthen_kink(clock: Vector, h: float, ratio: float, shortest: float) -> None:
    """After a step that was kept although its error is larger: back to lengths as before.

    Where the shortest step misses the accuracy, contacts that oscillate may settle in longer ones, which are tried.
    """
    beyond, clock[Clock.SHORT_RATIO] = clock[Clock.BEYOND] > 0.0, ratio
    clock[Clock.SHORT] = _MOST * h if beyond else max(clock[Clock.RECENT], _MOST * h)
    if h <= shortest and not beyond:
        clock[Clock.SHORT] = h * _MOST ** (1.0 + clock[Clock.MISSES] % _TRIES)
        clock[Clock.MISSES] += 1.0
    if clock[Clock.HIT] > 0.0:
        clock[Clock.SHORT] = h


@kernel
def shorten(clock: Vector, h: float, ratio: float, shortest: float) -> None:
    """After a step without an impact whose error is too large; the second one of a node may be on a kink."""
    most = 0.9 if clock[Clock.REFUSED] == 0.0 else _AGAIN
    clock[Clock.REFUSED] = 1.0
    length = next_length(h, ratio, 1.0, _power(clock))
    if clock[Clock.ROUGH] > 1.0:  # with order 4
        length = max(length, _SAFE * h * min(1.0 / clock[Clock.ROUGH], sqrt(_PRESSED / ratio)))
    length = min(length, most * h)
    clock[Clock.SHORT] = max(length, shortest) if clock[Clock.MISSES] == 0.0 else shortest


@kernel
def shorten_unsolved(clock: Vector, h: float, shortest: float) -> None:
    """After a step that has no solution."""
    clock[Clock.SHORT], clock[Clock.CEILING] = max(0.25 * h, shortest), 0.5 * h


@kernel
def stalls(clock: Vector, error: float) -> bool:
    """Whether an impact is kept since shorter steps make it no more exact: once where its error is slight, twice
    where it is large, and told. That of bodies which hit in turn may depend on the order, and jump.
    """
    stalled = clock[Clock.HIT] > 0.0 and 0.0 < _STALLED * clock[Clock.MISS] < error
    return stalled and (error < _SLIGHT or clock[Clock.STALLS] > 0.0 and error > _LARGE)


@kernel
def note_miss(clock: Vector, error: float) -> None:
    """After an impact that was refused for its error, in accuracies."""
    stalled = 0.0 < _STALLED * clock[Clock.MISS] < error
    clock[Clock.STALLS] = clock[Clock.STALLS] + 1.0 if stalled else 0.0
    clock[Clock.MISS] = error


@kernel
def shorten_impact(clock: Vector, tried: float, h: float) -> None:
    """Steps with an impact are no longer than h < tried; where it comes later than h/2, a step ends before it."""
    clock[Clock.IMPACT], ahead = h, clock[Clock.AHEAD]
    clock[Clock.LANDING] = clock[Clock.TIME] + ahead
    clock[Clock.CUT] = _UP_TO * ahead if 0.5 * h < ahead < tried else h


@kernel
def before_impact(clock: Vector) -> float:
    """Longest step on the way to an impact that was found: almost up to it, or half the way, then with it."""
    if clock[Clock.IMPACT] == NEVER or clock[Clock.LANDING] > 0.5 * NEVER:
        return NEVER
    left = clock[Clock.LANDING] - clock[Clock.TIME]
    if left <= 0.0:  # it did not come: it has to be found anew
        clock[Clock.IMPACT] = NEVER
        return NEVER
    return max((_UP_TO if left > _NEARLY * clock[Clock.IMPACT] else _HALF_WAY) * left, clock[Clock.IMPACT])


@kernel
def before_landing(h: float, ahead: float) -> float:
    """Length of a step that ends before contacts that the last one, of length h, reached after the time `ahead`."""
    return max(min(_UP_TO * ahead, 0.5 * h if ahead >= h else h), 0.02 * h)


@kernel
def before_stop(clock: Vector, h: float) -> float:
    """The length h, or as far as to where a contact stops sliding."""
    left = clock[Clock.STOP] - clock[Clock.TIME]
    return left if _SOON * h < left < h else h
