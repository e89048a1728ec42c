"""How what kernels are made of becomes LLVM's instructions: entries and rows of arrays, shapes, plain arithmetic.

For one entry of a matrix Numba 0.68 writes 45 instructions, most of which copy its seven words about, and looks through
every implementation of every operator for each `+`: reading, cleaning and optimising that was a third of a cold start.
Here the same takes four to ten, which the optimiser turns into the same code. Everything else is left to Numba, and so
is every index when bounds are checked.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from typing import Any

from llvmlite.ir import Constant, IntType
from numba.core import ir, types
from numba.core.compiler_machinery import register_pass
from numba.core.lowering import Lower
from numba.core.typed_passes import NativeLowering

__all__ = ["KernelLowering", "array_value"]

_WORD = IntType(64)
_MEMINFO, _PARENT, _NITEMS, _ITEMSIZE, _DATA, _SHAPE, _STRIDES = range(7)  # words of an array
_NUMBERS = (types.float64, types.int64)


def array_value(
    context: Any, builder: Any, kind: Any, data: Any, shape: Sequence[Any], strides: Sequence[Any], owner: Any = None
) -> Any:
    """The words of an array of 8-byte numbers; owner: (meminfo, parent), of nobody when left out."""
    value = Constant(context.get_value_type(kind), None)
    for k, word in zip((_MEMINFO, _PARENT), owner or (), strict=False):
        value = builder.insert_value(value, word, k)
    count = shape[0]
    for n in shape[1:]:
        count = builder.mul(count, n, flags=["nsw"])
    value = builder.insert_value(value, count, _NITEMS)
    value = builder.insert_value(value, _WORD(8), _ITEMSIZE)
    value = builder.insert_value(value, data, _DATA)
    for k, (n, stride) in enumerate(zip(shape, strides, strict=True)):
        value = builder.insert_value(value, n, (_SHAPE, k))
        value = builder.insert_value(value, stride, (_STRIDES, k))
    return value


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


_ARITHMETIC = _arithmetic()


class _Lower(Lower):
    """Numba's, but for what is said above; for functions without reference counts."""

    def init(self) -> None:
        """Before anything is lowered."""
        super().init()
        self._items: dict[Any, list[Any]] = {}  # of tuples, by their values

    def storevar(self, value: Any, name: str, argidx: Any = None) -> None:
        """Keep the value of a variable: no reference is counted, so its last one is of no interest."""
        self._alloca_var(name, self.typeof(name))
        if name in self._singly_assigned_vars:
            self._blk_local_varmap[name] = value
        else:
            self.builder.store(value, self.getvar(name))

    def delvar(self, name: str) -> None:
        """The end of a variable."""
        if name not in self._blk_local_varmap:
            self._singly_assigned_vars.discard(name)
        self._alloca_var(name, self.typeof(name))

    def lower_inst(self, inst: Any) -> None:
        """One statement."""
        if isinstance(inst, ir.Assign):
            self.storevar(self.lower_assign(self.typeof(inst.target.name), inst), inst.target.name)
        elif not (isinstance(inst, ir.SetItem | ir.StaticSetItem) and self._write(inst)):
            super().lower_inst(inst)

    def lower_expr(self, resty: Any, expr: Any) -> Any:
        """One expression."""
        if expr.op in ("getitem", "static_getitem"):
            value = self._read(resty, expr.value.name, expr.index if expr.op == "getitem" else expr.index_var)
            if value is not None:
                return value
        elif expr.op == "getattr" and expr.attr == "shape" and isinstance(self.typeof(expr.value.name), types.Array):
            return self._word(expr.value.name, _SHAPE)
        value = super().lower_expr(resty, expr)
        if expr.op == "build_tuple":
            self._items[value] = [self.loadvar(item.name) for item in expr.items]
        return value

    def lower_binop(self, resty: Any, expr: Any, op: Any) -> Any:
        """An operator of two numbers."""
        kinds = self.fndesc.calltypes[expr].args
        write = _ARITHMETIC.get((op, kinds[0])) if kinds[0] == kinds[1] else None
        if write is None:
            return super().lower_binop(resty, expr, op)
        x, y = (
            self.context.cast(self.builder, self.loadvar(side.name), self.typeof(side.name), kinds[0])
            for side in (expr.lhs, expr.rhs)
        )
        result = self.fndesc.calltypes[expr].return_type
        return self.context.cast(self.builder, write(self.builder, x, y), result, resty)

    def _word(self, name: str, *path: int) -> Any:
        """A word of a variable."""
        if name in self._blk_local_varmap:
            return self.builder.extract_value(self._blk_local_varmap[name], path)
        slot = self.builder.gep(self.getvar(name), [IntType(32)(k) for k in (0, *path)], inbounds=True)
        return self.builder.load(slot)

    def _indices(self, index: Any) -> list[Any] | None:
        """The whole numbers of an index; None when it has anything else, a slice for one."""
        if index is None:
            return None
        kind = types.unliteral(self.typeof(index.name))
        several = isinstance(kind, types.BaseTuple)
        if any(types.unliteral(k) != types.int64 for k in (kind.types if several else (kind,))):
            return None
        value = self.loadvar(index.name)
        if not several:
            return [value]
        return self._items.get(value) or [self.builder.extract_value(value, k) for k in range(len(kind.types))]

    def _place(self, name: str, index: Any) -> tuple[Any, list[int]] | None:
        """Where entry or row array[index] begins, and which dimensions it has left; None: not for us."""
        kind = self.typeof(name)
        if not isinstance(kind, types.Array) or kind.layout != "C" or kind.dtype not in _NUMBERS or not kind.aligned:
            return None
        indices = None if self.context.enable_boundscheck else self._indices(index)
        if indices is None or len(indices) > kind.ndim:
            return None
        b = self.builder
        offset: Any = _WORD(0)
        for k in range(kind.ndim):
            i = indices[k] if k < len(indices) else _WORD(0)
            known = isinstance(i, Constant) and i.constant >= 0
            zero = [isinstance(n, Constant) and n.constant == 0 for n in (offset, i)]
            size = self._word(name, _SHAPE, k) if not (known and zero[0]) else None
            if not known:
                i = b.select(b.icmp_signed("<", i, _WORD(0)), b.add(i, size), i)
            if zero[0]:
                offset = i
            else:
                offset = b.mul(offset, size)
                offset = offset if zero[1] else b.add(offset, i)
        return b.gep(self._word(name, _DATA), [offset]), list(range(len(indices), kind.ndim))

    def _read(self, resty: Any, name: str, index: Any) -> Any:
        """array[index], an entry or a row."""
        place = self._place(name, index)
        if place is None:
            return None
        data, left = place
        kind = self.typeof(name)
        if not left:
            return self.context.cast(self.builder, self.builder.load(data), kind.dtype, resty)
        shape, strides = ([self._word(name, words, k) for k in left] for words in (_SHAPE, _STRIDES))
        owner = self._word(name, _MEMINFO), self._word(name, _PARENT)
        return array_value(self.context, self.builder, resty, data, shape, strides, owner)

    def _write(self, inst: Any) -> bool:
        """array[index] = value, of an entry; False: not for us."""
        index = inst.index if isinstance(inst, ir.SetItem) else inst.index_var
        name, kind = inst.target.name, self.typeof(inst.target.name)
        if not isinstance(kind, types.Array) or isinstance(self.typeof(inst.value.name), types.Array):
            return False
        if self._many(index) != kind.ndim:
            return False
        place = self._place(name, index)
        if place is None:
            return False
        value = self.context.cast(
            self.builder, self.loadvar(inst.value.name), self.typeof(inst.value.name), kind.dtype
        )
        self.builder.store(value, place[0])
        return True

    def _many(self, index: Any) -> int:
        """How many numbers an index has."""
        kind = self.typeof(index.name)
        return len(kind.types) if isinstance(kind, types.BaseTuple) else 1


@register_pass(mutates_CFG=True, analysis_only=False)
class KernelLowering(NativeLowering):
    """Numba's pass, with the above."""

    _name = "kernel_lowering"

    @property
    def lowering_class(self) -> type[Lower]:
        """What does it."""
        return _Lower
