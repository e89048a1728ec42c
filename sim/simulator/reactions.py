"""Reactions: the wrenches that joints transmit over a step, recovered after the elimination of the joints.

A step leaves in `data.subtree` the momentum balance of the bodies behind each joint, without the forces of joints:

    sum over the bodies behind it of (p_out - p_in - impulses of gravity, contacts, loops, inputs) = h wrench of a joint

so the wrench of a joint of the tree is read from there, and that of a closing joint from its multipliers. Along the
directions S in which the joint is free it is the sum of springs, dampers, limits and inputs, less the force on the
armature; that part, as the smallest wrench at the joint point with these components, is the active one

    W_active = S (S^T S)^-1 S^T W

and the rest the constraint's, which does no work.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from sim.mechanism import checks
from sim.mechanism.joint import WORLD, Joint
from sim.mechanism.loop_joints import is_weld
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import rotation_matrix
from sim.mechanism.short_repr import short_repr
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import StepReport
from sim.simulator.engines.engine import DividedStep, Engine
from sim.simulator.results import Result
from solvers.status import MESSAGES, Status
from solvers.types import Floats

FRAMES = ("world", "joint", "body")


@dataclass(frozen=True)
class Reactions(Result):
    """Wrenches of the joints on their children, means over a step; the opposite wrenches act on the parents.

    Torques are about the joint point of the child where the step begins, whose place in the world is `point`. Axes are
    those of the world, of the joint frame in the parent, or of the child where the step begins, as `frame` says. Joints
    of the tree come first, then those that close loops. Some of the redundant constraints carry no load.

    Attributes:
        names: names of the n joints.
        frame: "world", "joint" or "body".
        point: (..., n, 3) joint points in the world [m].
        force: (..., n, 3) whole force on the child [N].
        torque: (..., n, 3) whole torque on the child [N m].
        constraint_force: (..., n, 3) part of the force that the constraint gives [N].
        constraint_torque: (..., n, 3) part of the torque that the constraint gives [N m].
        status: Status of the first unsolved step, whose rows are NaN.
        detail: sentence about an unsolved step, with its numbers.
    """

    names: tuple[str, ...]
    frame: str
    point: Floats
    force: Floats
    torque: Floats
    constraint_force: Floats
    constraint_torque: Floats
    status: Status
    detail: str = ""

    __repr__ = short_repr

    @property
    def active_force(self) -> Floats:
        """(..., n, 3) force of springs, dampers, limits and inputs of the joint, less that on its armature [N]."""
        return np.asarray(self.force - self.constraint_force)

    @property
    def active_torque(self) -> Floats:
        """(..., n, 3) torque of these [N m]."""
        return np.asarray(self.torque - self.constraint_torque)

    def __getitem__(self, joint: str) -> Reactions:
        """Reactions of one joint, (..., 3)."""
        k = self.names.index(checks.one_of("Reactions[...]: joint", joint, self.names))
        parts = (self.point, self.force, self.torque, self.constraint_force, self.constraint_torque)
        point, force, torque, held_force, held_torque = (part[..., k, :] for part in parts)
        return replace(
            self,
            names=(joint,),
            point=point,
            force=force,
            torque=torque,
            constraint_force=held_force,
            constraint_torque=held_torque,
        )


class _Row(NamedTuple):
    """One joint in one step."""

    point: Floats  # (3,)
    wrench: Floats  # (2, 3) force, and torque about the point, world axes
    constraint: Floats  # (2, 3) likewise
    axes: Floats  # (3, 3) of the requested frame, as columns


def reactions(
    mech: Mechanism,
    engine: Engine,
    steps: tuple[Floats, Floats, Floats | None],
    lead: tuple[int, ...],
    frame: str,
    explain: Callable[[str, Floats, Floats], str],
) -> Reactions:
    """The reactions of steps (states, inputs, external wrenches), each in rows; see `Simulator.reactions`.

    lead: leading axes of the result. explain: the sentence about an unsolved step, of (call, report, state).
    """
    call = "Simulator.reactions"
    checks.one_of(f"{call}(frame=...)", frame, FRAMES)
    if engine.settings.order != 2:
        s = engine.settings
        raise ValueError(f"{call}: expected a simulator of order 2, got {s.kind}; use {s.way_to_order_two}")
    states, us, wrenches = steps
    loops = [(m, loop) for m, loop in enumerate(mech.loops) if not is_weld(loop)]
    names = (*mech.joint_names, *(loop.name for _, loop in loops))
    out = np.full((5, len(states), len(names), 3), np.nan)
    status, detail = Status.SOLVED, ""
    for k, (state, control) in enumerate(zip(states, us, strict=True)):
        rolled = engine.roll(state, control[None], None if wrenches is None else wrenches[k : k + 1])
        if rolled.solved_steps == 0:
            if status == Status.SOLVED:
                report = rolled.reports[0]
                status, detail = Status(int(report[StepReport.STATUS])), explain(call, report, state)
            continue
        if rolled.parts[0] == 1:
            out[:, k] = _rows(mech, engine, loops, frame)
        else:
            external = engine.external(wrenches)[k : k + 1]
            divided = engine.divide(state, control, external)
            out[:, k] = np.nan if divided is None else _mean_rows(mech, divided, (control, external), loops, frame)
        if status == Status.SOLVED and not np.isfinite(out[:, k]).all():
            status, detail = Status.NOT_FINITE, f"{call}: {MESSAGES[Status.NOT_FINITE]}"
    point, force, torque, held_force, held_torque = out.reshape(5, *lead, len(names), 3)
    return Reactions(names, frame, point, force, torque, held_force, held_torque, status, detail)


def _rows(mech: Mechanism, engine: Engine, loops: list[tuple[int, Joint]], frame: str) -> Floats:
    """(5, n, 3) of all joints in the last step of the engine."""
    data, h = engine.last(), engine.settings.time_step
    rows = [_tree_joint(joint, i, engine.model, data, h, frame) for i, joint in enumerate(mech.joints)]
    rows += [_loop_joint(mech, loop, m, engine.model, data, h, frame) for m, loop in loops]
    out = np.zeros((5, len(rows), 3))
    for n, row in enumerate(rows):
        out[:, n] = row.point, *(row.wrench @ row.axes), *(row.constraint @ row.axes)
    return out


def _mean_rows(
    mech: Mechanism, divided: DividedStep, given: tuple[Floats, Floats], loops: list[tuple[int, Joint]], frame: str
) -> Floats:
    """As `_rows` of a divided step: points where it begins, means of the wrenches of its parts."""
    control, external = given
    parts = []
    for x in divided.rolled.xs[:-1]:
        divided.engine.roll(x, control[None], external)
        parts.append(_rows(mech, divided.engine, loops, frame))
    out = np.mean(parts, axis=0)
    out[0] = parts[0][0]
    return np.asarray(out)


def _tree_joint(joint: Joint, i: int, model: Model, data: Data, h: float, frame: str) -> _Row:
    """The wrench on everything behind joint i."""
    rotation = data.rot2[i].reshape(3, 3)
    point = data.pos2[i] + rotation @ np.asarray(joint.child_point)
    wrench = _at(point - data.origin, data.subtree[i] / h)
    S = np.array([_twist_at(point - data.origin, s) for s in data.S2[model.body_vadr[i] : model.body_vadr[i + 1]]])
    active = np.zeros(6)
    if len(S):
        S = S.reshape(-1, 6).T
        active = S @ np.linalg.lstsq(S, wrench.ravel(), rcond=None)[0]
    p = int(model.body_parent[i])
    return _Row(point, wrench, wrench - active.reshape(2, 3), _axes(joint, rotation, p, data, frame))


def _loop_joint(mech: Mechanism, loop: Joint, m: int, model: Model, data: Data, h: float, frame: str) -> _Row:
    """The wrench that closing joint m has on its child: nothing but the constraint's."""
    k = len(model.coupling_body) - len(mech.loops) + m
    a, b = (int(x) for x in model.coupling_body[k])
    rotation = data.rot2[a].reshape(3, 3)
    point = data.pos2[a] + rotation @ np.asarray(loop.child_point)
    rows = slice(model.coupling_row[k], model.coupling_row[k + 1])
    wrench = _at(point - data.origin, data.carry.couple_force[rows] @ data.couple_B[rows] / h)
    return _Row(point, wrench, wrench, _axes(loop, rotation, b, data, frame))


def _axes(joint: Joint, child: Floats, parent: int, data: Data, frame: str) -> Floats:
    """Rotation from the requested frame to the world."""
    if frame == "world":
        return np.eye(3)
    if frame == "body":
        return child
    above = np.eye(3) if joint.parent == WORLD else data.rot2[parent].reshape(3, 3)
    return np.asarray(above @ rotation_matrix(joint.orientation))


def _at(r: Floats, wrench: Floats) -> Floats:
    """(2, 3): a wrench about O as force and torque about the point at r from O."""
    return np.array([wrench[:3], wrench[3:] - np.cross(r, wrench[:3])])


def _twist_at(r: Floats, twist: Floats) -> Floats:
    """(6,): a twist about O as velocity of the point at r from O, and rotation."""
    return np.concatenate([twist[:3] + np.cross(twist[3:], r), twist[3:]])
