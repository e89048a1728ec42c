"""Operators of two numbers of one type, as LLVM's instructions."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from numba import types

__all__ = ["ARITHMETIC"]


def _arithmetic() -> dict[Any, Callable[..., Any]]:
    """What writes an operator of two numbers of one type, by both."""
    table: dict[Any, Callable[..., Any]] = {}
    for name in ("add", "sub", "mul"):
        for op in (getattr(operator, name), getattr(operator, f"i{name}")):
            table[op, types.float64] = lambda b, x, y, f=f"f{name}": getattr(b, f)(x, y)
            table[op, types.int64] = lambda b, x, y, f=name: getattr(b, f)(x, y, flags=["nsw"])
    table[operator.truediv, types.float64] = lambda b, x, y: b.fdiv(x, y)
    for op, sign in zip((operator.lt, operator.le, operator.gt, operator.ge, operator.eq, operator.ne),
                        ("<", "<=", ">", ">=", "==", "!="), strict=True):  # fmt: skip
        real = "fcmp_unordered" if sign == "!=" else "fcmp_ordered"  # NaN differs from everything
        table[op, types.float64] = lambda b, x, y, f=real, s=sign: getattr(b, f)(s, x, y)
        table[op, types.int64] = lambda b, x, y, s=sign: b.icmp_signed(s, x, y)
    return table


ARITHMETIC = _arithmetic()
