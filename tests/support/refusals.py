"""Refusals of a call, and the words of its message."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest


def check_refused(call: Callable[[], Any], *words: str) -> None:
    """The call raises a ValueError or TypeError with all the words in its message."""
    with pytest.raises((ValueError, TypeError)) as error:
        call()
    for word in words:
        assert word in str(error.value), str(error.value)
