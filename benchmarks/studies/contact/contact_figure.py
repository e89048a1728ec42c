"""The figure of the contact study."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from dojo_opt.plots.axes import finish
from dojo_opt.report.palette import is_ours, palette


def picture(results: dict[str, dict[str, Any]], curve: dict[str, list[float]], step: str) -> Figure:
    """Creep against kappa; creep, lift-off and penetration of every engine; rate independence."""
    figure = Figure(figsize=(13, 9.5), layout="constrained")
    axes = figure.subplots(2, 2)
    _creep(axes[0, 0], curve)
    _bars(axes[0, 1], results, step)
    _lines(axes[1, 0], results, "rates", "rate [Hz]", "trunk height, distance from 2 kHz [m]")
    _lines(axes[1, 1], results, "toss", "time step [s]", "tossed cube, distance from a fine step [m]")
    axes[0, 0].set_title("dojo-opt: creep and run time against kappa, h = 10 ms")
    axes[0, 1].set_title(f"all engines at h = {1e3 * float(step):g} ms")
    axes[1, 0].set_title("a dropped quadruped: rate independence")
    axes[1, 1].set_title("a tossed cube: self-consistency")
    handles, labels = axes[1, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, fontsize="small")
    return figure


def _creep(ax: Any, curve: dict[str, list[float]]) -> None:
    ax.loglog(curve["kappa"], curve["drift"], "o-", color="C0")
    ax.set_ylabel("drift in 10 s on the slope [m]", color="C0")
    ax.set_xlabel("kappa [N s m]")
    ax.grid(alpha=0.3)
    time = ax.twinx()
    time.semilogx(curve["kappa"], curve["us_per_step"], "s--", color="C1")
    time.set_ylabel("sliding block [us per step]", color="C1")
    time.set_ylim(0.0, 1.5 * max(curve["us_per_step"]))


def _bars(ax: Any, results: dict[str, dict[str, Any]], step: str) -> None:
    """One group per engine; draw values that are not positive at the foot of the axis, and omit failures."""
    foot = 1e-13
    names = list(results)
    columns = [
        ("drift on the slope", lambda r: r["creep"]["drift"]),
        ("lift-off while sliding", lambda r: r["sliding"]["lift"]),
        ("penetration at 100 m/s", lambda r: r["ball 100 m/s"]["depth"]),
    ]
    for k, (label, value) in enumerate(columns):
        heights = np.array([value(results[name][step]) for name in names])
        ax.barh(np.arange(len(names)) + 0.27 * (k - 1), np.maximum(heights, foot), 0.25, label=label)
    ax.set_yticks(range(len(names)), names, fontsize="small")
    ax.invert_yaxis()
    ax.set_xscale("log")
    ax.set_xlim(left=foot)
    finish(ax, "", "[m]")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=3, fontsize="small")


def _lines(ax: Any, results: dict[str, dict[str, Any]], key: str, xlabel: str, ylabel: str) -> None:
    colors = palette(results)
    for name, found in results.items():
        x = [float(value) for value in found[key]]
        style = {"marker": "o", "lw": 2.0} if is_ours(name) else {"marker": "x", "lw": 1.0, "ls": "--"}
        ax.loglog(x, list(found[key].values()), label=name, ms=4, color=colors[name], **style)
    ax.set_xticks(x, [f"{value:g}" for value in x])
    ax.minorticks_off()
    ax.set_xlabel(xlabel)
    ax.set_ylabel(ylabel)
    ax.grid(alpha=0.3)
