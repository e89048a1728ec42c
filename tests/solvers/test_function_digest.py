"""Functions of the user by content: the same digest in every process, another for whatever compiles to other code."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from solvers.compiler import fingerprint, users_cache, users_kernel
from solvers.compiler.function_digest import function_digest
from support.fork_server import forked

GAIN = 1.0


class PlanePoint(NamedTuple):
    x: float
    y: float


class Side(IntEnum):
    LEFT = 0
    RIGHT = 1


def scaled(gain: Any) -> Callable[..., Any]:
    def function(x: Any) -> Any:
        return gain * x

    return function


def digest(func: Callable[..., Any]) -> str | None:
    return function_digest(func, {})


def of_global(x: Any) -> Any:
    return GAIN * x


def of_global_inside(x: Any) -> Any:
    def inner(y: Any) -> Any:
        return GAIN * y

    return inner(x)


def around(func: Callable[..., Any]) -> Callable[..., Any]:
    def function(x: Any) -> Any:
        return func(x) + 1.0

    return function


def test_equal_functions_have_equal_digests() -> None:
    for value in (
        2.0,
        (1, "a"),
        np.ones(3),
        PlanePoint(1.0, 2.0),
        Side.LEFT,
        Side,
        np.float64(3.0),
        math.sin,
        np.cos,
        abs,
    ):
        assert digest(scaled(value)) == digest(scaled(value)) is not None
    assert digest(scaled(np.ones(3))) == digest(scaled(np.ones(3)))
    assert digest(around(users_kernel(scaled(2.0)))) == digest(around(users_kernel(scaled(2.0)))) is not None


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (1.0, 2.0),
        (1, 1.0),
        (1, True),
        (0.0, -0.0),
        (np.ones(3), np.array([1.0, 1.0, 2.0])),
        (np.ones(4), np.ones((2, 2))),
        (np.ones((2, 2)), np.asfortranarray(np.ones((2, 2)))),
        (np.ones(2), np.ones(2, dtype=np.float32)),
        ((1.0, 2.0), PlanePoint(1.0, 2.0)),
        (Side.LEFT, 0),
        (math.sin, math.cos),
        (np.sin, math.sin),
        (users_kernel(scaled(1.0)), users_kernel(scaled(2.0))),
        (users_kernel(scaled(1.0)), users_kernel(scaled(1.0), boundscheck=False)),
        (numba.njit(scaled(1.0)), numba.njit(fastmath=True)(scaled(1.0))),
    ],
)
def test_other_values_have_other_digests(one: Any, other: Any) -> None:
    found = digest(scaled(one)), digest(scaled(other))
    assert None not in found and found[0] != found[1]
    assert fingerprint(scaled(one)) != fingerprint(scaled(other))


@pytest.mark.parametrize("function", [of_global, of_global_inside, around(users_kernel(of_global))])
def test_globals_count_however_deep(function: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    before = digest(function)
    monkeypatch.setitem(globals(), "GAIN", 2.0)
    assert None not in (before, digest(function)) and digest(function) != before


@pytest.mark.parametrize("value", [scaled(1.0), json, object(), [1.0], {"a": 1.0}, np.array([object()]), Path])
def test_what_may_change_unseen_has_no_digest(value: Any) -> None:
    """A plain function, a module of others, or an object: in this process each counts as itself."""
    assert digest(scaled(value)) is None
    assert fingerprint(scaled(value)) == fingerprint(scaled(value))
    assert fingerprint(scaled(value)) != fingerprint(scaled(object()))


@users_kernel
def countdown(n: int) -> int:
    return 0 if n <= 0 else countdown(n - 1)


def test_a_function_that_calls_itself_has_a_digest() -> None:
    assert digest(around(countdown)) is not None
    assert users_kernel(around(countdown))(3) == 1.0


@pytest.mark.slow
def test_a_value_that_changes_is_not_kept_under_the_old_one() -> None:
    """The second signature of a loop compiles after a global has changed."""
    programs = (
        "gain = 2.0\nloop = users_loop(f)\na = loop(1.0)\ngain = 3.0\nprint([a, loop(1)])",
        "gain = 2.0\nprint([users_loop(f)(1.0), users_loop(f)(1)])",
    )
    head = "from solvers.compiler import users_loop\ndef f(x):\n    return gain * x\n"
    assert [json.loads(forked(head + text)) for text in programs] == [[2.0, 3.0], [2.0, 2.0]]


LOOPS = """
import json, sys
import numpy as np
from numba.core import event
from solvers.compiler import users_kernel, users_loop
class Count(event.Listener):
    names = []
    def on_start(self, found):
        self.names.append(found.data["dispatcher"].py_func.__name__)
    def on_end(self, found):
        pass
event.register("numba:compile", Count())
def made(gain):
    @users_kernel
    def part(x):
        return gain * x[0]
    @users_loop
    def whole(x):
        if x[0] > 10.0:
            raise ValueError("large")
        return part(x) + part(x[1:])
    return whole
found = [made(gain)(np.ones(2)) for gain in GAINS]
try:
    made(GAINS[0])(np.full(2, 11.0))
except ValueError as error:
    found.append(str(error))
try:
    made(GAINS[0])(np.ones(1))
except IndexError as error:
    found.append("beyond")
print(json.dumps([found, len(Count.names)]))
"""


def run(gains: list[float], folder: Path) -> Any:
    return json.loads(forked(LOOPS.replace("GAINS", str(gains)), NUMBA_CACHE_DIR=str(folder)))


@pytest.mark.slow
def test_another_process_compiles_nothing_and_mixes_nothing_up(tmp_path: Path) -> None:
    """Functions of one name, loaded and compiled side by side, in another order than that in which they were kept."""
    tail = ["large", "beyond"]
    assert run([1.0, 2.0, 3.0], tmp_path) == [[2.0, 4.0, 6.0, *tail], 6]
    assert run([3.0, 1.0, 2.0], tmp_path) == [[6.0, 2.0, 4.0, *tail], 0]
    assert run([5.0, 3.0, 4.0, 1.0], tmp_path) == [[10.0, 6.0, 8.0, 2.0, *tail], 4]
    for file in tmp_path.rglob("users-*.nbc"):
        file.write_bytes(file.read_bytes()[:-1])
    assert run([3.0, 1.0], tmp_path) == [[6.0, 2.0, *tail], 4]


@pytest.mark.slow
def test_code_given_to_numba_by_others_turns_it_off(tmp_path: Path) -> None:
    """A function of NumPy that Numba does not know, as a user defines it: the definition may change without a trace."""
    program = """
import numpy as np
from numba.extending import overload
from solvers.compiler import users_loop
@overload(np.pad)
def pad(x):
    return lambda x: FACTOR * x
print(users_loop(lambda x: np.pad(x))(3.0))
"""
    found = [float(forked(program.replace("FACTOR", factor), NUMBA_CACHE_DIR=str(tmp_path))) for factor in "23"]
    assert found == [6.0, 9.0] and not list(tmp_path.rglob("users-*"))


def test_unused_files_are_dropped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Few:
        folder = tmp_path

        @staticmethod
        def drop(name: str) -> None:
            (tmp_path / name).unlink()

    monkeypatch.setattr(users_cache, "STORE", Few)
    monkeypatch.setattr(users_cache, "_MOST", 3)
    for k, name in enumerate(("users-b", "users-a", "users-d", "users-c", "step")):
        (tmp_path / f"{name}.nbc").write_bytes(b"")
        os.utime(tmp_path / f"{name}.nbc", (k, k))
    users_cache._prune()
    assert sorted(path.stem for path in tmp_path.iterdir()) == ["step", "users-c", "users-d"]
