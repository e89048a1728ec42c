"""Gear: a joint coordinate that follows another one."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import KW_ONLY, dataclass

import numpy as np
from numpy.typing import ArrayLike

from sim.mechanism import checks
from sim.mechanism.joint import Joint
from sim.mechanism.joint_coordinates import joint_places
from sim.mechanism.positional import few_positional


@few_positional
@dataclass(frozen=True)
class Gear:
    """q[joint] = ratio q[other] + offset: toothed wheels, belts, a rack, a mimic joint.

    The gear acts on both coordinates like two motors: on their children, and in the opposite direction on their
    parents. Quaternions have no gears.

    Attributes:
        joint: name of the driven joint.
        other: name of the driving joint.
        ratio: ratio of the coordinates [rad/rad, m/rad, ...] (default 1).
        offset: offset of the driven coordinate [m, rad] (default 0).
        dof: number of the coordinate of `joint`, for joints with several (default 0).
        other_dof: number of the coordinate of `other` (default 0).
        name: name of the gear (default that of `joint`).

    Raises:
        ValueError: for an empty name, or a number that is not finite.
    """

    joint: str
    other: str
    ratio: float = 1.0
    offset: float = 0.0
    _: KW_ONLY
    dof: int = 0
    other_dof: int = 0
    name: str = ""

    def __post_init__(self) -> None:
        checks.name("Gear(joint=...)", self.joint)
        checks.name("Gear(other=...)", self.other)
        object.__setattr__(self, "name", checks.name_or("Gear(name=...)", self.name, self.joint))
        call = f"Gear({self.name!r}"
        for field in ("dof", "other_dof"):
            checks.whole_number(f"{call}, {field}=...)", getattr(self, field), 0)
        for field in ("ratio", "offset"):
            object.__setattr__(self, field, checks.number(f"{call}, {field}=...)", getattr(self, field)))


def check_gears(call: str, gears: Sequence[Gear], joints: Sequence[Joint]) -> None:
    """Refuse gears between coordinates that are not there, or are one."""
    by_name = {j.name: j for j in joints}
    checks.distinct(f"{call}: gears", (g.name for g in gears))
    for g in gears:
        for name, dof in ((g.joint, g.dof), (g.other, g.other_dof)):
            joint = by_name[checks.one_of(f"{call}: joint of gear {g.name!r}", name, by_name)]
            scalar = joint.scalar_count
            if not isinstance(dof, int | np.integer) or not 0 <= dof < scalar:
                raise ValueError(
                    f"{call}: gear {g.name!r}: joint {name!r} has {scalar} scalar coordinates, got {dof!r}"
                )
        if (g.joint, g.dof) == (g.other, g.other_dof):
            raise ValueError(f"{call}: gear {g.name!r} couples joint {g.joint!r} with itself")


def geared(q: ArrayLike, named: Collection[str], joints: Sequence[Joint], gears: Sequence[Gear]) -> tuple[float, ...]:
    """Coordinates q (nq,) where those of joints without a name follow those of joints with one, along all gears."""
    out = np.array(q, dtype=np.float64)
    first = {joint.name: at.start for joint, at, _ in joint_places(joints)}
    known = {first[joint.name] + k for joint in joints if joint.name in named for k in range(joint.scalar_count)}
    before = -1
    while len(known) != before:  # a gear may follow another one
        before = len(known)
        for g in gears:
            driven, driving = first[g.joint] + g.dof, first[g.other] + g.other_dof
            if driving in known and driven not in known:
                out[driven] = g.ratio * out[driving] + g.offset
            elif driven in known and driving not in known and g.ratio:
                out[driving] = (out[driven] - g.offset) / g.ratio
            else:
                continue
            known |= {driven, driving}
    return tuple(float(x) for x in out)
