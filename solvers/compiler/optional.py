"""`@optional`: kernels that other kernels call by their address, for features that few scenes have.

A call of an optional kernel is compiled like any other call, but the kernel itself is not: its address is read from the
table `optional` of the first argument, a record, and where it is 0 the call gives a default. So a scene compiles the
features that it links, and pays a comparison for the others; and a kernel that many entries call, the time step for
one, is compiled once instead of once in each.

The types of its arguments and of its result are read from the annotations, because a caller is compiled before it:

    int, float, bool, None, Vector, Matrix, Integers, tuples of these, records (solvers/compiler), NamedTuples

    @optional(Slot.FACTOR_COUPLING, default=True)  # Slot: an IntEnum of the package that uses them
    def factor_coupling(model: Model, data: Data) -> bool: ...

    link(model.optional, factor_coupling)

`link` also takes kernels that Python will call, with such annotations, so that two processes share all that there is to
compile.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Iterable
from contextlib import closing
from functools import cached_property
from types import GenericAlias
from typing import Any, TypeVar, cast

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.registry import cpu_target
from numba.extending import intrinsic
from numpy.typing import NDArray

from solvers.compiler.garbage import seldom_collected
from solvers.compiler.helper_process import divided, serve
from solvers.compiler.kernels import entry, is_kept
from solvers.compiler.pipeline import OptionalCompiler, RolledCompiler, SeldomCompiler
from solvers.compiler.progress import parts
from solvers.compiler.records import RECORDS, load_word
from solvers.compiler.signals import signals_held

__all__ = ["OptionalKernel", "link", "optional", "optional_kernels"]

Function = TypeVar("Function", bound=Callable[..., Any])

_TYPES: dict[str, types.Type] = {
    "int": types.int64,
    "float": types.float64,
    "bool": types.boolean,
    "None": types.none,
    "Vector": types.Array(types.float64, 1, "C"),
    "Matrix": types.Array(types.float64, 2, "C"),
    "Cube": types.Array(types.float64, 3, "C"),
    "Stack": types.Array(types.float64, 3, "C"),
    "Integers": types.Array(types.int64, 1, "C"),
    "IntegerMatrix": types.Array(types.int64, 2, "C"),
}


def type_of(annotation: str, names: dict[str, Any]) -> types.Type:
    """Numba's type for the text of an annotation, in a module with these names."""
    if annotation in _TYPES:
        return _TYPES[annotation]
    found = eval(annotation, {}, names)
    if isinstance(found, GenericAlias):
        return _tuple_of(found)
    if found in RECORDS:
        return RECORDS[found]
    fields = [type_of(ref.__forward_arg__, vars(sys.modules[found.__module__])) for ref in _annotations(found)]
    return types.BaseTuple.from_types(fields, found)


def _annotations(cls: Any) -> Iterable[Any]:
    """Annotations of the fields of a NamedTuple, which keeps their texts as references."""
    found: Iterable[Any] = cls.__annotations__.values()
    return found


def _tuple_of(alias: GenericAlias) -> types.Type:
    """Numba's type of tuple[...], of numbers and tuples of them."""
    parts = [_tuple_of(part) if isinstance(part, GenericAlias) else _TYPES[part.__name__] for part in alias.__args__]
    return types.BaseTuple.from_types(parts)


_EVERY: list[OptionalKernel] = []
_UNCOMPILED: list[OptionalKernel] = []  # addresses requested with NUMBA_DISABLE_JIT=1


class OptionalKernel:
    """A kernel with a slot in a table of addresses; compiled when it is first linked."""

    def __init__(self, func: Callable[..., Any], slot: int, default: Any, compiler: Any) -> None:
        self.func, self.slot, self.default, self._compiler = func, slot, default, compiler
        self.name = f"{func.__module__}:{func.__name__}"
        self._code: Any = None
        self._address = 0
        _EVERY.append(self)

    def __call__(self, *args: Any) -> Any:
        """The call of compiled code, for kernels that run uncompiled."""
        if not numba.config.DISABLE_JIT:
            raise TypeError(f"{self.name} is called from kernels only")
        number = int(args[0].optional[self.slot])
        if number:
            return _UNCOMPILED[number - 1].func(*args)
        return self.default_of(self.signature().return_type)

    def default_of(self, kind: types.Type) -> Any:
        """Result of a call while the slot is empty."""
        return _zeros(kind) if self.default is None else self.default

    @property
    def compiled(self) -> bool:
        """Whether its address was requested."""
        return self._code is not None

    def signature(self) -> Any:
        """Numba's signature, by the annotations."""
        *arguments, result = (type_of(text, self.func.__globals__) for text in self.func.__annotations__.values())
        return result(*arguments)

    def at_hand(self) -> bool:
        """Whether it is loaded, or can be."""
        return self.compiled or is_kept(self.func, self.signature().args)

    def address(self) -> int:
        """Where the compiled kernel is, in this process; uncompiled, its number, from 1."""
        if numba.config.DISABLE_JIT:
            if self not in _UNCOMPILED:
                _UNCOMPILED.append(self)
            return _UNCOMPILED.index(self) + 1
        if self._code is None:
            declared = self.signature()
            code = entry(self.func, declared.args, self._compiler)
            if code.signature.return_type != declared.return_type:
                found = code.signature.return_type
                raise TypeError(f"optional kernel {self.name}: expected to return {declared.return_type}, got {found}")
            self._code = code
        if not self._address:  # which every new scene asks for again
            with signals_held():  # llvmlite would keep its lock for ever, if an exception came as it leaves the lock
                self._address = int(self._code.library.get_pointer_to_function(self._code.fndesc.llvm_func_name))
        return self._address

    @cached_property
    def _call(self) -> Any:
        call = _caller(self)
        cpu_target.typing_context.refresh()  # which learns of intrinsics only so
        return call

    @property
    def _numba_type_(self) -> Any:
        return cpu_target.typing_context.resolve_value_type(self._call)


class _Ahead:
    """A kernel that Python will call, for the arguments of its annotations."""

    def __init__(self, kernel: Any) -> None:
        self._kernel, self.func = kernel, kernel.py_func
        self.name = f"{self.func.__module__}:{self.func.__name__}"

    def types(self) -> tuple[types.Type, ...]:
        """Types of its arguments."""
        *arguments, _ = (type_of(text, self.func.__globals__) for text in self.func.__annotations__.values())
        return tuple(arguments)

    def at_hand(self) -> bool:
        """Whether it is loaded, or can be."""
        return self.types() in self._kernel.entry.overloads or is_kept(self.func, self.types())

    def address(self) -> int:
        """Compile or load it; Python has no use for its address."""
        self._kernel.entry.compile(self.types())
        return 0


def _job(kernel: Any) -> OptionalKernel | _Ahead:
    return kernel if isinstance(kernel, OptionalKernel) else _Ahead(kernel)


def help_out() -> None:
    """The program of a helper."""
    serve(_job)


def _zeros(kind: types.Type) -> Any:
    """Zeros of a type of numbers and tuples; None of the others."""
    if isinstance(kind, types.BaseTuple):
        parts = [_zeros(part) for part in kind]
        return kind.instance_class(*parts) if isinstance(kind, types.BaseNamedTuple) else tuple(parts)
    return {types.float64: 0.0, types.int64: 0, types.boolean: False}.get(kind)


def optional(
    slot: int, default: Any = None, seldom: bool = False, rolled: bool = False
) -> Callable[[Function], Function]:
    """A decorator: the kernel gets a slot in the table of addresses.

    Args:
        slot: its index in the table, a member of an IntEnum: never the order of imports, because machine code on disk
            holds it.
        default: result of a call where the slot is empty; zeros of the type of the result unless given.
        seldom: few steps call it: to compile it fast is worth more than fast code.
        rolled: its loops have few rounds, and are not unrolled.

    Returns:
        The decorator. Tools see the decorated function with its own type.
    """
    compiler = SeldomCompiler if seldom else RolledCompiler if rolled else OptionalCompiler

    def decorate(func: Function) -> Function:
        return cast(Function, OptionalKernel(func, slot, default, compiler))

    return decorate


def optional_kernels() -> list[OptionalKernel]:
    """Optional kernels of all modules imported so far."""
    return list(_EVERY)


def link(table: NDArray[np.int64] | list[Callable[..., Any]], *kernels: Callable[..., Any]) -> None:
    """Write the addresses of optional kernels into their slots; compile them, or load them, the first time.

    Args:
        table: (slots,) addresses; overwritten in place. A list collects the kernels instead: those of one call divide
            the work of compilation among two processes (helper_process.py).
        kernels: functions decorated by `optional`; and kernels that Python will call, which have no slot.
    """
    if isinstance(table, list):
        table += kernels
        return
    every = list(dict.fromkeys(kernels))
    slotted = [kernel for kernel in every if isinstance(kernel, OptionalKernel)]
    if not numba.config.DISABLE_JIT:
        jobs = [_job(kernel) for kernel in every if kernel not in slotted or not cast(Any, kernel).compiled]
        with seldom_collected(), closing(divided(jobs)) as queue:
            for job in parts(queue, len(jobs)):
                job.address()
    for found in slotted:
        table[found.slot] = found.address()


def _caller(kernel: OptionalKernel) -> Any:
    """The code of a call of the kernel."""

    def call(typing: Any, *args: Any) -> Any:
        signature = kernel.signature()

        def lower(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            result = signature.return_type
            k, _ = signature.args[0].fields["optional"]
            addresses = load_word(builder, arguments[0], cgutils.intp_t.as_pointer(), 3 * k)
            address = builder.load(builder.gep(addresses, [ir.Constant(cgutils.intp_t, kernel.slot)]))
            value = context.get_constant_generic(builder, result, kernel.default_of(result))
            slot = cgutils.alloca_once_value(builder, value)
            with builder.if_then(cgutils.is_not_null(builder, address)):
                kind = context.call_conv.get_function_type(result, signature.args)
                callee = builder.inttoptr(address, kind.as_pointer())
                status, value = context.call_conv.call_function(builder, callee, result, signature.args, arguments)
                with cgutils.if_unlikely(builder, status.is_error):
                    context.call_conv.return_status_propagate(builder, status)
                builder.store(value, slot)
            return builder.load(slot)

        return signature, lower

    parameters = inspect.signature(kernel.func).parameters.values()
    first = inspect.Parameter("typing", inspect.Parameter.POSITIONAL_OR_KEYWORD)
    call.__signature__ = inspect.Signature([first, *parameters])  # type: ignore[attr-defined]
    return intrinsic(call)
