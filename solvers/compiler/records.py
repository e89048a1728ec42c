"""Records: NamedTuples of arrays that compiled code takes as one pointer.

Numba passes a NamedTuple by value, seven numbers per array: with a hundred arrays every call inside compiled code
copies hundreds of numbers, and every function that takes one is slow to compile. A record is the address of a table

    table[3 k : 3 k + 3] = address of the data of array k, rows, columns (1 for a vector)

and its field k an array read from there. Tables do not change while compiled code runs, which the loads say (LLVM's
`invariant.load`), so a field costs no more in a loop than a local array does.

A record may be part of another: its words stand between those of the fields around it, so reading one of its arrays
costs no more. A table holds addresses: whoever makes one keeps the arrays alive.
"""

from __future__ import annotations

import ctypes
import zlib
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr_generic, models, register_model
from numpy.typing import NDArray

from solvers.compiler.array_words import WORD, ArrayWords
from solvers.compiler.instructions import compiled_as

Table = NDArray[np.int64]
R = TypeVar("R")


class Field(NamedTuple):
    """One array of a record: C order, 8 bytes per entry."""

    name: str
    integer: bool
    columns: int | None  # None: a vector; 0: a matrix whose width is in the table


class Part(NamedTuple):
    """A record inside a record."""

    name: str
    cls: type


class RecordType(types.Type):
    """Numba's type of a record."""

    def __init__(self, name: str, fields: tuple[Field | Part, ...]) -> None:
        self.fields: dict[str, tuple[int, Field | Part]] = {}
        self.size = 0  # arrays, those of its parts included
        for field in fields:
            self.fields[field.name] = self.size, field
            self.size += RECORDS[field.cls].size if isinstance(field, Part) else 1
        text = repr([RECORDS[field.cls].name if isinstance(field, Part) else field for field in fields])
        digest = zlib.crc32(text.encode())  # the name stands in every symbol: short, and one per list of fields
        super().__init__(name=f"{name}_{digest:08x}")

    def type_of(self, name: str) -> types.Type:
        """Type of one field."""
        field = self.fields[name][1]
        if isinstance(field, Part):
            return RECORDS[field.cls]
        return types.Array(types.int64 if field.integer else types.float64, 1 if field.columns is None else 2, "C")


@register_model(RecordType)
class RecordModel(models.OpaqueModel):
    """In compiled code a record is the address of its table."""


@infer_getattr
class RecordAttribute(AttributeTemplate):
    """Types of the fields."""

    key = RecordType

    def generic_resolve(self, record: RecordType, name: str) -> types.Type | None:
        return record.type_of(name) if name in record.fields else None


@lower_getattr_generic(RecordType)
def _field(context: Any, builder: Any, record: RecordType, value: Any, name: str) -> Any:
    """One field, as Numba has it."""
    found = field_words(context, builder, record, value, name)
    if isinstance(found, ArrayWords):
        return found.value(builder, context.get_value_type(record.type_of(name)))
    return found


def field_words(context: Any, builder: Any, record: RecordType, value: Any, name: str) -> Any:
    """One field: the words of an array, from its three of the table, or where those of a part begin."""
    k, field = record.fields[name]
    if isinstance(field, Part):
        words = builder.bitcast(value, WORD.as_pointer())
        return builder.bitcast(builder.gep(words, [ir.Constant(WORD, 3 * k)]), cgutils.voidptr_t)
    data = load_word(builder, value, context.get_data_type(record.type_of(name).dtype).as_pointer(), 3 * k)
    shape = [load_word(builder, value, WORD, 3 * k + 1)]
    strides = [WORD(8)]
    if field.columns is not None:
        columns = WORD(field.columns) if field.columns else load_word(builder, value, WORD, 3 * k + 2)
        shape.append(columns)
        strides = [WORD(8 * field.columns) if field.columns else builder.mul(columns, WORD(8)), WORD(8)]
    return ArrayWords.of(builder, data, shape, strides, home=f"{record.name}.{name}")


def load_word(builder: Any, table: Any, kind: Any, k: int) -> Any:
    """Word k of a table; nothing writes to it while compiled code runs."""
    words = builder.bitcast(table, kind.as_pointer())
    word = builder.load(builder.gep(words, [ir.Constant(ir.IntType(64), k)]))
    word.set_metadata("invariant.load", builder.module.add_metadata([]))
    return word


RECORDS: dict[type, RecordType] = {}


def record(cls: type[R], fields: Sequence[Field | Part]) -> Callable[[Table], R]:
    """A function, for compiled code and for Python, from a table to the record `cls` with these fields.

    Args:
        cls: a NamedTuple.
        fields: one for each of its own; records that are parts of it are made before it.

    Returns:
        The function.
    """
    kind = RecordType(cls.__name__, tuple(fields))
    RECORDS[cls] = kind

    @intrinsic
    def at(typing: Any, table: Any) -> Any:
        def lower(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            array = context.make_array(signature.args[0])(context, builder, arguments[0])
            return builder.bitcast(array.data, cgutils.voidptr_t)

        return kind(table), lower

    @compiled_as(at)
    def view(table: Table) -> R:
        return cast(R, _view(cls, table))

    return view


def _view(cls: type, table: Table) -> Any:
    """The record of a table, for Python."""
    places = RECORDS[cls].fields.values()
    return cls(
        *(_view(field.cls, table[3 * k :]) if isinstance(field, Part) else _array(field, table[3 * k : 3 * k + 3])
          for k, field in places)
    )  # fmt: skip


def _array(field: Field, words: Table) -> NDArray[Any]:
    """One field, for Python."""
    address, rows, columns = (int(word) for word in words)
    kind: Any = ctypes.c_int64 if field.integer else ctypes.c_double
    flat: NDArray[Any] = np.ctypeslib.as_array((kind * (rows * columns)).from_address(address))
    return flat if field.columns is None else flat.reshape(rows, columns)


def table(arrays: Sequence[Any]) -> Table:
    """Addresses and shapes of the arrays of a record, in the order of its fields, and of the records in it."""
    return np.array(_rows(arrays), dtype=np.int64).ravel()


def _rows(arrays: Sequence[Any]) -> list[tuple[int, int, int]]:
    rows = []
    for a in arrays:
        if isinstance(a, tuple):
            rows += _rows(a)
        else:
            rows.append((a.ctypes.data, a.shape[0], a.shape[1] if a.ndim == 2 else 1))
    return rows
