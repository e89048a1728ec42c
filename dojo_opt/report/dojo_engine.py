"""Our own simulator as an engine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dojo_opt.report.engine import Run, clocked, held, nodes, observe
from sim.mechanism.mechanism import Mechanism
from sim.simulator.results import SimulationError
from sim.simulator.simulator import Simulator
from solvers.types import Floats

_PIECE = 10_000  # steps per rollout: a long run keeps its samples, not all its states


@dataclass(frozen=True)
class Ours:
    """The variational step; order, kappa and tolerance as in Simulator."""

    order: int = 2
    kappa: float | None = None  # by default that of Simulator
    tolerance: float = 1e-8
    divide: bool = True  # whether steps that cannot be solved are divided
    rounds: int = 3  # a run shorter than a second is clocked so many times

    @property
    def name(self) -> str:
        """As it stands in a table."""
        return "dojo-opt" if self.order == 2 else f"dojo-opt order {self.order}"

    def simulate(
        self,
        mechanism: Mechanism,
        *,
        time_step: float,
        q: ArrayLike,
        v: ArrayLike,
        duration: float,
        samples: int,
        inputs: ArrayLike | None = None,
    ) -> Run:
        """As Engine.simulate; a start that cannot be represented ends the run at its first sample."""
        marks = nodes(time_step, duration, samples)
        u = held(mechanism, inputs, int(marks[-1]))
        sim = Simulator(mechanism, time_step, self.kappa, self.tolerance, order=self.order, divide=self.divide)
        if sim.second_order_reason:  # a point of its curve would be one of order 2
            raise ValueError(f"order {self.order}: {sim.second_order_reason}")
        try:
            x = sim.state_from_velocity(q, v)
        except SimulationError as error:
            q, v = np.asarray(q, dtype=np.float64), np.asarray(v, dtype=np.float64)
            return observe(sim, np.zeros(1), q[None], v[None], 0.0, 0, str(error))
        sim.rollout(x, np.zeros((1, sim.nu)))  # compiled before the clock starts
        (xs, steps, message), seconds = clocked(
            lambda: _steps(sim, x, u, marks), self.rounds, lambda: sim.rollout(x, np.zeros((0, sim.nu)))
        )
        times = time_step * marks[: len(xs)].astype(np.float64)
        return observe(sim, times, xs[:, : sim.nq], sim.velocity(xs), seconds, steps, message)


def _steps(sim: Simulator, x: Floats, u: Floats, marks: NDArray[np.int64]) -> tuple[Floats, int, str]:
    """(states at the marks, number of steps taken, why it stopped)."""
    total = int(marks[-1])
    kept = [x[None]]
    done = 0
    while done < total:
        count = min(_PIECE, total - done)
        us = np.broadcast_to(u, (count, sim.nu)) if len(u) == 1 else u[done : done + count]
        piece = sim.rollout(x, us)
        inside = marks[(marks > done) & (marks <= done + piece.solved_steps)] - done
        kept.append(piece.x[inside])
        done += piece.solved_steps
        if not piece.success:
            return np.concatenate(kept), done, piece.message
        x = piece.x[-1]
    return np.concatenate(kept), done, ""
