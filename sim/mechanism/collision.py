"""Collision: two bodies, or a body and an obstacle, that cannot enter each other."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import KW_ONLY, dataclass, replace
from itertools import product
from typing import Any

from sim.mechanism import checks
from sim.mechanism.body import Body
from sim.mechanism.contact import LAWS
from sim.mechanism.joint import WORLD
from sim.mechanism.positional import few_positional
from sim.mechanism.shapes import SURFACE_FIELDS, Solid, String


@few_positional
@dataclass(frozen=True)
class Collision:
    """A collision of bodies a and b: their shapes touch with friction, and do not overlap.

    With a String on both sides, a string connects the bodies instead: the distance of its ends is at most its length,
    and there is no friction. A taut string moves like a rod (taut_string.py); a string that is jerked taut
    dissipates the energy of the jerk.

    A mechanism makes one collision for each shape of a body that has several, called "name.shape" by the name or the
    number of the shape.

    A motion may start with shapes that overlap: the first step moves them apart, at a speed of their overlap over the
    time step, and adds the energy of this motion.

    Attributes:
        a: name of the first body.
        b: name of the second body (default None: the world, whose shape is an obstacle, a step or a slope).
        shape_a: Sphere, Capsule, Box, Cylinder, Ellipsoid, Polytope, SignedDistance or HalfSpace; a HalfSpace
            moves with its body (default None: the shape of the body).
        shape_b: likewise of b; of the world, it is placed in world axes (default None: the shape of the body).
        friction: coefficient of friction (default None: the larger one of the two shapes, 0.5 where they have none).
        law: contact law, see `dojo.Contact` (default "nonlinear").
        name: name of the collision (default "a-b").
        restitution: share of the normal velocity that an impact gives back, 0 to 1 (default None: the larger one of the
            two shapes, 0 where they have none).
        torsional_friction: largest moment about the normal, over the normal force [m] (default None: the larger one of
            the two shapes, 0 where they have none).
        rolling_friction: largest moment across the normal, against rolling, over the normal force [m] (default None:
            likewise).
        reach: gap beyond which the shapes do not act on one another [m]; below half of it, the contact law is
            unchanged. Shapes farther apart than twice the reach cost next to nothing, and their contacts have an
            infinite gap in results (default None: an impulse kappa/gap at every distance).

    Raises:
        ValueError: for one body on both sides, an obstacle without a shape, or a value out of range.
    """

    a: str
    b: str | None = None
    shape_a: Solid | None = None
    shape_b: Solid | None = None
    _: KW_ONLY
    friction: float | None = None
    law: str = "nonlinear"
    name: str = ""  # default: a-b
    restitution: float | None = None
    torsional_friction: float | None = None  # [m]
    rolling_friction: float | None = None  # [m]
    reach: float | None = None

    def __post_init__(self) -> None:
        checks.name("Collision(a=...)", self.a)
        object.__setattr__(self, "b", checks.name_or("Collision(b=...)", self.b, WORLD))
        object.__setattr__(self, "name", checks.name_or("Collision(name=...)", self.name, f"{self.a}-{self.b}"))
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
        for field in ("friction", "torsional_friction", "rolling_friction"):
            value = getattr(self, field)
            if value is not None:
                object.__setattr__(self, field, checks.number(f"{call}, {field}=...)", value, at_least=0.0))
        checks.one_of(f"{call}, law=...)", self.law, LAWS)
        if self.restitution is not None:
            object.__setattr__(self, "restitution", checks.fraction(f"{call}, restitution=...)", self.restitution))
        if self.reach is not None:
            object.__setattr__(self, "reach", checks.number(f"{call}, reach=...)", self.reach, above=0.0))
            if isinstance(self.shape_a, String) or isinstance(self.shape_b, String):
                raise ValueError(f"{call}, reach=...): a string acts at its length, and has no reach")


def shape_by_shape(collisions: Iterable[Collision], bodies: Mapping[str, Body]) -> tuple[Collision, ...]:
    """One collision per pair of shapes, with the friction and restitution of its shapes where it has none.

    The only shape of a body stays that of the body; a body without a shape is refused where contact points are made.
    """
    return tuple(one for collision in collisions for one in _single(collision, bodies))


def _single(collision: Collision, bodies: Mapping[str, Body]) -> list[Collision]:
    sides: list[list[Solid | None]] = [
        [shape] if shape is not None or name not in bodies else list(bodies[name].shapes) or [None]
        for name, shape in ((collision.a, collision.shape_a), (collision.b or WORLD, collision.shape_b))
    ]
    several = [len(side) > 1 for side in sides]
    out = []
    for (i, a), (j, b) in product(enumerate(sides[0]), enumerate(sides[1])):
        labels = [
            shape.name or str(k) for k, shape, many in zip((i, j), (a, b), several, strict=True) if many and shape
        ]
        given: dict[str, Any] = {}
        if labels:
            given["name"] = f"{collision.name}.{'-'.join(labels)}"
        given |= {field: s for field, s, many in zip(("shape_a", "shape_b"), (a, b), several, strict=True) if many}
        for field in SURFACE_FIELDS:
            if getattr(collision, field) is None:
                own = (getattr(shape, field) for shape in (a, b) if shape is not None)
                given[field] = max(
                    (value for value in own if value is not None), default=0.5 if field == "friction" else 0.0
                )
        out.append(replace(collision, **given) if given else collision)
    return out
