"""Ctrl-C during a call, and how long it takes to be heard."""

from __future__ import annotations

import inspect
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from typing import Any, NamedTuple, cast

import pytest

from sim.model import interruptible_loops

LONGER = 4  # as many steps are tried where a call ends before its signal comes: machines differ
TRIES = 3  # a call that does not listen fails in each of them, a busy machine does not
HEARD = 0.2  # [s] of processor time of each thread within which a call has to answer
_THREADS = os.cpu_count() or 1  # whose processor times are added


class HeardInterrupt(NamedTuple):
    """The effect of Ctrl-C."""

    stop: KeyboardInterrupt | None  # None: the call had ended before
    seconds: float  # of processor time, of all threads, from the signal to the exception


@contextmanager
def at_first_piece(start: Callable[[], None]) -> Iterator[None]:
    """Call `start` when the loop over steps begins, whatever time its arguments took before."""
    before = interruptible_loops._pieces

    def begun(settings: Any) -> Iterator[None]:
        start()
        yield from before(settings)

    interruptible_loops._pieces = begun
    try:
        yield
    finally:
        interruptible_loops._pieces = before


def interrupt(call: Callable[[], Any], after: float, *, in_loop: bool = False) -> HeardInterrupt:
    """Send SIGINT to this process so many seconds after `call` has begun, or after its first loop over steps has."""
    sent: list[float] = []

    def send() -> None:
        sent.append(time.process_time())
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(after, send)

    def start() -> None:
        if timer.ident is None:  # later pieces do not start it again
            timer.start()

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    stop = None
    try:
        with at_first_piece(start) if in_loop else nullcontext(start()):
            call()
        timer.cancel()
        timer.join()
        time.sleep(0.01)  # a signal that came this late is heard here
    except KeyboardInterrupt as error:
        stop, end = error, time.process_time()
    finally:
        timer.cancel()
        signal.signal(signal.SIGINT, before)
    return HeardInterrupt(stop, end - sent[0] if stop else 0.0)


def heard(call: Callable[[], Any], after: float = 0.3) -> Any:
    """The content of the exception with which Ctrl-C ends the call, which has to come soon; see `interrupt`."""
    return heard_in(lambda _: call(), 1, after, in_loop=False)


def heard_in(call: Callable[[int], Any], steps: int, after: float, *, in_loop: bool) -> Any:
    """As `heard`, of a call with so many steps, or with more where these take less time."""
    for _ in range(TRIES):
        found = interrupt(partial(call, steps), after, in_loop=in_loop)
        if found.stop is None:
            steps *= LONGER
        elif found.seconds < (1 + _THREADS) * HEARD:
            return getattr(found.stop, "result", None)
    assert found.stop is not None, f"the call took less than {after:g} s"
    pytest.fail(f"heard after {found.seconds:.2f} s")


class _Raised:
    """A call with a SIGINT where Python may handle it: as its function of that number begins; 0: none.

    within: count only these functions, and each of their lines.
    """

    def __init__(self, call: Callable[[], Any], number: int, within: Collection[Any] = ()) -> None:
        self.count, self._number, self._within = 0, number, {function.__code__ for function in within}
        self.where, self.stop = "", cast("KeyboardInterrupt | None", None)
        before, handler = sys.gettrace(), signal.signal(signal.SIGINT, signal.default_int_handler)
        sys.settrace(self._trace)
        try:
            call()
        except KeyboardInterrupt as error:
            self.stop = error
        finally:
            sys.settrace(before)
            signal.signal(signal.SIGINT, handler)

    def _trace(self, frame: Any, event: str, arg: object) -> Any:
        code = frame.f_code
        if code.co_flags & inspect.CO_GENERATOR:  # traced as it is closed, too, where Python handles no signals
            return None
        if event not in ("call", "line") or (self._within and code not in self._within):
            return None if event == "call" else self._trace
        self.count += 1
        if self.count == self._number:
            self.where = f"{code.co_filename}:{frame.f_lineno}:{code.co_qualname}"
            handler = signal.getsignal(signal.SIGINT)
            assert callable(handler)
            handler(signal.SIGINT, frame)
        return self._trace if self._within else None


def _raised_everywhere(call: Callable[[], Any], most: int, within: Collection[Any]) -> list[_Raised]:
    """Calls with a SIGINT in each of the places, or in `most` of them."""
    call()
    counted = _Raised(call, 0, within)
    assert counted.count > 0
    numbers = range(1, counted.count + 1, 1 + counted.count // most)
    return [found for found in (_Raised(call, k, within) for k in numbers) if found.where]


def dropped(call: Callable[[], Any], most: int = 300, within: Collection[Any] = ()) -> list[str]:
    """Places in which a KeyboardInterrupt during the call is lost, of all, or of `most` spread over it; see _Raised."""
    return [found.where for found in _raised_everywhere(call, most, within) if found.stop is None]


def unfinished(call: Callable[[], Any], within: Collection[Any]) -> list[Any]:
    """The `result` that each KeyboardInterrupt within a call carries, in order of time; None: it has none."""
    return [getattr(found.stop, "result", None) for found in _raised_everywhere(call, 10_000, within)]
