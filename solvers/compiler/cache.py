"""Compiled code on disk: a folder that no other user can write to, with one file per compiled signature.

Numba's own cache looks only at the file a function is written in, so a caller keeps an old copy of a callee that lives
in another file. Here the folder is named by a digest of every source file that can reach a kernel, so any edit starts
from an empty folder.

To load compiled code is to run it. So a folder is read only where its owner is the user or root, and where neither a
group nor the world can write; and a file only when it is as it was written. Everything else is compiled, in memory
if it cannot be stored, with one warning that gives the reason. Code that came compiled with the package (shipped.py) is
looked for first, and never written here.

    DOJO_OPT_CACHE=0         compile in memory only
    NUMBA_CACHE_DIR=DIR      keep the compiled code below DIR instead of the user's cache folder
"""

from __future__ import annotations

import hashlib
import inspect
import os
import pickle
import re
import shutil
import stat
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import FunctionCache
from numba.core.compiler import CompileResult
from numba.core.imputils import builtin_registry
from numba.core.registry import cpu_target
from numba.core.runtime import rtsys
from numba.core.serialize import dumps

from solvers.compiler.crossing import Crossing, crossings, keep_modules
from solvers.compiler.ownership import OTHERS, WORLD, foreign
from solvers.compiler.pipeline import FAST, inner_result
from solvers.compiler.progress import because
from solvers.compiler.shipped import Shipped, open_shipped, write_shipped
from solvers.compiler.signals import hold_while_translating, signals_held
from solvers.compiler.targets import system_of

__all__ = [
    "CALLEE",
    "INNER",
    "STORE",
    "KernelCache",
    "cache_folder",
    "magic_of",
    "open_store",
    "prepare",
    "ship",
    "shipped",
    "stamp",
]

INNER = "inner"  # the form of a kernel that kernels call
CALLEE = "callee"  # the same of one that loops around functions of the user call, and that is shipped

_KEEP = 4  # digests kept on disk however old they are, so that switching between two versions stays warm
_IN_USE = 14 * 24 * 3600.0  # [s] since its last use for which a folder is kept
_DIGEST = re.compile("[0-9a-f]{16}")
_LOADERS = ("urdf", "mjcf")  # folders without kernels
_PYTHON = (*sys.version_info[:2], getattr(sys, "abiflags", ""))
_CHECK = hashlib.blake2b().digest_size  # bytes of a file before its contents
_KERNELS = re.compile(rb"from solvers\.compiler import (\([^)]*|.*)(kernel|inlined)")  # in a file that may hold some
_ROOT = Path(__file__).resolve().parents[2]
_FLAGS = ("BOUNDSCHECK", "OPT", "DEBUGINFO_DEFAULT", "LOOP_VECTORIZE", "SLP_VECTORIZE")  # that Numba's own key omits


def _sources() -> list[Path]:
    """Every file whose text can end up inside a compiled kernel; a loader (sim/urdf, sim/mjcf) is not among them."""
    files = [*_ROOT.glob("solvers/**/*.py"), *(f for f in _ROOT.glob("sim/**/*.py") if f.parent.name not in _LOADERS)]
    files += [f for f in _ROOT.glob("dojo_opt/**/*.py") if _KERNELS.search(f.read_bytes())]
    return sorted(files)


@cache
def stamp() -> str:
    """Digest of all kernel sources, of the versions of Numba and Python, and of flags."""
    flags = [getattr(numba.config, name, None) for name in _FLAGS]
    digest = hashlib.sha256(f"{numba.__version__} {_PYTHON} {flags} {FAST}".encode())
    for path in _sources():
        digest.update(path.relative_to(_ROOT).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def _base() -> tuple[Path | None, int]:
    """(folder of NUMBA_CACHE_DIR, or the user's cache folder; who must not write there); None if there is none.

    A folder that the XDG specification calls invalid, because it depends on where the process was started, is none.
    """
    named = [numba.config.CACHE_DIR and os.path.abspath(numba.config.CACHE_DIR), os.environ.get("XDG_CACHE_HOME", "")]
    for name in named:
        if os.path.isabs(name):
            return Path(name), OTHERS
    try:
        home = Path.home()
    except RuntimeError:  # of a user that the system does not know
        return None, 0
    # the group of a home is often that of its user alone; and folders below are checked one by one
    return (home / ".cache" if home.is_absolute() else None), WORLD


def _opened(base: Path, forbidden: int) -> tuple[Path | None, str]:
    """(folder below the base, made if need be; why there is none)."""
    for outer in (base, *base.parents):  # root makes no folders where they would be in another user's way
        if outer.exists():
            if why := foreign(outer, outer.stat(), forbidden=0):
                return None, why
            break
    base.parent.mkdir(parents=True, exist_ok=True)
    folder = base / "dojo_opt" / stamp()
    for part in (base, folder.parent, folder):
        part.mkdir(mode=0o700, exist_ok=True)
        about = part.stat()
        # in a sticky folder such as /tmp, other users cannot replace ours
        bits = OTHERS if part != base else 0 if about.st_mode & stat.S_ISVTX else forbidden
        if why := foreign(part, about, bits):
            return None, why
    return folder, ""


def _prune(root: Path) -> None:
    """Drop digests below `root` that are neither among the newest few nor used within the last weeks."""
    with suppress(OSError):  # of a folder that another process drops
        folders = [d for d in root.iterdir() if d.is_dir() and _DIGEST.fullmatch(d.name)]
        ages = sorted((time.time() - d.stat().st_mtime, d) for d in folders)
        for age, folder in ages[_KEEP:]:
            if age > _IN_USE:
                shutil.rmtree(folder, ignore_errors=True)


def _found() -> tuple[Path | None, str]:
    """(folder of the compiled code; the reason if there is none, empty if it is turned off)."""
    if os.environ.get("DOJO_OPT_CACHE", "1") == "0":
        return None, ""
    try:
        base, forbidden = _base()
        return _opened(base, forbidden) if base else (None, "the user has no home folder")
    except OSError as error:
        return None, str(error)


def cache_folder() -> Path | None:
    """Folder of the compiled code, or None when the cache is off or no folder can be used."""
    return _found()[0]


class Store:
    """The files of the folder, each as it was written or not at all."""

    def __init__(self, folder: Path | None, why_not: str) -> None:
        self.folder, self.why_not = folder, why_not
        self.wanted, self._told = self.folder is not None or bool(self.why_not), False
        self._written = False
        if self.folder is not None:
            with suppress(OSError):  # one that is filled, and read-only
                os.utime(self.folder)  # says when it was used last

    def names(self) -> list[str]:
        """Names of all files, apart from drafts."""
        return sorted(path.name for path in self.folder.glob("*.nbc")) if self.folder else []

    def holds(self, name: str) -> bool:
        """Whether anything is stored under this name."""
        return self.folder is not None and (self.folder / name).exists()

    def read(self, name: str) -> bytes:
        """The contents stored under this name.  OSError, ValueError: missing or damaged."""
        if self.folder is None:
            raise FileNotFoundError(name)
        path = self.folder / name
        # a named pipe without a writer would block
        with open(path, "rb", opener=lambda p, flags: os.open(p, flags | getattr(os, "O_NONBLOCK", 0))) as file:
            about = os.fstat(file.fileno())
            if not stat.S_ISREG(about.st_mode) or foreign(path, about):
                raise ValueError(f"{path}: not a file of this user")
            data = file.read()
        if hashlib.blake2b(data[_CHECK:]).digest() != data[:_CHECK]:
            raise ValueError(f"{path}: damaged")
        return data[_CHECK:]

    def write(self, name: str, body: bytes) -> None:
        """Store it atomically; warn once if that fails."""
        if self.folder is None or self._told:
            self.tell(self.why_not)
            return
        try:
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)  # another version may have pruned it
            if not self._written and not any(self.folder.iterdir()):  # the first file of a new digest
                _prune(self.folder.parent)
            self._written = True
            handle, draft = tempfile.mkstemp(dir=self.folder)
            try:
                with open(handle, "wb") as file:
                    file.write(hashlib.blake2b(body).digest() + body)
                os.replace(draft, self.folder / name)
            except BaseException:
                Path(draft).unlink(missing_ok=True)
                raise
        except OSError as error:
            # Windows refuses to replace a file that another process, which compiled the same, is reading
            if os.name != "nt" or not (self.folder / name).exists():
                self.tell(str(error))

    def drop(self, name: str) -> None:
        """Remove an unusable file, or anything else in its place."""
        if self.folder is not None:
            path = self.folder / name
            with suppress(OSError):
                shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()

    def tell(self, why: str) -> None:
        """Warn, once, that compiled code is not kept."""
        if not self._told:
            self._told = True
            warnings.warn(
                f"dojo_opt: compiled code cannot be stored, so every process compiles it again: {why}. "
                "NUMBA_CACHE_DIR=DIR stores it elsewhere; DOJO_OPT_CACHE=0 turns storing off",
                RuntimeWarning,
                stacklevel=2,
            )


def open_store(base: Path) -> Store:
    """The compiled code below another folder."""
    return Store(*_opened(base, OTHERS))


STORE = Store(*_found())


@cache
def shipped() -> Shipped:
    """The code that came with the package."""
    return open_shipped(stamp())


def ship(base: Path, folder: Path, target: str) -> tuple[Path, int]:
    """Write the entries that processes compiled for a target as shipped code.

    Args:
        base: their NUMBA_CACHE_DIR; with the variables of `targets.build_environment`.
        folder: where the file goes.
        target: one of `targets.FEATURES`.

    Returns:
        The file, and the number of its entries.

    Raises:
        RuntimeError: sources were edited since this process began, so the compiled version is unknown; or there is
            nothing compiled with the flags of this process.
    """
    if stamp.__wrapped__() != stamp():
        raise RuntimeError("sources of kernels were edited during the build; build again")
    store = open_store(base)
    entries = {name: store.read(name) for name in store.names() if f"-{INNER}-" not in name}
    if not entries:
        raise RuntimeError("nothing was compiled with the flags of this process; unset NUMBA_... and DOJO_OPT_...")
    return write_shipped(folder, target, stamp(), entries), len(entries)


@cache
def prepare() -> None:
    """Let Numba register its types and functions: half a second of processor time, which shipped code does not need.

    Plain arithmetic before anything else: otherwise the operators of sets and strings come first, and every operator
    of every kernel is then tried on all of them: 10 of the 50 s of processor time of a cold start (Numba 0.68).
    """
    if crossings():
        keep_modules(cpu_target.target_context.codegen())
    cpu_target.typing_context.refresh()
    cpu_target.target_context.refresh()
    hold_while_translating(cpu_target.target_context.codegen()._engine)
    why = shipped().why_not or "this is not among the shipped code"
    because(f"{why}; {f'kept in {STORE.folder}' if STORE.folder else 'not kept on disk'}")


def renew(context: Any) -> None:
    """Let Numba register later additions of modules: a refresh also imports all of its own modules again."""
    context.install_registry(builtin_registry)
    context.typing_context._load_builtins()


@cache
def _text_digest(file: str) -> bytes:
    return hashlib.sha256(Path(file).read_bytes()).digest()


class _Named:
    """Properties of a code generator in Numba's keys: system, processor and features."""

    def __init__(self, triple: str, target: str, features: str = "") -> None:
        self._magic = (system_of(triple), target, features)

    def magic_tuple(self) -> tuple[str, str, str]:
        """As a process that compiles for the target has it."""
        return self._magic


def magic_of(codegen: Any) -> tuple[str, str, str]:
    """System, processor and features of a code generator, in keys."""
    return _Named(*codegen.magic_tuple()).magic_tuple()


def _for_shipped_target(codegen: Any) -> _Named:
    return _Named(codegen.magic_tuple()[0], str(shipped().target))


@cache
def _store_of(crossing: Crossing) -> Store:
    """The entries of another system, beside the compiled code of this one."""
    assert STORE.folder is not None
    return open_store(crossing.folder(STORE.folder.parents[1]))


class KernelCache(FunctionCache):
    """The signatures of one form of a kernel; any failure to load one is a reason to compile it."""

    def __init__(self, py_func: Callable[..., Any], form: str) -> None:
        self._py_func, self._form = py_func, form
        path = Path(inspect.getfile(py_func))
        self._text = _text_digest(str(path))
        try:  # of a kernel of ours the same wherever the package is
            self._file = path.resolve().relative_to(_ROOT).as_posix()
        except ValueError:
            self._file = str(path)
        name = re.sub(r"\W+", "_", f"{path.stem}.{py_func.__name__}")
        self._stem = f"{name}-{py_func.__code__.co_firstlineno}-{form}"
        self._cache_path = str(STORE.folder)
        self.enable()

    def _key(self, sig: Any, codegen: Any) -> tuple[Any, str]:
        """(dependencies of the compiled code, apart from those of the stamp; name of its file)."""
        key = (self._form, self._file, self._text, self._index_key(sig, _Named(*codegen.magic_tuple())))
        return key, f"{self._stem}-{self.short(key)}.nbc"

    @staticmethod
    def short(key: tuple[Any, ...]) -> str:
        """Digest of a key."""
        return hashlib.sha256(repr(key).encode()).hexdigest()[:24]

    @signals_held()
    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The compile result that was shipped or kept for this signature; None where there is none, or none of use."""
        if self._form != INNER and (found := self._load_shipped(sig, target_context)) is not None:
            return found
        prepare()
        renew(target_context)
        key, name = self._key(sig, target_context.codegen())
        try:
            kept, payload = pickle.loads(STORE.read(name))
            if kept == key:
                return self._rebuild(target_context, payload)
        except FileNotFoundError:
            return None
        except Exception:  # of a damaged file, whatever unpickling runs into
            pass
        STORE.drop(name)
        return None

    def _rebuild(self, target_context: Any, payload: tuple[Any, ...]) -> Any:
        """Numba's compile result, from the reduced one."""
        rebuild = inner_result if self._form in (INNER, CALLEE) else CompileResult._rebuild
        return rebuild(target_context, *payload)

    def holds(self, sig: Any, codegen: Any) -> bool:
        """Whether there is a file for this signature, of use or not."""
        if len(shipped()) and self._key(sig, _for_shipped_target(codegen))[1] in shipped():
            return True
        return STORE.holds(self._key(sig, codegen)[1])

    def _load_shipped(self, sig: Any, target_context: Any) -> Any:
        """The compile result that was shipped; None where there is none."""
        if not len(shipped()):
            return None
        key, name = self._key(sig, _for_shipped_target(target_context.codegen()))
        if name not in shipped():
            return None
        try:
            kept, payload = pickle.loads(shipped().read(name))
            if kept == key:
                rtsys.initialize(target_context)
                return self._rebuild(target_context, payload)
        except Exception as error:  # as above; but this one cannot be mended by writing it again
            warnings.warn(f"dojo_opt: shipped code is not used: {error}", RuntimeWarning, stacklevel=2)
        shipped().drop(name)
        return None

    @signals_held()
    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a compile result."""
        if data.lifted or data.library.has_dynamic_globals:
            STORE.tell(f"{self._py_func.__name__} holds addresses of this process")
            return
        if not STORE.wanted:  # the cache is off, and shipped code is looked for only
            return
        key, name = self._key(sig, data.codegen)
        try:
            payload = dumps((key, data._reduce()))
        except Exception as error:  # of whatever kind: a value among its constants or types has the say in its pickling
            STORE.tell(f"{self._py_func.__name__} holds a value that cannot be kept: {error}")
            return
        STORE.write(name, payload)
        if self._form != INNER and crossings():
            self._save_crossings(sig, data)

    def _save_crossings(self, sig: Any, data: Any) -> None:
        """Keep a compile result with code for other systems."""
        for crossing in crossings():
            key, name = self._key(sig, crossing)
            _store_of(crossing).write(name, dumps((key, crossing.reduced(data))))

    def flush(self) -> None:
        """Delete the stored files of this form."""
        for path in STORE.folder.glob(f"{self._stem}-*.nbc") if STORE.folder else ():
            STORE.drop(path.name)
