"""Memory: counts whose arrays the machine cannot hold are refused by name, before any work."""

from __future__ import annotations

import os
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from sim.mechanism.checks import whole_number

__all__ = ["check_room", "memory", "room_for"]

_GROUPS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")  # limits of a container


@cache
def memory() -> float:
    """Bytes that this process may have, infinite where the machine does not say.

    Returns:
        The least of the memory of the machine, of its container and of the process.
    """
    found = [float("inf")]
    with suppress(AttributeError, ValueError, OSError):
        found.append(float(os.sysconf("SC_PHYS_PAGES")) * float(os.sysconf("SC_PAGE_SIZE")))
    for path in _GROUPS:
        with suppress(ValueError, OSError):
            found.append(float(Path(path).read_text(encoding="ascii")))
    with suppress(ImportError, ValueError, OSError):
        import resource

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        found.append(float("inf") if limit == resource.RLIM_INFINITY else float(limit))
    return min(bytes_ for bytes_ in found if bytes_ > 0.0)


def check_room(call: str, number: int, each: float, remedy: str = "take fewer", noun: str = "rows") -> None:
    """Refuse arrays that are larger than the memory.

    Args:
        call: the call and the argument that an error names.
        number: of rows, steps, knots, runs.
        each: bytes that one of them takes at least.
        remedy: end of the message.
        noun: their name in the message.

    Raises:
        ValueError: they do not fit.
    """
    if number * each > memory():
        raise ValueError(
            f"{call}: {number:.6g} {noun} need at least {number * each / 2**30:.3g} GiB of memory; "
            f"{memory() / 2**30:.3g} GiB are available: {remedy}"
        )


def room_for(
    call: str, value: Any, each: float, *, least: int = 1, remedy: str = "take fewer", noun: str = "rows"
) -> int:
    """A whole number of rows, steps, knots or runs that fit the memory.

    Args:
        call: the call and the argument that an error names.
        value: the number.
        each: bytes that one of them takes at least.
        least: smallest number.
        remedy: end of the message.
        noun: their name in the message.

    Returns:
        The number.

    Raises:
        ValueError: it is no whole number, less than `least`, or they do not fit.
    """
    out = whole_number(call, value, least)
    check_room(call, out, each, remedy, noun)
    return out
