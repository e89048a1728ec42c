"""`@kernel` and its variants: functions that Numba compiles with our flags, and keeps on disk."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable
from functools import cached_property, update_wrapper
from typing import Any, TypeVar, cast

import numba
from numba import types
from numba.core.compiler_lock import global_compiler_lock
from numba.core.errors import NumbaError as CompilationError
from numba.core.event import trigger_event
from numba.core.registry import CPUDispatcher, cpu_target
from numba.core.serialize import custom_reduce
from numba.core.sigutils import normalize_signature
from numba.core.types.misc import unliteral

from solvers.compiler.cache import CALLEE, INNER, STORE, KernelCache, cache_folder, prepare, shipped
from solvers.compiler.frame_stack import with_room
from solvers.compiler.function_digest import CompiledFunction
from solvers.compiler.pipeline import FAST, EntryCompiler, InnerCompiler, OptionalCompiler
from solvers.compiler.signals import signals_outside_locks
from solvers.compiler.users_cache import UsersCache
from solvers.compiler.users_pipeline import UsersCompiler, UsersEntryCompiler, UsersInnerCompiler

__all__ = [
    "FLAGS",
    "CompilationError",
    "cache_folder",
    "cached",
    "compiled_signatures",
    "inlined",
    "inner_kernel",
    "is_kept",
    "kernel",
    "local_kernel",
    "reduced",
    "registered",
    "users_callee",
    "users_kernel",
    "users_loop",
]

F = TypeVar("F", bound=Callable[..., Any])

# "contract": products and sums are fused where the processor can; "arcp": several quotients by one number cost one
# division, and are rounded once more. Nothing is assumed of infinities and NaN
FLAGS: dict[str, Any] = {"error_model": "numpy", "nogil": True, "fastmath": {"contract", "arcp"}}
_REGISTRY: list[Any] = []


def _is_plain(kind: Any) -> bool:
    """Whether Numba makes a Python object of this type without running Python."""
    if isinstance(kind, types.Tuple | types.UniTuple):
        return all(map(_is_plain, kind))
    return isinstance(kind, types.Integer | types.Float | types.Boolean | types.NoneType)


class _Form(CPUDispatcher):
    """One of the two forms of a kernel."""

    def __init__(self, func: Callable[..., Any], compiler: Any, **flags: Any) -> None:
        options = {"nopython": True, "boundscheck": None, **FLAGS, "_nrt": False, "no_cfunc_wrapper": True, **flags}
        super().__init__(func, targetoptions=options, pipeline_class=compiler)

    def compile(self, sig: Any) -> Any:
        """Compile or load. Kernels that return a NamedTuple or an enum to Python are refused: Numba 0.68 runs Python
        to make one, ignores failures, and crashes on a Ctrl-C that arrived during the call.
        """
        if not isinstance(self._cache, KernelCache):
            prepare()
        compiled = self._compiled(sig)
        for found in () if self.targetoptions.get("no_cpython_wrapper") else self.overloads.values():
            if not _is_plain(kind := found.signature.return_type):
                name = self.py_func.__qualname__
                raise TypeError(f"kernel {name}: expected to return numbers and plain tuples to Python, got {kind}")
        return compiled

    @signals_outside_locks
    def _compiled(self, sig: Any) -> Any:
        """Numba's `compile` without its clocks: one per function that waits for its callees, each of which is told of
        every call of LLVM.
        """
        with global_compiler_lock, self._compiling_counter:
            args, result = normalize_signature(sig)
            if tuple(args) in self.overloads:
                return self.overloads[tuple(args)].entry_point
            code = self._cache.load_overload(sig, self.targetctx)
            if code is not None:
                self._cache_hits[sig] += 1
                self.targetctx.insert_user_function(code.entry_point, code.fndesc, [code.library])
                self.add_overload(code)
                return code.entry_point
            self._cache_misses[sig] += 1
            with trigger_event("numba:compile", data={"dispatcher": self, "args": args, "return_type": result}):
                code = with_room(self._compiler.compile, args, result)
                self.add_overload(code)
            self._cache.save_overload(sig, code)
            return code.entry_point

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """How kernels see it: a constant argument is a number like any other, not a reason to compile anew."""
        return super().get_call_template([unliteral(a) for a in args], {k: unliteral(a) for k, a in kws.items()})


class Kernel(CompiledFunction):
    """A compiled function in two forms: an entry, which Python calls, and `inner`, for other kernels.

    Each is made on first use: a dispatcher of Numba takes a third of a millisecond to make, and of the
    hundreds of kernels that a plan imports Python calls a dozen.
    """

    def __init__(self, func: Callable[..., Any], keep: bool = True, **flags: Any) -> None:
        update_wrapper(self, func)
        self.py_func, self.keep = func, keep
        self.flags = self.targetoptions = flags  # where Numba looks for `inline`

    def __call__(self, *args: Any) -> Any:
        return self.entry(*args)

    def __reduce__(self) -> Any:
        """By its name; a kernel made inside a function by its code, compiled anew where it is loaded."""
        return self.py_func.__qualname__ if self.keep else custom_reduce(Kernel, {"func": self.py_func})

    @classmethod
    def _rebuild(cls, func: Callable[..., Any]) -> Any:
        """Rebuild a kernel from the data of `__reduce__`, for Numba's unpickling."""
        return local_kernel(func)

    @cached_property
    def entry(self) -> _Form:
        """The form with a way in for Python."""
        form = _Form(self.py_func, EntryCompiler)
        return cached(form) if self.keep else form

    @cached_property
    def inner(self) -> _Form:
        """The form without."""
        form = _Form(self.py_func, InnerCompiler, no_cpython_wrapper=True, **self.targetoptions)
        return cached(form, INNER) if self.keep else form

    @property
    def _numba_type_(self) -> Any:
        return self.inner._type

    @property
    def signatures(self) -> set[Any]:
        """Signatures compiled or loaded so far, of both forms."""
        return {s for form in ("entry", "inner") if form in vars(self) for s in vars(self)[form].overloads}


def cached(form: Any, name: str = "entry") -> Any:
    """The form, with its compiled code on disk; that of a function without a file is in memory."""
    if (STORE.wanted or (name != INNER and len(shipped()))) and os.path.isfile(inspect.getfile(form.py_func)):
        form._cache = KernelCache(form.py_func, name)
    return form


def registered(kernel: Any) -> Any:
    """Register the kernel with `compiled_signatures`."""
    _REGISTRY.append(kernel)
    return kernel


def kernel(func: F) -> F:
    """Compile `func` without the Python runtime and without Numba's allocator.

    A kernel cannot allocate: it fails to compile if it tries. That removes the reference counting of every array in
    every call (`_nrt=False`; in a prototype, one step of a 13-body tree went from 103 to 61 us).
    """
    return func if numba.config.DISABLE_JIT else cast(F, registered(Kernel(func)))


def inlined(func: F) -> F:
    """A kernel whose text becomes part of its callers, which read better with it apart. Called from kernels only."""
    return func if numba.config.DISABLE_JIT else cast(F, Kernel(func, inline="always"))


inner_kernel = kernel  # where only kernels call it


def entry(func: Callable[..., Any], signature: tuple[Any, ...], compiler: Any = OptionalCompiler) -> Any:
    """`func` compiled, or loaded, for arguments of these types, to be called by its address: Numba's result.

    compiler: of one that is called by its address.
    """
    form = registered(cached(_Form(func, compiler, no_cpython_wrapper=True)))
    form.compile(signature)
    return form.overloads[signature]


def is_kept(func: Callable[..., Any], signature: tuple[Any, ...]) -> bool:
    """Whether an `entry` for these types was shipped, or is on disk."""
    return KernelCache(func, "entry").holds(signature, cpu_target.target_context.codegen())


def local_kernel(func: F) -> F:
    """A kernel made inside a function: Numba never finds such a closure in its cache, so it leaves no file there."""
    return func if numba.config.DISABLE_JIT else cast(F, registered(Kernel(func, keep=False)))


class Callee(Kernel):
    """A kernel that loops around functions of the user call. Those are compiled where the user is, so that its code for
    kernels is shipped.
    """

    @cached_property
    def inner(self) -> _Form:
        """The form without a way in for Python."""
        return cached(_Form(self.py_func, InnerCompiler, no_cpython_wrapper=True), CALLEE)


def users_callee(func: F) -> F:
    """A kernel that users' loops call."""
    return func if numba.config.DISABLE_JIT else cast(F, registered(Callee(func)))


class UsersKernel(Kernel):
    """A function of the user, or a loop around one: it may allocate, and is compiled once per process, or loaded.

    Numba never frees the code of a function. Without the ways in that it has no use for, there is a third of it.
    """

    def __init__(self, func: Callable[..., Any], **flags: Any) -> None:
        super().__init__(func, keep=False)
        self.flags = {**FLAGS, **flags, "no_cfunc_wrapper": True}

    def __reduce__(self) -> Any:
        return custom_reduce(UsersKernel, {"func": self.py_func, "flags": self.flags})

    @classmethod
    def _rebuild(cls, func: Callable[..., Any], flags: dict[str, Any]) -> Any:  # type: ignore[override]
        return cls(func, **flags)

    @cached_property
    def entry(self) -> Any:
        """The form with a way in for Python, kept on disk where its content is known."""
        form = self._form(UsersEntryCompiler)
        if FAST and not self.flags.get("parallel") and (STORE.wanted or len(shipped())):
            form._cache = UsersCache(self.py_func, self.flags)
        else:
            prepare()
        return form

    @cached_property
    def inner(self) -> Any:
        """The form without."""
        prepare()
        return self._form(UsersInnerCompiler, no_cpython_wrapper=True)

    def compile_for(self, *args: Any) -> None:
        """Compile or load the entry for arguments of these types, without a call."""
        self.entry.compile(tuple(self.entry.typeof_pyval(value) for value in args))

    def address(self, kinds: tuple[Any, ...]) -> int:
        """Where the entry for arguments of these types is, in this process."""
        self.entry.compile(kinds)
        code = self.entry.overloads[kinds]
        return int(code.library.get_pointer_to_function(code.fndesc.llvm_func_name))

    def _form(self, compiler: Any, **flags: bool) -> Any:
        chosen = UsersCompiler if self.flags.get("parallel") else compiler  # whose loops are functions of their own
        form = numba.jit(nopython=True, pipeline_class=chosen, **flags, **self.flags)(self.py_func)
        form.compile = signals_outside_locks(form.compile)
        return form


def users_kernel(func: F, boundscheck: bool = True) -> F:
    """Compile a function of the user, with a look at the bounds of arrays at every index unless boundscheck=False.

    One that Numba has compiled for the user is compiled again, with its own flags, and looks at bounds unless these say
    boundscheck=False; a kernel stays as it is.
    """
    if numba.config.DISABLE_JIT or isinstance(func, Kernel):
        return func
    flags: dict[str, Any] = {"boundscheck": boundscheck}
    if isinstance(func, CPUDispatcher):
        own = {name: value for name, value in func.targetoptions.items() if name != "nopython" and value is not None}
        return cast(F, UsersKernel(func.py_func, **flags, **own) if "boundscheck" not in own else func)
    return cast(F, UsersKernel(func, **flags))


def reduced(kind: Any, fields: dict[str, Any]) -> Any:
    """`__reduce__` of an object that holds functions, pickled by their code: it is kind._rebuild(**fields)."""
    return custom_reduce(kind, fields)


def users_loop(func: F) -> F:
    """Compile a loop around a function of the user."""
    return func if numba.config.DISABLE_JIT else cast(F, UsersKernel(func))


def compiled_signatures() -> dict[str, int]:
    """Kernels compiled or loaded so far in this process, by qualified name, with their number of signatures."""
    counts = {f"{k.py_func.__module__}.{k.py_func.__name__}": len(k.signatures) for k in _REGISTRY}
    return {name: count for name, count in counts.items() if count}
