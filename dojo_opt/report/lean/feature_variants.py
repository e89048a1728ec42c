"""A robot without each of its features."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from dojo_opt.report.step_cost import CostScene
from sim.mechanism.contact import Contact
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator


def robot_scene(name: str, mechanism: Mechanism, time_step: float) -> CostScene:
    """A robot in its neutral state, nothing held."""
    simulator = Simulator(mechanism, time_step=time_step)
    return CostScene(name, simulator, simulator.neutral())


def with_joints(mechanism: Mechanism, **features: Any) -> Mechanism:
    """The mechanism with these fields of all joints that are not floating."""
    joints = [j if j.kind == "floating" else replace(j, **features) for j in mechanism.joints]
    return replace(mechanism, joints=joints)


def with_contacts(mechanism: Mechanism, contacts: Sequence[Contact]) -> Mechanism:
    """The mechanism with more contacts."""
    return replace(mechanism, contacts=[*mechanism.contacts, *contacts])


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
