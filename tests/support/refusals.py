"""What a call refuses, and the words of its message."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest


def check_refused(call: Callable[[], Any], *words: str) -> None:
    """The call raises a ValueError or TypeError whose message has all the words."""
    with pytest.raises((ValueError, TypeError)) as error:
        call()
    for word in words:
        assert word in str(error.value), str(error.value)
