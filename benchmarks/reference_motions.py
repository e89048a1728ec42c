"""Motions whose end is known: exactly, or by steps that are far shorter than those of a study.

`motions` lists them all: pendulums, free bodies, balls and blocks on the ground with exact solutions, a closed loop, a
tower, a chain, and the robots of the library in flight and falling onto the ground.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

import dojo_opt as dojo
from solvers.types import Vector
from support.linkage import plain_fourbar
from support.scenes import ball, block
from support.towers import tower

_G = 9.81
FALLING = ("ant", "atlas", "halfcheetah", "hopper", "humanoid", "quadruped", "raiberthopper", "walker")
FLYING = (*FALLING, "panda", "youbot")


class ReferenceMotion(NamedTuple):
    """A motion from a node, and its expected end."""

    name: str
    mechanism: dojo.Mechanism
    q: Vector
    v: Vector
    seconds: float
    exact: Vector | None  # coordinates in the end; None: found by small steps


def _at(q: Vector, k: int, value: float) -> Vector:
    """The coordinates q with another value of coordinate k."""
    out = q.copy()
    out[k] = value
    return out


def pendulum(links: int) -> ReferenceMotion:
    """Released from rest."""
    q = np.full(links, 0.4)
    return ReferenceMotion(f"pendulum of {links}", dojo.models.npendulum(links), q, np.zeros(links), 2.0, None)


def free_body() -> ReferenceMotion:
    """Turning about all axes."""
    mech = dojo.models.tennisracket()
    q = np.array(mech.neutral, dtype=np.float64)
    return ReferenceMotion("free body", mech, q, np.random.default_rng(4).normal(size=6), 2.0, None)


def tree() -> ReferenceMotion:
    """A quadruped without a ground."""
    mech = replace(dojo.models.quadruped(damper=0.0, limits=False), contacts=(), name="tree")
    rng = np.random.default_rng(1)
    q = np.array(mech.neutral, dtype=np.float64)
    q[7:] += 0.3 * rng.normal(size=12)
    return ReferenceMotion("tree of 13 bodies", mech, q, rng.normal(size=18), 0.5, None)


def bouncing(seconds: float = 2.0, share: float = 0.8) -> ReferenceMotion:
    """A ball without friction, dropped from 1 m."""
    mech = ball(friction=0.0)
    mech = replace(mech, contacts=tuple(replace(c, restitution=share) for c in mech.contacts))
    when, speed = np.sqrt(2.0 / _G), share * np.sqrt(2.0 * _G)
    while when + 2.0 * speed / _G < seconds:
        when, speed = when + 2.0 * speed / _G, share * speed
    rest = seconds - when
    q = np.array([0.0, 0.0, 1.1, 1.0, 0.0, 0.0, 0.0])
    end = _at(q, 2, 0.1 + speed * rest - 0.5 * _G * rest**2)
    return ReferenceMotion("bouncing ball", mech, q, np.zeros(6), seconds, end)


def sliding() -> ReferenceMotion:
    """A block that comes to rest after 0.68 s."""
    q = np.array([0.0, 0.0, 0.25, 1.0, 0.0, 0.0, 0.0])
    end = _at(q, 0, 2.0**2 / (2.0 * 0.3 * _G))
    return ReferenceMotion("sliding block", block(friction=0.3), q, np.eye(6)[0] * 2.0, 1.0, end)


def rolling(height: float, speed: float, seconds: float) -> ReferenceMotion:
    """A ball of radius .1 m falls from a height with a speed along x, loses mu w of this speed at the impact w, slides,
    and rolls as soon as the point in contact is at rest.
    """
    mu = 0.3
    fall, impact = np.sqrt(2.0 * height / _G), np.sqrt(2.0 * height * _G)
    start, spin = speed - mu * impact, 25.0 * mu * impact
    slide = (start - 0.1 * spin) / (3.5 * mu * _G)
    rest = seconds - fall - slide
    x = speed * fall + start * slide - 0.5 * mu * _G * slide**2 + (start - mu * _G * slide) * rest
    turn = spin * slide + 12.5 * mu * _G * slide**2 + (spin + 25.0 * mu * _G * slide) * rest
    q = np.array([0.0, 0.0, 0.1 + height, 1.0, 0.0, 0.0, 0.0])
    end = np.array([x, 0.0, 0.1, np.cos(0.5 * turn), 0.0, np.sin(0.5 * turn), 0.0])
    name = "thrown ball" if height else "rolling ball"
    return ReferenceMotion(name, ball(friction=mu), q, np.eye(6)[0] * speed, seconds, end)


def tumbling() -> ReferenceMotion:
    """A block that falls onto a corner."""
    turn = np.array([1.0, 0.2, 0.1, 0.05])
    q = np.r_[0.0, 0.0, 0.6, turn / np.linalg.norm(turn)]
    return ReferenceMotion(
        "tumbling block", block(friction=0.5), q, np.array([0.5, 0.0, 0.0, 1.0, 2.0, 0.0]), 0.6, None
    )


def fall(robot: str) -> ReferenceMotion:
    """A robot of the library, 5 cm above the ground, with random velocities."""
    mech = getattr(dojo.models, robot)()
    sim = dojo.Simulator(mech)
    q, rng = np.array(sim.neutral()[: sim.nq]), np.random.default_rng(1)
    up = 1 if mech.joints[0].kind == "planar_axis" else 2  # planar: x, z, pitch
    q[up] += 0.05 + _clearance(sim, q, up)
    return ReferenceMotion(f"{robot} falling", mech, q, 0.5 * rng.normal(size=sim.nv), 0.3, None)


def _clearance(sim: dojo.Simulator, q: Vector, up: int) -> float:
    """How much a mechanism has to be raised to stand on the ground [m]."""
    high = np.r_[q, np.zeros(sim.nv)]
    high[up] += 5.0
    return 5.0 - float(sim.step(high, throw=True).contacts.gap.min())


def fourbar() -> ReferenceMotion:
    """Let go: a closed loop."""
    mech = plain_fourbar()
    return ReferenceMotion("four-bar", mech, np.array(mech.neutral, dtype=np.float64), np.zeros(3), 0.5, None)


def stack() -> ReferenceMotion:
    """Two boxes that stand on each other and fall by 0.1 mm each."""
    mech = tower(dojo.Box(0.2, 0.2, 0.2), [1.0, 1.0])
    return ReferenceMotion("stack", mech, np.array(mech.neutral, dtype=np.float64), np.zeros(12), 0.2, None)


def chain() -> ReferenceMotion:
    """Five links with a ball at each joint, 2 cm above the ground."""
    links = dojo.models.npendulum(5)
    points = [dojo.Contact(body.name, radius=0.05, friction=0.5) for body in links.bodies]
    root = dojo.Joint("floating", None, links.bodies[0].name)
    mech = dojo.Mechanism(links.bodies, [root, *links.joints[1:]], points, name="chain")
    sim = dojo.Simulator(mech)
    q = np.array(sim.neutral()[: sim.nq])
    q[3:7], q[7:] = (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0), 0.2
    q[2] += 0.02 + _clearance(sim, q, 2)
    return ReferenceMotion("chain on the ground", mech, q, np.zeros(sim.nv), 0.3, None)


def flight(robot: str) -> ReferenceMotion:
    """A robot of the library without ground and limits, thrown with random velocities."""
    mech = getattr(dojo.models, robot)()
    joints = [replace(j, limits=None, cone=None) for j in mech.joints]
    mech = replace(mech, joints=joints, contacts=(), collisions=(), name=robot)
    sim = dojo.Simulator(mech)
    rng = np.random.default_rng(3)
    start = sim.integrate(sim.neutral(), np.r_[0.1 * rng.normal(size=sim.nv), np.zeros(sim.nv)])
    return ReferenceMotion(f"{robot} in flight", mech, start[: sim.nq], 0.5 * rng.normal(size=sim.nv), 0.5, None)


def motions(quick: bool) -> list[Callable[[], ReferenceMotion]]:
    """All motions, or a few."""
    found: list[Callable[[], ReferenceMotion]] = [partial(pendulum, 1), bouncing, sliding]
    if quick:
        return found
    return [
        *found,
        *(partial(pendulum, links) for links in (2, 5, 50)),
        free_body,
        tree,
        partial(rolling, 0.0, 2.0, 0.5),
        partial(rolling, 0.2, 3.0, 0.8),
        tumbling,
        stack,
        chain,
        fourbar,
        *(partial(fall, robot) for robot in FALLING),
        *(partial(flight, robot) for robot in FLYING),
    ]
