"""Mechanisms that move smoothly, for steps of order 4, 6 and 8."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import dojo_opt as dojo
from sim.mechanism.input import Input
from sim.mechanism.joint import KINDS, Joint
from sim.mechanism.mechanism import Mechanism
from support.mechanisms import random_body, random_state, unit_quaternion

ORDERS = (4, 6, 8)


def branch(kind: str, on_world: bool, *, spring: float = 3.0, damper: float = 0.0, free: bool = False) -> Mechanism:
    """A joint of one kind with a branch behind it, every frame skewed, pushed by inputs of every sort."""
    rng = np.random.default_rng(4)
    names = ["a", "b", "c"]
    kinds = [kind, "revolute", "spherical"] if on_world else ["floating", kind, "revolute"]

    def joint(k: int) -> Joint:
        n = sum(KINDS[kinds[k]])
        loose = free or kinds[k] == "floating"
        return Joint(
            kinds[k], None if k == 0 else "a", names[k], parent_point=0.3 * rng.normal(size=3),
            child_point=0.3 * rng.normal(size=3), axis=rng.normal(size=3), orientation=unit_quaternion(rng),
            spring=0.0 if loose else spring, damper=0.0 if loose else damper, rest=0.2 * rng.normal(size=n),
            pitch=1.2 if kinds[k] == "screw" else 0.0,
        )  # fmt: skip

    inputs = [
        Input("joint1", dof=0) if sum(KINDS[kinds[1]]) else Input(body="b", force=(0, 1, 0)),
        Input(body="c", force=(1.0, 0.5, -2.0), torque=(0.1, 0.2, 0.3), frame="body"),
        Input(body="b", force=(0.3, 0.1, -0.4), torque=(0.3, -0.2, 0.1), frame="world"),
    ]
    joints = [replace(joint(k), name=f"joint{k}") for k in range(3)]
    return Mechanism([random_body(rng, n) for n in names], joints, inputs=inputs)


def end(mech: Mechanism, order: int, h: float, duration: float, u: np.ndarray | None = None) -> np.ndarray:
    sim = dojo.Simulator(mech, time_step=h, order=order, tolerance=1e-13)
    q, v = random_state(np.random.default_rng(3), mech, speed=1.0)
    steps = round(duration / h)
    us = np.zeros((steps, sim.nu)) if u is None else np.tile(u, (steps, 1))
    return np.asarray(sim.rollout(sim.state_from_velocity(q, v), us, throw=True).x[-1])


def apart(mech: Mechanism, a: np.ndarray, b: np.ndarray) -> float:
    return float(np.abs(dojo.Simulator(mech, time_step=1.0).difference(a, b)).max())
