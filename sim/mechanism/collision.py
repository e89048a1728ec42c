"""Collision: two bodies, or a body and an obstacle, that cannot enter each other."""

from __future__ import annotations

from dataclasses import dataclass

from sim.mechanism import checks
from sim.mechanism.parts import LAWS, WORLD
from sim.mechanism.shapes import Solid


@dataclass(frozen=True)
class Collision:
    """Bodies a and b keep apart: their shapes touch, and rub, but do not overlap.

    shape_a, shape_b   Sphere, Capsule, Box, Cylinder, Ellipsoid, Polytope, HalfSpace; by default that of the body.
                       With String on both sides the bodies are tied together instead: their points keep within its
                       length, and there is no friction; taut, it moves as a rod does (string.py), and jerked taut it
                       takes the energy of the jerk. A HalfSpace on a body moves with it.
    b                  the world by default; shape_b is then placed in world axes: an obstacle, a step, a slope
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
