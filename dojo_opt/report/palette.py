"""Colours of engines in figures: ours from light to dark blue, others by their order."""

from __future__ import annotations

from collections.abc import Iterable

_OURS = ("#9ecae1", "#4292c6", "#08519c", "#08306b")
_OTHERS = (
    "#e6550d", "#31a354", "#756bb1", "#dd1c77", "#636363", "#b8860b", "#17becf", "#8c564b", "#bcbd22", "#fdae6b",
)  # fmt: skip


def palette(names: Iterable[str]) -> dict[str, str]:
    """A colour for each name."""
    out: dict[str, str] = {}
    for name in dict.fromkeys(names):
        colors = _OURS if is_ours(name) else _OTHERS
        out[name] = colors[sum(is_ours(other) == is_ours(name) for other in out) % len(colors)]
    return out


def is_ours(name: str) -> bool:
    """Whether an engine is a setting of ours."""
    return name.startswith("dojo-opt")
