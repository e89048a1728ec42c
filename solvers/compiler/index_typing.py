"""Members of an IntEnum as indices of arrays, which Numba takes since 0.68: in kernels before that, too."""

from __future__ import annotations

import operator
from typing import Any

import numba
from numba import types
from numba.core.typing import Context

__all__ = ["OLD", "IndexTyping"]

OLD = numba.__version__.startswith(("0.66.", "0.67."))


def _whole(kind: types.Type) -> types.Type:
    """The type of an index with whole numbers for members of an IntEnum."""
    if isinstance(kind, types.IntEnumMember):
        return kind.dtype
    if isinstance(kind, types.BaseTuple) and any(isinstance(part, types.IntEnumMember) for part in kind):
        return types.Tuple([_whole(part) for part in kind])
    return kind


class IndexTyping(Context):
    """Numba's typing context, which shares all that the other knows, and equals it: implementations of functions are
    kept by context.
    """

    __slots__ = ("_shared",)  # not in the shared dictionary

    def __init__(self, context: Any) -> None:
        self._shared = context
        object.__setattr__(self, "__dict__", context.__dict__)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Context) and self.__dict__ is other.__dict__

    def __hash__(self) -> int:
        return hash(self._shared)

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        """The signature of a call."""
        if OLD and func is operator.getitem:
            args = args[0], _whole(args[1])
        return super().resolve_function_type(func, args, kws)

    def resolve_setitem(self, target: Any, index: Any, value: Any) -> Any:
        """The signature of array[index] = value."""
        return super().resolve_setitem(target, _whole(index) if OLD else index, value)
