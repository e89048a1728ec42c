"""The scenes of the study `lean`: a pendulum to which features are added one by one.

The pendulum swings, and its tip slides over the floor if it has contacts that are near.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dojo_opt.models import pendulum
from dojo_opt.report.lean.feature_variants import with_contacts, with_joints
from dojo_opt.report.step_cost import CostScene
from sim.mechanism.contact import Contact
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator

MANY = 100  # contacts at once
FAR = 50.0  # [m] to the wall that they might touch
TIME_STEP = 0.01
DISTANCES = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)  # [m] of the wall
KAPPAS = (1e-4, 1e-6, 1e-8)  # [N s m]


def pendulum_scene(name: str, mechanism: Mechanism, kappa: float = 1e-6) -> CostScene:
    """The pendulum passing its lowest point at 0.5 rad/s: contacts at its tip are within a tenth of its length."""
    return CostScene(name, Simulator(mechanism, time_step=TIME_STEP, kappa=kappa), np.array([-0.1, 0.5]))


def along(mechanism: Mechanism, count: int, *, friction: float, distance: float | None) -> Mechanism:
    """The pendulum with more points along its lower half: over the floor, or facing a wall at this distance [m]."""
    kind, normal, height = ("floor", (0.0, 0.0, 1.0), 0.0) if distance is None else ("wall", (0.0, 1.0, 0.0), -distance)
    points = [
        Contact(
            "link_0",
            (0.0, 0.0, -0.5 * (k + 1.0) / count),
            friction=friction,
            normal=normal,
            height=height,
            name=f"{kind} {k}",
        )
        for k in range(count)
    ]
    return with_contacts(mechanism, points)


def features() -> list[tuple[str, Mechanism]]:
    """Pendulums, each with the features of the previous one and one more; many contacts come last, twice."""
    plain = pendulum()
    limit = with_joints(plain, limits=(-1.0, 1.0))
    spring = with_joints(limit, spring=2.0)
    floor = with_contacts(spring, [Contact("link_0", (0.0, 0.0, -0.5), friction=0.0, name="tip")])
    cone = replace(floor, contacts=[replace(floor.contacts[0], friction=0.5)])
    return [
        ("pendulum", plain),
        ("+ limit", limit),
        ("+ spring", spring),
        ("+ frictionless contact", floor),
        ("+ cone", cone),
        (f"+ {MANY} far contacts", along(cone, MANY, friction=0.5, distance=FAR)),
        (f"+ {MANY} near instead", along(cone, MANY, friction=0.5, distance=None)),
    ]


def absent() -> list[tuple[str, Mechanism, Mechanism]]:
    """(feature, a mechanism that never had it, one that mentions it and does not have it)."""
    plain = pendulum()
    tip = with_contacts(plain, [Contact("link_0", (0.0, 0.0, -0.5), law="impact", friction=0.0)])
    none = {"spring": 0.0, "damper": 0.0, "limits": (-np.inf, np.inf)}
    return [
        ("spring, damper and limits of a joint", plain, with_joints(plain, **none)),
        ("friction of a contact", tip, replace(tip, contacts=[replace(tip.contacts[0], law="nonlinear")])),
    ]
