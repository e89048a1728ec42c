"""Short texts of results for the screen: kind and sizes of an object instead of all its numbers."""

from __future__ import annotations

import html
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

__all__ = ["short_repr", "short_table"]

_FEW = 6  # length of the longest array or list that is printed in full
_LETTERS = 120  # of a part
_ROWS = 50  # of a table


def short_repr(self: Any) -> str:
    """Use as the `__repr__` of a dataclass or NamedTuple: fields by name, arrays and long lists by their size."""
    names = [f.name for f in fields(self) if f.repr] if is_dataclass(self) else self._fields
    return f"{type(self).__name__}({', '.join(f'{name}={_brief(getattr(self, name))}' for name in names)})"


def _brief(value: Any) -> str:
    """One value."""
    if isinstance(value, np.ndarray):
        if value.size > _FEW or value.dtype == object:
            return f"<array {value.shape}>"
        return np.array2string(value, precision=6, separator=", ")
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{k!r}: {_brief(v)}' for k, v in value.items())}}}" if _plain(value.values()) else (
            f"<{len(value)} entries>"
        )  # fmt: skip
    if isinstance(value, list | tuple) and not hasattr(value, "_fields"):
        if len(value) <= _FEW and _plain(value):
            return f"[{', '.join(map(_brief, value))}]"
        return f"<{len(value)} of {type(value[0]).__name__}>" if value else "[]"
    text = repr(value)
    return text if len(text) <= _LETTERS else f"{text[: _LETTERS - 3]}..."


def _plain(values: Iterable[Any]) -> bool:
    """Whether there are few, and all of them numbers or words."""
    listed = list(values)
    return len(listed) <= _FEW and all(isinstance(v, str | int | float | np.generic | None) for v in listed)


def short_table(title: str, header: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """HTML for a notebook: a table of at most 50 rows, the last with the number of omitted rows."""

    def line(cells: Iterable[Any], tag: str) -> str:
        texts = (f"{cell:.4g}" if isinstance(cell, float) else str(cell) for cell in cells)
        return "<tr>" + "".join(f"<{tag}>{html.escape(text)}</{tag}>" for text in texts) + "</tr>"

    shown = [line(row, "td") for row in rows[:_ROWS]]
    if len(rows) > _ROWS:
        shown.append(line([f"and {len(rows) - _ROWS} more"], "td"))
    return f"<p>{html.escape(title)}</p><table>{line(header, 'th')}{''.join(shown)}</table>"
