"""Figures of the report `lean`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


def pendulum(details: dict[str, Any]) -> Any:
    """Time by feature; time of a step against the distance of a hundred contacts.  A matplotlib Figure."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    _bars(left, details["features"])
    left.set_title("A pendulum, one feature more in every row")
    rows = details["distance"]
    for kappa in dict.fromkeys(row["kappa"] for row in rows):
        line = [row for row in rows if row["kappa"] == kappa]
        (drawn,) = right.plot([r["distance"] for r in line], [r["step"] for r in line], "-", label=f"kappa {kappa:g}")
        for far, fill in ((True, "none"), (False, None)):
            points = [r for r in line if (r["far"] > details["none"]["far"]) == far]
            marks = {"color": drawn.get_color(), "mfc": fill or drawn.get_color(), "linestyle": "none"}
            right.plot([r["distance"] for r in points], [r["step"] for r in points], marker="o", **marks)
    right.axhline(details["none"]["step"], color="0.5", linestyle=":", label="without them")
    right.set(xscale="log", yscale="log", xlabel="distance of the wall [m]", ylabel="step [us]")
    for axis in (right.xaxis, right.yaxis):
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("")
    right.set_yticks([3.0, 5.0, 10.0, 20.0, 50.0, 100.0])
    right.set_title("100 contacts that face a wall; hollow: far")
    right.legend(frameon=False)
    return figure


def robot(name: str, rows: Sequence[dict[str, Any]]) -> Any:
    """Time of a robot as it is and without each feature.  A matplotlib Figure."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 0.5 * len(rows) + 1.6), layout="constrained")
    axes = figure.subplots()
    _bars(axes, rows)
    axes.set_title(name)
    return figure


def _bars(axes: Any, rows: Sequence[dict[str, Any]]) -> None:
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
