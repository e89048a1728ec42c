"""Ctrl-C during a compilation: no lock of Numba or LLVM stays closed, and the next compilation is right."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import pytest
from llvmlite.binding import ffi
from numba.core.compiler_lock import global_compiler_lock

from solvers.compiler import local_kernel, users_kernel
from support.interrupts import dropped

# functions that take and leave the locks of LLVM and of Numba
LLVM, NUMBA = type(ffi.lib._lock), type(global_compiler_lock)
LOCKS = (LLVM.__enter__, LLVM.__exit__, NUMBA.__enter__, NUMBA.__exit__, NUMBA.acquire, NUMBA.release)


def _compile_anew(decorate: Callable[[Any], Any]) -> float:
    """Compile a function and call it."""

    @decorate
    def line(x: float) -> float:
        return 2.0 * x + 1.0

    return float(line(5.5))


@pytest.mark.sweep(2)
@pytest.mark.parametrize("decorate", [local_kernel, users_kernel])
def test_ctrl_c_in_a_compilation_leaves_no_lock_closed(decorate: Callable[[Any], Any]) -> None:
    found: list[float] = []

    def compile_anew() -> None:
        found.append(_compile_anew(decorate))

    for within in (LOCKS, ()):
        assert dropped(compile_anew, 12, within) == []
        found.clear()
        other = threading.Thread(target=compile_anew, daemon=True)
        other.start()
        other.join(60.0)
        assert found == [12.0], "a lock is kept"
        compile_anew()
        assert found == [12.0, 12.0]
