"""Planar four-bars on the ground: one with a loop that may be cut at any of its joints, and one of any lengths."""

from __future__ import annotations

from typing import Any

import numpy as np

import dojo_opt as dojo
from sim.mechanism.body import Body
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box

Y = (0.0, 1.0, 0.0)
CRANK, COUPLER, ROCKER = 0.5, 1.0, 0.8  # [m]; the ground is 1 m long


def bar(name: str, length: float) -> Body:
    return Body(name, 2.0 * length, shape=Box(x=length, y=0.05, z=0.05))


def fourbar(cut: str, inputs: tuple[str, ...] = (), **action: Any) -> Mechanism:
    """Crank and rocker on the ground, the coupler between them; `cut` closes the loop, "pin" acts."""
    ends = {
        "crank": (None, "crank", (0, 0, 0), (-CRANK / 2, 0, 0)),
        "coupler": ("crank", "coupler", (CRANK / 2, 0, 0), (-COUPLER / 2, 0, 0)),
        "pin": ("coupler", "rocker", (COUPLER / 2, 0, 0), (ROCKER / 2, 0, 0)),
        "rocker": (None, "rocker", (1.0, 0, 0), (-ROCKER / 2, 0, 0)),
    }
    joints = [
        Joint("revolute", *e[:2], name, *e[2:], axis=Y, close=name == cut, **(action if name == "pin" else {}))
        for name, e in ends.items()
    ]
    neutral = {"crank": -1.0, "coupler": 0.6, "rocker": -1.2, "pin": -0.6}
    bodies = [bar("crank", CRANK), bar("coupler", COUPLER), bar("rocker", ROCKER)]
    known = {name: q for name, q in neutral.items() if name != cut}
    return Mechanism(bodies, joints, inputs=[Input(name) for name in inputs], neutral=known)


def plain_fourbar(
    crank: float = 0.5, coupler: float = 1.0, rocker: float = 0.8, ground: float = 1.0, kind: str = "revolute"
) -> Mechanism:
    """Crank and rocker on the ground, the coupler between them."""
    bodies = [bar("crank", crank), bar("coupler", coupler), bar("rocker", rocker)]
    joints = [
        Joint("revolute", None, "crank", child_point=(-crank / 2, 0, 0), axis=Y),
        Joint("revolute", "crank", "coupler", parent_point=(crank / 2, 0, 0), child_point=(-coupler / 2, 0, 0), axis=Y),
        Joint("revolute", None, "rocker", parent_point=(ground, 0, 0), child_point=(-rocker / 2, 0, 0), axis=Y),
        Joint(kind, "coupler", "rocker", "pin", (coupler / 2, 0, 0), (rocker / 2, 0, 0), axis=Y, close=True),
    ]
    return Mechanism(bodies, joints, neutral={"crank": -1.0, "coupler": 0.6, "rocker": -1.2}, name="fourbar")


def worst_gap(sim: dojo.Simulator, x: np.ndarray) -> float:
    return max(float(np.abs(gap).max()) for gap in sim.loop_gaps(x).values())
