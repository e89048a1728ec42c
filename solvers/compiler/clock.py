"""The clock of kernels: a long loop reads it, and returns to Python in time.

    deadline = seconds() + pause
    ...
        if seconds() > deadline: return how far it came

Signals wait until Python runs again, so a loop that never pauses is deaf to Ctrl-C.
"""

from __future__ import annotations

import ctypes
import sys
import time
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from solvers.compiler.instructions import compiled_as

__all__ = ["PAUSE", "seconds"]

PAUSE = 0.02  # [s] a kernel may take before it goes back to Python

if sys.platform == "win32":
    _TICKS = ctypes.windll.kernel32.GetTickCount64
    _TICKS.restype = ctypes.c_uint64

_WORD, _INT = ir.IntType(64), ir.IntType(32)


def _ticks(builder: Any) -> Any:
    """Milliseconds, by Windows."""
    kind = ir.FunctionType(_WORD, [])
    count = builder.call(cgutils.get_or_insert_function(builder.module, kind, "GetTickCount64"), [])
    return builder.fmul(builder.uitofp(count, ir.DoubleType()), ir.Constant(ir.DoubleType(), 1e-3))


def _monotonic(builder: Any) -> Any:
    """Seconds and nanoseconds, by POSIX."""
    kind = ir.FunctionType(_INT, [_INT, _WORD.as_pointer()])
    read = cgutils.get_or_insert_function(builder.module, kind, "clock_gettime")
    moment = cgutils.alloca_once(builder, _WORD, size=2)
    builder.call(read, [ir.Constant(_INT, time.CLOCK_MONOTONIC), moment])
    whole, rest = (builder.load(builder.gep(moment, [ir.Constant(_INT, k)])) for k in range(2))
    whole, rest = (builder.sitofp(part, ir.DoubleType()) for part in (whole, rest))
    return builder.fadd(whole, builder.fmul(rest, ir.Constant(ir.DoubleType(), 1e-9)))


@intrinsic
def _seconds(typing: Any) -> Any:
    def lower(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _ticks(builder) if sys.platform == "win32" else _monotonic(builder)

    return types.float64(), lower


@compiled_as(_seconds)
def seconds() -> float:
    """Seconds that have gone by since some moment, the same one for kernels and Python; the clock never goes back."""
    if sys.platform == "win32":
        return float(_TICKS() * 1e-3)
    return time.clock_gettime(time.CLOCK_MONOTONIC)
