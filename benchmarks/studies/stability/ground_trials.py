"""Trials on the ground: impacts, friction, redundant contacts, mass ratios, deep overlap, time steps 1e-5 to 0.5."""

from __future__ import annotations

from itertools import product

import numpy as np

from benchmarks.studies.stability import scene_measures
from dojo_opt.models.block import block
from dojo_opt.models.quadruped import quadruped
from dojo_opt.models.sphere import sphere
from dojo_opt.report.stability import measures
from dojo_opt.report.stability.trial import StabilityTrial
from sim.mechanism.body import Body
from sim.mechanism.contact import Contact
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism

G = 9.81  # [m/s^2]
TILTED = (0.8, 0.36, 0.48, 0.0)
REST = (1.0, 0.0, 0.0, 0.0)


def on_a_foot(ratio: float, time_step: float) -> StabilityTrial:
    """A load on a foot of 1 kg with four contacts, between them a spring that sags by 10 mm, damped."""
    mass, sag = ratio, 0.01
    stiffness = mass * G / sag
    bodies = [Body("foot", 1.0, (0.01, 0.01, 0.01)), Body("load", mass, (0.1 * mass, 0.1 * mass, 0.1 * mass))]
    column = Joint(
        "prismatic",
        "foot",
        "load",
        parent_point=(0.0, 0.0, 0.3),
        spring=stiffness,
        damper=(stiffness * mass) ** 0.5,
    )
    corners = [(x, y, -0.05) for x, y in product((-0.2, 0.2), repeat=2)]
    mechanism = Mechanism(
        bodies, [Joint("floating", None, "foot"), column], [Contact("foot", p) for p in corners], inputs=[]
    )
    return StabilityTrial(
        "mass ratio",
        f"{ratio:g} kg on a foot of 1 kg dropped from 20 mm, at {1e3 * time_step:g} ms",
        "no penetration (1e-4 m), load at its place after 2 s within 0.1 mm",
        mechanism,
        (0.0, 0.0, 0.07, *REST, 0.0),
        np.zeros(7),
        time_step,
        2.0,
        scene_measures.standing_at(1, 0.35 - sag),
        1e-4,
    )


def impact(shape: str, time_step: float) -> StabilityTrial:
    """A ball, a box on a corner, or a quadruped at 100 m/s.

    Its shanks leave the ground with 300 rad/s and more: in 10 ms that is half a turn, which no step represents.
    """
    velocity = np.r_[0.0, 0.0, -100.0, np.zeros(3)]
    if shape == "ball":
        mechanism, q = sphere(radius=0.1, friction=0.5), np.array([0.0, 0.0, 0.1, *REST])
    elif shape == "box":
        mechanism, q = block(friction=0.5), np.array([0.0, 0.0, 0.5, *TILTED])
        velocity += (30.0, 0.0, 0.0, 5.0, -5.0, 5.0)
    else:
        mechanism = quadruped(contacts="all", limits=False)
        q, velocity = np.array(mechanism.neutral), np.r_[velocity, np.zeros(12)]
    q[2] += 100.0 * time_step * 3.33
    return StabilityTrial(
        "impacts",
        f"{shape} at 100 m/s, at {1e3 * time_step:g} ms",
        "no penetration (1e-8 m)",
        mechanism,
        q,
        velocity,
        time_step,
        30 * time_step,
        scene_measures.penetration,
        1e-8,
    )


def drop(time_step: float, duration: float) -> StabilityTrial:
    """A box dropped flat from 0.1 m, at time steps of all sizes."""
    return StabilityTrial(
        "time steps",
        f"box dropped from 0.1 m, {duration:g} s at {1e3 * time_step:g} ms",
        "no penetration, no motion in the last tenth of the time (1e-6 m)",
        block(friction=0.5),
        (0.0, 0.0, 0.35, *REST),
        np.zeros(6),
        time_step,
        duration,
        scene_measures.resting,
        1e-6,
        samples=min(1000, round(duration / time_step)),
        kappa=1e-12 if time_step < 1e-4 else 0.0,
        why="kappa is the gap times the impulse m g h: it has to shrink with the time step" if time_step < 1e-4 else "",
    )


def friction(coefficient: float) -> StabilityTrial:
    """A box thrown along the ground at 3 m/s: with much friction it tips over its front edge."""
    return StabilityTrial(
        "friction",
        f"box thrown along the ground at 3 m/s, friction {coefficient:g}, 2 s at 10 ms",
        "no penetration (1e-6 m), no gain of energy (0.1 % of that at the start)",
        block(friction=coefficient),
        (0.0, 0.0, 0.25, *REST),
        (3.0, 1.0, 0.0, 0.0, 0.0, 0.0),
        1e-2,
        2.0,
        measures.growth_and_penetration(1e-3 * (0.5 * 10.0 + G * 0.25), 1e-6),
        1.0,
    )


def plate(contacts: int, time_step: float) -> StabilityTrial:
    """A plate with a grid of contacts dropped from 0.1 m, tilted a little: 3 of them would hold it."""
    side = round(contacts**0.5)
    grid = np.linspace(-0.5, 0.5, side)
    points = [(x, y, -0.025) for x, y in product(grid, repeat=2)]
    body = Body("plate", 10.0, (10.0 / 12.0, 10.0 / 12.0, 10.0 / 6.0))
    mechanism = Mechanism([body], [Joint("floating", None, "plate")], [Contact("plate", p) for p in points], inputs=[])
    return StabilityTrial(
        "redundant contacts",
        f"plate of 10 kg on {contacts} contacts, dropped from 0.1 m, at {1e3 * time_step:g} ms",
        "no penetration, no motion in the last tenth of 3 s (1e-6 m)",
        mechanism,
        (0.0, 0.0, 0.125, 0.9998, 0.02, 0.0, 0.0),
        np.zeros(6),
        time_step,
        3.0,
        scene_measures.resting,
        1e-6,
    )


def box_on_8() -> StabilityTrial:
    """A box with four corners below and four points at the middles of the lower edges."""
    half = 0.25
    corners = [(x * half, y * half, -half) for x, y in product((-1, 1), repeat=2)]
    middles = [(half, 0, -half), (-half, 0, -half), (0, half, -half), (0, -half, -half)]
    body = Body("box", 1.0, (1.0 / 24.0, 1.0 / 24.0, 1.0 / 24.0))
    points = [Contact("box", p) for p in [*corners, *middles]]
    return StabilityTrial(
        "redundant contacts",
        "box on 8 contacts, dropped from 0.1 m, at 10 ms",
        "no penetration, no motion in the last tenth of 3 s (1e-6 m)",
        Mechanism([body], [Joint("floating", None, "box")], points, inputs=[]),
        (0.0, 0.0, 0.35, *REST),
        np.zeros(6),
        1e-2,
        3.0,
        scene_measures.resting,
        1e-6,
    )


def small(edge: float, mass: float) -> StabilityTrial:
    """A tiny cube dropped from ten times its size."""
    return StabilityTrial(
        "lengths",
        f"cube of {1e3 * edge:g} mm and {mass:g} kg dropped from ten times its size, at 1 ms",
        "no penetration and at rest within 1 % of its size",
        block(edge=edge, mass=mass, friction=0.5),
        (0.0, 0.0, 10.5 * edge, *REST),
        np.zeros(6),
        1e-3,
        1.0,
        scene_measures.standing_at(0, 0.5 * edge),
        0.01 * edge,
        kappa=1e-11 * mass / 1e-3,
        why="kappa is the gap times the impulse m g h: it has to shrink with the mass",
    )


def overlap(depth: float) -> StabilityTrial:
    """A box that starts below the surface."""
    return StabilityTrial(
        "deep overlap",
        f"box starts {depth:g} m deep, at 10 ms",
        "out of the ground after 0.1 s, and never in it again (1e-8 m)",
        block(friction=0.5),
        (0.0, 0.0, 0.25 - depth, *TILTED),
        np.zeros(6),
        1e-2,
        1.0,
        scene_measures.late_penetration(0.1),
        1e-8,
        why="it is thrown out at depth / h: a state in overlap has no past that led there",
    )


def trials() -> list[StabilityTrial]:
    """All trials on the ground."""
    return [
        *(on_a_foot(ratio, h) for ratio in (1e2, 1e4, 1e6) for h in (1e-3, 1e-2)),
        *(impact(shape, h) for shape in ("ball", "box") for h in (1e-3, 1e-2, 1e-1)),
        impact("quadruped", 1e-3),
        impact("quadruped", 5e-3),
        drop(1e-5, 0.2),
        drop(1e-3, 2.0),
        drop(1e-1, 10.0),
        drop(0.5, 20.0),
        *(friction(mu) for mu in (0.0, 0.1, 1.0, 3.0, 10.0)),
        box_on_8(),
        plate(100, 1e-2),
        plate(100, 1e-3),
        small(1e-2, 1e-3),
        small(1e-3, 1e-6),
        overlap(0.05),
        overlap(0.5),
    ]
