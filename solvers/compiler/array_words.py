"""The words of an array in compiled code, separate until the array is used as one value."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from llvmlite.ir import Constant, IntType

__all__ = ["DATA", "SHAPE", "STRIDES", "WORD", "ArrayWords"]

WORD = IntType(64)
_NOBODY = (Constant(IntType(8).as_pointer(), None),) * 2
DATA, SHAPE, STRIDES = 4, 5, 6  # where they are in the value; before them meminfo, parent, nitems, itemsize


class ArrayWords:
    """An array of 8-byte numbers: (meminfo, parent, nitems, itemsize, data, shape, strides), as Numba has it.

    home: the field of a record that it is part of, "" where that is not known.
    """

    def __init__(self, words: Sequence[Any], shape: Sequence[Any], strides: Sequence[Any], home: str = "") -> None:
        self.words, self.shape, self.strides, self.home = tuple(words), tuple(shape), tuple(strides), home

    @classmethod
    def of(
        cls,
        builder: Any,
        data: Any,
        shape: Sequence[Any],
        strides: Sequence[Any],
        owner: Sequence[Any] = _NOBODY,
        home: str = "",
    ) -> ArrayWords:
        """An array of this data; owner: meminfo and parent."""
        count = shape[0]
        for n in shape[1:]:
            count = builder.mul(count, n, flags=["nsw"])
        return cls((*owner, count, WORD(8), data), shape, strides, home)

    @classmethod
    def from_flat(cls, flat: Sequence[Any], dimensions: int) -> ArrayWords:
        """An array of all its words, as a function takes them."""
        return cls(flat[:SHAPE], flat[SHAPE : SHAPE + dimensions], flat[SHAPE + dimensions :])

    @property
    def flat(self) -> tuple[Any, ...]:
        """All words, as a function takes them."""
        return (*self.words, *self.shape, *self.strides)

    def word(self, k: int, *dimension: int) -> Any:
        """One word."""
        if k < SHAPE:
            return self.words[k]
        return (self.shape, self.strides)[k - SHAPE][dimension[0]]

    def value(self, builder: Any, kind: Any) -> Any:
        """The array as one value of this LLVM type."""
        value = Constant(kind, None)
        for k, word in enumerate(self.words):
            value = builder.insert_value(value, word, k)
        for d, (size, stride) in enumerate(zip(self.shape, self.strides, strict=True)):
            value = builder.insert_value(value, size, (SHAPE, d))
            value = builder.insert_value(value, stride, (STRIDES, d))
        return value
