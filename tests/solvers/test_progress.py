"""Progress messages during compilation: late, short, and only to a terminal or a notebook."""

from __future__ import annotations

import io
import sys
from collections.abc import Iterable
from importlib import import_module
from types import SimpleNamespace

import pytest

from solvers.compiler import progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """A settable clock, and no messages so far."""
    now = [0.0]
    monkeypatch.setattr(progress, "_CLOCK", progress._Clock())
    monkeypatch.setattr(progress.time, "perf_counter", lambda: now[0])
    monkeypatch.delenv("DOJO_OPT_QUIET", raising=False)
    return now


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> io.StringIO:
    return watched(monkeypatch, Terminal())


def watched(monkeypatch: pytest.MonkeyPatch, stream: io.StringIO, *modules: str) -> io.StringIO:
    """The stream as standard error; `sys.stderr` itself changes between a fixture and its test."""
    monkeypatch.setattr(
        progress, "sys", SimpleNamespace(stderr=stream, modules={**sys.modules, **dict.fromkeys(modules)})
    )
    return stream


def compile_for(clock: list[float], seconds: float, within: int = 1) -> None:
    with progress.compiling(compile_for):
        for _ in range(within):
            clock[0] += seconds
            with progress.compiling(parts_of):
                pass


def parts_of(items: Iterable[int]) -> list[int]:
    return list(progress.parts(items))


def test_compiling_for_longer_than_a_second_is_announced(clock: list[float], terminal: io.StringIO) -> None:
    progress.because("no code is shipped")
    compile_for(clock, 0.4, within=2)
    assert terminal.getvalue() == ""
    compile_for(clock, 0.5, within=4)
    assert terminal.getvalue().count("dojo_opt: compiling, once: no code is shipped\n") == 1
    assert "compiling function 5 (1 s so far): progress messages during compilation " in terminal.getvalue()
    compile_for(clock, 9.0)
    assert "compiling function 10 (12 s so far)" in terminal.getvalue()
    assert terminal.getvalue().count("once") == 1
    assert terminal.getvalue().endswith(" \r"), "the line is removed at the end"


def test_the_topic_is_that_of_the_entry_in_words() -> None:
    def function() -> None: ...

    for module, topic in (
        ("sim.contact.inactive", "the active set of contacts with the ground"),
        ("sim.dynamics.joints.limits", "joint limits on the central path"),
        ("solvers.lu", "LU factors with row pivoting of small matrices"),
    ):
        import_module(module)
        function.__module__ = module
        assert progress._topic(function) == topic
    function.__module__, function.__qualname__ = "of_a_user", "f"
    assert progress._topic(function) == "of_a_user.f"


def test_parts_of_a_task_are_counted(clock: list[float], terminal: io.StringIO) -> None:
    for _ in progress.parts("abc", 3):
        compile_for(clock, 0.7)
    assert "part 2 of 3): progress" in terminal.getvalue()
    before = len(terminal.getvalue())
    compile_for(clock, 2.0)
    assert "part" not in terminal.getvalue()[before:].replace("parts_of", "")


def test_time_between_compilations_does_not_count(clock: list[float], terminal: io.StringIO) -> None:
    for _ in range(3):
        compile_for(clock, 0.1)
        clock[0] += 100.0
    assert terminal.getvalue() == ""


def test_quiet_says_nothing(clock: list[float], terminal: io.StringIO, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DOJO_OPT_QUIET", "1")
    compile_for(clock, 9.0)
    assert terminal.getvalue() == ""


def test_a_file_is_told_once(clock: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    stream = watched(monkeypatch, io.StringIO())
    progress.because("no code is shipped")
    compile_for(clock, 0.4)
    assert stream.getvalue() == ""
    for _ in range(3):
        compile_for(clock, 9.0)
    assert stream.getvalue() == "dojo_opt: compiling, once: no code is shipped\n"


def test_a_quiet_file_and_no_output_at_all(clock: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DOJO_OPT_QUIET", "1")
    stream = watched(monkeypatch, io.StringIO())
    compile_for(clock, 9.0)
    assert stream.getvalue() == ""
    monkeypatch.setenv("DOJO_OPT_QUIET", "0")
    monkeypatch.setattr(progress, "sys", SimpleNamespace(stderr=None, modules={}))
    compile_for(clock, 9.0)


def test_a_notebook_is_told(clock: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    stream = watched(monkeypatch, io.StringIO(), "ipykernel")
    compile_for(clock, 9.0)
    assert "compiling" in stream.getvalue()


def test_compilations_are_counted_by_name(clock: list[float]) -> None:
    compile_for(clock, 0.0)
    assert [name.split(".")[-1] for name in progress.compiled()] == ["compile_for", "parts_of"]


def test_the_number_of_functions_is_told_as_far_as_it_is_known(clock: list[float], terminal: io.StringIO) -> None:
    compile_for(clock, 0.1)
    for _ in progress.parts([1], 1):
        progress.expect(8)
        compile_for(clock, 3.0)
    assert "function 4 of about 10 (3 s so far)" in terminal.getvalue()
    compile_for(clock, 3.0)
    assert "function 6 (6 s so far)" in terminal.getvalue()
