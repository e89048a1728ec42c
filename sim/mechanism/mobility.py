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

    c, p: the bodies that the joint connects. Others that hang on them only make them more inert. Bodies without mass
    stand for their neighbours. Translations from the world are omitted: they move the whole tree. So are joints without
    limits where nothing touches anything.
    """
    bodies = {body.name: body for body in mechanism.bodies}
    children: dict[str, str] = {}
    parents = {joint.child: str(joint.parent) for joint in mechanism.joints if joint.parent not in (None, WORLD)}
    for child, parent in parents.items():
        children.setdefault(parent, child)
    touches = bool(mechanism.contacts or mechanism.collisions)
    most = 0.0
    for joint in mechanism.joints:
        stops = joint.cone is not None or any(np.isfinite(pair).any() for pair in joint.limits or ())
        if touches or stops:
            ends = [(_with_mass(bodies, joint.child, children), 1.0)]
            if joint.child in parents:
                ends.append((_with_mass(bodies, parents[joint.child], parents), -1.0))
            most = max(most, _mobility(joint, ends))
    return most


def _with_mass(bodies: dict[str, Body], name: str, following: dict[str, str]) -> Body | None:
    """The body, or the first one that follows it and has a mass; None without one."""
    while bodies[name].mass == 0.0:
        if name not in following:
            return None
        name = following[name]
    return bodies[name]


def _mobility(joint: Joint, ends: list[tuple[Body | None, float]]) -> float:
    """Mobility of one joint; ends: the child, with 1, and the parent, with -1, where it is not the world."""
    turns, moves = np.zeros((3, 3)), 0.0
    for body, side in ends:
        if body is None:
            continue
        inverse: Floats = np.linalg.inv(np.asarray(body.inertia, dtype=np.float64))
        R = np.eye(3) if side > 0.0 else rotation_matrix(joint.orientation)
        turns += R.T @ inverse @ R
        moves += 1.0 / body.mass
    if joint.nrot == 0:
        turns[:] = 0.0
    axis = np.asarray(joint.axis, dtype=np.float64)
    turn = float(axis @ turns @ axis) if joint.nrot == 1 else float(np.linalg.eigvalsh(turns)[-1])
    return max(turn, moves if joint.ntrans and len(ends) > 1 else 0.0)
