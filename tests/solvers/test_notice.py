"""A word to whoever waits for a compilation: once, late, and only to a terminal."""

from __future__ import annotations

import io
import sys

import pytest

from solvers.compiler import notice


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """A clock to be set, and a notice that has not been given."""
    now = [0.0]
    monkeypatch.setattr(notice, "_CLOCK", notice._Clock())
    monkeypatch.setattr(notice.time, "perf_counter", lambda: now[0])
    return now


def compile_for(clock: list[float], seconds: float, within: int = 1) -> None:
    with notice.compiling():
        for _ in range(within):
            clock[0] += seconds
            with notice.compiling():
                pass


def test_a_terminal_is_told_once_when_it_takes_long(clock: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    compile_for(clock, 0.5, within=2)
    assert stream.getvalue() == ""
    compile_for(clock, 0.5, within=4)
    compile_for(clock, 9.0)
    assert stream.getvalue().count("compiling") == 1


def test_time_between_compilations_does_not_count(clock: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    for _ in range(3):
        compile_for(clock, 0.1)
        clock[0] += 100.0
    assert stream.getvalue() == ""


def test_a_file_is_told_nothing(clock: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    stream = io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    compile_for(clock, 9.0)
    assert stream.getvalue() == ""
