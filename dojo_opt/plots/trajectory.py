"""Figures of a motion: state, controls, contact forces, paths."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, overload

import numpy as np

from dojo_opt.plots.axes import finish as _finish
from dojo_opt.plots.axes import input_units, label_lines, panel, units
from dojo_opt.plots.legs_over_time import Branch, branches, dof_limits, draw_limits, input_panel, joint_panel
from dojo_opt.viewer.motion import Motion, motion
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure


_MOST, _DOTS = 8, 80  # lines of a panel of contacts; points of a path that are marked
_LIGHT = 1e-4  # times the weight: a force of a contact that does not touch
_FEW_DOFS, _COLUMNS = 10, 6  # up to so many degrees of freedom share a panel; so many branches fit beside one another


@overload
def trajectory(result: Any, figure: None = None, *, simulator: Simulator | None = None) -> Figure: ...


@overload
def trajectory(result: Any, figure: SubFigure, *, simulator: Simulator | None = None) -> SubFigure: ...


def trajectory(
    result: Any, figure: Figure | SubFigure | None = None, *, simulator: Simulator | None = None
) -> Figure | SubFigure:
    """The panels of a motion: state, controls, contact forces, path of body and feet.

    A motion without contacts shows its velocities instead of their forces. A robot with legs or arms on a base shows
    the base, then joints and inputs leg by leg: grey while the leg stands, with the limits that are near.

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
    m = motion(result, simulator)
    parts = branches(m.mechanism)
    several = m.mechanism.nv > _FEW_DOFS and 1 < len(parts) <= _COLUMNS
    if figure is None:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(3.4 * max(len(parts), 4), 9.0) if several else (10, 7.5), layout="constrained")
    if several:
        _by_branches(m, parts, figure)
        return figure
    axes = np.ravel(figure.subplots(2, 2))
    state(m, axes[0])
    controls(m, axes[1])
    (contact_forces if _touches(m) else velocities)(m, axes[2])
    paths(m, axes[3])
    return figure


def _touches(m: Motion) -> bool:
    """Whether a contact is loaded: the forces kappa/(gap h) of far ones are far below the weight."""
    weight = sum(body.mass for body in m.mechanism.bodies) * float(np.linalg.norm(m.mechanism.gravity))
    return bool(m.normal_force.max(initial=0.0) > _LIGHT * weight)


def _by_branches(m: Motion, parts: list[Branch], figure: Any) -> None:
    """Base, forces and paths above; joints and inputs below, a column for each branch."""
    above, below = figure.subfigures(2, 1, height_ratios=(1.0, 1.7))
    place, attitude, forces, way = above.subplots(1, 4)
    values, base = coordinates(m), m.mechanism.joints[0]
    names = _labels(m.mechanism)
    for ax, dofs, label in (
        (place, range(base.ntrans), "base [m]"),
        (attitude, range(base.ntrans, base.nv), "base, rotation vector [rad]"),
    ):
        for dof in dofs:
            ax.plot(m.time, values[dof], label=names[dof].removeprefix(f"{base.name} "))
        _finish(ax, label, "time [s]", at_lines=True)
    (contact_forces if _touches(m) else velocities)(m, forces)
    paths(m, way)
    rows = below.subplots(2, len(parts), sharex=True, sharey="row", squeeze=False)
    for k, part in enumerate(parts):
        joint_panel(m, part, values, rows[0, k])
        input_panel(m, part, rows[1, k])
    for ax in rows.flat:  # the scales are settled now
        label_lines(ax)
    rows[0, 0].set_ylabel(f"joints {units(m.mechanism, 'm', 'rad', range(base.nv, m.mechanism.nv))}")
    rows[1, 0].set_ylabel(f"inputs {input_units(m.mechanism)}")


@panel
def state(m: Motion, ax: Axes) -> Axes:
    """Coordinates that change, over time; the orientation of a quaternion joint as its rotation vector."""
    drawn: list[int] = []
    for dof, (label, values) in enumerate(zip(_labels(m.mechanism), coordinates(m), strict=True)):
        if np.ptp(values) > 1e-4 or m.mechanism.nv == 1:
            ax.plot(m.time, values, label=label)
            drawn.append(dof)
    bounds = dof_limits(m.mechanism)
    note = draw_limits(ax, [bounds[dof] for dof in drawn])
    return _finish(ax, f"coordinates {units(m.mechanism, 'm', 'rad', drawn)}{note}", "time [s]", at_lines=True)


@panel
def velocities(m: Motion, ax: Axes) -> Axes:
    """Joint velocities over time, each the mean over the step that led to its knot."""
    for label, values in zip(_labels(m.mechanism), m.x[:, m.mechanism.nq :].T, strict=True):
        ax.plot(m.time, values, label=label)
    return _finish(ax, f"velocities {units(m.mechanism, 'm/s', 'rad/s')}", "time [s]", at_lines=True)


@panel
def controls(m: Motion, ax: Axes) -> Axes:
    """Inputs over time, each constant over its knot."""
    for k, name in enumerate(m.mechanism.input_names):
        ax.stairs(m.u[:, k], m.time, baseline=None, label=name)
    note = draw_limits(ax, np.transpose(m.mechanism.input_limits))
    return _finish(ax, f"inputs {input_units(m.mechanism)}{note}", "time [s]", at_lines=True)


@panel
def contact_forces(m: Motion, ax: Axes) -> Axes:
    """Mean normal force over each step of every loaded contact; the size of its friction force is dotted.

    More than 8 loaded contacts are added up by body, and of more than 8 bodies the most loaded 7 have a line of their
    own.
    """
    edges = np.concatenate([[0.0], m.contact_time])
    lines, many = _forces(m)
    for i, (name, normal, friction) in enumerate(lines):
        ax.stairs(normal, edges, baseline=None, label=name, color=f"C{i % 10}")
        ax.stairs(friction, edges, baseline=None, linestyle=":", color=f"C{i % 10}")
    by = "by body " if many else ""
    return _finish(ax, f"contact forces {by}[N]\n(dotted: friction)", "time [s]", at_lines=True)


def _forces(m: Motion) -> tuple[list[tuple[str, Any, Any]], bool]:
    """(name, normal force (T,), friction (T,)) of each line, and whether they are those of bodies."""
    peak = m.normal_force.max(axis=0, initial=0.0)
    loaded = np.flatnonzero(peak > 1e-3 * peak.max(initial=0.0))
    mech = m.mechanism
    if len(loaded) <= _MOST:
        return [(mech.contact_names[k], m.normal_force[:, k], m.friction_force[:, k]) for k in loaded], False
    points = [*mech.contacts, *mech.contact_candidates]
    groups: dict[str, list[int]] = {}
    for k in loaded:
        groups.setdefault(_body_of(points[k]), []).append(int(k))
    sums = [
        (name, m.normal_force[:, ks].sum(axis=1), m.friction_force[:, ks].sum(axis=1)) for name, ks in groups.items()
    ]
    sums.sort(key=lambda line: -float(line[1].max(initial=0.0)))
    if len(sums) > _MOST:
        rest = sums[_MOST - 1 :]
        others = sum(line[1] for line in rest), sum(line[2] for line in rest)
        sums = [*sums[: _MOST - 1], (f"{len(rest)} others", *others)]
    return sums, True


def _body_of(point: Any) -> str:
    """The body of a contact, or the name of a collision."""
    return str(getattr(point, "body", None) or point.collision)


@panel
def paths(m: Motion, ax: Axes) -> Axes:
    """Paths of the first body and of the feet in the vertical plane of the motion; without feet, of all bodies."""
    side = int(np.ptp(m.position[:, :, 1], axis=0).max() > np.ptp(m.position[:, :, 0], axis=0).max())
    names = m.mechanism.body_names
    feet = [c for c in m.mechanism.contacts if c.body != names[0]]
    if len(feet) > _MOST:  # the lowest point of every body at the end of the tree
        inner = {joint.parent for joint in m.mechanism.joints}
        ends = {c.body: c for c in sorted(feet, key=lambda c: -_height(m, c)) if c.body not in inner}
        feet = list(ends.values())[-_MOST:]
    drawn = [(names[0], m.position[:, 0])]
    for foot in feet:
        path = m.points(names.index(foot.body), foot.point)
        drawn.append((f"{foot.name}, underside", path - foot.radius * np.asarray(foot.normal)))
    if not feet:
        drawn += [(name, m.position[:, k]) for k, name in enumerate(names[1:], start=1)]
    for label, path in drawn:
        marker = "." if len(path) <= _DOTS else ""
        (line,) = ax.plot(path[:, side], path[:, 2], marker=marker, markersize=4, label=label)
        ax.plot(path[-1, side], path[-1, 2], marker="o", color=line.get_color())
    _ground(m, side, ax)
    ax.set_aspect("equal", adjustable="datalim")
    return _finish(ax, "height [m]", f"{'xy'[side]} [m]")


def _height(m: Motion, foot: Any) -> float:
    """Least height of a contact [m]."""
    path = m.points(m.mechanism.body_names.index(foot.body), foot.point)
    return float(path[:, 2].min()) - float(foot.radius)


def _ground(m: Motion, side: int, ax: Axes) -> None:
    """Level ground, or the profile of the terrain below the path of the first body."""
    first = next((c for c in m.mechanism.contacts if np.allclose(c.normal, (0, 0, 1))), None)
    if first is None:
        return
    if first.terrain is None:
        ax.axhline(first.height, color="0.6", linewidth=1)
        return
    path = m.position[:, 0]
    along = np.linspace(path[:, side].min() - 0.5, path[:, side].max() + 0.5, 400)
    across = np.full_like(along, np.median(path[:, 1 - side]))
    x, y = (across, along) if side else (along, across)
    ax.plot(along, first.terrain.height(x, y) + first.height, color="0.6", linewidth=1)


def coordinates(m: Motion) -> list[Any]:
    """Values over time of every degree of freedom, in the order of v."""
    rows: list[Any] = []
    for joint in m.mechanism.joints:
        q = m.x[:, m.mechanism.q_slice(joint.name)]
        rows += list((q if joint.nrot < 3 else np.hstack([q[:, :-4], _rotation_vectors(q[:, -4:])])).T)
    return rows


def _labels(mechanism: Mechanism) -> list[str]:
    """Names of the degrees of freedom, without that of the joint when there is no other."""
    names = list(mechanism.dof_names)
    return [name.split(" ", 1)[-1] for name in names] if len(mechanism.joints) == 1 else names


def _rotation_vectors(quaternions: Any) -> Any:
    """Axis times angle, (T, 3), of unit quaternions (w, x, y, z)."""
    q = quaternions * np.where(quaternions[:, :1] < 0, -1.0, 1.0)
    sine = np.linalg.norm(q[:, 1:], axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, q[:, :1])
    return q[:, 1:] * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 2.0)
