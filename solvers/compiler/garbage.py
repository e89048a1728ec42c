"""The garbage collector during compilation."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["seldom_collected"]

_THRESHOLDS = (50_000, 20, 100)


@contextmanager
def seldom_collected() -> Iterator[None]:
    """Collect garbage seldom: a compilation makes millions of objects of which most stay while it goes on, and going
    through them again and again was an eighth of a cold start. The way out collects, so that it is around as many
    kernels as are compiled together; inside another it does nothing.
    """
    before = gc.get_threshold()
    if not gc.isenabled() or not 0 < before[0] < _THRESHOLDS[0]:
        yield
        return
    gc.set_threshold(*_THRESHOLDS)
    try:
        yield
    finally:
        if gc.get_threshold() == _THRESHOLDS:  # unless it was changed meanwhile
            gc.set_threshold(*before)
