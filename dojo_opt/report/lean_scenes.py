"""Scenes of the report `lean`: one pendulum, to which features are added one by one; and a robot without its features.

Every scene is a mechanism with a state in motion; the pendulum swings, and its tip slides over the floor when it has
contacts that are near.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_opt.models import pendulum
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.parts import Contact
from sim.simulator.simulator import Simulator

MANY = 100  # contacts at once
FAR = 50.0  # [m] to the wall that they might touch
TIME_STEP = 0.01
DISTANCES = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)  # [m] of the wall
KAPPAS = (1e-4, 1e-6, 1e-8)  # [N s m]


@dataclass(frozen=True)
class Scene:
    """A mechanism in motion."""

    name: str
    simulator: Simulator
    state: NDArray[np.float64]  # (nx,)


def pendulum_scene(name: str, mechanism: Mechanism, kappa: float = 1e-6) -> Scene:
    """The pendulum passing its lowest point at 0.5 rad/s: contacts at its tip are within a tenth of its length."""
    return Scene(name, Simulator(mechanism, time_step=TIME_STEP, kappa=kappa), np.array([-0.1, 0.5]))


def robot_scene(name: str, mechanism: Mechanism, time_step: float) -> Scene:
    """A robot in its neutral state, nothing held."""
    simulator = Simulator(mechanism, time_step=time_step)
    return Scene(name, simulator, simulator.neutral())


def with_joints(mechanism: Mechanism, **features: Any) -> Mechanism:
    """The same with these fields of all joints that are not floating."""
    joints = [j if j.kind == "floating" else replace(j, **features) for j in mechanism.joints]
    return replace(mechanism, joints=joints)


def with_contacts(mechanism: Mechanism, contacts: Sequence[Contact]) -> Mechanism:
    """The same with more contacts."""
    return replace(mechanism, contacts=[*mechanism.contacts, *contacts])


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
    """The pendulum, each with everything of the one before and one feature more; many contacts come last, twice."""
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
    """(what, a mechanism that never had the feature, one that mentions it and does not have it)."""
    plain = pendulum()
    tip = with_contacts(plain, [Contact("link_0", (0.0, 0.0, -0.5), law="impact", friction=0.0)])
    none = {"spring": 0.0, "damper": 0.0, "limits": (-np.inf, np.inf)}
    return [
        ("spring, damper and limits of a joint", plain, with_joints(plain, **none)),
        ("friction of a contact", tip, replace(tip, contacts=[replace(tip.contacts[0], law="nonlinear")])),
    ]


def without(mechanism: Mechanism) -> list[tuple[str, Mechanism]]:
    """A robot, then the robot without each of its features, and without all of them."""
    joints, contacts = mechanism.joints, mechanism.contacts
    has = {
        "limits": any(np.isfinite(b) for j in joints for pair in j.limits or () for b in pair),
        "spring": any(np.any(np.asarray(j.spring)) for j in joints),
        "damper": any(np.any(np.asarray(j.damper)) for j in joints),
    }
    blank = {"limits": None, "spring": 0.0, "damper": 0.0}
    out = [("as it is", mechanism)]
    if any(c.friction > 0.0 for c in contacts):
        smooth = [replace(c, friction=0.0) for c in contacts]
        out.append(("without friction", replace(mechanism, contacts=smooth)))
    if contacts:
        out.append(("without contacts", replace(mechanism, contacts=())))
    out += [(f"without {name}", with_joints(mechanism, **{name: blank[name]})) for name in has if has[name]]
    if len(out) > 2:
        out.append(("without all of these", with_joints(replace(mechanism, contacts=()), **blank)))
    return out
