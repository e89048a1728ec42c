"""ContactChoices: properties that all contacts of a file share, from the arguments of its loader."""

from __future__ import annotations

from typing import NamedTuple

from sim.mechanism import checks
from sim.mechanism.contact import LAWS

__all__ = ["ContactChoices", "contact_choices"]


class ContactChoices(NamedTuple):
    """The choices of a caller."""

    friction: float | None  # coefficient of all contacts; None: those of the file
    law: str  # of contacts with friction
    rim_points: int  # per rim of a cylinder


def contact_choices(call: str, friction: float | None, law: str, rim_points: int) -> ContactChoices:
    """The checked choices; a ValueError names the call."""
    return ContactChoices(
        None if friction is None else checks.number(f"{call}(friction=...)", friction, at_least=0.0),
        checks.one_of(f"{call}(law=...)", law, LAWS),
        checks.whole_number(f"{call}(rim_points=...)", rim_points, 3),
    )
