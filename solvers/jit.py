"""`@kernel`: Numba, its flags, and a disk cache that cannot go stale. (Only this file and record.py import Numba.)

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
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba import prange
from numba.core.registry import cpu_target

__all__ = [
    "cache_folder",
    "compiled_signatures",
    "inlined",
    "inner_kernel",
    "kernel",
    "local_kernel",
    "parallel_kernel",
    "prange",
    "threads",
]

F = TypeVar("F", bound=Callable[..., Any])

_FLAGS: dict[str, Any] = {"error_model": "numpy", "nogil": True}
_LATE_FLAGS: dict[str, Any] = {"error_model": "numpy", "_nrt": False}
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


def _compile(func: F, cache: bool = True, **flags: Any) -> F:
    users_folder = numba.config.CACHE_DIR
    try:
        if _FOLDER is not None:
            numba.config.CACHE_DIR = str(_FOLDER)
        compiled = numba.njit(cache=cache and _FOLDER is not None, **_FLAGS, **flags)(func)
    finally:
        numba.config.CACHE_DIR = users_folder
    _REGISTRY.append(compiled)
    return compiled


def kernel(func: F) -> F:
    """Compile `func` without the Python runtime and without Numba's allocator.

    A kernel cannot allocate: it fails to compile if it tries. That removes the reference counting of every array in
    every call (`_nrt=False`; in a prototype, one step of a 13-body tree went from 103 to 61 us).

    A kernel that takes a Model or a Work gets no Python wrapper, which would be half of its compile time. Call it from
    kernels only: called from Python it takes the process down.
    """
    inner = not {"Model", "Work"}.isdisjoint(func.__annotations__.values())
    return _compile(func, _nrt=False, no_cpython_wrapper=inner, no_cfunc_wrapper=True)


def inlined(func: F) -> F:
    """A kernel whose text becomes part of its callers: for the few that stand around a long one, which the compiler
    would otherwise optimise once more on their account. Called from kernels only.
    """
    return _compile(func, _nrt=False, inline="always", no_cpython_wrapper=True, no_cfunc_wrapper=True)


def inner_kernel(func: F) -> F:
    """A kernel that only kernels call, for the small ones: without the Python wrapper, half of their compile time."""
    return _compile(func, _nrt=False, no_cpython_wrapper=True, no_cfunc_wrapper=True)


class Late:
    """A kernel that other kernels call by its address (solvers/record.py, `call_late`): for what few scenes have.

    It takes two records as pointers, a whole number and two numbers, and returns a whole number. It is compiled when a
    scene first asks for its address; in all other scenes nothing but the call is compiled.
    """

    def __init__(self, func: Callable[..., int]) -> None:
        self.func = func
        self._compiled: Any = None

    def address(self) -> int:
        """Where the compiled kernel is, in this process."""
        if self._compiled is None:
            users_folder = numba.config.CACHE_DIR
            try:
                if _FOLDER is not None:
                    numba.config.CACHE_DIR = str(_FOLDER)
                signature = "int64(voidptr, voidptr, int64, float64, float64)"
                self._compiled = numba.cfunc(signature, cache=_FOLDER is not None, **_LATE_FLAGS)(self.func)
            finally:
                numba.config.CACHE_DIR = users_folder
        return int(self._compiled.address)


def late(func: Callable[..., int]) -> Late:
    """A kernel that is compiled by the first scene that needs it, see `Late`."""
    return Late(func)


def local_kernel(func: F) -> F:
    """A kernel made inside a function, around another kernel: Numba never finds such a closure in its cache again, so
    it is compiled once per process and leaves no file behind.
    """
    return _compile(func, cache=False, _nrt=False)


def parallel_kernel(func: F) -> F:
    """Compile `func` with `prange` over the cores; allowed to allocate. Only for loops over whole knots or rollouts."""
    return _compile(func, parallel=True)


def compiled_signatures() -> dict[str, int]:
    """Kernels compiled or loaded so far in this process, by qualified name, with their number of signatures."""
    return {
        f"{k.py_func.__module__}.{k.py_func.__name__}": len(k.signatures)
        for k in _REGISTRY
        if getattr(k, "signatures", None)
    }


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Run `parallel_kernel` loops on `count` threads inside the block."""
    before = numba.get_num_threads()
    numba.set_num_threads(count)
    try:
        yield
    finally:
        numba.set_num_threads(before)
