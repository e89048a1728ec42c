"""Axes: the finish that all plots share, and the units on their labels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
from typing import TYPE_CHECKING, Any

from dojo_opt.viewer.motion import Motion, motion
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DECADES = 300.0  # ratio of the ends of an axis
_FEW, _MANY = 5, 14  # entries of a legend that fit into the axes, and beside them
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


def finish(ax: Axes, ylabel: str, xlabel: str) -> Axes:
    """Labels, grid, and a legend as long as it can be read: beside the axes when it would hide the curves."""
    ax.set_xlabel(xlabel)
    ax.set_ylabel(ylabel)
    ax.grid(alpha=0.3)
    entries = len(ax.get_legend_handles_labels()[1])
    if 0 < entries <= _FEW:
        ax.legend(fontsize="small", framealpha=0.6)
    elif _FEW < entries <= _MANY:
        ax.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, borderaxespad=0.2)
    legend = ax.get_legend()
    for label in legend.get_texts() if legend else ():
        label.set_parse_math(False)  # names of a user, in which a dollar sign is not a formula
    return ax


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
