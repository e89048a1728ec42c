"""The figure of the study `planning`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.studies.planning.planners import PlanOutcome
from benchmarks.studies.planning.planning_cases import NAMES
from benchmarks.studies.planning.setting_families import Score

_CLOSED = 1e-6  # gap up to which a trajectory has a cost
_LEAST = 1e-7  # violations are drawn from here
_COLORS = {"default": "C3", "one stage": "C0", "soft": "C1", "schedule": "C2", "last stage": "C4", "solver": "C5"}


def draw(
    plans: Mapping[str, PlanOutcome],
    alone: Mapping[str, PlanOutcome],
    peers: Mapping[str, Sequence[PlanOutcome]],
    scores: Mapping[str, Sequence[Score]],
) -> Any:
    """A column per problem: cost and violation against time, then all settings on its variants."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(17, 11), layout="constrained")
    axes = figure.subplots(3, len(NAMES))
    for column, name in enumerate(NAMES):
        own = next(plan for key, plan in plans.items() if key.startswith(f"{name}, 1 x"))
        curves = [("dojo-opt, default", "C3", "-", own), (f"dojo-opt, {alone[name].setting}", "C0", "-", alone[name])]
        for plan, style in zip(peers.get(name, ()), ("-", "--", ":", "-."), strict=False):
            curves.append((f"MuJoCo, {plan.setting}", "0.35", style, plan))
        for label, color, style, plan in curves:
            _history(axes[0, column], axes[1, column], plan, label, {"color": color, "linestyle": style})
        times = _decades([1e3 * t for _, _, _, plan in curves for t in plan.history[:, 0]])
        axes[0, column].set(title=name, xscale="log", yscale="log", xlim=times)
        axes[1, column].set(xscale="log", yscale="log", xlabel="processor time [ms]", ylim=(_LEAST, None), xlim=times)
        axes[1, column].axhline(1e-3, color="0.7", linewidth=0.8)
        axes[1, column].legend(fontsize=7.5, loc="lower left")
        _scatter(axes[2, column], scores[name])
    for row, label in enumerate(("cost", "violation", "median cost over the best found - 1")):
        axes[row, 0].set_ylabel(label)
    for panel in axes.flat:
        panel.grid(alpha=0.25)
    return figure


def _history(top: Any, bottom: Any, plan: PlanOutcome, label: str, look: dict[str, Any]) -> None:
    """Cost, where the trajectory has no gaps, and violation; a cross marks a failed solve."""
    seconds, cost, violation, gap = plan.history.T
    ms, closed = 1e3 * seconds, gap <= _CLOSED
    top.plot(ms[closed], cost[closed], **look)
    bottom.plot(ms[closed], np.maximum(violation[closed], _LEAST), label=label, **look)
    if len(ms):
        marker = "o" if plan.success else "x"
        top.plot(ms[-1], plan.cost, marker, color=look["color"])
        bottom.plot(ms[-1], max(plan.violation, _LEAST), marker, color=look["color"])


def _scatter(axes: Any, scores: Sequence[Score]) -> None:
    """Settings: filled if every variant has a plan that holds when replayed, else the number of variants with one."""
    named = set()
    for s in scores:
        color = _COLORS[s.setting.group]
        label = None if s.setting.group in named else s.setting.group
        named.add(s.setting.group)
        x, y = 1e3 * s.seconds, max(s.excess, 1e-4) if np.isfinite(s.excess) else np.nan
        face = color if s.true == s.variants else "none"
        size = 11 if s.setting.group == "default" else 6
        axes.plot(x, y, "o", color=color, markerfacecolor=face, markersize=size, label=label)
        if s.true < s.variants:
            axes.annotate(f"{s.true}/{s.variants}", (x, y), (5, 3), textcoords="offset points", fontsize=7, color="0.3")
    times = _decades([1e3 * s.seconds for s in scores])
    axes.set(xscale="log", yscale="log", xlabel="median time of a plan [ms], all variants", xlim=times)
    axes.legend(fontsize=7.5)


def _decades(values: Sequence[float]) -> tuple[float, float]:
    """Whole powers of ten around the values."""
    logs = np.log10([value for value in values if value > 0.0])
    return 10.0 ** float(np.floor(logs.min())), 10.0 ** float(np.ceil(logs.max()))
