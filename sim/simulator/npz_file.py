"""NpzFile: arrays and a head of plain data in one .npz file; reading one runs no code, whatever the file holds."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from os import PathLike
from typing import Any
from zipfile import ZipFile

import numpy as np
from numpy.typing import NDArray

from sim.mechanism import checks
from sim.mechanism.memory_limit import check_room

Arrays = dict[str, NDArray[Any]]

__all__ = ["check_head", "check_shapes", "read_npz", "reading", "write_npz"]


@contextmanager
def reading(call: str, path: str | PathLike[str], kind: str) -> Iterator[None]:
    """Whatever a damaged file raises is a ValueError that names it; errors of the system, and Ctrl-C, pass.

    Args:
        call: the call that an error names.
        path: path of the file.
        kind: the kind of file that it should be.

    Yields:
        Nothing.

    Raises:
        ValueError: the file is damaged, or another one.
    """
    try:
        yield
    except (OSError, TypeError) as error:
        if isinstance(error, OSError) or str(error).startswith(call):
            raise
        raise ValueError(_damaged(call, path, kind, error)) from error
    except Exception as error:  # of zip, zlib, NumPy, JSON, and of the parts that refuse their fields
        if isinstance(error, ValueError) and str(error).startswith(call):
            raise
        raise ValueError(_damaged(call, path, kind, error)) from error


def _damaged(call: str, path: str | PathLike[str], kind: str, error: Exception) -> str:
    return f"{call}: {path} is no {kind} of dojo-opt, or damaged: {type(error).__name__}: {checks.shown(str(error))}"


def write_npz(
    call: str, path: str | PathLike[str], head: Mapping[str, Any], arrays: Mapping[str, Any], name: str = "meta"
) -> None:
    """Write a file.

    Args:
        call: the call and the argument that an error names.
        path: path of the file; NumPy appends .npz to a name without it.
        head: plain data, as JSON has it.
        arrays: arrays by name.
        name: that of the head among them.

    Raises:
        TypeError: the path is none.
        OSError: the file cannot be written.
    """
    np.savez(checks.path(call, path), allow_pickle=False, **{name: np.array(json.dumps(head))}, **arrays)


def read_npz(call: str, path: str | PathLike[str], name: str = "meta") -> tuple[dict[str, Any], Arrays]:
    """Head and arrays of a file, or of the same name with .npz, which NumPy adds to other endings.

    Args:
        call: the call that an error names.
        path: path of the file.
        name: that of the head among its arrays.

    Returns:
        (head, arrays by name); arrays of objects are refused, as they are pickles.

    Raises:
        TypeError: the path is none.
        OSError: the file cannot be read.
        ValueError: its arrays are larger than the memory.
    """
    file = checks.path(f"{call}(path)", path)
    added = file.with_name(f"{file.name}.npz")
    file = added if not file.exists() and added.exists() else file
    with file.open("rb") as opened, ZipFile(opened) as members:
        check_room(f"{call}: {path}", sum(m.file_size for m in members.infolist()), 1.0, "damaged?", "bytes")
    with np.load(file, allow_pickle=False) as data:
        arrays = {key: data[key] for key in data.files}
    head = json.loads(str(arrays.pop(name)))
    if not isinstance(head, dict) or not all(isinstance(array, np.ndarray) for array in arrays.values()):
        raise ValueError("expected a head by names, and arrays")
    return head, arrays


def check_head(head: Mapping[str, Any], kinds: Mapping[str, Any]) -> None:
    """Refuse a head with other entries than these, or of other kinds.

    Args:
        head: plain data by name.
        kinds: type of each entry, or types; whole numbers are numbers, too.

    Raises:
        ValueError: an entry is missing, unknown, or of another kind.
    """
    if unfit := set(head) ^ set(kinds):
        raise ValueError(f"entries {', '.join(sorted(map(str, unfit)))}: missing, or unknown")
    for name, kind in kinds.items():
        allowed = (int, float) if kind is float else kind
        if not isinstance(head[name], allowed) or (isinstance(head[name], bool) and kind is not bool):
            raise ValueError(f"entry {name}: {checks.shown(head[name])}")


def check_shapes(arrays: Mapping[str, Any], shapes: Mapping[str, tuple[int | None, ...]]) -> None:
    """Refuse arrays that are missing, of another shape, or no numbers.

    Args:
        arrays: arrays by name.
        shapes: shape of each; None stands for any length.

    Raises:
        ValueError: an array does not fit.
    """
    for name, shape in shapes.items():
        array = arrays.get(name)
        if array is None or array.dtype.kind not in "biuf":
            raise ValueError(f"array {name}: missing, or no numbers")
        fits = array.ndim == len(shape) and all(n in (None, m) for n, m in zip(shape, array.shape, strict=True))
        if not fits:
            raise ValueError(f"array {name}: expected shape {shape}, got {array.shape}")
