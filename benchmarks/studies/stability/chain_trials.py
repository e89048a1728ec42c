"""Trials of chains: undamped and long, with a heavy tip, of links from millimetres to metres, thrown on the ground."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi

import numpy as np

from benchmarks.studies.stability import scene_measures
from dojo_opt.report.stability import measures
from dojo_opt.report.stability.trial import StabilityTrial
from sim.mechanism.body import Body
from sim.mechanism.contact import Contact
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism

G = 9.81  # [m/s^2]
WHY = "tension acts along the links at the start of a step, which limits h to 2/omega, omega = 2 sqrt(tension / (m l))"
LENGTH, MASS, RADIUS = 2.0, 2.0, 0.005  # of a whole chain [m], [kg]; of its rods [m]


def rods(
    lengths: Sequence[float], masses: Sequence[float], *, floating: bool = False, damper: float = 0.0
) -> Mechanism:
    """Rods on hinges about y, hanging from the origin at zero angles; floating: free, with a ball at every middle."""
    bodies, joints = [], []
    for i, (length, mass) in enumerate(zip(lengths, masses, strict=True)):
        across = mass * (length**2 / 12.0 + RADIUS**2 / 4.0)
        bodies.append(Body(f"rod_{i}", mass, (across, across, mass * RADIUS**2 / 2.0)))
        if i == 0 and floating:
            joints.append(Joint("floating", None, "rod_0"))
            continue
        above = (0.0, 0.0, -lengths[i - 1] / 2.0) if i else (0.0, 0.0, 0.0)
        parent, below = f"rod_{i - 1}" if i else None, (0.0, 0.0, length / 2.0)
        hinge = Joint("revolute", parent, f"rod_{i}", "", above, below, axis=(0.0, 1.0, 0.0), damper=damper)
        joints.append(hinge)
    touching = [Contact(f"rod_{i}", radius=length / 4.0) for i, length in enumerate(lengths)] if floating else []
    return Mechanism(bodies, joints, touching, inputs=[])


def pendulum(
    links: int, time_step: float, duration: float, *, slow: bool, peer_duration: float = 0.0
) -> StabilityTrial:
    """An undamped chain of 2 m and 2 kg released from the horizontal."""
    mechanism = rods([LENGTH / links] * links, [MASS / links] * links)
    scale = MASS * G * LENGTH
    return StabilityTrial(
        "long chains",
        f"{links} undamped links, {duration:g} s at {1e3 * time_step:g} ms",
        "energy off by at most 5 % of m g L",
        mechanism,
        np.r_[-pi / 2.0, np.zeros(links - 1)],
        np.zeros(links),
        time_step,
        duration,
        scene_measures.energy_error(scale),
        0.05,
        samples=round(duration / 0.01),
        why=WHY,
        peer_duration=peer_duration,
        slow=slow,
    )


def heavy_tip(ratio: float, time_step: float, *, angle: float, refusal: str = "", slow: bool = False) -> StabilityTrial:
    """Ten links of 0.2 m and 0.2 kg in a straight line, the last one heavier; released at `angle` from below.

    From 90 degrees links become slack, and snap taut with all the energy of the tip.
    """
    mechanism = rods([0.2] * 10, [0.2] * 9 + [0.2 * ratio])
    return StabilityTrial(
        "mass ratio",
        f"tip {ratio:g} times heavier, from {np.rad2deg(angle):.0f} degrees, 5 s at {1e3 * time_step:g} ms",
        "refused as a whole: a step does not reach its tolerance" if refusal else "energy off by at most 1 % of m g L",
        mechanism,
        np.r_[-angle, np.zeros(9)],
        np.zeros(10),
        time_step,
        5.0,
        scene_measures.energy_error(0.2 * ratio * G * 2.0),
        0.01,
        samples=500,
        why=WHY,
        refusal=refusal,
        peer_duration=min(5.0, 25_000 * time_step),
        slow=slow,
    )


def lengths() -> StabilityTrial:
    """A rod of 10 m, one of 0.1 m and one of 1 mm on one another."""
    sizes = [10.0, 0.1, 1e-3]
    return StabilityTrial(
        "lengths",
        "rods of 10 m, 0.1 m and 1 mm on one another, 1 kg per metre, at 1 ms",
        "energy off by at most 0.1 % of m g L",
        rods(sizes, sizes),
        (-pi / 2.0, 0.5, 0.5),
        np.zeros(3),
        1e-3,
        10.0,
        scene_measures.energy_error(10.0 * G * 10.0),
        1e-3,
        samples=1000,
    )


def on_the_ground(time_step: float) -> StabilityTrial:
    """A free chain of 100 links, damped by 1e-3 N m s/rad, falling on the ground at 60 degrees."""
    mechanism = rods([0.02] * 100, [0.02] * 100, floating=True, damper=1e-3)
    tilt = pi / 3.0
    low = 0.01 * np.cos(tilt) + 1.99 * np.cos(tilt)
    q = np.r_[0.0, 0.0, low + 0.2, np.cos(tilt / 2.0), 0.0, np.sin(tilt / 2.0), 0.0, np.zeros(99)]
    return StabilityTrial(
        "long chains",
        f"100 links fall on the ground, 100 contacts, at {1e3 * time_step:g} ms",
        "no gain of energy (0.1 % of that at the start), no penetration (1e-8 m)",
        mechanism,
        q,
        np.zeros(105),
        time_step,
        2.0,
        measures.growth_and_penetration(1e-3 * MASS * G * 0.7, 1e-8),
        1.0,
        samples=200,
        peer_duration=2.0 if time_step > 5e-3 else 0.5,
    )


def trials() -> list[StabilityTrial]:
    """All trials of chains."""
    return [
        heavy_tip(5e2, 5e-4, angle=pi / 2.0),
        heavy_tip(5e4, 2e-4, angle=0.5),
        heavy_tip(5e4, 1e-4, angle=pi / 2.0, refusal="tolerance"),
        heavy_tip(5e6, 2e-5, angle=0.5, slow=True),
        lengths(),
        pendulum(10, 1e-3, 10.0, slow=False),
        pendulum(10, 1e-3, 100.0, slow=True, peer_duration=20.0),
        pendulum(50, 2e-4, 100.0, slow=True, peer_duration=1.0),
        pendulum(100, 1e-4, 100.0, slow=True, peer_duration=0.2),
        on_the_ground(1e-2),
        on_the_ground(1e-3),
    ]
