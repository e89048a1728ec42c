"""The figure of the stability study: trials down, engines across."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from dojo_opt.report.stability.trial import NOT_GIVEN, StabilityTrial, TrialVerdict

_LEGEND = (
    "green: passed; red: not (x: above the bar of its rule); yellow: refused with a reason; grey: not represented.\n"
    "Numbers are the measure of the rule of each row; the rules are in the tables."
)


def picture(trials: Sequence[StabilityTrial], verdicts: Mapping[str, Sequence[TrialVerdict]]) -> Figure:
    """Green where the rule is met, red where it is not, yellow where a scene is refused, grey where it is not given."""
    rows, columns = len(trials), len(verdicts)
    figure = Figure(figsize=(6.5 + 1.15 * columns, 1.6 + 0.26 * rows), layout="constrained")
    ax = figure.subplots()
    colors = np.array([[_color(verdict) for verdict in found] for found in verdicts.values()]).T
    ax.imshow(colors, cmap=ListedColormap(["#e8a49c", "#ece0a4", "#a9d8b0", "#e4e4e4"]), vmin=0, vmax=3, aspect="auto")
    for column, found in enumerate(verdicts.values()):
        for row, verdict in enumerate(found):
            ax.text(column, row, verdict.text, ha="center", va="center", fontsize=7)
    ax.set_xticks(range(columns), [name.replace(" ", "\n", 1) for name in verdicts], fontsize=8)
    ax.xaxis.tick_top()
    ax.set_yticks(range(rows), [f"{trial.group}: {trial.name}" for trial in trials], fontsize=7)
    edges = [k for k in range(1, rows) if trials[k].group != trials[k - 1].group]
    ax.hlines(np.array(edges) - 0.5, -0.5, columns - 0.5, color="white", lw=2.0)
    ax.vlines(np.arange(1, columns) - 0.5, -0.5, rows - 0.5, color="white", lw=1.0)
    figure.supxlabel(_LEGEND, fontsize=8)
    ax.tick_params(length=0)
    for side in ax.spines.values():
        side.set_visible(False)
    return figure


def _color(verdict: TrialVerdict) -> int:
    if verdict.text == NOT_GIVEN:
        return 3
    return 1 if verdict.text == "refused" else 2 * verdict.passed
