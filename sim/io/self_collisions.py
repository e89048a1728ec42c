"""with_self_collisions: a loaded robot whose own bodies collide."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from sim.io.loader_choices import LoaderChoices
from sim.io.urdf.report import Notes
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.self_collisions import self_collisions
from sim.mechanism.shapes import Solid

__all__ = ["with_self_collisions"]

Robot = TypeVar("Robot", bound=Mechanism)


def with_self_collisions(
    mech: Robot, choices: LoaderChoices, notes: Notes, world: Sequence[Solid] = (), *, slippery: bool = False
) -> Robot:
    """The robot whose bodies collide with one another, with a note on the pairs of shapes that do not.

    Args:
        mech: the robot.
        choices: the friction and law of the collisions; without a friction, the larger one of both shapes.
        notes: where the note goes.
        world: shapes of its parts that are fixed to the world, world axes.
        slippery: whether shapes of zero friction stay without.

    Returns:
        The robot with its collisions.
    """
    pairs, overlapping = self_collisions(mech.bodies, mech.joints, mech.loops, np.array(mech.neutral), world)
    if overlapping:
        notes.add("shapes that overlap in the neutral state, and do not collide", overlapping)
    both = replace(mech, collisions=[*mech.collisions, *(replace(pair, law=choices.law) for pair in pairs)])
    if choices.friction is None:
        return both
    names = {pair.name for pair in pairs}
    chosen = [c for c in both.collisions if c.name in names and not (slippery and c.friction == 0.0)]
    rough = {c.name: replace(c, friction=choices.friction) for c in chosen}
    return replace(both, collisions=[rough.get(c.name, c) for c in both.collisions])
