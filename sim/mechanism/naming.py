"""Names of contacts and inputs: those given, or taken from their targets, with numbers if they repeat."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from sim.mechanism import checks
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint


def renamed(part: Any, name: str) -> Any:
    """The part under another name; frozen parts are rebuilt without repeating their checks."""
    if part.name == name:
        return part
    out = object.__new__(type(part))
    for field, value in vars(part).items():
        object.__setattr__(out, field, value)
    object.__setattr__(out, "name", name)
    return out


def number_repeats(parts: Sequence[Any]) -> list[Any]:
    """Parts of equal name get numbers: foot, foot -> foot_0, foot_1."""
    total = Counter(p.name for p in parts)
    counts: dict[str, int] = {}
    out = []
    for part in parts:
        if total[part.name] > 1:
            k = counts.get(part.name, 0)
            counts[part.name] = k + 1
            out.append(renamed(part, f"{part.name}_{k}"))
        else:
            out.append(part)
    return out


def name_contacts(call: str, contacts: Sequence[Contact], bodies: Sequence[str]) -> tuple[Contact, ...]:
    """The contacts with names, after a look at their bodies."""
    known = dict.fromkeys(bodies)
    for c in contacts:
        checks.one_of(f"{call}: body of contact {c.name!r}" if c.name else f"{call}: contact body", c.body, known)
    checks.distinct(f"{call}: contacts", (c.name for c in contacts if c.name))
    named = number_repeats([renamed(c, c.name or c.body) for c in contacts])
    checks.distinct(f"{call}: contacts", (c.name for c in named))
    return tuple(named)


def name_inputs(
    call: str, inputs: Sequence[Input], joints: Sequence[Joint], bodies: Sequence[str]
) -> tuple[Input, ...]:
    """The inputs with names, after a check of their targets."""
    by_name, known = {j.name: j for j in joints}, dict.fromkeys(bodies)
    out = []
    for part in inputs:
        if part.joint is not None:
            label = checks.one_of(f"{call}, inputs=...): joint", part.joint, by_name)
            nv = by_name[label].nv
            if not isinstance(part.dof, int | np.integer) or not 0 <= part.dof < nv:
                raise ValueError(f"{call}): Input({label!r}, dof={part.dof!r}): the joint has {nv} degrees of freedom")
            label += f"[{part.dof}]" if nv > 1 else ""
            if part.servo is not None and by_name[part.joint].nrot == 3 and part.dof >= by_name[part.joint].ntrans:
                raise ValueError(f"{call}): Input({label!r}, servo=...): a servo cannot drive a quaternion")
        else:
            label = checks.one_of(f"{call}, inputs=...): body", part.body, known)
        out.append(renamed(part, part.name or label))
    return tuple(number_repeats(out))
