"""Scratch: the buffers of a step, made once per thread, so that one Simulator may be used from several."""

from __future__ import annotations

import os
import threading

import numpy as np

from sim.model.layout import Sizes, allocate_tables
from solvers.compiler import Table
from solvers.types import Vector

_CORES = os.cpu_count() or 1
_CHUNKS = 4  # per core: evens out items that take longer


class Scratch:
    """Tables of Data, of the thread that asks."""

    def __init__(self, sizes: Sizes, contact_frame: Vector) -> None:
        self._sizes, self._contact_frame = sizes, contact_frame
        self._kept = threading.local()
        self._turns = 0  # of the contact frames

    def tables(self, count: int) -> Table:
        """Tables of `count` Data, (count, ...)."""
        kept = self._kept.__dict__
        frames = kept.setdefault("frames", [])  # of the Data so far, which they keep alive
        if kept.setdefault("turns", self._turns) != self._turns:
            for part in frames:
                part[:] = self._contact_frame.ravel()
            kept["turns"] = self._turns
        known: Table | None = kept.get("tables")
        if known is None or len(known) < count:
            more, frame = allocate_tables(self._sizes, count - (0 if known is None else len(known)))
            frame[:] = self._contact_frame.ravel()
            frames.append(frame)
            known = kept["tables"] = more if known is None else np.concatenate([known, more])
        return known[:count]

    def table(self) -> Table:
        """Table of the first Data."""
        kept = self._kept.__dict__
        first: Table | None = kept.get("first")
        if first is None or kept["turns"] != self._turns:
            first = kept["first"] = self.tables(1)[0]
        return first

    def refresh_contact_frames(self) -> None:
        """Mark Data as stale after contact frames turned; every thread reloads them at its next call."""
        self._turns += 1

    def chunks(self, count: int) -> Table:
        """Tables for a parallel call over `count` items, one per chunk."""
        return self.tables(max(1, min(count, _CHUNKS * _CORES)))
