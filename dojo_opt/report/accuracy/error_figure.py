"""The figure of the accuracy study: errors against processor time, one line per engine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dojo_opt.plots.axes import plain_ticks
from dojo_opt.report.accuracy.error_curves import Curves
from dojo_opt.report.palette import is_ours, palette

PANELS = (  # scene, quantity, title
    ("free body", "attitude", "free body: attitude [rad]"),
    ("tree of 13 bodies", "position", "tree of 13 bodies: position [m]"),
    ("tree of 13 bodies", "energy", "tree: energy, relative"),
    ("tree of 13 bodies", "angular", "tree: angular momentum, relative"),
    ("pendulum of 5", "position", "pendulum of 5 links: position [m]"),
    ("pendulum of 50", "position", "pendulum of 50 links: position [m]"),
    ("pendulum of 2", "position", "pendulum of 2 links: position [m]"),
)


def figure(measured: Mapping[str, Curves], panels: Sequence[tuple[str, str, str]] = PANELS) -> Any:
    """A matplotlib Figure of the first six panels whose scenes were measured."""
    from matplotlib.figure import Figure

    panels = [panel for panel in panels if panel[0] in measured][:6]
    columns = min(3, len(panels))
    rows = -(-len(panels) // columns)
    out = Figure(figsize=(4.6 * columns, 3.6 * rows + 0.8), layout="constrained")
    axes = np.atleast_1d(out.subplots(rows, columns)).ravel()
    names = palette(name for curves in measured.values() for name in curves)
    for axis, (scene, quantity, title) in zip(axes, panels, strict=False):
        for name, points in measured[scene].items():
            good = [p for p in points if np.isfinite(p.errors[quantity]) and p.errors[quantity] < 10.0]
            x, y = [1e3 * p.seconds for p in good], [max(p.errors[quantity], 1e-16) for p in good]
            ours = is_ours(name)
            style: dict[str, Any] = {
                "lw": 2.0 if ours else 1.2,
                "ls": "-" if ours else "--",
                "zorder": 3 if ours else 2,
            }
            axis.loglog(x, y, "o" if ours else "s", ms=4, color=names[name], label=name, **style)
        axis.set_title(title, fontsize=10)
        axis.set_xlabel("processor time [ms]")
        plain_ticks(axis)
        axis.grid(alpha=0.3)
    for axis in axes[len(panels) :]:
        axis.set_visible(False)
    handles, labels = axes[0].get_legend_handles_labels()
    out.legend(handles, labels, loc="outside lower center", ncols=5, fontsize=9, frameon=False)
    return out
