"""Loops over ranges of whole numbers in compiled code.

For `for i in range(n)` Numba writes some sixty instructions, in nine blocks. Most of them find out the sign of the
step, and whether it is zero. A step that is written as a number needs about ten, in the blocks of the loop itself. The
optimiser turns both into the same code, but reading and cleaning the longer one was a twentieth of a cold start.

The optimiser also writes four or eight rounds of a loop side by side where it does not know their number, with a second
loop for the rest. Loops of kernels run over a few joints, axes or contacts: the further code is seldom used, and took a
twentieth of a cold start. `Loop` forbids that; loops of a known number of rounds are written out as before.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from llvmlite.ir import Constant, MetaDataString, Module
from llvmlite.ir.values import MDValue
from numba import types
from numba.core import cgutils

from solvers.compiler.array_words import WORD

__all__ = ["RANGE", "Loop", "RangeIterator", "RangeValue", "RangeRound"]

RANGE = types.range_state64_type


class Loop(MDValue):
    """A loop that is not written out where its number of rounds is unknown: LLVM's `llvm.loop`, one node for each."""

    @classmethod
    def of(cls, module: Module) -> Loop:
        """The node of one more loop of a module."""
        rolled = module.add_metadata([MetaDataString(module, "llvm.loop.unroll.runtime.disable")])
        return cls(module, [rolled], str(len(module.metadata)))

    def descr(self, buf: list[str]) -> None:
        """Write it; the first operand of such a node is itself."""
        references = ", ".join(node.get_reference() for node in (self, *self.operands))
        buf += (f"distinct !{{ {references} }}", "\n")


class RangeValue(NamedTuple):
    """A range; its step is a number other than zero."""

    start: Any
    stop: Any
    step: int

    @classmethod
    def of(cls, words: Sequence[Any]) -> RangeValue | None:
        """The range of the arguments of `range`; None where its step is not known."""
        step = words[2] if len(words) == 3 else WORD(1)
        if not isinstance(step, Constant) or step.constant == 0:
            return None
        start, stop = (WORD(0), words[0]) if len(words) == 1 else words[:2]
        return cls(start, stop, step.constant)

    def value(self, builder: Any, kind: Any) -> Any:
        """The range as one value of this LLVM type, as Numba has it."""
        return _packed(builder, kind, (self.start, self.stop, WORD(self.step)))

    def begin(self, builder: Any) -> RangeIterator:
        """The iterator, before the first number."""
        ends = (self.stop, self.start) if self.step > 0 else (self.start, self.stop)
        size = abs(self.step)
        count = builder.sub(*ends)
        if size > 1:
            count = builder.sdiv(builder.add(count, WORD(size - 1)), WORD(size))
        count = builder.select(builder.icmp_signed(">", *ends), count, WORD(0))
        number, left = cgutils.alloca_once(builder, WORD), cgutils.alloca_once(builder, WORD)
        found = RangeIterator(number, left, self.stop, self.step)
        builder.store(self.start, found.number)
        builder.store(count, found.left)
        return found


class RangeIterator(NamedTuple):
    """An iterator: where its next number is, and how many are left."""

    number: Any
    left: Any
    stop: Any
    step: int

    def value(self, builder: Any, kind: Any) -> Any:
        """The iterator as one value of this LLVM type, as Numba has it."""
        return _packed(builder, kind, (self.number, self.stop, WORD(self.step), self.left))

    def go_on(self, builder: Any) -> RangeRound:
        """The next round of the loop, if there is one. After the last round the iterator is of no more use."""
        number, left = builder.load(self.number), builder.load(self.left)
        builder.store(builder.add(number, WORD(self.step)), self.number)
        builder.store(builder.sub(left, WORD(1), flags=["nsw"]), self.left)
        return RangeRound(number, builder.icmp_signed(">", left, WORD(0)))


class RangeRound(NamedTuple):
    """The number of a round of a loop, and whether there is such a round."""

    number: Any
    follows: Any

    def value(self, builder: Any, kind: Any) -> Any:
        """Both as one value of this LLVM type, as Numba has it."""
        return _packed(builder, kind, (self.number, builder.zext(self.follows, kind.elements[1])))


def _packed(builder: Any, kind: Any, words: Sequence[Any]) -> Any:
    value = Constant(kind, None)
    for k, word in enumerate(words):
        value = builder.insert_value(value, word, k)
    return value
