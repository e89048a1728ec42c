"""Axes: the finish that all plots share, and the units on their labels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
from typing import TYPE_CHECKING, Any

import numpy as np

from dojo_opt.viewer.motion import Motion, motion
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DECADES = 300.0  # ratio of the ends of an axis
_FEW, _MANY = 5, 14  # entries of a legend that fit above the axes, and beside them
_LETTERS, _WIDE = 40, 24  # of a legend above the axes, and of a label at most
_END = 14  # letters at the end of a longer one
_LINE = 11.0  # [points] between two labels
_STYLES = ("-", (0, (5, 2)), (0, (1, 1.5)))
_ARGUMENTS = """
    Args:
        result: Trajectory, Plan, ClosedLoop, or the Motion of one.
        ax: axes to draw on (default None: those of a new figure).
        simulator: simulator of the result, for one that was read from a file (default None: that of the result).

    Returns:
        The axes.

    Raises:
        TypeError: the result is none of these.
        ValueError: the result does not know its simulator.
        SimulationError: a step of a plan cannot be solved again, for its forces.
    """


def panel(draw: Callable[[Motion, Axes], Axes]) -> Callable[..., Axes]:
    """Decorator of a figure of one panel: users call it with a result, on new axes unless some are given.

    The docstring gets the arguments that all panels share.
    """

    @wraps(draw, assigned=("__module__", "__name__", "__qualname__"))
    def drawn(result: Any, ax: Axes | None = None, *, simulator: Simulator | None = None) -> Axes:
        if ax is None:
            from matplotlib.figure import Figure

            ax = Figure(figsize=(6, 4), layout="constrained").subplots()
        return draw(result if isinstance(result, Motion) else motion(result, simulator), ax)

    del drawn.__wrapped__  # help() shows the arguments of the panel
    drawn.__doc__ = f"{draw.__doc__}\n{_ARGUMENTS}"
    return drawn


def finish(ax: Axes, ylabel: str, xlabel: str, *, at_lines: bool = False) -> Axes:
    """Labels, grid, and the names of the curves, which cover nothing: at the ends of the lines, above or beside."""
    ax.set_xlabel(xlabel)
    ax.set_ylabel(ylabel)
    ax.grid(alpha=0.3)
    entries = len(ax.get_legend_handles_labels()[1])
    if at_lines and entries > 1:
        label_lines(ax)
    elif 0 < entries <= _FEW and sum(map(len, ax.get_legend_handles_labels()[1])) <= _LETTERS:
        ax.legend(
            fontsize="small",
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            borderaxespad=0.2,
            frameon=False,
            ncols=entries,
            columnspacing=1.0,
            handlelength=1.2,
        )
    elif 0 < entries <= _MANY:
        ax.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, borderaxespad=0.2)
    legend = ax.get_legend()
    for label in legend.get_texts() if legend else ():
        label.set_text(_short(label.get_text()))
        label.set_parse_math(False)  # names of a user, in which a dollar sign is not a formula
    return ax


def label_lines(ax: Axes) -> None:
    """The name of every curve beside its end, in its colour, moved apart where they would touch.

    Curves beyond the tenth repeat the colours; they are dashed, then dotted.
    """
    curves: list[tuple[Any, str]] = [
        (artist, label) for artist, label in zip(*ax.get_legend_handles_labels(), strict=True)
    ]
    low, high = ax.get_ylim()
    height = max(ax.get_window_extent().height / ax.figure.dpi * 72.0, 1.0)  # points
    gap = _LINE * (high - low) / height
    ends = []
    for k, (artist, label) in enumerate(curves):
        color, style = f"C{k % 10}", _STYLES[(k // 10) % len(_STYLES)]
        data = artist.get_data()
        if not len(data.values if hasattr(data, "values") else data[1]):
            continue  # of a motion without a step
        value = float(data.values[-1] if hasattr(data, "values") else data[1][-1])
        if hasattr(data, "values"):
            artist.set_edgecolor(color)
        else:
            artist.set_color(color)
        artist.set_linestyle(style)
        rows = np.asarray(data.values if hasattr(data, "values") else data[1], dtype=np.float64)
        value = value if low <= value <= high else 0.5 * (low + high)
        ends.append((round(value / gap), float(np.nan_to_num(rows).mean()), value, label, color))
    ends.sort()  # of those that end together, by their means
    places = _apart([value for _, _, value, _, _ in ends], gap, low, high)
    for (_, _, value, label, color), place in zip(ends, places, strict=True):
        ax.annotate(
            _short(label),
            (1.0, value),
            (1.03, place),
            xycoords=ax.get_yaxis_transform(),
            textcoords=ax.get_yaxis_transform(),
            fontsize="small",
            color=color,
            va="center",
            parse_math=False,
            annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": color, "linewidth": 0.6, "shrinkA": 0.0, "shrinkB": 0.0},
        )


def _short(name: str) -> str:
    """A name that leaves room for the curves; its end, where numbers are, tells it from others."""
    return name if len(name) <= _WIDE else f"{name[: _WIDE - 3 - _END]}...{name[-_END:]}"


def _apart(values: Sequence[float], gap: float, low: float, high: float) -> list[float]:
    """Growing values moved up until they are a gap apart, then down until they end below the top."""
    out: list[float] = []
    for value in values:
        out.append(max(value, out[-1] + gap) if out else max(value, low))
    top = high
    for i in range(len(out) - 1, -1, -1):
        out[i] = min(out[i], top)
        top = out[i] - gap
    return out


def shade(ax: Axes, spans: Sequence[tuple[float, float]]) -> None:
    """Grey bands over these spans of time [s]."""
    for begin, end in spans:
        ax.axvspan(begin, end, color="0.92", linewidth=0.0, zorder=0)


def plain_ticks(ax: Axes) -> None:
    """Plain numbers at 1, 2, 5, 10, ... on logarithmic axes that span few decades; powers crowd there."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    for axis in (ax.xaxis, ax.yaxis):
        low, high = axis.get_view_interval()
        if axis.get_scale() == "log" and high < _DECADES * low:
            axis.set_major_locator(LogLocator(10.0, subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axis.set_minor_formatter(NullFormatter())


def units(mechanism: Mechanism, slide: str, turn: str, dofs: Sequence[int] | None = None) -> str:
    """Units of these degrees of freedom, all by default, as on an axis: "[m]", "[rad]" or "[m, rad]"."""
    kinds = [unit for j in mechanism.joints for unit in (slide,) * j.ntrans + (turn,) * j.nrot]
    chosen = kinds if dofs is None else [kinds[i] for i in dofs]
    return f"[{', '.join(unit for unit in (slide, turn) if unit in chosen) or slide}]"


def input_units(mechanism: Mechanism) -> str:
    """Units of the inputs: "[N]", "[N m]" or "[N, N m]"."""
    slides = {joint.name: joint.ntrans for joint in mechanism.joints}
    found = set()
    for part in mechanism.inputs or ():
        if part.joint is not None:
            found.add("N" if part.dof < slides.get(part.joint, 0) else "N m")
        else:
            found |= {unit for unit, vector in (("N", part.force), ("N m", part.torque)) if any(vector)}  # type: ignore[arg-type]
    return f"[{', '.join(sorted(found)) or 'N'}]"
