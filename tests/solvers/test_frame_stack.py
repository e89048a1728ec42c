"""Room for Python's frames: calls at any depth of a compilation map no memory."""

from __future__ import annotations

import sys
from collections.abc import Callable

import pytest

from solvers.compiler.frame_stack import with_room

resource = pytest.importorskip("resource", reason="counts page faults")
pytestmark = pytest.mark.skipif(sys.implementation.name != "cpython", reason="CPython keeps frames in pieces")

_CALLS = 200


def _leaf() -> None:
    pass


def _descend(depth: int) -> None:
    """Call a function that does nothing, again and again at every depth."""
    for _ in range(_CALLS):
        _leaf()
    if depth:
        _descend(depth - 1)


def _faults(call: Callable[..., None], *args: object) -> int:
    call(*args)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    call(*args)
    return int(resource.getrusage(resource.RUSAGE_SELF).ru_minflt) - before


def test_no_call_at_any_depth_maps_memory() -> None:
    """Without room, calls at the edge of a piece fault once each: the reason for the room, in this very Python."""
    assert _faults(_descend, 800) > 2 * _CALLS
    assert _faults(with_room, _descend, 800) < _CALLS


def test_results_and_exceptions_come_through_and_nested_calls_share_the_room() -> None:
    """It is a call like any other."""
    assert with_room(lambda a, b: with_room(max, a, b), 3, 5) == 5
    with pytest.raises(KeyError, match="missing"):
        with_room({}.__getitem__, "missing")
    assert _faults(with_room, _descend, 800) < _CALLS, "the room after an exception is a new one"
