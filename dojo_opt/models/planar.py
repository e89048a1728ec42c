"""The base, limits and parts that the planar robots of OpenAI's gym have in common."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.models.links import Link, Mount, bodies, grounded, joints, touch
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism

Ball = tuple[str, str, ArrayLike, float]  # name, link, point in its frame [m], radius [m]


def planar_robot(
    name: str,
    links: Mapping[str, Link],
    mounts: Sequence[Mount],
    balls: Sequence[Ball],
    *,
    springs: Mapping[str, float],
    dampers: Mapping[str, float],
    base_damper: float,
    limits: bool,
    friction: float,
    law: str,
    gravity: ArrayLike,
) -> Mechanism:
    """A robot in the plane y = 0, standing; its first link, the torso, moves along x, along z and about y."""
    torso = next(iter(links))
    base = Joint(
        "planar_axis",
        None,
        torso,
        name="base",
        child_point=-np.asarray(links[torso].com),
        axis=(0.0, 1.0, 0.0),
        damper=base_damper,
    )
    legs = [replace(j, spring=springs[j.name], damper=dampers[j.name]) for j in joints(links, mounts, limits=limits)]
    contacts = [touch(links, link, point, r, label, friction=friction, law=law) for label, link, point, r in balls]
    inputs = [Input(j.name) for j in legs]
    mech = Mechanism(bodies(links), [base, *legs], contacts, inputs, gravity=gravity, name=name)
    return grounded(mech, mech.q_slice("base").start + 1)
