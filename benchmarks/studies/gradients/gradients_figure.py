"""The figure of the study `gradients`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.studies.gradients import touchdown
from benchmarks.studies.gradients.drake_motion import CARRIED
from benchmarks.studies.gradients.gradients_tables import worst
from benchmarks.studies.gradients.sliding import Derivative
from dojo_opt.report.gradients.step_figure import draw_steps

_TOP = 1e4  # errors beyond are drawn here
EPS_WIDE = 1e-2  # of differenced motions: an average


def draw(results: Mapping[str, Any]) -> Any:
    """Four panels: one step, whole motions, touch-down, smoothing."""
    from matplotlib.figure import Figure

    panels: dict[str, Any] = {
        "one step": draw_steps,
        "motions": _motions,
        "touch-down": _touchdown,
        "smoothing": _smoothing,
    }
    figure = Figure(figsize=(13, 10), layout="constrained")
    for axes, (name, panel) in zip(figure.subplots(2, 2).flat, panels.items(), strict=True):
        panel(axes, results[name])
        axes.grid(alpha=0.25)
    return figure


def _motions(axes: Any, found: Sequence[Derivative]) -> None:
    """Worst error of the five derivatives against the time step."""
    steps = sorted({d.time_step for d in found})
    ways = list(dict.fromkeys((d.engine, d.how, d.kappa) for d in found))
    engines = list(dict.fromkeys(d.engine for d in found if d.kappa is None))
    for engine, how, kappa in ways:
        if engine == "dojo-opt" and "differences" in how:
            continue  # lies on the chained curve
        if kappa is None and how == f"differences of {EPS_WIDE:g}":
            continue  # in the table
        if "differences" in how and (engine, CARRIED, None) in ways:
            continue  # lies on the curve of its AutoDiffXd
        own = [d for d in found if (d.engine, d.how, d.kappa) == (engine, how, kappa)]
        x = sorted({d.time_step for d in own})
        y = [min(worst([d for d in own if d.time_step == h]), _TOP) for h in x]
        look: dict[str, Any] = {"color": "C3", "linewidth": 2, "alpha": {1e-6: 0.4, 1e-8: 1.0}.get(kappa or 0.0, 0.7)}
        label = f"dojo-opt, (A, B) chained, kappa {kappa:g}" if kappa else f"{engine}: {how}"
        if kappa is None:
            color = f"C{[0, 1, 2, 4, 5, 6, 7, 8, 9][engines.index(engine) % 9]}"
            look = {"color": color, "linestyle": "-" if "differences" in how else ":"}
        axes.plot(1e3 * np.array(x), y, marker="o", markersize=3.5, label=label, **look)
    axes.plot(1e3 * np.array(steps), steps, color="0.2", linewidth=1, linestyle=(0, (1, 3)), label="h / 1 s")
    axes.set(xscale="log", yscale="log", xlabel="time step [ms]", ylabel="worst relative error of five derivatives")
    lines = -(-len(axes.get_lines()) // 2)  # of the legend, below the curves
    axes.set_ylim(10.0 ** (-3.4 - 0.5 * lines), 2 * _TOP)
    axes.set_title("Whole motions with friction: dx/dF, d(stop)/dv0")
    axes.legend(fontsize=7, ncols=2, loc="lower right")


def _touchdown(axes: Any, result: tuple[Any, list[touchdown.Curve]]) -> None:
    """Gradient against height; ours in colour, others in grey."""
    from matplotlib import colormaps

    heights, curves = result
    ours = [curve for curve in curves if curve.kappa is not None]
    colors = dict(zip((c.label for c in ours), colormaps["viridis"](np.linspace(0.85, 0.05, len(ours))), strict=True))
    grays = iter((("0.6", "-"), ("0.45", "--"), ("0.2", ":"), ("0.3", "-.")))
    h = touchdown.H
    for curve in curves:
        if curve.kappa is None:
            color, style = next(grays)
            axes.plot(1e3 * heights, h * curve.gradient, color=color, linestyle=style, label=curve.label, zorder=1)
        else:
            axes.plot(1e3 * heights, h * curve.gradient, color=colors[curve.label], linewidth=2, label=curve.label)
    axes.axvline(1e3 * touchdown.TOUCH, color="0.8", zorder=0)
    axes.set(xlabel="height before the step [mm]", ylabel="h d(velocity after the step)/d(height)", ylim=(-1.3, 0.15))
    axes.set_title(f"Touch-down of a ball at {touchdown.SPEED:g} m/s, one step of {1e3 * h:g} ms")
    cut = [f"{c.label}: {h * c.gradient.min():,.0f}" for c in curves if h * c.gradient.min() < -1.3]
    if cut:
        note = "below the frame:\n" + "\n".join(cut)
        axes.text(0.98, 0.62, note, transform=axes.transAxes, ha="right", va="top", fontsize=7.5)
    axes.legend(fontsize=7.5, loc="lower right")


def _smoothing(axes: Any, result: Mapping[str, Any]) -> None:
    """Bias against kappa, with the distance at which contact is felt on top."""
    kappas, reach = result["kappas"], result["reach"]
    for name, errors in result["bias"].items():
        if name != "touching":  # right at every kappa
            axes.plot(kappas, errors, marker=".", linestyle="--" if name == "sliding" else "-", label=name)
    axes.set(xscale="log", yscale="log", xlabel="kappa [N s m], for 1 kg and 20 ms", ylabel="error of the gradient")
    axes.set_title("Bias against hard contact, and how far contact is felt")
    scale = 1e3 * float(reach[0] / np.sqrt(kappas[0]))
    top = axes.secondary_xaxis("top", functions=(lambda k: scale * np.sqrt(np.abs(k)), lambda d: (d / scale) ** 2))
    top.set_xlabel("gap at which the gradient is 1 % of a contact's [mm]", fontsize=9)
    axes.legend(fontsize=8)
