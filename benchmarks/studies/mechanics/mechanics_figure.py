"""Figure of the study `mechanics`: how far every entry of its tables is from its bar."""

from __future__ import annotations

from math import isfinite
from typing import Any

from benchmarks.studies.mechanics import joint_kinds as joints
from support import collision_checks as collisions
from support import parameter_errors as parameters

FLOOR = 1e-12  # of the axis; smaller ones, and stops that are not reached, stand on it


def margins(details: dict[str, Any]) -> Any:
    """Error over bar, a dot per entry: joint kinds, pairs of shapes, parameters.  A matplotlib Figure."""
    from matplotlib.figure import Figure

    rows = {
        "joint kinds": _transposed({k: _joint(v) for k, v in details["joints"].items()}),
        "pairs of shapes": _transposed(
            {p: {c: e / collisions.bar(p, c) for c, e in v.items()} for p, v in details["pairs"].items()}
        ),
        "derivatives by parameters": {
            name: {kind: error / parameters.BAR for kind, error in v.items()}
            for name, v in details["parameters"].items()
        },
    }
    figure = Figure(figsize=(13.0, 1.4 + 0.28 * max(len(r) for r in rows.values())), layout="constrained")
    for axes, (title, lines) in zip(figure.subplots(1, 3), rows.items(), strict=True):
        for y, values in enumerate(lines.values()):
            axes.plot([max(v, FLOOR) for v in values.values()], [y] * len(values), "o", color="#4477aa", alpha=0.5)
        axes.axvline(1.0, color="#cc3311")
        largest = max((v for values in lines.values() for v in values.values() if isfinite(v)), default=1.0)
        axes.set_yticks(range(len(lines)), list(lines))
        axes.invert_yaxis()
        axes.set(xscale="log", xlim=(0.5 * FLOOR, max(10.0, 2.0 * largest)), xlabel="error / bar", title=title)
        axes.spines[["top", "right"]].set_visible(False)
    return figure


def _joint(values: dict[str, float | None]) -> dict[str, float]:
    """Values over their bars, without missing features and without the order of the energy error."""
    return {name: v / joints.BARS[name] for name, v in values.items() if v is not None and name != "energy"}


def _transposed(rows: dict[str, dict[str, float]]) -> dict[str, dict[str, float]]:
    """{column: {row: value}}"""
    columns = {column: None for values in rows.values() for column in values}
    return {c: {row: values[c] for row, values in rows.items() if c in values} for c in columns}
