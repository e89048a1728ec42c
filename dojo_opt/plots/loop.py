"""Figures of closed loops: what happened, how long the ticks took, how many runs survived.

As in `dojo_opt.plots`: matplotlib is imported when a figure is made, and nothing is shown.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dojo_opt.mpc.tick import Tick, milliseconds
from dojo_opt.plant.loop import ClosedLoop
from dojo_opt.plant.study import Study
from dojo_opt.plots.axes import finish

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["base_path", "closed_loop", "study", "survival", "tick_times", "tracking"]


def _axes(ax: Axes | None) -> Axes:
    if ax is not None:
        return ax
    from matplotlib.figure import Figure

    return Figure(figsize=(6, 4), layout="constrained").subplots()


def closed_loop(result: ClosedLoop) -> Figure:
    """Four panels of a closed loop: height and reference, distance from the reference, path of the base, tick times."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 7), layout="constrained")
    axes = np.ravel(figure.subplots(2, 2))
    coordinate(result, 2, axes[0], "height of the base [m]")
    tracking(result, axes[1])
    base_path(result, axes[2])
    tick_times(result.log, ax=axes[3])
    figure.suptitle(result.message)
    return figure


def coordinate(result: ClosedLoop, index: int, ax: Axes | None = None, label: str = "") -> Axes:
    """One coordinate of the state over time, and its reference, dashed."""
    ax = _axes(ax)
    ax.plot(result.time, result.x[:, index], label="plant")
    if result.reference is not None:
        ax.plot(result.time, np.asarray(result.reference(result.time))[:, index], "--", color="0.4", label="reference")
    _mark(result.log, ax)
    return finish(ax, label or f"coordinate {index}", "time [s]")


def tracking(result: ClosedLoop, ax: Axes | None = None) -> Axes:
    """Distance from the reference over time, along each axis."""
    ax = _axes(ax)
    error = result.error()
    for k, name in enumerate("xyz"[: min(3, error.shape[1])]):
        ax.plot(result.time, error[:, k], label=name)
    _mark(result.log, ax)
    return finish(ax, "off the reference [m]", "time [s]")


def base_path(result: ClosedLoop, ax: Axes | None = None) -> Axes:
    """Path of the base seen from above, and that of the reference, dashed."""
    ax = _axes(ax)
    ax.plot(result.x[:, 0], result.x[:, 1], label="plant")
    ax.plot(result.x[-1, 0], result.x[-1, 1], "o", color="C0")
    if result.reference is not None:
        rows = np.asarray(result.reference(result.time))
        ax.plot(rows[:, 0], rows[:, 1], "--", color="0.4", label="reference")
    ax.set_aspect("equal", adjustable="datalim")
    return finish(ax, "y [m]", "x [m]")


def tick_times(log: Sequence[Tick], period: float | None = None, ax: Axes | None = None) -> Axes:
    """Time of every tick but the first, with median and 99 %; period [s]: also the time that there was."""
    ax = _axes(ax)
    ticks = [tick for tick in log if not tick.first]
    ms = milliseconds(log)
    ax.plot([tick.time for tick in ticks], ms, ".", markersize=3, label="tick")
    fallen_back = [tick for tick in ticks if tick.fallback]
    if fallen_back:
        ax.plot([t.time for t in fallen_back], [t.milliseconds for t in fallen_back], "rx", label="fell back")
    if ms.size:
        ax.axhline(float(np.median(ms)), color="C1", label=f"median {np.median(ms):.2f} ms")
        ax.axhline(float(np.percentile(ms, 99)), color="C1", ls="--", label=f"99 %: {np.percentile(ms, 99):.2f} ms")
    if period is not None:
        ax.axhline(1e3 * period, color="0.4", label=f"period {1e3 * period:g} ms")
    ax.set_yscale("log")
    return finish(ax, "tick [ms]", "time [s]")


def study(result: Study) -> Figure:
    """Two panels of a Monte Carlo study: survival, and the times of all its ticks."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    survival({"all runs": result}, left)
    ms = np.sort(result.milliseconds)
    right.plot(ms, np.arange(1, ms.size + 1) / max(1, ms.size))
    right.axhline(0.99, color="0.4", ls="--", label="99 %")
    right.set_xscale("log")
    finish(right, "share of ticks", "tick [ms]")
    return figure


def survival(studies: dict[str, Study], ax: Axes | None = None) -> Axes:
    """Share of the runs that still stand over time, one line per study, with Wilson's 95 % interval at the end."""
    ax = _axes(ax)
    for name, result in studies.items():
        n = len(result.outcomes)
        falls = np.sort([o.duration for o in result.outcomes if not o.survived])
        times = np.concatenate([[0.0], falls, [result.duration]])
        share = np.concatenate([[1.0], 1.0 - np.arange(1, falls.size + 1) / n, [result.survived / n]])
        (line,) = ax.step(times, share, where="post", label=f"{name}: {result.survived} of {n}")
        lo, hi = result.interval
        ax.errorbar(
            [result.duration],
            [share[-1]],
            yerr=[[max(0.0, share[-1] - lo)], [max(0.0, hi - share[-1])]],
            capsize=4,
            color=line.get_color(),
        )
    ax.set_ylim(-0.05, 1.05)
    return finish(ax, "share that stands", "time [s]")


def _mark(log: Sequence[Tick], ax: Axes) -> None:
    """A grey line where a tick fell back."""
    for tick in log:
        if tick.fallback:
            ax.axvline(tick.time, color="0.85", linewidth=1, zorder=0)
