"""Names of degrees of freedom, and the components of a perturbation dx with these names."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from sim.mechanism import checks
from sim.mechanism.joint import Joint
from solvers.types import Integers

_RATE = "v "  # before the name of a degree of freedom: its velocity


def dof_names(joints: Sequence[Joint]) -> tuple[str, ...]:
    """One name per degree of freedom, (nv,): "knee" of a hinge, "base x" to "base rz" of a floating base."""
    return tuple(f"{joint.name} {part}".strip() for joint in joints for part in _parts(joint))


def _parts(joint: Joint) -> list[str]:
    """Names of the degrees of freedom of one joint: directions of its frame, then rotations about them."""
    if joint.nv == 1:
        return [""]
    along = "xyz"
    if joint.ntrans == 2:  # without the direction that is nearest to the axis
        along = along.replace(along[int(np.argmax(np.abs(np.asarray(joint.axis))))], "")
    slides = ["slide"] if joint.ntrans == 1 else list(along[: joint.ntrans])
    turns = {0: [], 1: ["angle"], 2: ["r1", "r2"], 3: ["rx", "ry", "rz"]}[joint.nrot]
    return [*slides, *turns]


def components(call: str, joints: Sequence[Joint], names: str | Iterable[str]) -> Integers:
    """Numbers in dx = [dq; dv] of joints and degrees of freedom, in the order of the names.

    "body" is all of a joint, "body x" one of its degrees of freedom, "v body", "v body x" their velocities; "q", "v"
    are all coordinates and all velocities.
    """
    parts = dof_names(joints)
    spans: dict[str, list[int]] = {"q": list(range(len(parts)))}
    spans |= {name: [i] for i, name in enumerate(parts)}
    stop = 0
    for joint in joints:
        spans[joint.name] = list(range(stop, stop := stop + joint.nv))
    rates = {"v" if name == "q" else _RATE + name: [len(parts) + i for i in span] for name, span in spans.items()}
    known = spans | rates
    chosen = (names,) if isinstance(names, str) else checks.names(call, names)
    return np.array([i for name in chosen for i in known[_known(call, name, known)]], dtype=np.int64)


def _known(call: str, name: object, known: dict[str, list[int]]) -> str:
    """The name, when there is such a joint or degree of freedom; the velocities are not listed, but found."""
    if not isinstance(name, str) or name not in known:
        listed = [word for word in known if not word.startswith(_RATE)]
        close = checks.nearest(name, known)
        raise ValueError(
            f"{call}: {name!r} is not one of: {', '.join(listed)}; before each, 'v ' for its velocity{close}"
        )
    return name
