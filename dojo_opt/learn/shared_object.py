"""Shared: an object that many calls in workers need, made once per process."""

from __future__ import annotations

import pickle
from functools import cached_property, lru_cache
from typing import Any

__all__ = ["Shared"]

_KEPT = 8  # objects per worker


class Shared:
    """An object that is pickled once, and unpickled once in every process that it is sent to.

    Args:
        value: the object.
    """

    def __init__(self, value: Any) -> None:
        self.value = value

    def __reduce__(self) -> Any:
        return _received, (self._bytes,)

    @cached_property
    def _bytes(self) -> bytes:
        return pickle.dumps(self.value)


@lru_cache(maxsize=_KEPT)
def _received(data: bytes) -> Shared:
    """The object in this process."""
    return Shared(pickle.loads(data))
