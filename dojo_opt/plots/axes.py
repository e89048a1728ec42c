"""What all plots do to their axes at the end."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def finish(ax: Axes, ylabel: str, xlabel: str) -> Axes:
    """Labels, grid, and a legend as long as it can be read."""
    ax.set_xlabel(xlabel)
    ax.set_ylabel(ylabel)
    ax.grid(alpha=0.3)
    if 0 < len(ax.get_legend_handles_labels()[1]) <= 12:
        ax.legend(fontsize="small", framealpha=0.6)
    return ax
