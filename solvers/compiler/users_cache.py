"""Compiled loops around functions of the user on disk, by the content of all functions in them.

A kernel is known by its file, and the digest of all sources names the folder. A user's function may stand anywhere, and
be made anew with other values: a file here is named by a digest of its code and of the values in it. Functions without
a digest (function_digest.py) compile in every process.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from solvers.compiler.cache import STORE, KernelCache, magic_of, prepare, renew
from solvers.compiler.function_digest import function_digest

__all__ = ["UsersCache"]

_USERS = "users-"  # names of the files begin so
_MOST = 400  # files, of about 50 kB; a program that makes functions with new values leaves one for each


class UsersCache(KernelCache):
    """The signatures of a loop around functions of the user, or of such a function."""

    def __init__(self, py_func: Callable[..., Any], flags: dict[str, Any]) -> None:
        self._py_func, self._flags, self._form, self._stem = py_func, flags, "users", py_func.__qualname__
        self._digest: str | None = None
        self._cache_path = str(STORE.folder)
        self.enable()

    def _key(self, sig: Any, codegen: Any) -> tuple[Any, str]:
        """(dependencies of the compiled code, apart from those of the stamp; name of its file)."""
        key = (self._form, self._digest, repr(sig), magic_of(codegen))
        return key, f"{_USERS}{self._digest}-{self.short(key)}.nbc"

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The compile result that was shipped or kept for the present content; None where there is none, or of use."""
        self._digest = function_digest(self._py_func, self._flags)
        if self._digest is None:
            prepare()
            renew(target_context)
            return None
        found = super().load_overload(sig, target_context)
        if found is not None and STORE.folder is not None:
            with suppress(OSError):  # shipped, or read-only
                os.utime(STORE.folder / self._key(sig, target_context.codegen())[1])
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a compile result, unless a value in it has changed meanwhile, or is an address of this process."""
        known = self._digest is not None and self._digest == function_digest(self._py_func, self._flags)
        if known and not data.lifted and not data.library.has_dynamic_globals:
            super().save_overload(sig, data._replace(type_annotation=""))
            _prune()

    def flush(self) -> None:
        """Delete the stored files of the present content."""
        for path in STORE.folder.glob(f"{_USERS}{self._digest}-*.nbc") if STORE.folder else ():
            STORE.drop(path.name)


def _prune() -> None:
    """Drop the half of the files that was not used for longest, where there are too many."""
    if STORE.folder is None:
        return
    with suppress(OSError):  # of a file that another process drops
        paths = list(STORE.folder.glob(f"{_USERS}*.nbc"))
        if len(paths) > _MOST:
            for path in sorted(paths, key=lambda path: path.stat().st_mtime)[: len(paths) // 2]:
                STORE.drop(path.name)
