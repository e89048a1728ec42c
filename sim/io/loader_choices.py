"""LoaderChoices: the arguments that the loaders of URDF and MJCF files share."""

from __future__ import annotations

from typing import NamedTuple

from numpy.typing import ArrayLike

from sim.mechanism import checks
from sim.mechanism.contact import LAWS

__all__ = ["LoaderChoices", "loader_choices"]


class LoaderChoices(NamedTuple):
    """The choices of a caller that do not depend on the kind of the file."""

    ground: bool  # whether there are contacts with it
    friction: float | None  # coefficient of all contacts; None: those of the file
    law: str  # of contacts with friction
    rim_points: int  # per rim of a cylinder
    joint_friction: bool  # whether joints have the dry friction of the file
    gravity: tuple[float, ...]  # (3,) [m/s^2]
    itself: bool  # whether all bodies but neighbours collide
    turning_friction: bool  # whether contacts have the torsional and rolling friction of the file


def loader_choices(
    call: str,
    *,
    ground: bool,
    friction: float | None,
    law: str,
    rim_points: int,
    joint_friction: bool,
    gravity: ArrayLike,
    collisions: str | None,
    turning_friction: bool,
) -> LoaderChoices:
    """The checked choices; a ValueError names the call."""
    if collisions is not None:
        checks.one_of(f"{call}(collisions=...)", collisions, ("self",))
    return LoaderChoices(
        bool(ground),
        None if friction is None else checks.number(f"{call}(friction=...)", friction, at_least=0.0),
        checks.one_of(f"{call}(law=...)", law, LAWS),
        checks.whole_number(f"{call}(rim_points=...)", rim_points, 3),
        bool(joint_friction),
        checks.vector(f"{call}(gravity=...)", gravity, 3),
        collisions == "self",
        checks.flag(f"{call}(turning_friction=...)", turning_friction),
    )
