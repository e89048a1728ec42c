"""Figures of the report `lean`."""

from __future__ import annotations

from typing import Any

from dojo_opt.report.lean.cost_figure import draw_bars


def pendulum(details: dict[str, Any]) -> Any:
    """Time by feature; time of a step against the distance of a hundred contacts.  A matplotlib Figure."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    draw_bars(left, details["features"])
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
