"""Two free bodies that fly towards each other: the scene of the tests and the benchmark of collisions."""

from __future__ import annotations

import numpy as np

from sim.mechanism.body import Body
from sim.mechanism.collision import Collision
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.polytope import Polytope
from sim.mechanism.shapes import Box, Capsule, Cylinder, Ellipsoid, Shape, Sphere
from sim.simulator.simulator import Simulator

SHAPES: dict[str, Shape] = {
    "sphere": Sphere(0.2),
    "capsule": Capsule(0.15, 0.4),
    "box": Box(0.4, 0.3, 0.5),
}
ROCK = Polytope.about_centroid(
    [[0.3, 0, 0], [-0.2, 0.2, -0.1], [-0.2, -0.25, -0.1], [0, 0.05, 0.3], [0.1, 0.2, 0.1], [0.05, -0.2, -0.2]]
)
ALL: dict[str, Shape | Polytope] = {
    **SHAPES,
    "cylinder": Cylinder(0.2, 0.4),
    "wheel": Cylinder(0.3, 0.2),
    "polytope": ROCK,
    "ellipsoid": Ellipsoid(0.3, 0.2, 0.15),
}


def two(a: Shape | Polytope, b: Shape | Polytope, friction: float = 0.5, law: str = "nonlinear") -> Mechanism:
    """Two free bodies without gravity."""
    bodies = [Body("a", 1.0, (0.02, 0.03, 0.04), shape=a), Body("b", 2.0, (0.05, 0.06, 0.07), shape=b)]
    joints = [Joint("floating", None, "a"), Joint("floating", None, "b")]
    return Mechanism(bodies, joints, collisions=[Collision("a", "b", friction=friction, law=law)], gravity=(0, 0, 0))


def approaching(sim: Simulator, seed: int, distance: float) -> np.ndarray:
    """Random poses about this distance apart, moving towards one another and spinning."""
    rng = np.random.default_rng(seed)
    n = rng.normal(size=3)
    n /= np.linalg.norm(n)
    turns = [q / np.linalg.norm(q) for q in rng.normal(size=(2, 4))]
    v = rng.normal(size=12)
    v[:3] -= 2.0 * n
    v[6:9] += 2.0 * n
    return np.concatenate([distance * n, turns[0], np.zeros(3), turns[1], v])
