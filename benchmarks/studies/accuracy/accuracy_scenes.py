"""The scenes of the accuracy study: a free body, a tree in space, and hanging chains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import dojo_opt as dojo
from dojo_opt.report.accuracy.reference import TreeReference, pendulum
from dojo_opt.report.accuracy.smooth_scene import Floats, SmoothScene, kinetic_energy, model_of


def free_body(duration: float) -> SmoothScene:
    """S1: an asymmetric body about its middle axis, which is unstable, at 5 rad/s."""
    body = dojo.Body("body", 1.0, (0.1, 0.2, 0.3))
    mech = dojo.Mechanism([body], [dojo.Joint("floating", None, "body")], gravity=(0, 0, 0), name="free body")
    q, v = np.array(mech.neutral, dtype=np.float64), np.array([0.0, 0.0, 0.0, 0.01, 5.0, 0.01])
    return SmoothScene(
        "free body", mech, q, v, duration, kinetic_energy(mech, q, v), True, TreeReference(model_of(mech)).run
    )


def tree(duration: float) -> SmoothScene:
    """S2: thirteen bodies, a trunk with four legs of three hinges, 15.84 J of random motion in space."""
    mech = replace(dojo.models.quadruped(damper=0.0, limits=False, gravity=(0, 0, 0)), contacts=(), name="tree")
    rng = np.random.default_rng(1)
    q = np.array(mech.neutral, dtype=np.float64)
    q[:3] = 0.0
    q[7:] += 0.3 * rng.normal(size=12)
    v = rng.normal(size=18)
    v *= np.sqrt(15.84 / kinetic_energy(mech, q, v))
    return SmoothScene("tree of 13 bodies", mech, q, v, duration, 15.84, True, TreeReference(model_of(mech)).run)


def chain(links: int) -> SmoothScene:
    """S5: a pendulum of 2 m and 2 kg in all, released from the horizontal, for one second."""
    mech = dojo.models.npendulum(links, length=2.0 / links, mass=2.0 / links, width=0.01)
    q = np.zeros(links)
    q[0] = 0.5 * np.pi
    model = model_of(mech)

    def exact(q: Floats, v: Floats, times: Floats) -> tuple[Floats, Floats]:
        return pendulum(model, q, v, times)

    return SmoothScene(f"pendulum of {links}", mech, q, np.zeros(links), 1.0, 2.0 * 9.81 * 2.0, False, exact)
