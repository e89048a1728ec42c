"""The table and the figure of (A, B) of one step: error and cost of every way to compute it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from dojo_opt.report.gradients import one_step
from dojo_opt.report.gradients.one_step import KAPPAS, TIGHTLY, JacobianPoint
from dojo_opt.report.result import Cell, Table

_LEAST = 1e-14  # errors below are drawn here: a logarithm has no zero
_SMALL: dict[str, Any] = {"textcoords": "offset points", "fontsize": 7, "color": "0.3"}


def step_table(scene: str, points: Sequence[JacobianPoint], bias: Sequence[float]) -> Table:
    """One line per way to get (A, B); differences at their best step size, and at 1e-6."""
    rows: list[list[Cell]] = []
    smoothed = dict(zip(KAPPAS, bias, strict=False))
    for p in points:
        if p.eps is None:
            of = smoothed.get(p.kappa or 0.0) if p.method == TIGHTLY else None
            name = f"{p.method}, kappa {p.kappa:g}" if p.kappa else p.method
            rows.append([name, p.microseconds, p.error, None, of])
    for method in dict.fromkeys(p.method for p in points if p.eps is not None):
        own = [p for p in points if p.method == method]
        best = min(own, key=lambda p: p.error if p.error == p.error else float("inf"))
        usual = next(p for p in own if p.eps == 1e-6)
        name = f"{method}, kappa {best.kappa:g}" if best.kappa else method
        rows.append([name, best.microseconds, usual.error, f"{best.error:.2g} ({best.eps:g})", None])
    note = "us: the step and its Jacobian. Errors are relative (Frobenius norm); the reference is good to "
    note += f"{max(p.doubt for p in points):.0e}. Steps are solved to 1e-8, "
    note += "those of differences of ours to 1e-13. "
    if any("Drake" in p.method for p in points):
        note += "Drake: in its own coordinates, called from Python. "
    note += f"Bias: from (A, B) at kappa {1e-2 * KAPPAS[-1]:g}, by our own step."
    header = ("", "us", "error", "best, at a step size of", "bias")
    return Table(f"(A, B) of one step: {scene}", header, rows, note)


def step_figure(measured: Mapping[str, Any]) -> Any:
    """A matplotlib Figure of one panel."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 5.5), layout="constrained")
    draw_steps(figure.subplots(), measured)
    return figure


def draw_steps(axes: Any, measured: Mapping[str, Any]) -> None:
    """Error against cost, of the last scene."""
    scene, points = list(measured)[-1], list(measured.values())[-1]["points"]
    looks = {
        one_step.FORWARD: ("C0", "v", "our step, one-sided differences"),
        one_step.CENTERED: ("C0", "s", "our step, centred differences"),
    }
    others = dict.fromkeys(p.method for p in points if p.kappa is None and p.eps is not None)
    looks |= {method: ("0.45", marker, method) for method, marker in zip(others, "vsP", strict=False)}
    for method, (color, marker, label) in looks.items():
        own = [p for p in points if p.method == method]
        if own:
            x, y = [p.microseconds for p in own], [max(p.error, _LEAST) for p in own]
            axes.plot(x, y, marker, color=color, label=label, alpha=0.75)
            best = min(own, key=lambda p: p.error)
            axes.annotate(f"eps {best.eps:.0e}", (best.microseconds, best.error), (4, -10), **_SMALL)
    for p, marker in zip((p for p in points if p.kappa is None and p.eps is None), "^DP", strict=False):
        axes.plot(p.microseconds, max(p.error, _LEAST), marker, color="C2", label=p.method)
    for method, face, label in ((one_step.IMPLICIT, "C3", "1e-8"), (one_step.TIGHTLY, "none", "1e-13")):
        own = [p for p in points if p.method == method]
        x, y = [p.microseconds for p in own], [max(p.error, _LEAST) for p in own]
        label = f"our step, implicit function theorem, solved to {label}"
        axes.plot(x, y, "o", color="C3", markerfacecolor=face, label=label)
        for p in own if face == "none" else []:
            axes.annotate(f"$\\kappa$ {p.kappa:.0e}", (p.microseconds, p.error), (6, -3), **_SMALL)
    axes.set(xscale="log", yscale="log", xlabel="step and Jacobian [us]", ylabel="relative error of (A, B)")
    axes.set_title(f"One step: {scene}, step sizes 1e-2 to 1e-9")
    axes.legend(fontsize=8, loc="upper left")
