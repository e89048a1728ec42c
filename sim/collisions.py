"""Collision: two bodies, or a body and an obstacle, that cannot enter each other; and its numbers for the kernels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sim import checks
from sim.collision import kinds
from sim.model import Law, Model
from sim.parts import LAWS, WORLD, share
from sim.shapes import Box, Capsule, Cylinder, HalfSpace, Solid, Sphere, String, rotation_matrix

if TYPE_CHECKING:
    from sim.mechanism import Mechanism

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Collision:
    """Bodies a and b keep apart: their shapes touch, and rub, but do not overlap.

    shape_a, shape_b   Sphere, Capsule, Box, Cylinder, or HalfSpace of b; left out, that of the body. With String on
                       both sides the bodies are tied together instead: their points keep within its length.
    b                  the world when left out; shape_b is then placed in world axes: an obstacle, a step, a slope
    friction, law, restitution     as in Contact
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
        if self.b == WORLD and self.shape_b is None:
            raise ValueError(f"{call}): give shape_b=..., the shape of the obstacle")
        for field in ("shape_a", "shape_b"):
            shape = getattr(self, field)
            if shape is not None and not isinstance(shape, Solid):
                raise ValueError(f"{call}, {field}=...): expected a shape, got {shape!r}")
        friction = checks.number(f"{call}, friction=...)", self.friction, at_least=0.0)
        object.__setattr__(self, "friction", friction)
        checks.one_of(f"{call}, law=...)", self.law, LAWS)
        object.__setattr__(self, "restitution", share(f"{call}, restitution=...)", self.restitution))


@dataclass(frozen=True)
class Touch:
    """One contact point that a collision may have, as kernels need it: a and b in the order of `collide`."""

    name: str
    bodies: tuple[int, int]  # -1 for the world
    kind: int
    feature: int
    sizes: Floats  # (8,)
    places: Floats  # (2, 12) centre and rotation of the shapes in their bodies
    friction: float
    law: str
    restitution: float


def touches(mech: Mechanism) -> list[Touch]:
    """All contact points of the collisions of a mechanism; those of the same two bodies follow one another."""
    found = [touch for collision in mech.collisions for touch in _touches(mech, collision)]
    order = list(dict.fromkeys(touch.bodies for touch in found))
    return sorted(found, key=lambda touch: order.index(touch.bodies))


def _touches(mech: Mechanism, collision: Collision) -> list[Touch]:
    call = f"Mechanism({mech.name!r}): collision {collision.name!r}"
    ends = []
    for body, given in ((collision.a, collision.shape_a), (collision.b or WORLD, collision.shape_b)):
        index = -1 if body == WORLD else mech.body_names.index(body)
        shape = given if given is not None else mech.bodies[index].shape
        if shape is None:
            raise ValueError(f"{call}: body {body!r} has no shape; give one to the body or to the collision")
        ends.append((index, shape, _CODES[type(shape)]))
    match = kinds.pair(ends[0][2], ends[1][2])
    if match is None:
        names = " and ".join(type(shape).__name__ for _, shape, _ in ends)
        raise ValueError(f"{call}: there is no collision of {names}")
    kind, swapped = match
    if swapped:
        ends.reverse()
    if ends[0][0] < 0:  # the world is b
        names = " with a fixed ".join(type(shape).__name__ for _, shape, _ in reversed(ends))
        raise ValueError(f"{call}: no collision of a {names}; give the obstacle another shape")
    sizes = np.zeros(8)
    for k, (_, shape, _) in enumerate(ends):
        values = _sizes(shape)
        sizes[4 * k : 4 * k + len(values)] = values
    places = np.array([_place(shape) for _, shape, _ in ends])
    number = kinds.count(kind)
    return [
        Touch(
            collision.name if number == 1 else f"{collision.name}_{feature}",
            (ends[0][0], ends[1][0]),
            int(kind),
            feature,
            sizes,
            places,
            collision.friction,
            collision.law,
            collision.restitution,
        )
        for feature in range(number)
    ]


_CODES = {
    Sphere: kinds.Shape.SPHERE,
    Capsule: kinds.Shape.CAPSULE,
    Box: kinds.Shape.BOX,
    Cylinder: kinds.Shape.CYLINDER,
    HalfSpace: kinds.Shape.HALFSPACE,
    String: kinds.Shape.STRING,
}


def _sizes(shape: Solid) -> tuple[float, ...]:
    """Sizes in the order of kinds.Shape."""
    if isinstance(shape, Sphere):
        return (shape.radius,)
    if isinstance(shape, Capsule | Cylinder):
        return shape.radius, 0.5 * shape.length
    if isinstance(shape, Box):
        return 0.5 * shape.x, 0.5 * shape.y, 0.5 * shape.z
    return (shape.length,) if isinstance(shape, String) else ()


def _place(shape: Solid) -> Floats:
    """Centre and rotation of a shape in its body, (12,)."""
    return np.concatenate([np.asarray(shape.center), rotation_matrix(shape.orientation).ravel()])


def couples(found: Sequence[Touch]) -> list[tuple[int, int]]:
    """The pairs of bodies, in the order of their touches."""
    return [bodies for bodies, _ in groupby(found, key=lambda touch: touch.bodies)]


def pack_collisions(mech: Mechanism, model: Model) -> None:
    """The numbers of the pairs, and of the couplings that they make."""
    found = touches(mech)
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
    for k, (a, b) in enumerate(bodies):
        model.coupling_body[k] = a, b
        model.coupling_row[k + 1] = model.coupling_row[k] + 6
