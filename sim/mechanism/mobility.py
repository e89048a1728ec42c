"""Mobility of the joints of a mechanism: velocities of their coordinates per impulse in them."""

from __future__ import annotations

import numpy as np

from sim.mechanism.body import Body
from sim.mechanism.joint import WORLD, Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import rotation_matrix
from solvers.types import Floats


def largest_mobility(mechanism: Mechanism) -> float:
    """An upper bound of the largest velocity of a coordinate per impulse in it [1/kg, 1/(kg m^2)].

        a^T (I_c^-1 + I_p^-1) a  of a rotation about a,    1/m_c + 1/m_p  of a translation

    c, p: the bodies that the joint connects. Others that hang on them only make them more inert. For a body without
    mass stand its neighbours beyond, the most mobile of them, turned about any axis. Translations from the world are
    omitted: they move the whole tree. So are joints without limits where nothing touches anything.
    """
    bodies = {body.name: body for body in mechanism.bodies}
    parents = {joint.child: str(joint.parent) for joint in mechanism.joints if joint.parent not in (None, WORLD)}
    above = {child: [parent] for child, parent in parents.items()}
    below: dict[str, list[str]] = {}
    for child, parent in parents.items():
        below.setdefault(parent, []).append(child)
    touches = bool(mechanism.contacts or mechanism.collisions)
    most = 0.0
    for joint in mechanism.joints:
        stops = joint.cone is not None or any(np.isfinite(pair).any() for pair in joint.limits or ())
        if touches or stops:
            ends = [_mobility(bodies, joint.child, below, np.eye(3))]
            if joint.child in parents:
                ends.append(_mobility(bodies, parents[joint.child], above, rotation_matrix(joint.orientation)))
            most = max(most, _of_joint(joint, ends))
    return most


def _mobility(bodies: dict[str, Body], name: str, following: dict[str, list[str]], R: Floats) -> tuple[Floats, float]:
    """(R^T I^-1 R, 1/m) of a body, or bounds of those of the first ones that follow it and have a mass."""
    body = bodies[name]
    if body.mass > 0.0:
        return R.T @ np.linalg.inv(np.asarray(body.inertia, dtype=np.float64)) @ R, 1.0 / body.mass
    found = [_mobility(bodies, other, following, np.eye(3)) for other in following.get(name, ())]
    turn = max((float(np.linalg.eigvalsh(turns)[-1]) for turns, _ in found), default=0.0)
    return turn * np.eye(3), max((moves for _, moves in found), default=0.0)


def _of_joint(joint: Joint, ends: list[tuple[Floats, float]]) -> float:
    """Mobility of one joint; ends: of its child, and of its parent where that is not the world."""
    turns, moves = sum(turns for turns, _ in ends), sum(moves for _, moves in ends)
    axis = np.asarray(joint.axis, dtype=np.float64)
    if joint.nrot == 0:
        turn = 0.0
    else:
        turn = float(axis @ turns @ axis) if joint.nrot == 1 else float(np.linalg.eigvalsh(turns)[-1])
    return max(turn, moves if joint.ntrans and len(ends) > 1 else 0.0)
