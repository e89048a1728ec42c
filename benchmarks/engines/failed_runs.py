"""Failures of an engine as runs that end at their start: a cell of a table instead of the end of a report."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

import numpy as np

from benchmarks.engines.separate_process import ProcessEnded
from dojo_opt.report.engine import PhysicsEngine, Run, observe
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator

Simulate = TypeVar("Simulate", bound=Callable[..., Any])


def ended(simulate: Simulate) -> Simulate:
    """A `simulate` that turns an exception into a run that ends at its start, so that the report goes on.

    A run that ended the process of the engine (separate_process.py) becomes such a run too.

    ValueErrors pass: they mean that a mechanism cannot be represented.
    """

    @wraps(simulate)
    def run(engine: PhysicsEngine, mechanism: Mechanism, **given: Any) -> Run:
        try:
            return simulate(engine, mechanism, **given)
        except ValueError:
            raise
        except Exception as error:  # whatever a library raises
            sim = Simulator(mechanism, time_step=given["time_step"])
            q, v = (np.atleast_2d(np.asarray(given[name], dtype=np.float64)) for name in ("q", "v"))
            reason = str(error).partition("\n")[0].partition(". ")[0][:200]
            message = reason if isinstance(error, ProcessEnded) else f"{type(error).__name__}: {reason}"
            return observe(sim, np.zeros(1), q, v, 0.0, 0, message)

    return run  # type: ignore[return-value]
