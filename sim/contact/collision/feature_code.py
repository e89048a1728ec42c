"""Elements of an earlier choice that still press, in the place of a contact point.

The number of a point that has taken over others encodes them: SUBSTITUTED + feature 2^24 + code.
"""

from __future__ import annotations

from solvers.compiler import inner_kernel

SUBSTITUTED = 1 << 40
_CODES = 1 << 24


@inner_kernel
def substitute_code(feature: int, code: int) -> int:
    """Elements `code` of contact point `feature`, as those of another one."""
    return SUBSTITUTED + feature * _CODES + code


@inner_kernel
def substituted_feature(feature: int, code: int) -> tuple[int, int]:
    """The contact point and its elements that a code stands for."""
    if code < SUBSTITUTED:
        return feature, code
    return (code - SUBSTITUTED) // _CODES, (code - SUBSTITUTED) % _CODES
