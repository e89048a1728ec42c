"""with_self_collisions: a loaded robot whose own bodies collide."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

from sim.io.urdf.report import Notes
from sim.mechanism.mechanism import Mechanism

__all__ = ["with_self_collisions"]

Robot = TypeVar("Robot", bound=Mechanism)


def with_self_collisions(mech: Robot, notes: Notes) -> Robot:
    """The robot whose bodies collide with one another, with a note on the pairs of shapes that do not."""
    pairs, overlapping = mech.self_collisions()
    if overlapping:
        notes.add("shapes that overlap in the neutral state, and do not collide", overlapping)
    return replace(mech, collisions=[*mech.collisions, *pairs])
