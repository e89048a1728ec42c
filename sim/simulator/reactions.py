"""Reactions: the wrenches that joints transmit over a step, which the elimination of the joints hides.

A step leaves in `work.subtree` the momentum balance of the bodies behind each joint, without the forces of joints:

    sum over the bodies behind it of (p_out - p_in - impulses of gravity, contacts, loops, inputs) = h wrench of a joint

so the wrench of a joint of the tree is read from there, and that of a closing joint from its multipliers. Along the
directions S in which the joint is free it is what springs, dampers, limits and inputs of the joint give, less what its
armature takes; that part, as the smallest wrench at the joint point with these components, is the active one

    W_active = S (S^T S)^-1 S^T W

and the rest the constraint's, which does no work.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.mechanism import checks
from sim.mechanism.brief import brief_repr
from sim.mechanism.closing import is_weld
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.parts import WORLD, Joint
from sim.mechanism.shapes import rotation_matrix
from sim.model.data import Work
from sim.model.model import Model
from sim.simulator.results import check_finite

if TYPE_CHECKING:
    from sim.simulator.simulator import Simulator

Floats = NDArray[np.float64]

FRAMES = ("world", "joint", "body")


@dataclass(frozen=True)
class Reactions:
    """Wrenches of the joints on their children, means over a step; what acts on the parents is the opposite.

    Torques are about the joint point of the child where the step begins, whose place in the world is `point`. Axes are
    those of the world, of the joint frame in the parent, or of the child where the step begins, as `frame` says.
    Joints of the tree come first, then those that close loops. Of redundant constraints some carry nothing.
    """

    names: tuple[str, ...]
    frame: str
    point: Floats  # (..., n, 3) [m]
    force: Floats  # (..., n, 3) whole force on the child [N]
    torque: Floats  # (..., n, 3) [N m]
    constraint_force: Floats  # (..., n, 3) of which the constraint gives [N]
    constraint_torque: Floats  # (..., n, 3) [N m]

    __repr__ = brief_repr

    @property
    def active_force(self) -> Floats:
        """(..., n, 3) of springs, dampers, limits and inputs of the joint, less its armature's inertia [N]."""
        return np.asarray(self.force - self.constraint_force)

    @property
    def active_torque(self) -> Floats:
        """(..., n, 3) likewise [N m]."""
        return np.asarray(self.torque - self.constraint_torque)

    def __getitem__(self, joint: str) -> Reactions:
        """Those of one joint, (..., 3)."""
        k = self.names.index(checks.one_of("Reactions[...]: joint", joint, self.names))
        parts = (self.point, self.force, self.torque, self.constraint_force, self.constraint_torque)
        return Reactions((joint,), self.frame, *(part[..., k, :] for part in parts))


class _Row(NamedTuple):
    """One joint in one step."""

    point: Floats  # (3,)
    wrench: Floats  # (2, 3) force, and torque about the point, world axes
    constraint: Floats  # (2, 3) likewise
    axes: Floats  # (3, 3) of the frame asked for, as columns


def reactions(sim: Simulator, x: ArrayLike, u: ArrayLike | None, frame: str) -> Reactions:
    """The reactions of the steps from x (..., nx) under u (..., nu), see `Simulator.reactions`."""
    call = "Simulator.reactions"
    checks.one_of(f"{call}(frame=...)", frame, FRAMES)
    if sim.order != 2:
        raise ValueError(f"{call}: steps of order 2 have them, got order {sim.order}")
    states, lead = sim._border.stacked("reactions", "x", x)
    given = np.zeros((*lead, sim.nu)) if u is None else u
    us = sim._border.inputs("reactions", "u", given, (*lead, sim.nu)).reshape(len(states), sim.nu)
    loops = [(m, loop) for m, loop in enumerate(sim.mechanism.loops) if not is_weld(loop)]
    names = (*sim.mechanism.joint_names, *(loop.name for _, loop in loops))
    out = np.zeros((5, len(states), len(names), 3))
    for k, (state, control) in enumerate(zip(states, us, strict=True)):
        knot, _, reports, _ = sim._calls.roll(state, control[None])
        if knot == 0:
            raise sim._error(call, reports[0], state)
        work, h = sim._calls.last(), sim.time_step
        rows = [_tree_joint(joint, i, sim.model, work, h, frame) for i, joint in enumerate(sim.mechanism.joints)]
        rows += [_loop_joint(sim.mechanism, loop, m, sim.model, work, h, frame) for m, loop in loops]
        for n, row in enumerate(rows):
            out[:, k, n] = row.point, *(row.wrench @ row.axes), *(row.constraint @ row.axes)
    check_finite(call, out)
    return Reactions(names, frame, *out.reshape(5, *lead, len(names), 3))


def _tree_joint(joint: Joint, i: int, model: Model, work: Work, h: float, frame: str) -> _Row:
    """The wrench on everything behind joint i."""
    rotation = work.rot2[i].reshape(3, 3)
    point = work.pos2[i] + rotation @ np.asarray(joint.child_point)
    wrench = _at(point - work.origin, work.subtree[i] / h)
    S = np.array([_twist_at(point - work.origin, s) for s in work.S2[model.body_vadr[i] : model.body_vadr[i + 1]]])
    active = np.zeros(6)
    if len(S):
        S = S.reshape(-1, 6).T
        active = S @ np.linalg.lstsq(S, wrench.ravel(), rcond=None)[0]
    p = int(model.body_parent[i])
    return _Row(point, wrench, wrench - active.reshape(2, 3), _axes(joint, rotation, p, work, frame))


def _loop_joint(mech: Mechanism, loop: Joint, m: int, model: Model, work: Work, h: float, frame: str) -> _Row:
    """The wrench that closing joint m has on its child: nothing but the constraint's."""
    k = len(model.coupling_body) - len(mech.loops) + m
    a, b = (int(x) for x in model.coupling_body[k])
    rotation = work.rot2[a].reshape(3, 3)
    point = work.pos2[a] + rotation @ np.asarray(loop.child_point)
    rows = slice(model.coupling_row[k], model.coupling_row[k + 1])
    wrench = _at(point - work.origin, work.couple_force[rows] @ work.couple_B[rows] / h)
    return _Row(point, wrench, wrench, _axes(loop, rotation, b, work, frame))


def _axes(joint: Joint, child: Floats, parent: int, work: Work, frame: str) -> Floats:
    """Rotation to the world of the frame asked for."""
    if frame == "world":
        return np.eye(3)
    if frame == "body":
        return child
    above = np.eye(3) if joint.parent == WORLD else work.rot2[parent].reshape(3, 3)
    return np.asarray(above @ rotation_matrix(joint.orientation))


def _at(r: Floats, wrench: Floats) -> Floats:
    """(2, 3): a wrench about O as force and torque about the point at r from O."""
    return np.array([wrench[:3], wrench[3:] - np.cross(r, wrench[:3])])


def _twist_at(r: Floats, twist: Floats) -> Floats:
    """(6,): a twist about O as velocity of the point at r from O, and rotation."""
    return np.concatenate([twist[:3] + np.cross(twist[3:], r), twist[3:]])
