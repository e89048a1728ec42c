"""Derivatives of hard impacts: contacts 1e8 to 1e14 times stiffer than the bodies they stop, errors of 1e-6.

Figure of merit as in test_derivatives.py: the largest error over all entries relative to the largest entry. Impacts
without friction, with it, sticking and sliding, against planes, terrain and bodies, with restitution, behind joints.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import dojo_opt as dojo
from sim.mechanism.shapes import String
from support.jacobians import check_step, five_point
from support.parameter_case import kind_of
from support.scenes import block
from support.two_bodies import SHAPES, approaching, two

FREE = dojo.Joint("floating", None, "b")


def landing(
    mech: dojo.Mechanism, h: float, speed: float, kappa: float | None = None, turn=(1, 0.3, 0.2, 0.1)
) -> tuple[dojo.Simulator, np.ndarray]:
    """A state before landing: its next step brings the lowest contact to the ground, .7 of a step's way too early."""
    sim = dojo.Simulator(mech, h, kappa)
    x = np.array(sim.neutral())
    x[3:7] = np.array(turn) / np.linalg.norm(turn)
    x[2] += 3.0
    x[sim.nq : sim.nq + 3] = 0.3 * speed, 0.1 * speed, -speed
    for _ in range(8):  # gaps on terrain are not linear
        x[2] -= sim.step(x, throw=True).contacts.gap.min() - 5.0 * speed * h
    x[2] -= 5.7 * speed * h
    return sim, x


def meeting(mech: dojo.Mechanism, h: float, speed: float) -> tuple[dojo.Simulator, np.ndarray]:
    """Two bodies in the step in which they hit one another."""
    sim = dojo.Simulator(mech, h)
    x = approaching(sim, 3, 1.0)
    x[sim.nq :] *= 0.5 * speed
    for stepper in (sim.replace(time_step=max(h, 2e-3)), sim):  # long steps while they are far apart
        for _ in range(500):
            r = stepper.step(x, throw=True)
            if np.abs(r.contacts.impulse).max() > 0.05 * speed:
                break
            x = r.x
        else:
            raise AssertionError("they do not meet")
    return sim, x


def heavy(load: float) -> dojo.Mechanism:
    """A load on a leg; its foot of 1 kg stands on four points."""
    bodies = [
        dojo.Body("b", load, np.full(3, 0.1 * load)),
        dojo.Body("leg", 2.0, (0.1, 0.1, 0.02)),
        dojo.Body("foot", 1.0, np.full(3, 0.01)),
    ]
    joints = [
        FREE,
        dojo.Joint("revolute", "b", "leg", axis=(0, 1, 0), parent_point=(0, 0, -0.3), child_point=(0, 0, 0.4)),
        dojo.Joint("spherical", "leg", "foot", parent_point=(0, 0, -0.4), child_point=(0, 0, 0.1)),
    ]
    points = [(x, y, -0.05) for x in (-0.1, 0.1) for y in (-0.1, 0.1)]
    return dojo.Mechanism(bodies, joints, [dojo.Contact("foot", p, friction=0.8) for p in points])


def rope(h: float, speed: float) -> tuple[dojo.Simulator, np.ndarray]:
    """Two bodies apart, in the step in which the string between them becomes taut."""
    tie = dojo.Collision("a", "b", String(1.0), String(1.0), friction=0.0)
    sim = dojo.Simulator(replace(two(SHAPES["box"], SHAPES["box"]), collisions=[tie]), h)
    x = np.array(sim.neutral())
    x[7] = 1.0 - 0.3 * speed * h
    x[sim.nq :] = 0.1 * np.random.default_rng(1).normal(size=12)
    x[sim.nq], x[sim.nq + 6] = -0.5 * speed, 0.5 * speed
    return sim, x


HILL = dojo.Terrain(heights=0.3 * np.random.default_rng(0).normal(size=(8, 8)), origin=(-4, -4), spacing=(1.0, 1.0))
BALL = [dojo.Contact("b", (0.1, 0.05, -0.1), 0.1, terrain=HILL, friction=0.8)]
SCENES: dict[str, Callable[[float, float], tuple[dojo.Simulator, np.ndarray]]] = {
    **{law: (lambda h, v, law=law: landing(block(law=law, friction=0.8), h, v)) for law in ("linear", "impact")},
    "sticking": lambda h, v: landing(block(friction=1.0), h, v),
    "sticking, 1000 kg": lambda h, v: landing(block(mass=1000.0, friction=1.0), h, v),
    "sliding": lambda h, v: landing(block(friction=0.1), h, v),
    "on an edge": lambda h, v: landing(block(friction=0.8), h, v, turn=(1, 0.3, 0, 0)),
    "flat": lambda h, v: landing(block(friction=0.8), h, v, turn=(1, 0, 0, 0)),
    "on a slope": lambda h, v: landing(block(friction=0.8, normal=(0.3, -0.2, 0.9)), h, v),
    "kappa 1e-8": lambda h, v: landing(block(friction=0.8), h, v, 1e-8),
    "bouncing": lambda h, v: landing(block(friction=0.8, restitution=0.5), h, v),
    "bouncing, linear": lambda h, v: landing(block(friction=0.8, restitution=0.5, law="linear"), h, v),
    "bouncing, 1000 kg": lambda h, v: landing(block(mass=1e3, friction=0.8, restitution=0.9, law="linear"), h, v),
    "bouncing on a slope": lambda h, v: landing(block(friction=0.3, restitution=0.8, normal=(0.3, -0.2, 0.9)), h, v),
    "on terrain": lambda h, v: landing(dojo.Mechanism([dojo.Body("b", 1.0, np.full(3, 0.01))], [FREE], BALL), h, v),
    "bodies": lambda h, v: meeting(two(SHAPES["box"], SHAPES["sphere"]), h, v),
    "balls": lambda h, v: meeting(two(SHAPES["sphere"], SHAPES["sphere"]), h, v),
    "bodies, linear": lambda h, v: meeting(two(SHAPES["box"], SHAPES["box"], law="linear"), h, v),
    "a string": rope,
    "a load of 1000 kg": lambda h, v: landing(heavy(1000.0), h, v, turn=(1, 0.1, 0.05, 0.02)),
    "raiberthopper": lambda h, v: landing(dojo.models.raiberthopper(), h, v, turn=(1, 0.1, 0.1, 0.05)),
}


def check(sim: dojo.Simulator, x: np.ndarray) -> float:
    """A and B against differences; returns the largest impulse."""
    # an input of 1 N moves a load of 1000 kg by 1e-6 of an impact: its column has as much of the rounding of the impact
    return float(np.abs(check_step(sim, x, by_input=1e-5).contacts.impulse).max())


RATES = [(1e-3, 5.0), (1e-3, 20.0), (1e-4, 5.0)]  # time steps [s] and speeds [m/s]
ALL_RATES = ("sticking", "sliding", "bouncing", "bodies")  # of the others each has one of them, in turn


@pytest.mark.sweep(11)
@pytest.mark.parametrize(
    "name, h, speed",
    [
        (name, *rate)
        for k, name in enumerate(SCENES)
        for rate in (RATES if name in ALL_RATES else [RATES[k % len(RATES)]])
    ],
)
def test_impacts(name: str, h: float, speed: float) -> None:
    assert check(*SCENES[name](h, speed)) > 0.1


def test_random_impacts(rng: np.random.Generator) -> None:
    """Any block, any way up, on any of the laws."""
    for _ in range(12):
        mech = block(
            side=rng.uniform(0.1, 1.0),
            mass=10.0 ** rng.uniform(-1, 3),
            friction=rng.uniform(0.0, 1.5),
            law=str(rng.choice(["nonlinear", "linear"])),
            restitution=float(rng.choice([0.0, rng.uniform(0.1, 0.9)])),
        )
        kappa = float(rng.choice([1e-8, 1e-10])) if rng.random() < 0.5 else None
        check(*landing(mech, 10.0 ** rng.uniform(-4, -2), 10.0 ** rng.uniform(0, 1.5), kappa, rng.normal(size=4)))


def error_along(sim: dojo.Simulator, x: np.ndarray, seed: int) -> tuple[float, float]:
    """Error of A along a random direction, the best of three sizes of differences, and the accuracy that goes with A.

    Differences are of steps that are solved further than the one that is differentiated.
    """
    tight = sim.replace(tolerance=1e-13)
    here = tight.step(x, throw=True)
    linear = sim.linearize_trajectory(x[None], np.zeros((1, sim.nu)))
    d = np.random.default_rng(seed).normal(size=sim.ndx)
    slopes = [
        five_point(lambda e: sim.difference(tight.step(sim.integrate(x, e)).x, here.x), d, size)
        for size in (1e-5, 1e-6, 1e-7)
    ]
    off = min(float(np.abs(linear.A[0] @ d - slope).max()) for slope in slopes)
    return off / float(np.abs(linear.A[0]).max()), float(linear.accuracy[0])


@pytest.mark.parametrize("h, speed", [(1e-3, 5.0), (1e-2, 5.0), (1e-4, 10.0)])
@pytest.mark.parametrize("name", ["quadruped", "atlas", "humanoid"])
def test_robots_that_fall(name: str, h: float, speed: float) -> None:
    """Robots with parts of very different mass: to 1e-6, and no worse than the reported accuracy."""
    sim, x = landing(getattr(dojo.models, name)(), h, speed, turn=(1, 0.1, 0.1, 0.05))
    for seed in range(3):
        off, accuracy = error_along(sim, x, seed)
        assert off < 1e-6
        assert off < accuracy < 1e-5


def test_the_accuracy_includes_the_effect_of_a_load() -> None:
    """It grows with stiffness over inertia; far from contacts there is nothing to lose."""
    for load in (1e2, 1e4, 1e6):
        sim, x = landing(heavy(load), 1e-3, 10.0, turn=(1, 0.1, 0.05, 0.02))
        off, accuracy = error_along(sim, x, 0)
        assert off < accuracy < 1e-3
    sim, x = landing(block(), 1e-3, 5.0)
    soft = sim.linearize_trajectory(x[None], np.zeros((1, sim.nu)), kappa=1e-3).accuracy
    hard = sim.linearize_trajectory(x[None], np.zeros((1, sim.nu))).accuracy
    assert soft[0] < 3e-10 < 1e-7 < hard[0] < 1e-5
    x[2] += 5.0
    assert sim.linearize_trajectory(x[None], np.zeros((1, sim.nu))).accuracy[0] < 1e-10


@pytest.mark.sweep(2)
@pytest.mark.parametrize("name", ["sticking", "sliding", "bouncing", "on a slope", "bodies"])
def test_parameters_of_impacts(name: str) -> None:
    """To 1e-6 of the largest entry by their kind, or of 1: an impact that sticks hardly feels its friction."""
    sim, x = SCENES[name](1e-3, 5.0)
    here = sim.step(x, throw=True)
    for kind in ("mass", "friction", "com", "inertia"):
        names = [n for n in sim.parameters().names if kind_of(n) == kind]
        values = sim.parameters(names).values
        blocks = sim.linearize(x, wrt=names)
        J = np.concatenate([blocks[n] for n in names], axis=1)
        d = np.random.default_rng(2).uniform(0.5, 1.0, len(names)) * np.maximum(np.abs(values), 0.1)

        def change(p, names=names):
            return sim.difference(sim.with_parameters(dict(zip(names, p, strict=True))).step(x).x, here.x)

        slopes = [five_point(lambda e, values=values: change(values + e), d, size) for size in (1e-4, 1e-5)]  # noqa: B023
        off = min(float(np.abs(J @ d - slope).max()) for slope in slopes)
        assert off < 1e-6 * max(1.0, float(np.abs(J).max())), (kind, off)


@pytest.mark.parametrize("name", ["sticking", "bouncing", "bodies"])
def test_the_sweep_of_impacts(name: str, rng: np.random.Generator) -> None:
    """Backward through three steps, the first an impact, is the chain of their derivatives."""
    sim, x = SCENES[name](1e-3, 5.0)
    t = sim.rollout(x, np.zeros((3, sim.nu)), throw=True)
    loss = rng.normal(size=(4, sim.ndx))
    expected = loss[3]
    for k in (2, 1, 0):
        expected = sim.linearize(t.x[k])[0].T @ expected + loss[k]
    got = sim.vjp(t, loss, wrt=("state",))["state"]
    part = 2e-6 if name == "bodies" else 1e-6  # of three steps; one between bodies is right to 1e-6
    np.testing.assert_allclose(got, expected, rtol=0, atol=part * np.abs(expected).max())
