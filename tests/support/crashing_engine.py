"""An engine that ends its process; in a separate module, so that the process of the engines can import it."""

from __future__ import annotations

import os
import signal
from dataclasses import dataclass
from typing import Any

from benchmarks.engines import Ours, Run
from benchmarks.engines.failed_runs import ended
from benchmarks.engines.separate_process import apart
from sim.mechanism.mechanism import Mechanism


@dataclass(frozen=True)
class Killing:
    """Ours, but for one duration [s] that ends its process."""

    deadly: float
    by: signal.Signals = signal.SIGSEGV
    name: str = "killing"

    @ended
    @apart
    def simulate(self, mechanism: Mechanism, **given: Any) -> Run:
        """As Engine.simulate; the message says in which process it ran."""
        if given["duration"] == self.deadly:
            os.kill(os.getpid(), self.by)
        run = Ours(rounds=0).simulate(mechanism, **given)
        return run._replace(message=f"in process {os.getpid()}")
