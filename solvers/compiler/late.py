"""`@late`: kernels that other kernels call by their address, for what few scenes have.

A call of a late kernel is compiled like any other call, but the kernel itself is not: the address is read from the
table `late` of the first argument, a record, and where it is 0 the call stands for a constant. So a scene compiles what
it binds, and pays a comparison for the rest; and what many entries call, the time step for one, is compiled once
instead of once in each.

What a late kernel takes and returns is read from its annotations, because a caller is compiled before it:

    int, float, bool, None, Vector, Matrix, Integers, tuples of these, records (solvers/compiler), NamedTuples

    factor_coupling = _late("sim.coupling.system:factor_coupling")  # sim/late.py: for callers

    @late.factor_coupling.defined(otherwise=True)
    def factor_coupling(model: Model, work: Work) -> bool: ...

    model.late[factor_coupling.index] = factor_coupling.address()
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Iterable
from functools import cached_property
from importlib import import_module
from types import GenericAlias
from typing import Any

import numba
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.registry import cpu_target
from numba.extending import intrinsic

from solvers.compiler.kernels import entry
from solvers.compiler.records import RECORDS, load_word

__all__ = ["LateKernel", "LateTable"]

_TYPES: dict[str, types.Type] = {
    "int": types.int64,
    "float": types.float64,
    "bool": types.boolean,
    "None": types.none,
    "Vector": types.Array(types.float64, 1, "C"),
    "Matrix": types.Array(types.float64, 2, "C"),
    "Integers": types.Array(types.int64, 1, "C"),
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
    """Those of the fields of a NamedTuple, which keeps their texts as references."""
    found: Iterable[Any] = cls.__annotations__.values()
    return found


def _tuple_of(alias: GenericAlias) -> types.Type:
    """Numba's type of tuple[...], of numbers and tuples of them."""
    parts = [_tuple_of(part) if isinstance(part, GenericAlias) else _TYPES[part.__name__] for part in alias.__args__]
    return types.BaseTuple.from_types(parts)


_UNCOMPILED: list[LateKernel] = []  # asked for an address with NUMBA_DISABLE_JIT=1


class LateKernel:
    """A kernel at an address; imported, and compiled, when it is first asked for."""

    def __init__(self, home: str, index: int) -> None:
        self.home, self.index = home, index
        self.otherwise: Any = None
        self._func: Callable[..., Any] | None = None
        self._code: Any = None

    def defined(self, otherwise: Any = None) -> Callable[[Callable[..., Any]], LateKernel]:
        """A decorator for the text of the kernel; `otherwise` stands for calls of it where its address is 0."""

        def define(func: Callable[..., Any]) -> LateKernel:
            if f"{func.__module__}:{func.__name__}" != self.home:
                raise TypeError(f"late kernel {self.home}: expected there, got {func.__module__}:{func.__name__}")
            self._func, self.otherwise = func, otherwise
            return self

        return define

    @property
    def func(self) -> Callable[..., Any]:
        """The text."""
        if self._func is None:
            import_module(self.home.split(":")[0])
        if self._func is None:
            raise TypeError(f"late kernel {self.home}: not defined there")
        return self._func

    def __call__(self, *args: Any) -> Any:
        """What compiled code does at a call, for kernels that run uncompiled."""
        if not numba.config.DISABLE_JIT:
            raise TypeError(f"{self.home} is called from kernels only")
        number = int(args[0].late[self.index])
        if number:
            return _UNCOMPILED[number - 1].func(*args)
        return _nothing(self.signature().return_type) if self.otherwise is None else self.otherwise

    @property
    def compiled(self) -> bool:
        """Whether its address was asked for."""
        return self._code is not None

    def signature(self) -> Any:
        """Numba's signature, by the annotations."""
        *arguments, result = (type_of(text, self.func.__globals__) for text in self.func.__annotations__.values())
        return result(*arguments)

    def address(self) -> int:
        """Where the compiled kernel is, in this process; uncompiled, its number, from 1."""
        if numba.config.DISABLE_JIT:
            if self not in _UNCOMPILED:
                _UNCOMPILED.append(self)
            return _UNCOMPILED.index(self) + 1
        if self._code is None:
            declared = self.signature()
            code = entry(self.func, declared.args)
            if code.signature.return_type != declared.return_type:
                found = code.signature.return_type
                raise TypeError(f"late kernel {self.home}: expected to return {declared.return_type}, got {found}")
            self._code = code
        return int(self._code.library.get_pointer_to_function(self._code.fndesc.llvm_func_name))

    @cached_property
    def _call(self) -> Any:
        call = _caller(self)
        cpu_target.typing_context.refresh()  # which learns of intrinsics only so
        return call

    @property
    def _numba_type_(self) -> Any:
        return cpu_target.typing_context.resolve_value_type(self._call)


def _nothing(kind: types.Type) -> Any:
    """What a call stands for where it is said of neither the kernel nor its address: zeros of its type."""
    if isinstance(kind, types.BaseTuple):
        parts = [_nothing(part) for part in kind]
        return kind.instance_class(*parts) if isinstance(kind, types.BaseNamedTuple) else tuple(parts)
    return {types.float64: 0.0, types.int64: 0, types.boolean: False}.get(kind)


class LateTable:
    """Late kernels by their homes, "module:name"; each has an index of its own, but for one `instead_of` another."""

    def __init__(self) -> None:
        self.count = 0

    def __call__(self, home: str, instead_of: Any = None) -> Any:
        index = self.count if instead_of is None else instead_of.index
        self.count += instead_of is None
        return LateKernel(home, index)


def _caller(kernel: LateKernel) -> Any:
    """What Numba compiles a call of the kernel to."""

    def call(typing: Any, *args: Any) -> Any:
        signature = kernel.signature()

        def lower(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            result = signature.return_type
            k, _ = signature.args[0].fields["late"]
            addresses = load_word(builder, arguments[0], cgutils.intp_t.as_pointer(), 3 * k)
            address = builder.load(builder.gep(addresses, [ir.Constant(cgutils.intp_t, kernel.index)]))
            value = context.get_constant_generic(builder, result, kernel.otherwise)
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
