"""Steps in which parameters matter, one situation each: flying, touching, sliding, at a limit, in a loop, ..."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.dynamics.maximal_energy import rotated
from sim.mechanism.body import Body
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.joint import KINDS as JOINTS
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Sphere, String
from sim.mechanism.terrain import Terrain
from sim.simulator.simulator import Simulator
from support.couplings import STONE, colliding, geared, loop, touching
from support.parameter_case import Case, turned

Floats = NDArray[np.float64]

H = 0.02  # [s]
GRID = np.linspace(-3.0, 3.0, 25)
HILLS = Terrain.from_function(lambda x, y: 0.1 * np.sin(2.0 * x + 0.3) * np.cos(1.5 * y - 0.2), GRID, GRID)
LEVEL = (0.0, 0.0, -9.81)


def _pair(kind: str, base: str | None, gravity: ArrayLike, **options: Any) -> Mechanism:
    """Two bodies without symmetry: the first on a joint `base`, the second on one of `kind`, with inputs.

    Without a base, the first is on one of `kind` too.
    """
    rng = np.random.default_rng(5)
    bodies, joints = [], []
    for i, parent in enumerate((None, "body0")):
        inertia = np.diag([0.11, 0.17, 0.23]) * (1.0 + 0.3 * i)
        inertia[0, 1] = inertia[1, 0] = 0.01
        bodies.append(Body(f"body{i}", 1.0 + 0.5 * i, inertia))
        if base is not None and parent is None:
            joints.append(Joint(base, None, "body0"))
            continue
        joints.append(
            Joint(
                kind,
                parent,
                f"body{i}",
                orientation=turned(rng.normal(size=3)),
                axis=rng.normal(size=3),
                parent_point=rng.normal(size=3) / 4.0,
                child_point=rng.normal(size=3) / 4.0,
                pitch=1.5 if kind == "screw" else 0.0,
                **options,
            )
        )
    inputs = [Input(j.name, dof=d) for j in joints if j.kind == kind for d in range(j.nv)]
    return Mechanism(bodies, joints, inputs=inputs, gravity=gravity)


def _random_state(sim: Simulator, rng: np.random.Generator, speed: float, spread: float) -> Floats:
    """A state about the neutral one."""
    dx = np.concatenate((spread * rng.normal(size=sim.nv), speed * rng.normal(size=sim.nv)))
    x = np.array(sim.neutral())
    x[sim.nq :] = 0.0
    return sim.integrate(x, dx)


def _center(sim: Simulator, x: Floats, foot: Contact) -> Floats:
    """Where the centre of a contact on the second body is [m]."""
    z = sim.maximal(x)[1]
    return np.asarray(z[:3] + rotated(z[6:10], np.asarray(foot.point)))


def _resting(
    kind: str, height: float, friction: float, speed: float, kappa: float = 1e-4, turning: float = 0.0
) -> Case:
    """A body on a joint on a floating base, its contact so high above a tilted ground after a step without contact.

    turning: torsional, and half the rolling friction [m].
    """
    rng = np.random.default_rng(3)
    normal = (0.2, -0.1, 0.9)
    mech = _pair(kind, "floating", LEVEL, spring=3.0, damper=0.2)
    if mech.joints[1].nrot < 3:
        mech = replace(mech, joints=[mech.joints[0], replace(mech.joints[1], armature=0.1)])
    foot = Contact("body1", point=(0.1, -0.05, -0.2), radius=0.05, normal=normal, height=-1e3, friction=friction)
    foot = replace(foot, torsional_friction=turning, rolling_friction=0.5 * turning)
    mech = replace(mech, contacts=[foot])
    far = Simulator(mech, time_step=H, kappa=1e-12, tolerance=3e-14)
    x, u = _random_state(far, rng, speed, 0.4), 0.1 * rng.normal(size=far.nu)
    lowest = _center(far, far.step(x, u, throw=True).x, foot) @ np.asarray(foot.normal) - foot.radius
    mech = replace(mech, contacts=[replace(foot, height=float(lowest) - height)])
    return Case(Simulator(mech, time_step=H, kappa=kappa, tolerance=3e-14), x, u)


def _pyramid() -> Case:
    """A box slides on two corners with friction of the linear law, pushed by inputs on the body."""
    corners = [(0.2, 0.1, -0.1), (-0.2, 0.1, -0.1)]
    contacts = [Contact("box", p, friction=0.3, law="linear") for p in corners]
    inputs = [
        Input(body="box", force=(1.0, 0.5, 0.0), torque=(0.2, 0.1, 0.0), frame="body"),
        Input(body="box", force=(0.0, 1.0, 2.0), torque=(0.0, 0.1, 0.3)),
    ]
    mech = Mechanism([Body("box", 1.0, (0.02, 0.03, 0.04))], [Joint("floating", None, "box")], contacts, inputs)
    x = np.r_[0.0, 0.0, 0.1, turned(np.array([0.05, 0.02, 0.3])), 1.0, 0.5, -0.2, 0.3, -0.5, 1.0]
    return Case(Simulator(mech, time_step=H, kappa=1e-4, tolerance=3e-14), x, np.array([1.0, -2.0]))


def falling(
    terrain: Terrain | None = None,
    restitution: float = 0.5,
    friction: float = 0.5,
    sunk: float = 0.01,
    turning: float = 0.0,
) -> Case:
    """A spinning body on a joint falls on its foot, on a tilted ground or on terrain; with terrain, it slides.

    sunk: how far it would sink in without the ground [m]; an impact is only where it begins above it.
    turning: torsional, and half the rolling friction [m].
    """
    rng = np.random.default_rng(3)
    mech = _pair("revolute", "floating", LEVEL, spring=3.0, damper=0.2)
    ground = {"terrain": terrain} if terrain else {"normal": (0.2, -0.1, 0.9)}
    foot = Contact("body1", point=(0.1, -0.05, -0.2), radius=0.05, height=-1e3, **ground)
    foot = replace(foot, restitution=restitution, friction=friction)
    foot = replace(foot, torsional_friction=turning, rolling_friction=0.5 * turning)
    mech = replace(mech, contacts=[foot])
    far = Simulator(mech, time_step=H, kappa=1e-12, tolerance=3e-14)
    x, u = _random_state(far, rng, 1.0, 0.4), 0.1 * rng.normal(size=far.nu)
    x[far.nq + 2] = -3.0
    center = _center(far, far.step(x, u, throw=True).x, foot)
    level = replace(foot, height=0.0)
    steep = level.normal_at(center)[2] if terrain else 1.0
    foot = replace(foot, height=float(level.gap(center) / steep) + sunk)
    mech = replace(mech, contacts=[foot])
    return Case(Simulator(mech, time_step=H, kappa=1e-4, tolerance=3e-14), x, u)


def _limited(kind: str) -> Case:
    """Two joints of a kind, moving towards limits of their plain coordinates, and cones of their quaternions."""
    ntrans, nrot = JOINTS[kind]
    plain = ntrans + (nrot if nrot < 3 else 0)
    limits = [(-0.3, 0.3)] * plain + [None] * (ntrans + nrot - plain)
    mech = _pair(kind, None, (0.0, 0.0, 0.0), damper=0.1, limits=limits or None, cone=0.6 if nrot == 3 else None)
    sim = Simulator(mech, time_step=H, kappa=1e-4, tolerance=3e-14)
    rng = np.random.default_rng(1)
    x = _random_state(sim, rng, 1.0, 0.2)
    return Case(sim, x, rng.normal(size=sim.nu))


CASES: dict[str, Callable[[], Case]] = {
    "flying": lambda: _resting("planar_axis", 0.3, 0.5, 2.0),
    "flying, screw": lambda: _resting("screw", 0.3, 0.5, 2.0),
    "sliding, screw": lambda: _resting("screw", -0.01, 0.1, 2.0),
    "touching": lambda: _resting("prismatic_orbital", 0.0, 0.5, 0.3),
    "sliding": lambda: _resting("cylindrical_free", -0.01, 0.1, 2.0),
    "sticking": lambda: _resting("revolute", -0.01, 0.7, 0.02, 1e-3),
    "sliding, pyramid": _pyramid,
    "pivoting": lambda: _resting("revolute", -0.01, 0.7, 0.5, turning=0.05),
    "bouncing": falling,
    "bouncing, pivoting": lambda: falling(friction=0.1, turning=0.05),
    "on terrain": lambda: falling(HILLS),
    "on terrain, sticking": lambda: falling(HILLS, 0.0, 1.0, 0.03),
    "on terrain, pivoting": lambda: falling(HILLS, turning=0.05),
    "at a limit": lambda: _limited("planar_axis"),
    "at a cone": lambda: _limited("cylindrical_free"),
    "in a loop": lambda: loop("revolute"),
    "in a loop, orbital": lambda: loop("spherical", "orbital"),
    "in a loop, fixed": lambda: loop("fixed"),
    "in a loop, screw": lambda: loop("screw"),
    "geared": geared,
    "colliding, box and sphere": lambda: colliding(Sphere(0.2)),
    "colliding, bouncing": lambda: colliding(Sphere(0.2), 0.5),
    "colliding, boxes": lambda: colliding(Box(0.3, 0.3, 0.4)),
    "colliding, capsules": lambda: touching(Capsule(0.1, 0.4), Capsule(0.15, 0.3), -0.01),
    "colliding, polytopes": lambda: touching(STONE, STONE, -0.01),
    "rolling": lambda: touching(Cylinder(0.2, 0.1), HalfSpace(), -0.01),
    "rolling, ellipsoid": lambda: touching(Ellipsoid(0.3, 0.2, 0.15), HalfSpace(), -0.01),
    "colliding, ellipsoid and box": lambda: touching(Box(0.3, 0.3, 0.4), Ellipsoid(0.3, 0.2, 0.15), -0.01),
    "tied": lambda: touching(String(0.5), String(0.5), -0.01),
}
