"""Figures of walking: contact schedule, normal forces, use of friction, and paths of the feet."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dojo_opt.plots.axes import finish, panel
from dojo_opt.viewer.motion import Motion, motion
from sim.simulator.simulator import Simulator
from solvers.types import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LOADED = 0.02  # of the largest force: a foot that presses harder is on the ground


def gait(result: Any, figure: Figure | None = None, *, simulator: Simulator | None = None) -> Figure:
    """Four panels of a walking motion: gait diagram, normal forces, use of friction, paths of the feet.

    Args:
        result: Trajectory, Plan or ClosedLoop.
        figure: figure to draw on (default None: a new one).
        simulator: simulator of the result, for one that was read from a file (default None: that of the result).

    Returns:
        The figure.

    Raises:
        TypeError: the result is none of these.
        ValueError: the result does not know its simulator.
        SimulationError: a step of a plan cannot be solved again, for its forces.
    """
    if figure is None:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(11, 8), layout="constrained")
    m = motion(result, simulator)
    axes = np.ravel(figure.subplots(2, 2))
    gait_diagram(m, axes[0])
    normal_forces(m, axes[1])
    foot_paths(m, axes[2])
    friction_use(m, axes[3])
    return figure


def _feet(m: Motion) -> list[int]:
    """Numbers of the contacts at the ends of the tree."""
    inner = {joint.parent for joint in m.mechanism.joints}
    return [k for k, contact in enumerate(m.mechanism.contacts) if contact.body not in inner]


def _loaded(m: Motion) -> Any:
    """(N, ncontact) whether a contact carries anything during each simulation step."""
    return m.normal_force > _LOADED * m.normal_force.max(initial=1e-12)


def _edges(m: Motion) -> Floats:
    """Bounds of the simulation steps [s]."""
    return np.concatenate([[0.0], m.contact_time])


@panel
def gait_diagram(m: Motion, ax: Axes) -> Axes:
    """One row per foot, filled while it is on the ground."""
    feet, edges = _feet(m), _edges(m)
    loaded = _loaded(m)
    for row, k in enumerate(feet):
        changes = np.flatnonzero(np.diff(np.concatenate([[0], loaded[:, k].astype(int), [0]])))
        spans = [(edges[a], edges[b] - edges[a]) for a, b in zip(changes[::2], changes[1::2], strict=True)]
        ax.broken_barh(spans, (row - 0.35, 0.7), facecolors=f"C{row}")
    ax.set_yticks(range(len(feet)), [m.mechanism.contact_names[k] for k in feet])
    if feet and edges[-1] > 0.0:
        ax.set_xlim(0.0, float(edges[-1]))
        ax.set_ylim(len(feet) - 0.5, -0.5)
    return finish(ax, "on the ground", "time [s]")


@panel
def normal_forces(m: Motion, ax: Axes) -> Axes:
    """Mean normal force on every foot over each simulation step, in the colours of the gait diagram."""
    for row, k in enumerate(_feet(m)):
        ax.stairs(m.normal_force[:, k], _edges(m), baseline=None, color=f"C{row}", label=m.mechanism.contact_names[k])
    return finish(ax, "normal force [N]", "time [s]")


@panel
def friction_use(m: Motion, ax: Axes) -> Axes:
    """Friction force over its limit, friction coefficient times normal force, of every foot on the ground; 1 slides."""
    loaded = _loaded(m)
    for row, k in enumerate(_feet(m)):
        limit = m.mechanism.contacts[k].friction * m.normal_force[:, k]
        share = np.divide(m.friction_force[:, k], limit, out=np.full(len(limit), np.nan), where=loaded[:, k])
        ax.plot(m.contact_time, share, ".-", markersize=4, color=f"C{row}", label=m.mechanism.contact_names[k])
    ax.axhline(1.0, color="0.3", linewidth=1, linestyle="--")
    ax.set_ylim(0.0, 1.1)
    return finish(ax, "friction force / limit", "time [s]")


@panel
def foot_paths(m: Motion, ax: Axes) -> Axes:
    """Height of the underside of every foot over its path, with larger marks while the foot is on the ground."""
    loaded = _loaded(m)
    substeps = max(1, len(loaded) // max(1, len(m.u)))
    for row, k in enumerate(_feet(m)):
        contact = m.mechanism.contacts[k]
        path = m.points(m.mechanism.body_names.index(contact.body), contact.point)
        path = path - contact.radius * np.asarray(contact.normal)
        down = np.concatenate([[False], loaded[substeps - 1 :: substeps, k]])
        ax.plot(path[:, 0], path[:, 2], color=f"C{row}", linewidth=1, label=m.mechanism.contact_names[k])
        ax.plot(path[down, 0], path[down, 2], "o", color=f"C{row}", markersize=4)
    base = m.position[:, 0]
    ax.plot(base[:, 0], base[:, 2], color="0.4", label=m.mechanism.body_names[0])
    return finish(ax, "height [m]", "x [m]")
