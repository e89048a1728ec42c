"""Contacts that no motion of the joints can move, or lift out of the ground; found before any step.

Along the normal n of its ground, the height of a contact point stays constant while the joints above it slide across
n or turn about it. The first joint that turns otherwise keeps its own height; from there on the point is within reach:
on a circle about one axis, in a ball about several.

    IDLE    the gap never changes: the impulse of the point is undetermined, and the step omits it
    SUNK    the largest gap is below zero, or of all the contacts on one hinge the least is, however it turns: no step
            has a solution
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sim.mechanism.contact import Contact
from sim.mechanism.shapes import rotation_matrix
from sim.model.model import Model
from solvers.types import Floats, Integers

IDLE, SUNK = 1, 2
_DEEP = 1e-8  # [m], the usual tolerance of a step
_STILL = 1e-12  # of a unit vector, and of the size of the mechanism
_ROUNDS = 40


class Range(NamedTuple):
    """Heights that a point can have; on a hinge in the world, middle + swing . (cos, sin) of its angle."""

    low: float
    high: float
    hinge: int = -1
    middle: float = 0.0
    swing: tuple[float, float] = (0.0, 0.0)


def immovable_contacts(model: Model, contacts: Sequence[Contact]) -> Integers:
    """(nground,) 0, IDLE or SUNK."""
    ranges = [_range_of(model, c, contact) for c, contact in enumerate(contacts)]
    out = np.zeros(len(contacts), dtype=np.int64)
    for c, found in enumerate(ranges):
        if _is_still(found):
            out[c] = IDLE
        if found.high < -_DEEP:
            out[c] = SUNK
    for hinge in {found.hinge for found in ranges} - {-1}:
        group = [c for c, found in enumerate(ranges) if found.hinge == hinge]
        lowest = _lowest(np.array([(ranges[c].middle, *ranges[c].swing) for c in group]))
        if lowest is not None and not out[group].max() == SUNK:
            out[group[lowest]] = SUNK
    return out


def _is_still(r: Range) -> bool:
    return np.isfinite(r.high) and r.high - r.low <= _STILL * max(1.0, abs(r.high))


def _range_of(model: Model, c: int, contact: Contact) -> Range:
    """Gaps that a contact can have."""
    i, p = int(model.contact_body[c]), model.contact_point[c]
    if contact.terrain is None:
        n = model.contact_frame[c, :3]
        low, high, hinge, middle, swing = _heights(model, i, n, p)
        base = contact.radius + contact.height
        return Range(low - base, high - base, hinge, middle - base, swing)
    place = [_heights(model, i, e, p) for e in np.eye(3)]
    if not all(_is_still(r) for r in place):
        return Range(-np.inf, np.inf)
    x, y, z = (r.high for r in place)
    gap = z - float(contact.terrain.surface(contact.radius).height(x, y)) - contact.height
    return Range(gap, gap)


def _heights(model: Model, body: int, n: Floats, p: Floats) -> Range:
    """n . x of the point p of a body, over all motions; world axes."""
    path = _path(model, body)
    R, o = np.eye(3), np.zeros(3)  # of the body before, where all coordinates are zero
    moved = False
    for k, i in enumerate(path):
        o = o + R @ model.joint_parent_point[i]
        R = R @ rotation_matrix(model.joint_offset[i])
        count, turns = int(model.joint_ntrans[i]), int(model.joint_nrot[i])
        axis = R @ model.joint_axis[i]
        slides = [*model.joint_trans_axes[i].reshape(3, 3)[:count] @ R.T, model.joint_lead[i] * axis]
        if np.any(np.abs(slides @ n) > _STILL):
            return Range(-np.inf, np.inf)
        if turns > 1 or (turns == 1 and np.linalg.norm(np.cross(axis, n)) > _STILL):
            return _about(model, path[k:], (n, o, R, axis), p, not moved and count == 0)
        moved = moved or count + turns > 0
        o = o - R @ model.joint_child_point[i]
    height = float(n @ (o + R @ p))
    return Range(height, height)


def _path(model: Model, body: int) -> list[int]:
    """The bodies from the world to this one."""
    path = [body]
    while model.body_parent[path[0]] >= 0:
        path.insert(0, int(model.body_parent[path[0]]))
    return path


def _about(model: Model, path: list[int], at: tuple[Floats, Floats, Floats, Floats], p: Floats, fixed: bool) -> Range:
    """Heights about the joint of path[0], which turns; fixed: nothing before it moves.

    at: n, the joint point, rotation of its frame and the axis, all in world axes.
    """
    n, o, R, axis = at
    r, Q = -model.joint_child_point[path[0]], np.eye(3)  # from the joint point, in axes of its body
    reach = 0.0
    loose = False
    for i in path[1:]:
        r = r + Q @ model.joint_parent_point[i]
        Q = Q @ rotation_matrix(model.joint_offset[i])
        if model.joint_ntrans[i] > 0 or model.joint_lead[i] != 0.0:
            return Range(-np.inf, np.inf)
        if model.joint_nrot[i] > 0:
            loose = True
            reach += float(np.linalg.norm(r))
            r, Q = np.zeros(3), np.eye(3)
        r = r - Q @ model.joint_child_point[i]
    r = r + Q @ p
    height = float(n @ o)
    if loose or model.joint_nrot[path[0]] > 1:
        reach += float(np.linalg.norm(r))
        return Range(height - reach, height + reach)
    r = R @ r
    middle = height + float(axis @ r) * float(axis @ n)
    across = np.cross(axis, r)
    swing = float(n @ (r - axis * (axis @ r))), float(n @ across)
    size = float(np.hypot(*swing))
    return Range(middle - size, middle + size, path[0] if fixed else -1, middle, swing)


def _lowest(rows: Floats) -> int | None:
    """Which of the gaps middle + a cos t + b sin t, (n, 3), is least where the least is largest; None if that is not
    below zero for certain. Intervals of t that may reach zero are halved.
    """
    half = np.pi / 64
    t = np.arange(-np.pi + half, np.pi, 2.0 * half)
    steep = float(np.hypot(rows[:, 1], rows[:, 2]).max())
    best, which = -np.inf, 0
    for _ in range(_ROUNDS):
        gaps = rows @ np.array([np.ones_like(t), np.cos(t), np.sin(t)])
        least = gaps.min(axis=0)
        k = int(least.argmax())
        if least[k] > best:
            best, which = float(least[k]), int(gaps[:, k].argmin())
        if best >= -_DEEP:
            return None
        t = t[least + steep * half >= -_DEEP]
        if not len(t):
            return which
        half *= 0.5
        t = np.concatenate([t - half, t + half])
    return None
