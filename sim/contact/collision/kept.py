"""Elements of an earlier choice that still press, in the place of a contact point.

The number of a point that has taken over others encodes them: KEPT + feature 2^24 + code.
"""

from __future__ import annotations

from solvers.compiler import inner_kernel

KEPT = 1 << 40
_CODES = 1 << 24


@inner_kernel
def elsewhere(feature: int, code: int) -> int:
    """Elements `code` of contact point `feature`, as those of another one."""
    return KEPT + feature * _CODES + code


@inner_kernel
def original(feature: int, code: int) -> tuple[int, int]:
    """The contact point and its elements that a code stands for."""
    if code < KEPT:
        return feature, code
    return (code - KEPT) // _CODES, (code - KEPT) % _CODES
