"""Random mechanisms and states for benchmarks/attacks.py: trees of any joints, with contacts, shapes and springs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

import dojo_opt as dojo
from solvers.types import Vector

Rng = np.random.Generator

KINDS = (
    "fixed", "prismatic", "planar", "fixed_orientation", "revolute", "cylindrical", "planar_axis", "free_revolute",
    "orbital", "prismatic_orbital", "planar_orbital", "free_orbital", "spherical", "cylindrical_free", "planar_free",
    "floating", "screw",
)  # fmt: skip
COMMON = ("revolute", "revolute", "revolute", "spherical", "prismatic")
SIZE = 0.3  # [m] of a body


@dataclass(frozen=True)
class Recipe:
    """Features that a random mechanism may have."""

    bodies: int = 8  # at most
    kinds: tuple[str, ...] = KINDS
    root: str = "floating"
    mass_spread: float = 1.3  # decades up and down
    passive: bool = False  # no springs, limits, restitution or collisions
    crowded: bool = False  # passive, with shapes of most bodies, and collisions
    contacts: int = 8  # at most


def unit(rng: Rng, n: int = 3) -> Vector:
    """Uniform direction in n dimensions."""
    v = rng.normal(size=n)
    return v / np.linalg.norm(v)


def cloud_inertia(rng: Rng, mass: float) -> Vector:
    """Inertia of six equal points, (3, 3): physical, of any aspect."""
    p = rng.normal(size=(6, 3)) * SIZE * 10.0 ** rng.uniform(-1.0, 0.0, size=3)
    p -= p.mean(axis=0)
    inertia = mass / 6.0 * (np.sum(p * p) * np.eye(3) - p.T @ p)
    return inertia + 1e-3 * np.linalg.eigvalsh(inertia)[-1] * np.eye(3)


def random_shape(rng: Rng) -> Any:
    """Any shape that collides."""
    r = SIZE * rng.uniform(0.1, 0.4)
    kind = rng.integers(6)
    if kind == 0:
        return dojo.Sphere(r)
    if kind == 1:
        return dojo.Capsule(r, SIZE * rng.uniform(0.2, 1.0))
    if kind == 2:
        return dojo.Box(*(SIZE * rng.uniform(0.2, 1.0, size=3)))
    if kind == 3:
        return dojo.Cylinder(r, SIZE * rng.uniform(0.2, 1.0))
    if kind == 4:
        return dojo.Ellipsoid(*(SIZE * rng.uniform(0.1, 0.5, size=3)))
    return dojo.Polytope.about_centroid(rng.normal(size=(rng.integers(5, 9), 3)) * SIZE * 0.3)


def random_joint(rng: Rng, i: int, recipe: Recipe) -> dojo.Joint:
    """Joint i, on an earlier body; the first is the root's."""
    if i == 0:
        return dojo.Joint(recipe.root, None, "b0", "j0")
    kind = str(rng.choice(recipe.kinds))
    more: dict[str, Any] = {}
    if rng.random() < 0.5:
        more["damper"] = 10.0 ** rng.uniform(-3.0, 0.0)
    if not recipe.passive and kind not in ("fixed", "floating"):
        if rng.random() < 0.4:
            more["spring"] = 10.0 ** rng.uniform(-1.0, 4.0)
        if kind in ("revolute", "prismatic") and rng.random() < 0.4:
            more["limits"] = (-(10.0 ** rng.uniform(-2.0, 0.2)), 10.0 ** rng.uniform(-2.0, 0.2))
    if kind == "screw":  # a displacement per turn of up to the size of a body, either way
        more["pitch"] = float(rng.choice([-1.0, 1.0]) * SIZE * 10.0 ** rng.uniform(-1.5, 0.0))
    points = {"parent_point": rng.normal(size=3) * SIZE / 2, "child_point": rng.normal(size=3) * SIZE / 2}
    return dojo.Joint(kind, f"b{rng.integers(i)}", f"b{i}", f"j{i}", axis=unit(rng), **points, **more)


def random_mechanism(rng: Rng, recipe: Recipe) -> dojo.Mechanism:
    """Bodies, joints, contacts with level ground, and collisions of some of the bodies."""
    count = int(rng.integers(2, recipe.bodies + 1))
    spread = rng.uniform(0.0, recipe.mass_spread)
    bodies, joints, contacts = [], [], []
    for i in range(count):
        mass = float(10.0 ** rng.uniform(-spread, spread))
        often = 0.7 if recipe.crowded else 0.0 if recipe.passive else 0.4
        shape = random_shape(rng) if often and rng.random() < often else None
        bodies.append(dojo.Body(f"b{i}", mass, cloud_inertia(rng, mass), shape=shape))
        joints.append(random_joint(rng, i, recipe))
        for _ in range(rng.integers(0, 3)):
            bounce = 0.0 if recipe.passive or rng.random() < 0.8 else rng.uniform(0.0, 1.0)
            law = "nonlinear" if rng.random() < 0.7 else str(rng.choice(["linear", "impact"]))
            point, friction = rng.normal(size=3) * SIZE / 2, rng.uniform(0.0, 1.2)
            name = f"c{len(contacts)}"
            contacts.append(dojo.Contact(f"b{i}", point, friction=friction, law=law, restitution=bounce, name=name))
    contacts = contacts[: recipe.contacts] or [dojo.Contact("b0", (0.0, 0.0, -0.1), friction=0.8, name="c0")]
    return dojo.Mechanism(bodies, joints, contacts, collisions=random_collisions(rng, bodies, joints))


def random_collisions(rng: Rng, bodies: list[dojo.Body], joints: list[dojo.Joint]) -> list[dojo.Collision]:
    """Up to three pairs of bodies with shapes that no joint connects."""
    shaped = [b.name for b in bodies if b.shape is not None]
    joined = {frozenset((j.parent, j.child)) for j in joints}
    pairs = [(a, b) for k, a in enumerate(shaped) for b in shaped[:k] if frozenset((a, b)) not in joined]
    chosen = [pairs[k] for k in rng.permutation(len(pairs))[:3]]
    return [dojo.Collision(a, b, friction=rng.uniform(0.0, 1.0), name=f"k{n}") for n, (a, b) in enumerate(chosen)]


def rotated(q: Vector, v: Vector) -> Vector:
    """R(q) v."""
    t = 2.0 * np.cross(q[1:], v)
    return v + q[0] * t + np.cross(q[1:], t)


def heights(sim: dojo.Simulator, x: Vector) -> Vector:
    """Gaps of the contacts with level ground [m], by another formula than the engine's, (ncontact,)."""
    z, mech = sim.maximal(x), sim.mechanism
    rows = [z[mech.body_names.index(c.body)] for c in mech.contacts]
    lows = [r[2] + rotated(r[6:10], np.asarray(c.point))[2] for r, c in zip(rows, mech.contacts, strict=True)]
    return np.array(lows) - [c.radius for c in mech.contacts]


def random_state(sim: dojo.Simulator, rng: Rng) -> Vector:
    """Any pose with the lowest contact up to 2 cm above the ground, or far above it; anything from rest to 20 m/s."""
    mech, x = sim.mechanism, np.array(sim.neutral())
    speed = 10.0 ** rng.uniform(-0.5, 1.3)
    for joint in mech.joints:
        part = mech.q_slice(joint.name)
        values = rng.uniform(-1.0, 1.0, part.stop - part.start)
        bounded = joint.limits and np.isfinite(joint.limits).all()
        x[part] = values * SIZE if not joint.nrot else values
        if bounded:
            x[part] = [rng.uniform(*b) for b in joint.limits]
        if joint.nrot == 3:
            x[part.stop - 4 : part.stop] = unit(rng, 4)
    x[sim.nq :] = rng.normal(size=sim.nv) * speed * (rng.random(sim.nv) < 0.7)
    x[sim.nq + 2] = -abs(x[sim.nq + 2])
    x[2] += (rng.uniform(0.0, 0.02) if rng.random() < 0.8 else rng.uniform(0.1, 1.0)) - heights(sim, x).min()
    return x
