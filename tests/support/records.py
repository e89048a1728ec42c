"""The arrays of the records that kernels read and write."""

from __future__ import annotations

from typing import Any


def arrays_of(record: Any) -> dict[str, Any]:
    """All arrays of a record, those of its parts included."""
    out = {}
    for name, value in zip(record._fields, record, strict=True):
        out.update(arrays_of(value) if isinstance(value, tuple) else {name: value})
    return out
