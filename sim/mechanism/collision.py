"""Collision: two bodies, or a body and an obstacle, that cannot enter each other."""

from __future__ import annotations

from dataclasses import dataclass

from sim.mechanism import checks
from sim.mechanism.parts import LAWS, WORLD
from sim.mechanism.shapes import Solid


@dataclass(frozen=True)
class Collision:
    """Bodies a and b keep apart: their shapes touch, and rub, but do not overlap.

    With a String on both sides, the bodies are tied together instead: their points keep within its length, and there is
    no friction. A taut string moves as a rod does (string.py), and one that is jerked taut takes the energy of the
    jerk.

    A motion may start with shapes that overlap: its first step moves them apart, at a speed of their overlap over the
    time step, and adds the energy that this takes.

    Attributes:
        a: name of the first body.
        b: name of the second body (default None: the world, whose shape is an obstacle, a step or a slope).
        shape_a: Sphere, Capsule, Box, Cylinder, Ellipsoid, Polytope or HalfSpace; a HalfSpace moves with its body
            (default None: the shape of the body).
        shape_b: likewise of b; of the world, it is placed in world axes (default None: the shape of the body).
        friction: coefficient of friction (default 0.5).
        law: contact law, see `dojo.Contact` (default "nonlinear").
        name: name of the collision (default "a-b").
        restitution: share of the normal velocity that an impact gives back, 0 to 1 (default 0).

    Raises:
        ValueError: for one body on both sides, an obstacle without a shape, or a value out of range.
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
