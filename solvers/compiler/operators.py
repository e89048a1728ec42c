"""Operators on types of our own: instructions that kernels have, and other functions of the process do not see."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import types
from numba.core.typing.templates import ConcreteTemplate, signature
from numba.extending import lower_builtin

__all__ = ["OPERATORS", "kernel_operator", "with_our_cases"]

OPERATORS: dict[tuple[Any, types.Type, types.Type], tuple[types.Type, Callable[..., Any]]] = {}
_FUNCTIONS: dict[Any, types.Function] = {}  # by operator: Numba's, with our cases


def kernel_operator(op: Any, left: types.Type, right: types.Type, result: types.Type, write: Any) -> None:
    """Give an operator on two types the instructions write(builder, x, y).

    Of their types Numba's registry knows nothing; its own pipeline, which finds instructions there alone, is given them
    for these types, which no other function has.
    """
    OPERATORS[op, left, right] = result, write
    lower_builtin(op, left, right)(lambda context, builder, sig, args: write(builder, *args))


def with_our_cases(op: Any, known: Any) -> Any:
    """The type of an operator, with the cases above; `known` is Numba's."""
    if op not in _FUNCTIONS:
        ours = [signature(result, *kinds) for (key, *kinds), (result, _) in OPERATORS.items() if key is op]

        class Cases(ConcreteTemplate):
            key = op
            cases = ours

        _FUNCTIONS[op] = types.Function((*known.templates, Cases))
    return _FUNCTIONS[op]
