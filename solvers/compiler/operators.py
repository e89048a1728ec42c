"""Operators on types of our own: instructions that kernels have, and other functions of the process do not see."""

from __future__ import annotations

from typing import Any

from numba import types
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import lower_builtin

from solvers.compiler.arithmetic import OPERATORS
from solvers.compiler.pipeline import FAST

__all__ = ["kernel_operator"]


def kernel_operator(op: Any, left: types.Type, right: types.Type, result: types.Type, write: Any) -> None:
    """Give an operator on two types the instructions write(builder, x, y).

    Numba's own pipeline finds operators in its registry alone, which the whole process shares.
    """
    if FAST:
        OPERATORS[op, left, right] = result, write
        return

    class Cases(ConcreteTemplate):
        key = op
        cases = [signature(result, left, right)]

    infer_global(op)(Cases)
    lower_builtin(op, left, right)(lambda context, builder, sig, args: write(builder, *args))
