"""A mechanism with other settings of its contacts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from sim.mechanism import checks
from sim.mechanism.mechanism import Mechanism


def with_contacts(mech: Mechanism, field: str, value: Any) -> Mechanism:
    """The mechanism with another friction or law, of all contacts and collisions or by name."""
    parts: tuple[Any, ...] = (*mech.contacts, *mech.collisions)
    if isinstance(value, Mapping):
        names = tuple(part.name for part in parts)
        for name in value:
            checks.one_of(f"Simulator.replace({field}=...)", name, names)
        chosen = value
    else:
        chosen = {part.name: value for part in parts}
    return replace(
        mech,
        contacts=[replace(c, **{field: chosen.get(c.name, getattr(c, field))}) for c in mech.contacts],
        collisions=[replace(c, **{field: chosen.get(c.name, getattr(c, field))}) for c in mech.collisions],
    )
