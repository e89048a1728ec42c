"""Springs, dampers, limits of a joint as a user gives them, one value per degree of freedom; checked."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from sim import checks

if TYPE_CHECKING:
    from sim.parts import Joint


def per_dof(call: str, joint: Joint, field: str) -> tuple[float, ...]:
    """One value per degree of freedom."""
    call, value = f"{call}, {field}=...)", getattr(joint, field)
    if np.ndim(value) == 0:
        values = (checks.number(call, value),) * joint.nv
        if field == "rest" and joint.nrot == 3 and any(values):
            raise ValueError(f"{call}: expected {joint.nv} numbers, the last three a rotation vector, got {value!r}")
    else:
        values = checks.vector(call, value, joint.nv)
    if field != "rest" and any(x < 0.0 for x in values):
        raise ValueError(f"{call}: expected numbers >= 0, got {value!r}")
    if field == "armature" and joint.nrot == 3 and any(values[-3:]):
        raise ValueError(f"{call}: the rotations of a quaternion joint have none, got {value!r}")
    if field == "spring" and joint.nrot == 3 and len(set(values[-3:])) > 1:
        raise ValueError(f"{call}: a quaternion joint has one spring constant for its three rotations, got {value!r}")
    return values


def limits_of(call: str, joint: Joint) -> tuple[tuple[float, float], ...]:
    """One (lo, hi) per degree of freedom, infinite where there is none."""
    free = (-np.inf, np.inf)
    given = joint.limits
    if given is None:
        return (free,) * joint.nv
    if not hasattr(given, "__len__"):
        raise ValueError(f"{call}: expected (lo, hi), or one such pair per degree of freedom, got {given!r}")
    if len(given) == 2 and all(np.ndim(x) == 0 for x in given) and (joint.nv == 1 or any(x is not None for x in given)):
        given = (given,)
    if len(given) != joint.nv:
        raise ValueError(f"{call}: expected {joint.nv} pairs (lo, hi), one per degree of freedom, got {len(given)}")
    out = []
    for dof, pair in enumerate(given):
        lo, hi = bounds(call, free if pair is None else pair)
        if joint.nrot == 3 and dof >= joint.ntrans and (lo, hi) != free:
            raise ValueError(
                f"{call}: the three rotations of a {joint.kind} joint have no bounds; cone=... limits them"
            )
        out.append((lo, hi))
    return tuple(out)


def cone_of(call: str, joint: Joint) -> float | None:
    """The largest angle of a cone, between 0 and pi, on kinds with three rotations."""
    if joint.cone is None:
        return None
    if joint.nrot != 3:
        raise ValueError(f"{call}: a {joint.kind} joint has no three rotations to limit; see limits=...")
    angle = checks.number(call, joint.cone, above=0.0)
    if angle > 3.1:
        raise ValueError(f"{call}: expected an angle below 3.1 rad, got {angle:g}")
    return angle


def bounds(call: str, pair: Any) -> tuple[float, float]:
    """(lo, hi) with lo < hi; None stands for no bound."""
    try:
        lo, hi = (float(x) if x is not None else s * np.inf for x, s in zip(pair, (-1, 1), strict=True))
    except (TypeError, ValueError):
        raise ValueError(f"{call}: expected a pair (lo, hi), got {pair!r}") from None
    if not lo < hi or lo == np.inf or hi == -np.inf:
        raise ValueError(f"{call}: expected lo < hi, got ({lo:g}, {hi:g})")
    return lo, hi
