"""Steps of bodies that loops, gears and collisions couple."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.mechanism.body import Body
from sim.mechanism.collision import Collision
from sim.mechanism.contact import Contact
from sim.mechanism.gear import Gear
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.polytope import Polytope
from sim.mechanism.shapes import Box, HalfSpace, Solid, Sphere, String
from sim.simulator.simulator import Simulator
from support.parameter_case import Case, turned

Floats = NDArray[np.float64]

STONE = Polytope.about_centroid(
    [(0.2, 0.1, -0.1), (-0.2, 0.15, -0.1), (-0.1, -0.2, -0.15), (0.15, -0.15, 0.0), (0.0, 0.05, 0.2), (0.1, 0.2, 0.1)]
)


def loop(kind: str, tree: str = "spherical") -> Case:
    """A floating ring of four bodies, moving."""
    bodies = [Body(f"b{k}", 1.0 + 0.3 * k, (0.02, 0.03, 0.04)) for k in range(4)]
    corners = np.array([(0.5, 0.0, 0.0), (0.0, 0.5, 0.0), (-0.5, 0.0, 0.0), (0.0, -0.5, 0.0)])
    centers = 0.5 * (corners + np.roll(corners, -1, axis=0))
    joints = [Joint("floating", None, "b0")]
    for k in range(1, 4):
        at = corners[k]
        ends = (at - centers[k - 1], at - centers[k])
        joints.append(Joint(tree if k == 1 else "spherical", f"b{k - 1}", f"b{k}", "", *ends, damper=0.1))
    ends = (corners[0] - centers[3], corners[0] - centers[0])
    pitch = 0.7 if kind == "screw" else 0.0
    joints.append(Joint(kind, "b3", "b0", "last", *ends, axis=(0.6, 0.0, 0.8), close=True, pitch=pitch))
    sim = Simulator(Mechanism(bodies, joints), time_step=0.01, tolerance=1e-12)
    x = sim.neutral()
    x[sim.nq :] = np.random.default_rng(1).normal(size=sim.nv)
    return Case(sim, sim.close(x), np.zeros(sim.nu))


def geared() -> Case:
    """A floating body with geared arms, one with a rack and a limit, that touches the ground."""
    y = (0.0, 1.0, 0.0)
    bodies = [Body(name, 1.0 + 0.5 * k, (0.02, 0.03, 0.04)) for k, name in enumerate(("base", "l", "r", "rack"))]
    joints = [
        Joint("floating", None, "base"),
        Joint("revolute", "base", "l", "", (0.2, 0, 0), (-0.2, 0, 0), axis=y, spring=2.0, armature=0.1),
        Joint("revolute", "base", "r", "", (-0.2, 0, 0), (0.2, 0, 0), axis=y, limits=(-0.5, 0.8)),
        Joint("cylindrical", "r", "rack", "", (-0.2, 0, 0), axis=(1.0, 0.0, 0.0), damper=(0.1, 0.0)),
    ]
    foot = Contact("rack", point=(0.1, -0.05, -0.2), height=-0.25, friction=0.4)
    return started(Mechanism(bodies, joints, [foot], gears=[Gear("l", "r", -1.0), Gear("rack", "l", 0.15, 0.02)]))


def started(mech: Mechanism) -> Case:
    """A mechanism with gears after some steps."""
    sim = Simulator(mech, time_step=0.02, kappa=1e-4, tolerance=1e-12)
    x = sim.neutral()
    x[sim.nq :] = np.random.default_rng(5).normal(size=sim.nv)
    x = sim.rollout(sim.close(x), np.zeros((3, sim.nu)), throw=True).x[-1]
    return Case(sim, x, np.random.default_rng(2).normal(size=sim.nu))


def colliding(b: Box | Sphere, restitution: float = 0.0) -> Case:
    """Two spinning bodies run into each other."""
    bodies = [
        Body("a", 1.0, (0.02, 0.03, 0.04), shape=Box(0.4, 0.3, 0.5)),
        Body("b", 2.0, (0.05, 0.06, 0.07), shape=b),
    ]
    joints = [Joint("floating", None, name) for name in "ab"]
    mech = Mechanism(
        bodies, joints, collisions=[Collision("a", "b", restitution=restitution)], gravity=(0.1, 0.2, -0.3)
    )
    sim = Simulator(mech, time_step=0.01, kappa=1e-4, tolerance=1e-12)
    n = np.array([0.6, 0.0, 0.8])
    turns = [turned(np.array(t)) for t in ((0.3, 0.2, 0.1), (-0.2, 0.4, 0.3))]
    v = np.r_[-2.0 * n + (0.1, 0.2, 0.0), 0.5, -0.3, 1.0, 2.0 * n, 0.2, 0.7, -0.4]
    x = np.r_[n, turns[0], np.zeros(3), turns[1], v]
    for _ in range(60):
        r = sim.step(x)
        hit = np.abs(r.contacts.impulse).max() > 0.1 if restitution else r.contacts.gap.min() < 0.01
        if hit:
            return Case(sim, x, np.zeros(0 if sim.nu == 0 else sim.nu))
        x = r.x
    raise AssertionError("they do not meet")


def touching(a: Solid, b: Solid, gap: float, kappa: float = 1e-4, restitution: float = 0.0) -> Case:
    """Two spinning bodies with shapes so far apart, or the first above a half-space, move towards each other."""
    rng = np.random.default_rng(8)
    fixed, pulls = isinstance(b, HalfSpace), isinstance(a, String)
    bodies = [Body("a", 1.0, (0.02, 0.03, 0.04)), Body("b", 2.0, (0.05, 0.06, 0.07))][: 1 if fixed else 2]
    joints = [Joint("floating", None, body.name) for body in bodies]
    collision = Collision("a", None if fixed else "b", a, b, restitution=restitution)
    mech = Mechanism(bodies, joints, collisions=[collision], gravity=(0.0, 0.0, 0.0))
    n = np.array([0.0, 0.0, 1.0]) if fixed else np.array([0.6, -0.48, 0.64])
    turns = [turned(0.5 * rng.normal(size=3)) for _ in bodies]
    v = np.concatenate([np.r_[-sign * n, rng.normal(size=3)] for sign in (1.0, -1.0)])[: 6 * len(bodies)]
    still = Simulator(mech, time_step=0.01, kappa=1e-12, divide=False)

    def state(distance: float, velocity: Floats) -> Floats:
        ends = (distance * n, np.zeros(3))
        return np.concatenate([*(np.r_[end, turn] for end, turn in zip(ends, turns, strict=False)), velocity])

    low, high = 0.0, 3.0
    while high - low > 1e-9:
        middle = 0.5 * (low + high)
        apart = still.step(state(middle, 0.0 * v)).contacts.gap.min() > 1e-5
        low, high = (low, middle) if apart != pulls else (middle, high)
    x = state(high - gap, -v) if pulls else state(high + gap, v)
    return Case(Simulator(mech, time_step=0.01, kappa=kappa, tolerance=1e-12), x, np.zeros(0))
