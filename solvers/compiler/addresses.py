"""Calls of users' loops by their address, from kernels, which are compiled before them and for all of them.

    observe_at = AddressCall("Span", "Matrix", "Matrix")
    address = observe_at.address(loop)                  in Python
    failed = observe_at(address, (part, xs, out))       in a kernel: 1 where the loop raises an error, 0 otherwise

An error cannot pass through a loop over threads: whoever learns of one calls the loop again, from Python.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.registry import cpu_target
from numba.extending import intrinsic

__all__ = ["AddressCall"]

_KINDS = {
    "Span": types.UniTuple(types.int64, 2),
    "Vector": types.Array(types.float64, 1, "C"),
    "Matrix": types.Array(types.float64, 2, "C"),
    "Cube": types.Array(types.float64, 3, "C"),
    "Flags": types.Array(types.boolean, 1, "C"),
    "Integers": types.Array(types.int64, 1, "C"),
}
_LOOPS: list[Callable[..., Any]] = []  # with NUMBA_DISABLE_JIT=1, by their number, from 1


class AddressCall:
    """Calls of loops with arguments of these kinds, which return nothing.

    Args:
        *kinds: names of types, as in solvers/types.py.
    """

    def __init__(self, *kinds: str) -> None:
        self._kinds = tuple(_KINDS[kind] for kind in kinds)
        self._call = _caller(self._kinds)

    def __call__(self, address: int, args: tuple[Any, ...]) -> int:
        """The call in kernels that run uncompiled."""
        try:
            _LOOPS[address - 1](*args)
        except Exception:
            return 1
        return 0

    def address(self, loop: Any) -> int:
        """Where the compiled loop is, in this process; uncompiled, its number, from 1."""
        if numba.config.DISABLE_JIT:
            if loop not in _LOOPS:
                _LOOPS.append(loop)
            return _LOOPS.index(loop) + 1
        return int(loop.address(self._kinds))

    @property
    def _numba_type_(self) -> Any:
        return cpu_target.typing_context.resolve_value_type(self._call)


def _caller(kinds: tuple[Any, ...]) -> Any:
    """The code of a call."""

    @intrinsic
    def call(typing: Any, address: Any, args: Any) -> Any:
        def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            parts = cgutils.unpack_tuple(builder, values[1], len(kinds))
            kind = context.call_conv.get_function_type(types.none, kinds)
            callee = builder.inttoptr(values[0], kind.as_pointer())
            status, _ = context.call_conv.call_function(builder, callee, types.none, kinds, parts)
            return builder.zext(status.is_error, ir.IntType(64))

        return types.int64(types.int64, types.Tuple(kinds)), lower

    return call
