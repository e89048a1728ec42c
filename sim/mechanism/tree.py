"""The tree of bodies and joints, parents before children, and the joints that close loops in it: sorted, validated."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from heapq import heappop, heappush

import numpy as np

from sim.mechanism import checks
from sim.mechanism.body import Body
from sim.mechanism.joint import WORLD, Joint
from sim.mechanism.shapes import rotation_matrix

_ALONG = 1e-9  # sine of the angle, and distance [m], below which two axes are one


def check_loops(
    call: str, loops: Sequence[Joint], bodies: Sequence[Body], joints: Sequence[Joint]
) -> tuple[Joint, ...]:
    """The joints that close a loop; their bodies and names are checked."""
    names = dict.fromkeys(b.name for b in bodies)
    ends = {WORLD: None, **names}
    for j in loops:
        checks.one_of(f"{call}: parent of joint {j.name!r}", j.parent, ends)
        checks.one_of(f"{call}: child of joint {j.name!r}", j.child, names)
        if j.nv == 6:
            raise ValueError(f"{call}: joint {j.name!r} closes a loop, but constrains nothing")
        if j.parent == j.child:
            raise ValueError(f"{call}: joint {j.name!r} closes a loop from {j.child!r} to itself")
    checks.distinct(f"{call}: joints", (j.name for j in (*joints, *loops)))
    return tuple(loops)


def sort_tree(call: str, bodies: Sequence[Body], joints: Sequence[Joint]) -> tuple[tuple[Body, ...], tuple[Joint, ...]]:
    """Joints with parents before children, otherwise in the given order; bodies in the order of their joints."""
    if not bodies:
        raise ValueError(f"{call}: expected at least one body")
    checks.distinct(f"{call}: bodies", (b.name for b in bodies))
    checks.distinct(f"{call}: joints", (j.name for j in joints))
    by_name = {b.name: b for b in bodies}
    if WORLD in by_name:
        raise ValueError(f"{call}: a body cannot be named {WORLD!r}")
    hangs_on: dict[str, str] = {}
    parents = dict.fromkeys([WORLD, *by_name])
    for j in joints:
        checks.one_of(f"{call}: parent of joint {j.name!r}", j.parent, parents)
        checks.one_of(f"{call}: child of joint {j.name!r}", j.child, by_name)
        if j.child in hangs_on:
            raise ValueError(
                f"{call}: body {j.child!r} is the child of two joints, {hangs_on[j.child]!r} and {j.name!r}; "
                "a joint that closes a loop needs close=True"
            )
        hangs_on[j.child] = j.name
    for name in by_name:
        if name not in hangs_on:
            raise ValueError(f"{call}: body {name!r} has no joint; a free body needs Joint('floating', None, {name!r})")
    below: dict[str | None, list[int]] = {}
    for k, j in enumerate(joints):
        below.setdefault(j.parent, []).append(k)
    # the first that can be placed, one at a time, so that the given order survives wherever it is a tree order
    order, ready = [], below.get(WORLD, [])
    while ready:
        order.append(joints[heappop(ready)])
        for k in below.get(order[-1].child, ()):
            heappush(ready, k)
    if len(order) < len(joints):
        placed = {j.child for j in order}
        cycle = ", ".join(repr(j.name) for j in joints if j.child not in placed)
        raise ValueError(f"{call}: joints in a cycle: {cycle}")
    return tuple(by_name[j.child] for j in order), tuple(order)


def check_masses(call: str, bodies: Sequence[Body], joints: Sequence[Joint]) -> None:
    """Refuse a body without mass that carries none either and can move: nothing would hold its joint."""
    carries = {b.name: b.mass > 0.0 for b in bodies}
    for body, joint in zip(reversed(bodies), reversed(joints), strict=True):
        if joint.parent in carries:
            carries[joint.parent] |= carries[body.name]
        if not carries[body.name]:
            raise ValueError(f"{call}: body {body.name!r} has no mass, and neither has any body that hangs on it")


def check_axes(call: str, bodies: Sequence[Body], joints: Sequence[Joint]) -> None:
    """Refuse two hinges about one axis, or two slides along one direction, with nothing but a massless body between
    them: only the sum of their coordinates moves anything. Springs, dampers and armature tell them apart.
    """
    above = {j.child: j for j in joints}
    below = Counter(j.parent for j in joints)
    massless = {b.name for b in bodies if not b.mass > 0.0}
    for joint in joints:
        before = above[joint.parent] if joint.parent in massless and below[joint.parent] == 1 else joint
        if before is joint or joint.nv != 1 or (before.kind, before.lead) != (joint.kind, joint.lead):
            continue
        if any(np.any(getattr(j, held)) for j in (before, joint) for held in ("spring", "damper", "armature")):
            continue
        axis = rotation_matrix(joint.orientation) @ np.asarray(joint.axis, float)
        apart = np.asarray(joint.parent_point, float) - np.asarray(before.child_point, float)
        along = (axis, apart) if joint.nrot == 1 else (axis,)
        if max(np.linalg.norm(np.cross(np.asarray(before.axis, float), d)) for d in along) < _ALONG:
            raise ValueError(
                f"{call}: joints {before.name!r} and {joint.name!r} move along one axis, and body {joint.parent!r} "
                "between them has no mass: only the sum of their coordinates is determined"
            )
