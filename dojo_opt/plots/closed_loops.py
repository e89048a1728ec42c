"""Figures of closed loops: the motion, the times of the ticks, the runs that survived.

As in `dojo_opt.plots`: matplotlib is imported when a figure is made, and nothing is shown.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dojo_opt.plant.closed_loop import ClosedLoop
from dojo_opt.plant.fall import stands_free
from dojo_opt.plant.monte_carlo import MonteCarlo
from dojo_opt.plant.tick import Tick, milliseconds
from dojo_opt.plots.axes import finish, plain_ticks, units
from dojo_opt.plots.trajectory import controls, state, velocities
from dojo_opt.viewer.motion import motion
from sim.mechanism import checks
from solvers.types import Matrix

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


__all__ = ["base_height", "base_path", "closed_loop", "study", "survival", "tick_times", "tracking"]


def _expect(call: str, result: Any, kind: type) -> None:
    """Refuse results of another kind."""
    if not isinstance(result, kind):
        raise TypeError(f"plots.{call}: expected a {kind.__name__}, got {checks.shown(result)}")


def _axes(ax: Axes | None) -> Axes:
    if ax is not None:
        return ax
    from matplotlib.figure import Figure

    return Figure(figsize=(6, 4), layout="constrained").subplots()


def closed_loop(result: ClosedLoop) -> Figure:
    """Four panels of a closed loop: height and reference, distance from the reference, path of the base, tick times.

    For a robot without a base that can fall, such as an arm or a pendulum, coordinates and inputs replace height and
    path. Inputs also replace the distance without a reference, and the tick times without a log.

    Args:
        result: the closed loop.

    Returns:
        A new figure.

    Raises:
        TypeError: `result` is no closed loop.
    """
    from matplotlib.figure import Figure

    _expect("closed_loop(result)", result, ClosedLoop)
    figure = Figure(figsize=(10, 7), layout="constrained")
    axes = np.ravel(figure.subplots(2, 2))
    m = motion(result)
    free = stands_free(result.simulator.mechanism)
    if free:
        base_height(result, axes[0])
        base_path(result, axes[2])
    else:
        state(m, axes[0])
        controls(m, axes[2])
    spare = controls if free else velocities
    if result.reference is not None:
        tracking(result, axes[1])
    else:
        spare(m, axes[1])
    if len(result.log) > 1:
        tick_times(result.log, ax=axes[3])
    else:
        spare(m, axes[3])
    figure.suptitle(result.message)
    return figure


def _path(result: ClosedLoop, xs: Matrix) -> Matrix:
    """(n, 3) positions of the first body in the states xs [m]."""
    return np.asarray(result.simulator.maximal(xs)[:, 0, :3])


def base_height(result: ClosedLoop, ax: Axes | None = None) -> Axes:
    """Height of the first body over time; that of the reference is dashed.

    Args:
        result: the closed loop.
        ax: axes to draw on (default None: those of a new figure).

    Returns:
        The axes.
    """
    _expect("base_height(result)", result, ClosedLoop)
    ax = _axes(ax)
    ax.plot(result.time, _path(result, result.x)[:, 2], label="plant")
    if result.reference is not None:
        rows = _path(result, np.asarray(result.reference(result.time)))
        ax.plot(result.time, rows[:, 2], "--", color="0.4", label="reference")
    _mark(result.log, ax)
    return finish(ax, "height of the base [m]", "time [s]")


def tracking(result: ClosedLoop, ax: Axes | None = None) -> Axes:
    """Distance from the reference over time: lengths of a base that can fall, else all coordinates.

    Args:
        result: the closed loop, with a reference.
        ax: axes to draw on (default None: those of a new figure).

    Returns:
        The axes.

    Raises:
        ValueError: the closed loop has no reference.
    """
    _expect("tracking(result)", result, ClosedLoop)
    ax = _axes(ax)
    mechanism = result.simulator.mechanism
    count = mechanism.joints[0].ntrans if stands_free(mechanism) else mechanism.nv
    for name, error in list(zip(mechanism.dof_names, result.error().T, strict=True))[:count]:
        ax.plot(result.time, error, label=name)
    _mark(result.log, ax)
    return finish(ax, f"error {units(mechanism, 'm', 'rad', range(count))}", "time [s]")


def base_path(result: ClosedLoop, ax: Axes | None = None) -> Axes:
    """Path of the first body from above, or from the side if it stays in a plane; that of the reference is dashed.

    Args:
        result: the closed loop.
        ax: axes to draw on (default None: those of a new figure).

    Returns:
        The axes.
    """
    _expect("base_path(result)", result, ClosedLoop)
    ax = _axes(ax)
    path = _path(result, result.x)
    planar = result.simulator.mechanism.joints[0].kind == "planar_axis"
    across = 2 if planar else 1
    along = int(planar and np.ptp(path[:, 1]) > np.ptp(path[:, 0]))
    ax.plot(path[:, along], path[:, across], label="plant")
    ax.plot(path[-1, along], path[-1, across], "o", color="C0")
    if result.reference is not None:
        rows = _path(result, np.asarray(result.reference(result.time)))
        ax.plot(rows[:, along], rows[:, across], "--", color="0.4", label="reference")
    ax.set_aspect("equal", adjustable="datalim")
    return finish(ax, f"{'xyz'[across]} [m]", f"{'xyz'[along]} [m]")


def tick_times(log: Sequence[Tick], period: float | None = None, ax: Axes | None = None) -> Axes:
    """Time of every tick but the first, with median and 99 %.

    Args:
        log: the ticks, as `MPC.log` or `ClosedLoop.log`.
        period: time between two ticks [s], drawn as a line (default None: no line).
        ax: axes to draw on (default None: those of a new figure).

    Returns:
        The axes.
    """
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
    plain_ticks(ax)
    return finish(ax, "tick [ms]", "time [s]")


def study(result: MonteCarlo) -> Figure:
    """Two panels of a Monte Carlo study: survival, and the times of all its ticks.

    Args:
        result: the study, from `dojo.monte_carlo`.

    Returns:
        A new figure.
    """
    _expect("study(result)", result, MonteCarlo)
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    survival({"all runs": result}, left)
    ms = np.sort(result.milliseconds)
    right.plot(ms, np.arange(1, ms.size + 1) / max(1, ms.size))
    right.axhline(0.99, color="0.4", ls="--", label="99 %")
    right.set_xscale("log")
    plain_ticks(right)
    finish(right, "share of ticks", "tick [ms]")
    return figure


def survival(studies: dict[str, MonteCarlo], ax: Axes | None = None) -> Axes:
    """Share of the runs that still stand over time, one line per study, with Wilson's 95 % interval at the end.

    Args:
        studies: the studies by the names that the legend shows.
        ax: axes to draw on (default None: those of a new figure).

    Returns:
        The axes.
    """
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
