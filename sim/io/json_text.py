"""Numbers as JSON text."""

from __future__ import annotations

import json
from typing import Any


def json_text(value: Any, indent: int | None = None) -> str:
    """A value as JSON: arrays are lists, and numbers that are not finite, which JSON does not have, are strings.

    Args:
        value: numbers, texts, arrays, and lists and dictionaries of them.
        indent: spaces by which each level is indented; None: one line.

    Returns:
        The text.

    Raises:
        TypeError: JSON has no such value.
    """
    return json.dumps(_plain(value), indent=indent, allow_nan=False)


def _plain(value: Any) -> Any:
    """A value that JSON can hold."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, float) and value - value != 0.0:
        return str(value)
    return value
