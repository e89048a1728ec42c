"""Collision: two bodies, or a body and an obstacle, that cannot enter each other; and its numbers for the kernels."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sim import checks
from sim.collision import kinds
from sim.model import Law, Model
from sim.pairs.touch import Touch, couples
from sim.parts import LAWS, WORLD
from sim.shapes import Solid

if TYPE_CHECKING:
    from sim.mechanism import Mechanism


@dataclass(frozen=True)
class Collision:
    """Bodies a and b keep apart: their shapes touch, and rub, but do not overlap.

    shape_a, shape_b   Sphere, Capsule, Box, Cylinder, Polytope, HalfSpace; left out, that of the body. With String on
                       both sides the bodies are tied together instead: their points keep within its length, and
                       there is no friction; taut, it moves as a rod does (sim/pairs/string.py), and jerked taut it
                       takes the energy of the jerk. A HalfSpace on a body moves with it.
    b                  the world when left out; shape_b is then placed in world axes: an obstacle, a step, a slope
    friction, law, restitution     as in Contact

    A motion may start with shapes that overlap: its first step moves them apart, at a speed of their overlap over the
    time step, and adds the energy that this takes.
    """

    a: str
    b: str | None = None
    shape_a: Solid | None = None
    shape_b: Solid | None = None
    friction: float = 0.5
    law: str = "nonlinear"
    name: str = ""  # default: a-b
    restitution: float = 0.0

    def __post_init__(self) -> None:
        checks.name("Collision(a=...)", self.a)
        object.__setattr__(self, "b", checks.name("Collision(b=...)", self.b or WORLD))
        object.__setattr__(self, "name", checks.name("Collision(name=...)", self.name or f"{self.a}-{self.b}"))
        call = f"Collision({self.name!r}"
        if self.a == self.b:
            raise ValueError(f"{call}): a body cannot collide with itself")
        for body, field in ((self.a, "shape_a"), (self.b, "shape_b")):
            if body == WORLD and getattr(self, field) is None:
                raise ValueError(f"{call}): give {field}=..., the shape of the obstacle")
        if self.a == WORLD:  # the obstacle is b
            for one, other in (("a", "b"), ("shape_a", "shape_b")):
                first, second = getattr(self, one), getattr(self, other)
                object.__setattr__(self, one, second)
                object.__setattr__(self, other, first)
        for field in ("shape_a", "shape_b"):
            shape = getattr(self, field)
            if shape is not None and not isinstance(shape, Solid):
                raise ValueError(f"{call}, {field}=...): expected a shape, got {shape!r}")
        friction = checks.number(f"{call}, friction=...)", self.friction, at_least=0.0)
        object.__setattr__(self, "friction", friction)
        checks.one_of(f"{call}, law=...)", self.law, LAWS)
        object.__setattr__(self, "restitution", checks.share(f"{call}, restitution=...)", self.restitution))


def pack_collisions(mech: Mechanism, model: Model) -> None:
    """The numbers of the pairs, and of the couplings that they make."""
    found = mech.touches
    bodies = couples(found)
    ground = len(mech.contacts)
    for j, touch in enumerate(found):
        c = ground + j
        model.contact_body[c] = touch.bodies[0]
        model.contact_law[c] = Law[touch.law.upper()] if touch.friction > 0.0 else Law.IMPACT
        model.contact_friction[c] = touch.friction
        model.contact_restitution[c] = touch.restitution
        model.pair_coupling[j] = bodies.index(touch.bodies)
        model.pair_kind[j], model.pair_feature[j] = touch.kind, touch.feature
        model.pair_sizes[j] = touch.sizes
        model.pair_place[2 * j : 2 * j + 2] = touch.places
    _pack_far(found, model)
    _pack_hulls(found, model)
    for k, (a, b) in enumerate(bodies):
        model.coupling_body[k] = a, b
        model.coupling_row[k + 1] = model.coupling_row[k] + 6


def _pack_far(found: Sequence[Touch], model: Model) -> None:
    """pair_far and body_reach."""
    firsts = [j for j, touch in enumerate(found) if touch.feature == 0]
    if not firsts:
        return
    degree = Counter(i for j in firsts for i in found[j].bodies)
    for j, end in zip(firsts, [*firsts[1:], len(found)], strict=True):
        touch = found[j]
        arms, mobility, turning = [0.0, 0.0], 0.0, 0.0
        for side, i in enumerate(touch.bodies):
            if i < 0:
                continue
            arm = float(np.linalg.norm(touch.places[side, :3])) + touch.radii[side]
            least = float(np.linalg.eigvalsh(model.body_inertia[i].reshape(3, 3))[0])
            free = model.body_mass[i] > 0.0 and arm < np.inf
            arms[side] = arm
            mobility += 1.0 / model.body_mass[i] + arm**2 / least if free else np.inf
            turning += arm / least if free else np.inf
            model.body_reach[i] = max(model.body_reach[i], arm)
        most = max(degree[i] for i in touch.bodies if i >= 0)
        model.pair_far[j] = sum(touch.radii), *arms, mobility, turning, most, end - j


def _pack_hulls(found: Sequence[Touch], model: Model) -> None:
    """hull, and where in it the polytopes of every point are."""
    end, rows = 0, [0, 0]
    for j, touch in enumerate(found):
        for k, table in enumerate(touch.hulls):
            rows[k] = end
            model.hull[end : end + len(table)] = table
            end += len(table)
        if touch.kind % kinds.SWAPPED == kinds.Pair.POLYTOPE_POLYTOPE:
            model.pair_sizes[j, [0, 4]] = rows
        elif touch.kind % kinds.SWAPPED == kinds.Pair.POLYTOPE_CYLINDER:
            model.pair_sizes[j, 0] = rows[0]
