"""A mechanism with other settings of its contacts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from sim.mechanism import checks
from sim.mechanism.mechanism import Mechanism


def with_contacts(mech: Mechanism, field: str, value: Any) -> Mechanism:
    """The mechanism with another friction or law, of all contacts or by name."""
    if isinstance(value, Mapping):
        for name in value:
            checks.one_of(f"Simulator.replace({field}=...)", name, mech.contact_names)
        contacts = [replace(c, **{field: value.get(c.name, getattr(c, field))}) for c in mech.contacts]
    else:
        contacts = [replace(c, **{field: value}) for c in mech.contacts]
    return replace(mech, contacts=contacts)
