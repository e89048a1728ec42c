"""Bodies on top of one another."""

from __future__ import annotations

from sim.mechanism.body import Body
from sim.mechanism.collision import Collision
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import HalfSpace, Shape

EDGE = 0.2  # [m] height of every body


def tower(shape: Shape, masses: list[float], kind: str = "floating") -> Mechanism:
    """Bodies on top of one another, the lowest on the ground, in neutral 0.1 mm apart; on rails when `prismatic`."""
    names = [f"body{k}" for k in range(len(masses))]
    heights = [EDGE * (0.5 + k) + 1e-4 * (k + 1) for k in range(len(masses))]
    neutral = {n: [0, 0, z, 1, 0, 0, 0] if kind == "floating" else [z] for n, z in zip(names, heights, strict=True)}
    bodies = [Body(name, mass, shape=shape) for name, mass in zip(names, masses, strict=True)]
    collisions = [Collision(a, b) for a, b in zip(names[1:], names[:-1], strict=True)]
    collisions.append(Collision(names[0], shape_b=HalfSpace()))
    joints = [Joint(kind, None, name) for name in names]
    return Mechanism(bodies, joints, collisions=collisions, neutral=neutral, name="tower")
