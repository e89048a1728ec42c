"""Joints that close a loop and do more than constrain: with springs, dampers, armature, limits or inputs; those with
two rotations, whose twist-free swing is not an equation between two poses; and screws, whose turns two poses do not
count.

Such a joint becomes one of the tree. It carries a share of the mass and inertia of its child, as a body of its own,
"child.joint", which is welded to the rest of the child. The discrete Lagrangian of a body is linear in its mass and
inertia, and the two have one pose: the motion is that of the undivided body, and whatever a joint of the tree can have
the closing joint can have too, derivatives included. Its coordinates are part of the state.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from sim.mechanism.body import Body
from sim.mechanism.joint import Joint


def carried(
    call: str, bodies: Sequence[Body], joints: Sequence[Joint], loops: Sequence[Joint], driven: Collection[str]
) -> tuple[tuple[Body, ...], tuple[Joint, ...], tuple[Joint, ...]]:
    """(bodies, joints, loops) where the closing joints that act are joints of the tree.

    driven: names of the joints with an input.   ValueError: a child without a mass to share.
    """
    acting = [j for j in loops if acts(j) or j.nrot == 2 or j.lead != 0.0 or (j.name in driven and j.nv > 0)]
    shares = {name: 1.0 / (1 + n) for name in {j.child for j in acting} if (n := sum(j.child == name for j in acting))}
    whole = {b.name: b for b in bodies}
    for j in acting:
        if j.child in whole and whole[j.child].mass == 0.0:
            raise ValueError(
                f"{call}: joint {j.name!r} closes a loop with a spring, damper, limit, input, pitch or two "
                f"rotations, for which its child {j.child!r} needs a mass; let a body with a mass be the child"
            )
    out = [_part(b, b.name, shares[b.name]) if b.name in shares else b for b in bodies]
    out += [
        replace(_part(whole[j.child], _share(j), shares[j.child]), shape=None, visuals=())
        for j in acting
        if j.child in whole
    ]
    hung = [replace(j, child=_share(j) if j.child in whole else j.child, close=False) for j in acting]
    welds = {j.name: Joint("fixed", j.child, _share(j), _share(j), close=True) for j in acting}
    return tuple(out), (*joints, *hung), tuple(welds.get(j.name, j) for j in loops)


def acts(joint: Joint) -> bool:
    """Whether the joint does more than constrain."""
    limited = any(np.isfinite(bound) for pair in joint.limits or () for bound in pair) or joint.cone is not None
    return limited or any(
        np.any(np.asarray(part)) for part in (joint.spring, joint.damper, joint.armature, joint.friction)
    )


def is_weld(loop: Joint) -> bool:
    """Whether a loop joint holds the share of a body to the rest of it."""
    return loop.kind == "fixed" and loop.name == loop.child and loop.child.startswith(f"{loop.parent}.")


def parts_of(loops: Sequence[Joint], name: str) -> tuple[str, ...]:
    """The bodies that body `name` was divided into, itself first; all have the same share of its mass and inertia."""
    return (name, *(j.child for j in loops if is_weld(j) and j.parent == name))


def _share(joint: Joint) -> str:
    """Name of the part of the child that the joint carries."""
    return f"{joint.child}.{joint.name}"


def _part(body: Body, name: str, part: float) -> Body:
    """A part of the mass and inertia of a body, at its place."""
    return replace(body, name=name, mass=part * body.mass, inertia=part * np.asarray(body.inertia))
