"""Shipped code: the entries that came compiled with the package, one file per target in `solvers/shipped`.

    magic, digest of the index, length of the index
    index       stamp, versions of Numba and Python, target; by name of an entry its place, length and SHA-256
    entries     as the cache keeps them (cache.py)

The stamp is that of the cache: sources of all kernels, version of Numba, flags. Neither the place of the package nor
the processor that compiled are part of a name. An entry holds the machine code of all kernels that it calls, apart from
optional ones, which are entries of their own; so inner kernels are not shipped.

A file is read only where its owner is the user or root, and where nobody else can write; and an entry only when it has
its digest. Everything else is compiled, into the user's cache.

    DOJO_OPT_SHIPPED=0    use no shipped code
"""

from __future__ import annotations

import hashlib
import json
import os
import stat
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numba

from solvers.compiler.ownership import OTHERS, WORLD, foreign, is_private_group
from solvers.compiler.targets import best_target

__all__ = ["FOLDER", "SUFFIX", "Shipped", "open_shipped", "write_shipped"]

FOLDER = Path(__file__).resolve().parents[1] / "shipped"
SUFFIX = ".kernels"
_MAGIC = b"dojo_opt kernels\n"
_HASH = hashlib.sha256().digest_size
_HEAD = len(_MAGIC) + _HASH + 8  # bytes before the index


class Shipped:
    """The entries of one file; none if it cannot be used, with the reason in `why_not`."""

    def __init__(self, folder: Path, target: str | None, stamp: str) -> None:
        self.target, self.why_not = target, ""
        self._entries: dict[str, tuple[int, int, str]] = {}
        self._path = folder / f"{target}{SUFFIX}"
        if target is None:
            self.why_not = "no code is shipped for this processor" if _files(folder) else "no code is shipped"
            return
        try:
            found = self._index()
        except (OSError, ValueError, KeyError, TypeError) as error:
            self.why_not = str(error)
            return
        if found["stamp"] != stamp:
            same = found["versions"] == versions()
            other = "other sources or flags" if same else f"{found['versions']}, this is {versions()}"
            self.why_not = f"the shipped code is for {other}"
            return
        self._entries = {name: (int(a), int(n), str(d)) for name, (a, n, d) in found["entries"].items()}

    def __contains__(self, name: str) -> bool:
        return name in self._entries

    def __len__(self) -> int:
        return len(self._entries)

    def _read(self, start: int, length: int) -> bytes:
        """Bytes of the file.  OSError, ValueError: it is cut off, or others can write to it."""
        with open(self._path, "rb", opener=lambda p, flags: os.open(p, flags | getattr(os, "O_NONBLOCK", 0))) as file:
            about = os.fstat(file.fileno())
            if not stat.S_ISREG(about.st_mode):
                raise ValueError(f"{self._path}: not a file")
            _check(self._path, about)
            file.seek(start)
            data = file.read(length)
        if len(data) != length:
            raise ValueError(f"{self._path}: cut off")
        return data

    def _index(self) -> dict[str, Any]:
        """Content of the file."""
        _check(self._path.parent, self._path.parent.stat())
        head = self._read(0, _HEAD)
        digest, length = head[len(_MAGIC) : -8], int.from_bytes(head[-8:], "little")
        if not head.startswith(_MAGIC) or length > os.stat(self._path).st_size:
            raise ValueError(f"{self._path}: damaged")
        text = self._read(_HEAD, length)
        if hashlib.sha256(text).digest() != digest:
            raise ValueError(f"{self._path}: damaged")
        self._begin = _HEAD + length
        return dict(json.loads(text))

    def read(self, name: str) -> bytes:
        """An entry.  KeyError: it is not shipped; OSError, ValueError: not as it was shipped."""
        start, length, digest = self._entries[name]
        data = self._read(self._begin + start, length)
        if hashlib.sha256(data).hexdigest() != digest:
            raise ValueError(f"{self._path}: {name} is damaged")
        return data

    def drop(self, name: str) -> None:
        """Never read this entry again in this process."""
        self._entries.pop(name, None)


def _check(path: Path, about: os.stat_result) -> None:
    """ValueError: others could have written it."""
    if why := foreign(path, about, WORLD if is_private_group(about) else OTHERS):
        raise ValueError(why)


def _files(folder: Path) -> list[Path]:
    return sorted(folder.glob(f"*{SUFFIX}")) if folder.is_dir() else []


def versions() -> str:
    """Versions that compiled code depends on, as text."""
    return f"Numba {numba.__version__} and Python {sys.version_info[0]}.{sys.version_info[1]}"


def open_shipped(stamp: str, folder: Path = FOLDER) -> Shipped:
    """The code shipped for the best target that this processor can run."""
    if os.environ.get("DOJO_OPT_SHIPPED", "1") == "0":
        found = Shipped(folder, None, stamp)
        found.why_not = "DOJO_OPT_SHIPPED=0"
        return found
    return Shipped(folder, best_target(tuple(path.stem for path in _files(folder))), stamp)


def write_shipped(folder: Path, target: str, stamp: str, entries: Mapping[str, bytes]) -> Path:
    """Write the file of a target, as a whole or not at all.

    Args:
        folder: made if need be.
        target: one of `targets.FEATURES`.
        stamp: that of the sources and flags that the entries were compiled from.
        entries: contents by name.

    Returns:
        The file.
    """
    index, start = {}, 0
    for name, data in sorted(entries.items()):
        index[name] = (start, len(data), hashlib.sha256(data).hexdigest())
        start += len(data)
    text = json.dumps({"stamp": stamp, "versions": versions(), "target": target, "entries": index}).encode()
    folder.mkdir(parents=True, exist_ok=True)
    handle, draft = tempfile.mkstemp(dir=folder, suffix=".draft")
    try:
        with open(handle, "wb") as file:
            file.write(_MAGIC + hashlib.sha256(text).digest() + len(text).to_bytes(8, "little") + text)
            for name in index:
                file.write(entries[name])
            file.flush()
            os.fsync(file.fileno())
        os.chmod(draft, 0o644)
        path = folder / f"{target}{SUFFIX}"
        os.replace(draft, path)
    except BaseException:
        Path(draft).unlink(missing_ok=True)
        raise
    return path
