"""Damage: files that are changed at random, as disks, editors and attackers change them."""

from __future__ import annotations

import io
import json
import pickle
import zipfile
from collections.abc import Callable
from typing import Any

import numpy as np

__all__ = ["damaged_npz"]

Members = dict[str, bytes]
NUMBERS = (0, -1, 10**18, 2**63, 1e300, -1e-300, float("nan"), float("inf"), None, "x", [], {}, True, [[1]], "\0", 3.5)


def _npy(array: Any) -> bytes:
    out = io.BytesIO()
    np.save(out, array, allow_pickle=True)
    return out.getvalue()


def _members(data: bytes) -> Members:
    with zipfile.ZipFile(io.BytesIO(data)) as found:
        return {name: found.read(name) for name in found.namelist()}


def _zipped(members: Members) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as made:
        for name, data in members.items():
            made.writestr(name, data)
    return out.getvalue()


def _bytes_changed(data: bytes, rng: np.random.Generator) -> bytes:
    out = bytearray(data)
    for _ in range(int(rng.integers(1, 9))):
        out[int(rng.integers(len(out)))] = int(rng.integers(256))
    return bytes(out)


def _truncated(data: bytes, rng: np.random.Generator) -> bytes:
    return data[: int(rng.integers(len(data)))]


def _other_file(data: bytes, rng: np.random.Generator) -> bytes:
    others = (
        b"",
        b"\0" * 100,
        pickle.dumps(Bomb()),
        _npy(np.zeros(3)),
        b"PK\x03\x04",
        _npy(np.array([Bomb()], dtype=object)),
    )
    return others[int(rng.integers(len(others)))]


def _array_changed(data: bytes, rng: np.random.Generator) -> bytes:
    members = _members(data)
    name = str(rng.choice(list(members)))
    array = np.load(io.BytesIO(members[name]))
    choices: list[Callable[[], Any]] = [
        lambda: np.zeros((0,)),
        lambda: np.zeros((2, 2, 2, 2)),
        lambda: np.array([Bomb()], dtype=object),
        lambda: array[:-1] if array.ndim else array,
        lambda: np.repeat(array, 2, axis=0) if array.ndim else array,
        lambda: array.astype(np.complex128) if array.dtype.kind in "if" else array,
        lambda: array.astype(str),
        lambda: array.astype(np.float32) if array.dtype.kind in "if" else array,
        lambda: np.full_like(array, rng.choice([np.nan, np.inf, 1e300])) if array.dtype.kind == "f" else array,
        lambda: array.T,
    ]
    members[name] = _npy(choices[int(rng.integers(len(choices)))]())
    return _zipped(members)


def _header_changed(data: bytes, rng: np.random.Generator) -> bytes:
    """Shapes of 10^15 numbers, and code in place of a shape."""
    members = _members(data)
    name = str(rng.choice(list(members)))
    raw = members[name]
    end = 10 + int.from_bytes(raw[8:10], "little")
    shape = str(rng.choice(["(1000000000000000,)", "(-1,)", "(2**40,)", "__import__('os').abort()", "("]))
    head = raw[10:end].decode("latin1")
    head = head[: head.index("'shape':")] + f"'shape': {shape}, }}"
    padded = head.ljust(len(raw[10:end]) - 1)[: len(raw[10:end]) - 1] + "\n"
    members[name] = raw[:10] + padded.encode("latin1") + raw[end:]
    return _zipped(members)


def _member_lost(data: bytes, rng: np.random.Generator) -> bytes:
    members = _members(data)
    del members[str(rng.choice(list(members)))]
    return _zipped(members)


def _entry_changed(data: bytes, rng: np.random.Generator) -> bytes:
    """An entry of the JSON of the head, at any depth, is replaced, removed or doubled."""
    members = _members(data)
    head = next(name for name in members if np.load(io.BytesIO(members[name])).dtype.kind == "U")
    plain = json.loads(str(np.load(io.BytesIO(members[head]))))
    where, spot = _spots(plain)[int(rng.integers(len(_spots(plain))))]
    kind = rng.integers(4)
    if kind == 0:
        del where[spot]
    elif kind == 1 and isinstance(where, dict):
        where["more"] = where[spot]
    elif kind == 2:
        where[spot] = (
            plain_copy(plain) if rng.random() < 0.2 else {"part": str(rng.choice(["Body", "Simulator", "os"]))}
        )
    else:
        where[spot] = NUMBERS[int(rng.integers(len(NUMBERS)))]
    members[head] = _npy(np.array(json.dumps(plain)))
    return _zipped(members)


def plain_copy(plain: Any) -> Any:
    """A copy of plain data."""
    return json.loads(json.dumps(plain))


def _spots(plain: Any) -> list[tuple[Any, Any]]:
    """(container, key) of everything inside of plain data."""
    keys = list(plain) if isinstance(plain, dict) else range(len(plain)) if isinstance(plain, list) else ()
    here = [(plain, key) for key in keys]
    return here + [spot for key in keys for spot in _spots(plain[key])]


def _deep(data: bytes, rng: np.random.Generator) -> bytes:
    members = _members(data)
    head = next(name for name in members if np.load(io.BytesIO(members[name])).dtype.kind == "U")
    members[head] = _npy(np.array("[" * 100_000 + "]" * 100_000))
    return _zipped(members)


class Bomb:
    """Marks that a pickle was loaded."""

    loaded: list[int] = []

    def __reduce__(self) -> Any:
        return Bomb.loaded.append, (1,)


KINDS = (
    *(_bytes_changed, _truncated, _other_file, _member_lost, _deep),
    *(_array_changed, _header_changed, _entry_changed) * 3,
)


def damaged_npz(data: bytes, rng: np.random.Generator) -> bytes:
    """An .npz file with damage of one of many kinds.

    Args:
        data: the file.
        rng: of the damage.

    Returns:
        The other file.
    """
    return KINDS[int(rng.integers(len(KINDS)))](data, rng)
