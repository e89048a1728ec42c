"""Lanes: eight neighbouring numbers of a row, in the vector registers of the processor.

    x = load(A, i, j)        A[i, j : j + LANES]
    store(A, i, j, a * x + load(A, k, j))

Numba's loops over two rows or more check on every run whether the rows overlap, and end in single numbers; both cost as
much as the work on a row of twenty to eighty numbers. Lanes are explicit. A row that they fill has LANES more
numbers behind it than it needs, or a width that is a multiple of LANES (`whole`).
"""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, register_model
from numpy.typing import NDArray

from solvers.compiler import kernel
from solvers.compiler.instructions import compiled_as
from solvers.compiler.operators import kernel_operator
from solvers.types import Matrix, Vector

__all__ = [
    "LANES",
    "SIDE",
    "Lanes",
    "Six",
    "at_least",
    "dot_lanes",
    "keep",
    "load",
    "lowest",
    "minus_outer",
    "plus",
    "plus_outer",
    "put",
    "root",
    "six",
    "spread",
    "store",
    "total",
    "whole",
    "zeros",
]

LANES = 8
SIDE = 3 * LANES  # columns of a panel at a time: while one product is under way, others begin
Lanes = NDArray[np.float64]  # without compilation; (LANES,)
Six = tuple[Lanes, Lanes, Lanes, Lanes, Lanes, Lanes]  # rows of a wrench, or of a twist

_Vector = ir.VectorType(ir.DoubleType(), LANES)
_Bits = ir.VectorType(ir.IntType(1), LANES)


class LanesType(types.Type):
    """Numba's type of lanes."""

    def __init__(self) -> None:
        super().__init__(name="lanes")


_LANES = LanesType()


@register_model(LanesType)
class _Model(models.PrimitiveModel):
    """In compiled code lanes are a vector."""

    def __init__(self, manager: Any, kind: LanesType) -> None:
        super().__init__(manager, kind, _Vector)


def whole(count: int) -> int:
    """The least multiple of LANES that is not below `count`."""
    return -(-count // LANES) * LANES


def _spread(builder: Any, number: Any) -> Any:
    one = builder.insert_element(ir.Constant(_Vector, ir.Undefined), number, ir.Constant(ir.IntType(32), 0))
    places = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(one, ir.Constant(_Vector, ir.Undefined), places)


def _address(context: Any, builder: Any, kind: Any, matrix: Any, row: Any, column: Any) -> Any:
    """Where the lanes of a matrix, C order, begin: inside it, which is looked at where bounds are checked."""
    array = context.make_array(kind)(context, builder, matrix)
    height, width = cgutils.unpack_tuple(builder, array.shape, 2)
    first = builder.add(builder.mul(row, width), column)
    if context.enable_boundscheck:
        outside = builder.icmp_unsigned(">=", first, builder.mul(height, width))  # negative numbers are large ones, too
        with cgutils.if_unlikely(builder, outside):
            context.call_conv.return_user_exc(builder, IndexError, ("lanes that begin outside their matrix",))
    return builder.bitcast(builder.gep(array.data, [first], inbounds=True), _Vector.as_pointer())


@intrinsic
def _load(typing: Any, A: Any, i: Any, j: Any) -> Any:
    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.load(_address(context, builder, sig.args[0], *args), align=8)

    return _LANES(A, types.int64, types.int64), lower


@intrinsic
def _store(typing: Any, A: Any, i: Any, j: Any, x: Any) -> Any:
    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        builder.store(args[3], _address(context, builder, sig.args[0], *args[:3]), align=8)
        return context.get_dummy_value()

    return types.none(A, types.int64, types.int64, _LANES), lower


@intrinsic
def _keep(typing: Any, bits: Any, x: Any) -> Any:
    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        chosen = builder.bitcast(builder.trunc(args[0], ir.IntType(LANES)), _Bits)
        return builder.select(chosen, args[1], ir.Constant(_Vector, None))

    return _LANES(types.int64, _LANES), lower


@intrinsic
def _total(typing: Any, x: Any) -> Any:
    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        lanes = [builder.extract_element(args[0], ir.Constant(ir.IntType(32), k)) for k in range(LANES)]
        while len(lanes) > 1:
            lanes = [builder.fadd(a, b) for a, b in zip(lanes[::2], lanes[1::2], strict=True)]
        return lanes[0]

    return types.float64(_LANES), lower


@intrinsic
def _at_least(typing: Any, x: Any, number: Any) -> Any:
    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        bound = _spread(builder, args[1])
        return builder.select(builder.fcmp_ordered(">", args[0], bound), args[0], bound)

    return _LANES(_LANES, types.float64), lower


@intrinsic
def _lowest(typing: Any, x: Any) -> Any:
    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        lanes = [builder.extract_element(args[0], ir.Constant(ir.IntType(32), k)) for k in range(LANES)]
        while len(lanes) > 1:
            pairs = zip(lanes[::2], lanes[1::2], strict=True)
            lanes = [builder.select(builder.fcmp_ordered("<", a, b), a, b) for a, b in pairs]
        return lanes[0]

    return types.float64(_LANES), lower


@intrinsic
def _root(typing: Any, x: Any) -> Any:
    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kind = ir.FunctionType(_Vector, [_Vector])
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.sqrt.v{LANES}f64"), args)

    return _LANES(_LANES), lower


@intrinsic
def _spread_number(typing: Any, number: Any) -> Any:
    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _spread(builder, args[0])

    return _LANES(types.float64), lower


@compiled_as(_load)
def load(A: Matrix, i: int, j: int) -> Lanes:
    """A[i, j : j + LANES]; the matrix has to have that many columns left, or rows behind."""
    found = A.reshape(-1)[i * A.shape[1] + j :][:LANES]
    return np.pad(found, (0, LANES - len(found)))


@compiled_as(_store)
def store(A: Matrix, i: int, j: int, x: Lanes) -> None:
    """A[i, j : j + LANES] = x, as `load`."""
    A.reshape(-1)[i * A.shape[1] + j :][:LANES] = x


@compiled_as(_keep)
def keep(bits: int, x: Lanes) -> Lanes:
    """Lane k of x where bit k of `bits` is set, 0 elsewhere."""
    return np.where([bits >> k & 1 for k in range(LANES)], x, 0.0)


@compiled_as(_spread_number)
def spread(number: float) -> Lanes:
    """The number in every lane."""
    return np.full(LANES, number)


@compiled_as(_total)
def total(x: Lanes) -> float:
    """The sum of the lanes, in pairs."""
    return float(x.reshape(-1, 2).sum(axis=1).reshape(-1, 2).sum(axis=1).sum())


@compiled_as(_at_least)
def at_least(x: Lanes, number: float) -> Lanes:
    """The larger of each lane and the number; the number where a lane is NaN."""
    return np.where(x > number, x, number)


@compiled_as(_lowest)
def lowest(x: Lanes) -> float:
    """The smallest lane."""
    return float(x.min())


@compiled_as(_root)
def root(x: Lanes) -> Lanes:
    """Square roots."""
    return np.sqrt(x)


def _operator(op: Any, instruction: str) -> None:
    """An operator on lanes, and on a number and lanes."""

    def both(builder: Any, x: Any, y: Any) -> Any:
        return getattr(builder, instruction)(x, y)

    def number_first(builder: Any, x: Any, y: Any) -> Any:
        return getattr(builder, instruction)(_spread(builder, x), y)

    kernel_operator(op, _LANES, _LANES, _LANES, both)
    kernel_operator(op, types.float64, _LANES, _LANES, number_first)


for _op, _instruction in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    _operator(_op, _instruction)


@kernel
def six(P: Matrix, r: int, c: int) -> Six:
    """P[r : r + 6] of the columns from c on."""
    return load(P, r, c), load(P, r + 1, c), load(P, r + 2, c), load(P, r + 3, c), load(P, r + 4, c), load(P, r + 5, c)


@kernel
def put(P: Matrix, r: int, c: int, w: Six) -> None:
    """P[r : r + 6] = w, of the columns from c on."""
    store(P, r, c, w[0])
    store(P, r + 1, c, w[1])
    store(P, r + 2, c, w[2])
    store(P, r + 3, c, w[3])
    store(P, r + 4, c, w[4])
    store(P, r + 5, c, w[5])


@kernel
def zeros() -> Six:
    """Six rows of zeros."""
    o = spread(0.0)
    return o, o, o, o, o, o


@kernel
def plus(v: Six, w: Six) -> Six:
    """v + w"""
    return v[0] + w[0], v[1] + w[1], v[2] + w[2], v[3] + w[3], v[4] + w[4], v[5] + w[5]


@kernel
def plus_outer(w: Six, s: Vector, x: Lanes) -> Six:
    """w + s x"""
    return w[0] + s[0] * x, w[1] + s[1] * x, w[2] + s[2] * x, w[3] + s[3] * x, w[4] + s[4] * x, w[5] + s[5] * x


@kernel
def minus_outer(w: Six, s: Vector, x: Lanes) -> Six:
    """w - s x"""
    return w[0] - s[0] * x, w[1] - s[1] * x, w[2] - s[2] * x, w[3] - s[3] * x, w[4] - s[4] * x, w[5] - s[5] * x


@kernel
def dot_lanes(S: Matrix, d: int, first: int, w: Six) -> Lanes:
    """S[d, first : first + 6] . w"""
    s = S[d, first : first + 6]
    return (s[0] * w[0] + s[1] * w[1]) + (s[2] * w[2] + s[3] * w[3]) + (s[4] * w[4] + s[5] * w[5])
