"""Branches: the joints of a robot leg by leg, with their limits and the times at which the leg stands."""

from __future__ import annotations

from os.path import commonprefix
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from dojo_opt.plots.axes import shade
from dojo_opt.viewer.motion import Motion
from sim.mechanism.mechanism import Mechanism
from solvers.types import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SPLIT = 9  # more joints are split where their tree forks
_LOADED = 0.02  # of the largest force: a contact that presses harder is on the ground


class Branch(NamedTuple):
    """A leg, an arm, or all that hangs on one child of the base."""

    name: str
    dofs: tuple[int, ...]  # degrees of freedom
    labels: tuple[str, ...]  # of these, without the name of the branch
    inputs: tuple[int, ...]
    contacts: tuple[int, ...]  # with the ground


def branches(mech: Mechanism) -> list[Branch]:
    """The branches on the base; of a robot without a floating base, all of it is one."""
    children: dict[str, list[str]] = {}
    for joint in mech.joints:
        children.setdefault(joint.parent or "", []).append(joint.child)
    free = mech.joints[0].nv >= 3 and mech.nbody > 1
    root = mech.joints[0].child
    home: dict[str, str] = {}  # first body of the branch, by body
    for body in children.get(root, []) if free else [root]:
        _settle(body, children, {joint.child: joint.nv for joint in mech.joints}, home)
    out = []
    for first in dict.fromkeys(home.values()):
        joints = [joint for joint in mech.joints if home.get(joint.child) == first]
        dofs = [dof for joint in joints for dof in range(*mech.v_slice(joint.name).indices(mech.nv))]
        names = [mech.dof_names[dof] for dof in dofs]
        own = {joint.name for joint in joints}
        inputs = [k for k, part in enumerate(mech.inputs or ()) if part.joint in own]
        contacts = [k for k, contact in enumerate(mech.contacts) if home.get(contact.body) == first]
        shared = commonprefix(names) if len(names) > 1 else ""
        cut = max((shared.rfind(sign) for sign in "_ -."), default=-1) + 1
        name = shared[:cut].rstrip("_ -.") or first
        labels = tuple(text[cut:].removesuffix("_joint") for text in names)
        out.append(Branch(name, tuple(dofs), labels, tuple(inputs), tuple(contacts)))
    return out


def _settle(first: str, children: dict[str, list[str]], dofs: dict[str, int], home: dict[str, str]) -> None:
    """`home` of the bodies from `first` on: one branch, or, of many joints, one up to the fork and one per prong."""
    chain, below = [first], [first]
    while len(children.get(chain[-1], [])) == 1:
        chain.append(children[chain[-1]][0])
    for body in below:
        below += children.get(body, [])
    prongs = children.get(chain[-1], [])
    whole = sum(dofs[body] for body in below) <= _SPLIT or not prongs
    for body in below if whole else chain:
        home[body] = first
    for body in () if whole else prongs:
        _settle(body, children, dofs, home)


def stands(m: Motion, branch: Branch) -> list[tuple[float, float]]:
    """Spans of time in which a contact of the branch presses on the ground [s]."""
    if not branch.contacts or not len(m.normal_force):
        return []
    loaded = (m.normal_force[:, branch.contacts] > _LOADED * m.normal_force.max(initial=1e-12)).any(axis=1)
    edges = np.concatenate([[0.0], m.contact_time])
    changes = np.flatnonzero(np.diff(np.concatenate([[0], loaded.astype(int), [0]])))
    return [(float(edges[a]), float(edges[b])) for a, b in zip(changes[::2], changes[1::2], strict=True)]


def joint_panel(m: Motion, branch: Branch, values: list[Floats], ax: Axes) -> Axes:
    """Coordinates of the joints of a branch; its stances are shaded, limits nearby are dashed."""
    for dof, label in zip(branch.dofs, branch.labels, strict=True):
        ax.plot(m.time, values[dof], label=label)
    limits = dof_limits(m.mechanism)
    shade(ax, stands(m, branch))
    draw_limits(ax, [limits[dof] for dof in branch.dofs])
    ax.set_title(branch.name, fontsize="medium", parse_math=False)
    ax.grid(alpha=0.3)
    return ax


def input_panel(m: Motion, branch: Branch, ax: Axes) -> Axes:
    """Inputs of a branch; its stances are shaded, limits nearby are dashed."""
    low, high = m.mechanism.input_limits
    labels = dict(zip((m.mechanism.dof_names[d] for d in branch.dofs), branch.labels, strict=True))
    for k in branch.inputs:
        name = m.mechanism.input_names[k]
        ax.stairs(m.u[:, k], m.time, baseline=None, label=labels.get(name, name))
    shade(ax, stands(m, branch))
    draw_limits(ax, [(low[k], high[k]) for k in branch.inputs])
    ax.set_xlabel("time [s]")
    ax.grid(alpha=0.3)
    return ax


def dof_limits(mech: Mechanism) -> list[tuple[float, float]]:
    """(lower, upper) of every degree of freedom, infinite where there is none."""
    out: list[tuple[float, float]] = [(-np.inf, np.inf)] * mech.nv
    for joint in mech.joints:
        at = mech.v_slice(joint.name)
        if joint.limits:
            out[at] = [(float(low), float(high)) for low, high in joint.limits]
    return out


def draw_limits(ax: Axes, limits: Any) -> str:
    """Dashed lines at the limits, a pair per curve, that are no further from the curves than half their range.

    They have the colours of their curves; a limit of several curves is grey.

    Args:
        ax: the axes.
        limits: (lower, upper) of each curve.

    Returns:
        A line that says so, for the label of the axis; empty without such limits.
    """
    low, high = ax.get_ylim()
    room = 0.5 * (high - low)
    colors: dict[float, str] = {}
    for k, pair in enumerate(limits):
        for bound in {round(float(b), 9) for b in pair if np.isfinite(b)}:
            colors[bound] = "0.3" if bound in colors else f"C{k % 10}"
    near = {bound: color for bound, color in colors.items() if low - room <= bound <= high + room}
    for bound, color in near.items():
        ax.axhline(bound, color=color, linewidth=1, linestyle=(0, (4, 3)), zorder=1)
    gray = ", grey of several" if "0.3" in near.values() else ""
    return f"\n(dashed: limits{gray})" if near else ""
