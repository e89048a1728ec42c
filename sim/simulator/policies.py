"""Rollouts under a policy: u = policy(time, x), a function of the user that is asked before every step."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.mechanism import checks
from sim.simulator.border import whole
from sim.simulator.calls import interrupted
from sim.simulator.results import Interrupted

if TYPE_CHECKING:
    from sim.simulator.simulator import Simulator

Floats = NDArray[np.float64]
Rolled = tuple[int, Floats, Floats, Floats]  # solved steps; states, report and contacts of every step, see Calls.roll
Feedback = Callable[[float, Floats], ArrayLike]

__all__ = ["Feedback", "roll"]


def roll(sim: Simulator, x: Floats, policy: Feedback, steps: int | None) -> tuple[Floats, Rolled]:
    """Inputs (T, nu) and what came of them; T is `steps`, or fewer when one cannot be solved.

    Every step is solved afresh: states differ within the tolerance from those of one rollout of the same inputs.
    """
    count = whole("Simulator.rollout(steps=...)", steps)
    done: list[tuple[Floats, Rolled]] = []
    try:
        for k in range(count):
            name = f"Simulator.rollout: u of the policy at step {k}"
            u = checks.array(name, policy(k * sim.time_step, x.copy()), (sim.nu,))
            done.append((u, sim._calls.roll(x, u[None])))
            knot, xs, *_ = done[-1][1]
            if knot == 0:
                break
            x = xs[1]
    except KeyboardInterrupt:
        raise Interrupted(_joined(done, stopped=True) if done else None) from None
    return _joined(done)


def _joined(done: list[tuple[Floats, Rolled]], stopped: bool = False) -> tuple[Floats, Rolled]:
    """Inputs and results of single steps as those of one rollout; of one that was stopped there is one report more."""
    us, rolled = zip(*done, strict=True)
    solved = sum(knot for knot, *_ in rolled)
    states = np.concatenate([rolled[0][1][:1], *(xs[1:] for _, xs, _, _ in rolled)])
    reports, contacts = (np.concatenate([part[i] for part in rolled]) for i in (2, 3))
    if stopped:
        reports = interrupted(np.concatenate([reports, reports[-1:]]), len(reports))
    return np.array(us), (solved, states, reports, contacts)
