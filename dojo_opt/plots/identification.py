"""Figure of a fit: measured and predicted motion, residuals, correlations, and the iterations.

As in `dojo_opt.plots`: matplotlib is imported when a figure is made, and nothing is shown.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dojo_opt.identification.identify import Identified
from dojo_opt.identification.windows import Window
from dojo_opt.plots.axes import finish
from sim.simulator.results import Trajectory
from solvers.types import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_CURVES = 3  # coordinates that are drawn: those that move most
_NAMED = 14  # parameters whose names fit beside the correlations
_DARK = 0.6  # correlations above have a dark field
_SPAN = 5.0  # deviations that the histogram covers

__all__ = ["identification"]


def identification(found: Identified) -> Figure:
    """Four panels of a fit.

    The coordinates that move most in the window with the median error, measured and predicted; the histogram of all
    residuals over their noise, beside the normal distribution that they should have; the correlations of the
    parameters; the cost over the iterations.

    Args:
        found: the result of `dojo.identify`.

    Returns:
        A new figure.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 8), layout="constrained")
    axes = np.ravel(figure.subplots(2, 2))
    predictions = found.predictions()
    if predictions:
        _motion(found, predictions, axes[0])
        _histogram(found, [residuals for *_, residuals in predictions], axes[1])
    _correlations(found, axes[2])
    _iterations(found, axes[3])
    return figure


def _motion(found: Identified, predictions: list[tuple[Window, Trajectory, Floats]], ax: Axes) -> None:
    """Measured and predicted coordinates of the window with the median error, from their first values."""
    window, path, _ = sorted(predictions, key=lambda each: float(np.mean(each[2] ** 2)))[len(predictions) // 2]
    sim, measured = found.simulator, window.x
    moves = sim.difference(measured, measured[0])[:, : sim.nv]
    predicted = sim.difference(path.x, measured[0])[:, : sim.nv]
    seen = np.isfinite(found.noise[: sim.nv])
    order = np.argsort(-np.ptp(moves, axis=0) * seen)[: min(_CURVES, int(seen.sum()))]
    names = sim.mechanism.dof_names
    time = sim.time_step * np.arange(len(measured))
    for number, i in enumerate(order):
        ax.plot(time, moves[:, i], ".", ms=4, color=f"C{number}", label=f"{names[i]}, measured")
        ax.plot(time[: len(predicted)], predicted[:, i], color=f"C{number}", label=f"{names[i]}, predicted")
    finish(ax, "change [m, rad]", "time in the window of median error [s]")


def _histogram(found: Identified, residuals: list[Floats], ax: Axes) -> None:
    """Residuals over their noise."""
    values = np.concatenate([r[:, np.isfinite(found.noise)].ravel() for r in residuals])
    edges = np.linspace(-_SPAN, _SPAN, 61)
    ax.hist(np.clip(values, -_SPAN, _SPAN), edges.tolist(), density=True, alpha=0.5, label="residuals")
    normal = np.exp(-0.5 * edges**2) / np.sqrt(2.0 * np.pi)
    ax.plot(edges, normal, color="black", label="normal distribution")
    finish(ax, "density", f"residual over its noise, at most {_SPAN:g}")


def _correlations(found: Identified, ax: Axes) -> None:
    """Correlations of the parameters."""
    image = ax.imshow(found.correlation, vmin=-1.0, vmax=1.0, cmap="RdBu_r", aspect="auto")
    ax.figure.colorbar(image, ax=ax, label="correlation of the estimates", pad=0.02)
    n = len(found.labels)
    if n <= _NAMED:
        for i, j in np.ndindex(n, n):
            value = float(found.correlation[i, j])
            color = "white" if abs(value) > _DARK else "black"
            ax.text(j, i, f"{value:.2f}", ha="center", va="center", fontsize=7, color=color)
        ax.set_xticks(range(n), found.labels, rotation=60, ha="right", fontsize=7)
        ax.set_yticks(range(n), found.labels, fontsize=7)
    else:
        ax.set_xlabel("number of the parameter")


def _iterations(found: Identified, ax: Axes) -> None:
    """The cost over the iterations, by smoothing."""
    from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter

    for kappa in dict.fromkeys(record["kappa"] for record in found.history):
        some = [record for record in found.history if record["kappa"] == kappa]
        ax.semilogy([r["iteration"] for r in some], [r["rms"] for r in some], "o-", label=f"kappa {kappa:.0e} N s m")
    if ax.lines:
        ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ax.yaxis.set_minor_formatter(NullFormatter() if _decades(found) > 1.0 else ax.yaxis.get_major_formatter())
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    finish(ax, "rms of the residuals over their noise", "iteration")


def _decades(found: Identified) -> float:
    """Decades that the cost spans."""
    values = [record["rms"] for record in found.history if record["rms"] > 0.0]
    return float(np.ptp(np.log10(values))) if values else 0.0
