"""General mechanisms and states: skewed axes, offsets everywhere, every joint kind."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.mechanism.body import Body
from sim.mechanism.contact import Contact
from sim.mechanism.joint import KINDS, Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Sphere

Floats = NDArray[np.float64]
BALL = Sphere(0.1)
INF = float("inf")


def unit_quaternion(rng: np.random.Generator) -> Floats:
    """A random rotation."""
    q = rng.normal(size=4)
    return np.asarray(q / np.linalg.norm(q))


def random_body(rng: np.random.Generator, name: str) -> Body:
    """A body of about a kilogram with an inertia that is not diagonal."""
    a, b, c = rng.uniform(0.5, 1.0, 3)
    R, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return Body(name, rng.uniform(0.5, 2.0), 0.1 * R @ np.diag([b + c, a + c, a + b]) @ R.T)


def random_joint(rng: np.random.Generator, kind: str, parent: str | None, child: str) -> Joint:
    """A joint with random offsets, axis, spring and damper."""
    k = rng.uniform(1.0, 5.0)
    return Joint(
        kind,
        parent,
        child,
        parent_point=rng.normal(size=3),
        child_point=rng.normal(size=3),
        axis=rng.normal(size=3),
        orientation=unit_quaternion(rng),
        spring=k if kind != "floating" else 0.0,
        damper=rng.uniform(0.0, 0.5),
        rest=0.2 * rng.normal(size=sum(KINDS[kind])),
        pitch=-0.9 if kind == "screw" else 0.0,
    )


def chain_with(kind: str, on_world: bool, seed: int = 0) -> Mechanism:
    """A joint of one kind, between the world and a body or two bodies, with a branch behind it."""
    rng = np.random.default_rng(seed)
    names = ["a", "b", "c", "d"]
    kinds = [kind, "revolute", "spherical", "prismatic"] if on_world else ["floating", kind, "revolute", "spherical"]
    parents = [None, "a", "a", "c"] if on_world else [None, "a", "b", "a"]
    return Mechanism(
        [random_body(rng, n) for n in names],
        [random_joint(rng, k, p, n) for k, p, n in zip(kinds, parents, names, strict=True)],
        [Contact("d", 0.1 * rng.normal(size=3), radius=0.05)],
        name=f"{kind} on {'world' if on_world else 'body'}",
    )


CASES = [(kind, on_world) for kind in KINDS for on_world in (True, False)]


def random_state(rng: np.random.Generator, mech: Mechanism, speed: float = 1.0) -> tuple[Floats, Floats]:
    """(q, v): angles below half a turn, random quaternions, velocities of the given size."""
    q = rng.uniform(-1.5, 1.5, mech.nq)
    for joint in mech.joints:
        if joint.nrot == 3:
            stop = mech.q_slice(joint.name).stop
            q[stop - 4 : stop] = unit_quaternion(rng)
    return q, speed * rng.normal(size=mech.nv)


def two(**changes: object) -> Mechanism:
    """A floating body with a hinged one, and the errors that the test wants."""
    parts: dict[str, object] = {
        "bodies": [Body("torso", shape=BALL), Body("leg", shape=BALL)],
        "joints": [Joint("floating", None, "torso"), Joint("revolute", "torso", "leg", name="hip")],
        "name": "robot",
    }
    return Mechanism(**{**parts, **changes})  # type: ignore[arg-type]


def hip(**changes: object) -> Joint:
    return Joint("revolute", "torso", "leg", name="hip", **changes)  # type: ignore[arg-type]
