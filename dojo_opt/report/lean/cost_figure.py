"""The figure of the cost of each feature of a robot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


def cost_figure(name: str, rows: Sequence[dict[str, Any]]) -> Any:
    """Time of a robot with all features and without each of them.  A matplotlib Figure."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 0.5 * len(rows) + 1.6), layout="constrained")
    axes = figure.subplots()
    draw_bars(axes, rows)
    axes.set_title(name)
    return figure


def draw_bars(axes: Any, rows: Sequence[dict[str, Any]]) -> None:
    """Step and gradient, one bar per scene, the first on top."""
    places = range(len(rows))
    step = [row["step"] for row in rows]
    gradient = [max(row["gradient"], 0.0) for row in rows]
    axes.barh(places, step, color="#4477aa", label="step")
    axes.barh(places, gradient, left=step, color="#ccbb44", label="gradient")
    axes.set_yticks(places, [row["name"] for row in rows])
    axes.invert_yaxis()
    axes.set_xlabel("processor time [us]")
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, loc="upper right")
