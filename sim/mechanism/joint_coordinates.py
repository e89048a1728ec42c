"""Coordinates of joints, one after the other: their limits, and values given by joint."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from sim.mechanism import checks
from sim.mechanism.joint import Joint
from solvers.types import Floats

__all__ = ["coordinate_limits", "coordinates", "joint_places"]


def joint_places(joints: Sequence[Joint]) -> Iterator[tuple[Joint, slice, slice]]:
    """Each joint, and its places in q (nq,) and v (nv,)."""
    q = v = 0
    for joint in joints:
        yield joint, slice(q, q := q + joint.nq), slice(v, v := v + joint.nv)


def coordinate_limits(joints: Sequence[Joint]) -> tuple[Floats, Floats]:
    """(lower, upper) limits, (nq,) each, read-only; infinite where there are none, as for quaternions [m, rad]."""
    out = np.tile([[-np.inf], [np.inf]], sum(joint.nq for joint in joints))
    for joint, at, _ in joint_places(joints):
        count = joint.scalar_count
        if joint.limits and count:
            out[:, at.start : at.start + count] = np.transpose(joint.limits[:count])
    out.flags.writeable = False
    return out[0], out[1]


def coordinates(call: str, joints: Sequence[Joint], given: Any) -> tuple[float, ...]:
    """q (nq,) from a dict by joint, zero and unit quaternions for the others, or from a vector.

    Quaternions are normalised.

    Raises:
        TypeError, ValueError: an unknown joint, or values of the wrong shape; `call` is its place in the message.
    """
    q = np.zeros(sum(joint.nq for joint in joints))
    table = {} if given is None else given
    if isinstance(table, Mapping):
        names = dict.fromkeys(joint.name for joint in joints)  # a file may have thousands
        for name in table:
            checks.one_of(f"{call}: joint", name, names)
    else:
        values = checks.array(call, table, (len(q),))
        table = {joint.name: values[at] for joint, at, _ in joint_places(joints)}
    for joint, at, _ in joint_places(joints):
        if joint.nrot == 3:
            q[at.stop - 4] = 1.0
        if joint.name in table:
            value = checks.array(f"{call}: joint {joint.name!r}", np.atleast_1d(table[joint.name]), (joint.nq,))
            q[at] = value
            if joint.nrot == 3:
                q[at.stop - 4 : at.stop] = checks.quaternion(f"{call}: joint {joint.name!r}", value[-4:])
    return tuple(float(x) for x in q)
