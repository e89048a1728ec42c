"""Operators of two numbers of one type in kernels, and the least and largest: their types, and LLVM's instructions.

Numba asks NumPy's and half a dozen other libraries' rules for the type of every `+`, and looks through as many
implementations. Kernels do not ask, and ask about any other function once per process. Nothing is registered with
Numba: other functions of the process are compiled as ever.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from typing import Any

from numba import types
from numba.core.typing.templates import Signature, signature

from solvers.compiler.index_typing import IndexTyping
from solvers.compiler.operators import OPERATORS

__all__ = ["ARITHMETIC", "KernelTyping", "choice"]

_COMPARED = (operator.lt, operator.le, operator.gt, operator.ge, operator.eq, operator.ne)


def _arithmetic() -> dict[Any, Callable[..., Any]]:
    """The code generators of operators on two numbers of one type, by operator and type."""
    table: dict[Any, Callable[..., Any]] = {}
    for name in ("add", "sub", "mul"):
        for op in (getattr(operator, name), getattr(operator, f"i{name}")):
            table[op, types.float64] = lambda b, x, y, f=f"f{name}": getattr(b, f)(x, y)
            table[op, types.int64] = lambda b, x, y, f=name: getattr(b, f)(x, y, flags=["nsw"])
    table[operator.truediv, types.float64] = lambda b, x, y: b.fdiv(x, y)
    for op, sign in zip(_COMPARED, ("<", "<=", ">", ">=", "==", "!="), strict=True):
        real = "fcmp_unordered" if sign == "!=" else "fcmp_ordered"  # NaN differs from everything
        table[op, types.float64] = lambda b, x, y, f=real, s=sign: getattr(b, f)(s, x, y)
        table[op, types.int64] = lambda b, x, y, s=sign: b.icmp_signed(s, x, y)
    return table


ARITHMETIC = _arithmetic()
_CHOICES = {min: operator.lt, max: operator.gt}


def choice(function: Any, kinds: Sequence[types.Type]) -> Callable[..., Any] | None:
    """The code generator of min or max of numbers of one type, in the order in which Python compares them."""
    compare = ARITHMETIC.get((_CHOICES.get(function), kinds[0])) if kinds else None
    if compare is None or any(kind is not kinds[0] for kind in kinds):
        return None

    def write(builder: Any, chosen: Any, *others: Any) -> Any:
        for value in others:
            chosen = builder.select(compare(builder, value, chosen), value, chosen)
        return chosen

    return write


# Numba asks all of these rules anew in every function that it compiles, for most of the same few hundred calls
_CALLS: dict[tuple[Any, tuple[Any, ...]], Signature] = {}
_ITEMS = (operator.getitem, "static_getitem")  # by types, and by the type and an index that is known


class KernelTyping(IndexTyping):
    """Numba's typing context, with a short cut to the types of these operators and of calls that it has met."""

    __slots__ = ()

    def refresh(self) -> None:
        """Do nothing: `cache.prepare` and `cache.renew` did. Numba asks for it before each function."""

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        """The signature of a call."""
        if kws or not isinstance(func, types.Function):
            known = not kws and (func is _ITEMS[0] or func == _ITEMS[1]) and not isinstance(args[1], slice)
            return self._kept(func, args) if known else super().resolve_function_type(func, args, kws)
        if len(args) == 2:
            left, right = map(types.unliteral, args)
            op = func.typing_key
            if left is right and (op, left) in ARITHMETIC:
                func._impl_keys.setdefault((left, left), op)  # where lowering looks for calls of operator.add(x, y)
                return signature(types.boolean if op in _COMPARED else left, left, left)
            if (op, left, right) in OPERATORS:
                return signature(OPERATORS[op, left, right][0], left, right)
        if len(args) > 1 and choice(func.typing_key, kinds := [*map(types.unliteral, args)]):
            return signature(kinds[0], *kinds)
        return self._kept(func, args)

    def _kept(self, func: Any, args: Any) -> Any:
        """The signature of a call that was met before, or is kept from now on."""
        call = func, tuple(args)
        found = _CALLS.get(call)
        if found is None:
            found = super().resolve_function_type(func, args, {})
            if found is not None and all(kind.is_precise() for kind in args if isinstance(kind, types.Type)):
                _CALLS[call] = found
        return found
