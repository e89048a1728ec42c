"""`@kernel`: Numba, its flags, and a disk cache that cannot go stale. (Numba is imported here and in code.py,
lowering.py, arithmetic.py, lanes.py, late.py and record.py only.)

Numba's own cache looks only at the file a function is written in, so a caller keeps an old copy of a callee that lives
in another file. Here the cache folder is named by a digest of every source file that can reach a kernel, so any edit
starts from an empty folder.

    DOJO_OPT_CACHE=0         compile in memory only
    NUMBA_CACHE_DIR=DIR      keep the compiled code below DIR instead of the user's cache folder
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property, update_wrapper
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba import prange
from numba.core.errors import NumbaError as CompilationError
from numba.core.registry import CPUDispatcher, cpu_target
from numba.core.serialize import custom_reduce
from numba.core.types.misc import unliteral

from solvers.code import EntryCompiler, InnerCompiler

__all__ = [
    "CompilationError",
    "cache_folder",
    "compiled_signatures",
    "inlined",
    "inner_kernel",
    "kernel",
    "local_kernel",
    "parallel_kernel",
    "prange",
    "threads",
    "users_kernel",
    "users_loop",
]

F = TypeVar("F", bound=Callable[..., Any])

# "contract": products and sums are fused where the processor can; nothing is assumed of infinities and NaN
_FLAGS: dict[str, Any] = {"error_model": "numpy", "nogil": True, "fastmath": {"contract"}}
_KEEP = 4  # digests kept on disk: the newest few, so that switching between two versions stays warm
_LOADERS = ("urdf", "mjcf")  # folders without kernels
_REGISTRY: list[Any] = []


def _sources() -> list[Path]:
    """Every file whose text can end up inside a compiled kernel; a loader (sim/urdf, sim/mjcf) is not among them."""
    root = Path(__file__).resolve().parent.parent
    files = [*root.glob("solvers/**/*.py"), *(f for f in root.glob("sim/**/*.py") if f.parent.name not in _LOADERS)]
    files += [
        f for f in root.glob("dojo_opt/**/*.py") if re.search(rb"from solvers\.jit import .*kernel", f.read_bytes())
    ]
    return sorted(files)


def _digest() -> str:
    """Digest of all kernel sources and of the flags that Numba's own cache key leaves out."""
    digest = hashlib.sha256(f"{numba.__version__} {numba.config.BOUNDSCHECK}".encode())
    for path in _sources():
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def cache_folder() -> Path | None:
    """Folder of the compiled code, or None when the cache is off or no folder can be written."""
    if os.environ.get("DOJO_OPT_CACHE", "1") == "0":
        return None
    if numba.config.CACHE_DIR:
        root = Path(numba.config.CACHE_DIR) / "dojo_opt"
    else:
        root = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "dojo_opt"
    folder = root / _digest()
    return folder if _writable(folder) else None


def _prune(root: Path) -> None:
    """Drop all but the newest few digests below `root`."""
    old = sorted((d for d in root.iterdir() if d.is_dir() and len(d.name) == 16), key=lambda d: d.stat().st_mtime)
    for folder in old[:-_KEEP]:
        shutil.rmtree(folder, ignore_errors=True)


_FOLDER = cache_folder()
if _FOLDER is not None:
    os.utime(_FOLDER)
    _prune(_FOLDER.parent)


# Plain arithmetic before anything else: a first look into a cache registers the operators of sets and strings first,
# and every operator of every kernel is then tried on all of them: 10 of the 50 s of processor time of a cold start
# (numba 0.68).
cpu_target.typing_context.refresh()


class _Form(CPUDispatcher):
    """One of the two forms of a kernel."""

    def __init__(self, func: Callable[..., Any], compiler: Any, **flags: Any) -> None:
        options = {"nopython": True, "boundscheck": None, **_FLAGS, "_nrt": False, "no_cfunc_wrapper": True, **flags}
        super().__init__(func, targetoptions=options, pipeline_class=compiler)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """How kernels see it: a constant argument is a number like any other, not a reason to compile anew."""
        return super().get_call_template([unliteral(a) for a in args], {k: unliteral(a) for k, a in kws.items()})


class Kernel:
    """A compiled function in two forms: an entry, which Python calls, and `inner`, for other kernels.

    Each is made when it is first asked for: a dispatcher of Numba takes a third of a millisecond to make, and of the
    hundreds of kernels that a plan imports Python calls a dozen.
    """

    def __init__(self, func: Callable[..., Any], keep: bool = True, **flags: Any) -> None:
        update_wrapper(self, func)
        self.py_func, self.keep = func, keep
        self.targetoptions = flags  # where Numba looks for `inline`

    def __call__(self, *args: Any) -> Any:
        return self.entry(*args)

    def __reduce__(self) -> Any:
        """By its name; a kernel made inside a function by its code, compiled anew where it is loaded."""
        return self.py_func.__qualname__ if self.keep else custom_reduce(Kernel, {"func": self.py_func})

    @classmethod
    def _rebuild(cls, func: Callable[..., Any]) -> Any:
        """What Numba's unpickling calls with what `__reduce__` kept."""
        return local_kernel(func)

    @cached_property
    def entry(self) -> _Form:
        """The form with a way in for Python."""
        form = _Form(self.py_func, EntryCompiler)
        return _cached(form) if self.keep else form

    @cached_property
    def inner(self) -> _Form:
        """The form without."""
        form = _Form(self.py_func, InnerCompiler, no_cpython_wrapper=True, **self.targetoptions)
        return _cached(form, "inner") if self.keep else form

    @property
    def _numba_type_(self) -> Any:
        return self.inner._type

    @property
    def signatures(self) -> set[Any]:
        """Those compiled or loaded so far, of both forms."""
        return {s for form in ("entry", "inner") if form in vars(self) for s in vars(self)[form].overloads}


def _cached(form: Any, name: str = "entry") -> Any:
    """The form, with its cache in our folder, in which any edit of a source starts anew; one folder per form."""
    if _FOLDER is not None:
        users_folder = numba.config.CACHE_DIR
        try:
            numba.config.CACHE_DIR = str(_FOLDER / name)
            form.enable_caching()
        finally:
            numba.config.CACHE_DIR = users_folder
    return form


def _registered(kernel: Any) -> Any:
    _REGISTRY.append(kernel)
    return kernel


def kernel(func: F) -> F:
    """Compile `func` without the Python runtime and without Numba's allocator.

    A kernel cannot allocate: it fails to compile if it tries. That removes the reference counting of every array in
    every call (`_nrt=False`; in a prototype, one step of a 13-body tree went from 103 to 61 us).
    """
    return func if numba.config.DISABLE_JIT else cast(F, _registered(Kernel(func)))


def inlined(func: F) -> F:
    """A kernel whose text becomes part of its callers, which read better with it apart. Called from kernels only."""
    return func if numba.config.DISABLE_JIT else cast(F, Kernel(func, inline="always"))


inner_kernel = kernel  # where only kernels call it


def entry(func: Callable[..., Any], signature: tuple[Any, ...]) -> Any:
    """`func` compiled, or loaded, for arguments of these types, to be called by its address: Numba's result."""
    form = _registered(_cached(_Form(func, EntryCompiler, no_cpython_wrapper=True)))
    form.compile(signature)
    return form.overloads[signature]


def local_kernel(func: F) -> F:
    """A kernel made inside a function: Numba never finds such a closure in its cache, so it leaves no file there."""
    return func if numba.config.DISABLE_JIT else cast(F, _registered(Kernel(func, keep=False)))


class UsersKernel(Kernel):
    """A function of the user, or a loop around one: it may allocate, and is compiled once per process.

    Numba never frees the code of a function. Without the ways in that it has no use for, there is a third of it.
    """

    def __init__(self, func: Callable[..., Any], **flags: Any) -> None:
        super().__init__(func, keep=False)
        self.flags = {**_FLAGS, **flags, "no_cfunc_wrapper": True}

    def __reduce__(self) -> Any:
        return custom_reduce(UsersKernel, {"func": self.py_func, "flags": self.flags})

    @classmethod
    def _rebuild(cls, func: Callable[..., Any], flags: dict[str, Any]) -> Any:  # type: ignore[override]
        return cls(func, **flags)

    @cached_property
    def entry(self) -> Any:
        """The form with a way in for Python."""
        return numba.jit(nopython=True, **self.flags)(self.py_func)

    @cached_property
    def inner(self) -> Any:
        """The form without."""
        return numba.jit(nopython=True, no_cpython_wrapper=True, **self.flags)(self.py_func)


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


def users_loop(func: F) -> F:
    """Compile a loop around a function of the user."""
    return func if numba.config.DISABLE_JIT else cast(F, UsersKernel(func))


def parallel_kernel(func: F) -> F:
    """Compile `func` with `prange` over the cores; allowed to allocate. Only for loops over whole knots or rollouts."""
    if numba.config.DISABLE_JIT:
        return func
    return cast(F, _registered(_cached(numba.njit(parallel=True, **_FLAGS)(func))))


def compiled_signatures() -> dict[str, int]:
    """Kernels compiled or loaded so far in this process, by qualified name, with their number of signatures."""
    counts = {f"{k.py_func.__module__}.{k.py_func.__name__}": len(k.signatures) for k in _REGISTRY}
    return {name: count for name, count in counts.items() if count}


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Run `parallel_kernel` loops on `count` threads inside the block."""
    before = numba.get_num_threads()
    numba.set_num_threads(count)
    try:
        yield
    finally:
        numba.set_num_threads(before)
