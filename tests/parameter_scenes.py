"""Parameter kind x situation: derivatives of a step by parameters against differences of the solver at the same kappa."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from linkage import fourbar
from naive import rotation as rot
from scenes import chain, gaps, limited, random_state

import dojo_opt as dojo
from sim.gear import Gear
from sim.parameters import KINDS

H = 0.02
SIZES = (1e-3, 1e-4, 1e-2, 1e-5)
GOOD = 1e-8
GRID = np.linspace(-3.0, 3.0, 25)
HILLS = dojo.Terrain.from_function(lambda x, y: 0.1 * np.sin(2.0 * x + 0.3) * np.cos(1.5 * y - 0.2), GRID, GRID)
ONE_SIDED = ("spring", "damper", "armature", "friction", "contact_radius", "restitution")  # not below zero


class Case(NamedTuple):
    """A step, and the kinds of parameters that it has."""

    sim: dojo.Simulator
    x: np.ndarray
    u: np.ndarray
    names: tuple[str, ...] = ()  # all when empty

    def kinds(self) -> list[str]:
        """The kinds of its parameters; without restitution, a step need not be a continuous function of it."""
        known = list(self.names or self.sim.parameters().names)
        if not self.sim.model.contact_restitution.any():
            known = [name for name in known if not name.startswith("restitution")]
        return [kind for kind in KINDS if any(name.split(":")[0].split("[")[0] == kind for name in known)]


def _resting(kind: str, height: float, friction: float, speed: float, kappa: float = 1e-4) -> Case:
    """A body on a joint on a floating base, its contact so high above a tilted ground after a step without contact."""
    rng = np.random.default_rng(3)
    normal = (0.2, -0.1, 0.9)
    mech = chain(kind, 1, gravity=(0.0, 0.0, -9.81), spring=3.0, damper=0.2)
    if mech.joints[1].nrot < 3:
        mech = dataclasses.replace(mech, joints=[mech.joints[0], dataclasses.replace(mech.joints[1], armature=0.1)])
    foot = dojo.Contact("body1", point=(0.1, -0.05, -0.2), radius=0.05, normal=normal, height=-1e3, friction=friction)
    mech = dataclasses.replace(mech, contacts=[foot])
    far = dojo.Simulator(mech, time_step=H, kappa=1e-12, tolerance=3e-14)
    x, u = random_state(far, rng, speed, spread=0.4), 0.1 * rng.normal(size=far.nu)
    lowest = gaps(far, far.step(x, u).x).min() - 1e3
    mech = dataclasses.replace(mech, contacts=[dataclasses.replace(foot, height=lowest - height)])
    return Case(dojo.Simulator(mech, time_step=H, kappa=kappa, tolerance=3e-14), x, u)


def _pyramid() -> Case:
    """A box slides on two corners, its friction that of the linear law, pushed by inputs on the body."""
    corners = [(0.2, 0.1, -0.1), (-0.2, 0.1, -0.1)]
    contacts = [dojo.Contact("box", p, friction=0.3, law="linear") for p in corners]
    inputs = [
        dojo.Input(body="box", force=(1.0, 0.5, 0.0), torque=(0.2, 0.1, 0.0), frame="body"),
        dojo.Input(body="box", force=(0.0, 1.0, 2.0), torque=(0.0, 0.1, 0.3)),
    ]
    mech = dojo.Mechanism(
        [dojo.Body("box", 1.0, (0.02, 0.03, 0.04))], [dojo.Joint("floating", None, "box")], contacts, inputs
    )
    x = np.r_[0.0, 0.0, 0.1, rot.exp(np.array([0.05, 0.02, 0.3])), 1.0, 0.5, -0.2, 0.3, -0.5, 1.0]
    return Case(dojo.Simulator(mech, time_step=H, kappa=1e-4, tolerance=3e-14), x, np.array([1.0, -2.0]))


def _bouncing(terrain: dojo.Terrain | None = None) -> Case:
    """A spinning body on a joint falls on its foot, on a tilted ground or on terrain; with terrain, it slides."""
    rng = np.random.default_rng(3)
    mech = chain("revolute", 1, gravity=(0.0, 0.0, -9.81), spring=3.0, damper=0.2)
    ground = {"terrain": terrain} if terrain else {"normal": (0.2, -0.1, 0.9)}
    foot = dojo.Contact("body1", point=(0.1, -0.05, -0.2), radius=0.05, height=-1e3, restitution=0.5, **ground)
    mech = dataclasses.replace(mech, contacts=[foot])
    far = dojo.Simulator(mech, time_step=H, kappa=1e-12, tolerance=3e-14)
    x, u = random_state(far, rng, 1.0, spread=0.4), 0.1 * rng.normal(size=far.nu)
    x[far.nq + 2] -= 3.0
    z = far.maximal(far.step(x, u).x)[1]
    centre = z[:3] + rot.rotate(z[6:10], np.array(foot.point))
    level = dataclasses.replace(foot, height=0.0)
    steep = level.normal_at(centre)[2] if terrain else 1.0
    foot = dataclasses.replace(foot, height=float(level.gap(centre) / steep) + 0.03)
    mech = dataclasses.replace(mech, contacts=[foot])
    return Case(dojo.Simulator(mech, time_step=H, kappa=1e-4, tolerance=3e-14), x, u)


def _limited(kind: str) -> Case:
    """Two joints, moving towards their limits."""
    mech = limited(kind)
    sim = dojo.Simulator(mech, time_step=H, kappa=1e-4, tolerance=3e-14)
    rng = np.random.default_rng(1)
    x = random_state(sim, rng, 1.0, spread=0.2)
    return Case(sim, x, rng.normal(size=sim.nu))


def _loop(kind: str, tree: str = "spherical") -> Case:
    """A floating ring of four bodies, moving."""
    bodies = [dojo.Body(f"b{k}", 1.0 + 0.3 * k, (0.02, 0.03, 0.04)) for k in range(4)]
    corners = np.array([(0.5, 0.0, 0.0), (0.0, 0.5, 0.0), (-0.5, 0.0, 0.0), (0.0, -0.5, 0.0)])
    centres = 0.5 * (corners + np.roll(corners, -1, axis=0))
    joints = [dojo.Joint("floating", None, "b0")]
    for k in range(1, 4):
        at = corners[k]
        ends = (at - centres[k - 1], at - centres[k])
        joints.append(dojo.Joint(tree if k == 1 else "spherical", f"b{k - 1}", f"b{k}", "", *ends, damper=0.1))
    ends = (corners[0] - centres[3], corners[0] - centres[0])
    joints.append(dojo.Joint(kind, "b3", "b0", "last", *ends, axis=(0.6, 0.0, 0.8), close=True))
    sim = dojo.Simulator(dojo.Mechanism(bodies, joints), time_step=0.01, tolerance=1e-12)
    x = sim.neutral()
    x[sim.nq :] = np.random.default_rng(1).normal(size=sim.nv)
    return Case(sim, sim.close(x), np.zeros(sim.nu))


def _acting() -> Case:
    """A floating ring, its closing joint with springs, dampers and limits: it divides its child in two."""
    plain = _loop("spherical").sim.mechanism
    ends = plain.loops[0].parent_point, plain.loops[0].child_point
    action = {"spring": (50.0, 2.0), "damper": 0.1, "limits": ((-0.1, 0.1), None)}
    last = dojo.Joint("cylindrical", "b3", "b0", "last", *ends, axis=(0.6, 0.0, 0.8), close=True, **action)
    mech = dataclasses.replace(plain, joints=[*plain.joints, last], loops=(), inputs=None, neutral=None)
    sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-4, tolerance=1e-12)
    x = sim.neutral()
    x[sim.nq :] = np.random.default_rng(1).normal(size=sim.nv)
    return Case(sim, sim.close(x), 0.1 * np.random.default_rng(2).normal(size=sim.nu))


def _geared(crank: bool) -> Case:
    """A floating body with geared arms, one with a rack and a limit; or the crank of a four-bar turns a flywheel."""
    y = (0.0, 1.0, 0.0)
    if crank:
        plain = fourbar("pin", inputs=("crank",), spring=3.0, damper=0.2)
        wheel = dojo.Joint("revolute", None, "wheel", axis=y, armature=0.1)
        mech = dataclasses.replace(
            plain,
            bodies=[*plain.bodies, dojo.Body("wheel", 1.0, (0.1, 0.2, 0.15))],
            joints=[*plain.joints, wheel],
            gears=[Gear("wheel", "crank", 3.0)],
            neutral=(*plain.neutral, -3.0),
        )
    else:
        bodies = [
            dojo.Body(name, 1.0 + 0.5 * k, (0.02, 0.03, 0.04)) for k, name in enumerate(("base", "l", "r", "rack"))
        ]
        joints = [
            dojo.Joint("floating", None, "base"),
            dojo.Joint("revolute", "base", "l", "", (0.2, 0, 0), (-0.2, 0, 0), axis=y, spring=2.0, armature=0.1),
            dojo.Joint("revolute", "base", "r", "", (-0.2, 0, 0), (0.2, 0, 0), axis=y, limits=(-0.5, 0.8)),
            dojo.Joint("cylindrical", "r", "rack", "", (-0.2, 0, 0), axis=(1.0, 0.0, 0.0), damper=(0.1, 0.0)),
        ]
        foot = dojo.Contact("rack", point=(0.1, -0.05, -0.2), height=-0.25, friction=0.4)
        mech = dojo.Mechanism(bodies, joints, [foot], gears=[Gear("l", "r", -1.0), Gear("rack", "l", 0.15, 0.02)])
    sim = dojo.Simulator(mech, time_step=0.02, kappa=1e-4, tolerance=1e-12)
    x = sim.neutral()
    x[sim.nq :] = np.random.default_rng(5).normal(size=sim.nv)
    x = sim.rollout(sim.close(x), np.zeros((3, sim.nu)), throw=True).x[-1]
    names = sim.parameters().names
    if crank:  # it stays a planar linkage, of rods
        out = ("inertia", "orientation", "axis")
        names = tuple(n for n in names if not n.startswith(out) and not ("_point" in n and n.endswith("[1]")))
    return Case(sim, x, np.random.default_rng(2).normal(size=sim.nu), names)


def _colliding(b: dojo.Box | dojo.Sphere, restitution: float = 0.0) -> Case:
    """Two spinning bodies run into each other."""
    bodies = [
        dojo.Body("a", 1.0, (0.02, 0.03, 0.04), shape=dojo.Box(0.4, 0.3, 0.5)),
        dojo.Body("b", 2.0, (0.05, 0.06, 0.07), shape=b),
    ]
    joints = [dojo.Joint("floating", None, name) for name in "ab"]
    mech = dojo.Mechanism(
        bodies, joints, collisions=[dojo.Collision("a", "b", restitution=restitution)], gravity=(0.1, 0.2, -0.3)
    )
    sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-4, tolerance=1e-12)
    n = np.array([0.6, 0.0, 0.8])
    turns = [rot.exp(np.array(t)) for t in ((0.3, 0.2, 0.1), (-0.2, 0.4, 0.3))]
    v = np.r_[-2.0 * n + (0.1, 0.2, 0.0), 0.5, -0.3, 1.0, 2.0 * n, 0.2, 0.7, -0.4]
    x = np.r_[n, turns[0], np.zeros(3), turns[1], v]
    for _ in range(60):
        r = sim.step(x)
        hit = np.abs(r.contacts.impulse).max() > 0.1 if restitution else r.contacts.gap.min() < 0.01
        if hit:
            return Case(sim, x, np.zeros(0 if sim.nu == 0 else sim.nu))
        x = r.x
    raise AssertionError("they do not meet")


CASES: dict[str, Callable[[], Case]] = {
    "flying": lambda: _resting("planar_axis", 0.3, 0.5, 2.0),
    "touching": lambda: _resting("prismatic_orbital", 0.0, 0.5, 0.3),
    "sliding": lambda: _resting("cylindrical_free", -0.01, 0.1, 2.0),
    "sticking": lambda: _resting("revolute", -0.01, 0.7, 0.02, 1e-3),
    "sliding, pyramid": _pyramid,
    "bouncing": _bouncing,
    "on terrain": lambda: _bouncing(HILLS),
    "at a limit": lambda: _limited("planar_axis"),
    "at a cone": lambda: _limited("cylindrical_free"),
    "in a loop": lambda: _loop("revolute"),
    "in a loop, orbital": lambda: _loop("spherical", "orbital"),
    "in a loop, fixed": lambda: _loop("fixed"),
    "in a loop, acting": _acting,
    "geared": lambda: _geared(False),
    "geared, in a loop": lambda: _geared(True),
    "colliding, box and sphere": lambda: _colliding(dojo.Sphere(0.2)),
    "colliding, bouncing": lambda: _colliding(dojo.Sphere(0.2), 0.5),
    "colliding, boxes": lambda: _colliding(dojo.Box(0.3, 0.3, 0.4)),
}


def error(case: Case, kind: str) -> float:
    """Largest error of the derivative along a random direction of all parameters of a kind, relative to its size."""
    sim, x, u = case.sim, case.x, case.u
    names = [n for n in case.names or sim.parameters().names if n.split(":")[0].split("[")[0] == kind]
    found = sim.parameters(names)
    rng = np.random.default_rng(len(names))
    direction = rng.uniform(0.5, 1.0, size=len(names)) * (1.0 if kind in ONE_SIDED else rng.choice([-1, 1], len(names)))
    direction *= H if kind == "time_step" else np.maximum(np.abs(found.values), 1.0 if kind in ONE_SIDED[:3] else 0.1)
    expected = sim.linearize(x, u, wrt=names)
    rate = np.concatenate([expected[name] for name in names], axis=1) @ direction
    here = sim.step(x, u)
    assert here.success

    def change(size: float) -> np.ndarray:
        values = found.values + size * direction
        moved = sim.with_parameters(dict(zip(names, values, strict=True))).step(x, u)
        assert moved.success, moved.message
        return sim.difference(moved.x, here.x)

    doubts = []
    for size in SIZES:
        if kind in ONE_SIDED:
            a, b, c, d = (change(k * size) for k in (1, 2, 3, 4))
            slope = (4.0 * a - 3.0 * b + 4.0 / 3.0 * c - d / 4.0) / size
        else:
            a, b, c, d = (change(k * size) for k in (-2, -1, 1, 2))
            slope = (a - 8.0 * b + 8.0 * c - d) / (12.0 * size)
        doubts.append(np.abs(slope - rate).max() / max(np.abs(rate).max(), 1e-6))
        if doubts[-1] < GOOD:  # no smaller by chance
            break
    return float(min(doubts))


def table() -> dict[str, dict[str, float]]:
    """{situation: {kind: error}}, for a report."""
    out = {}
    for name, build in CASES.items():
        case = build()
        out[name] = {kind: error(case, kind) for kind in case.kinds()}
    return out
