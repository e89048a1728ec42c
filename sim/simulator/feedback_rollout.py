"""Rollout under a Python function that returns the input before each step."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from sim.mechanism import checks
from sim.simulator.engines.engine import REPORT, Engine, Floats, Rolled, interrupted
from sim.simulator.results import Interrupted

Feedback = Callable[[float, Floats], ArrayLike]  # u = policy(time, x)


def roll_policy(
    engine: Engine, x: Floats, policy: Feedback, count: int, wrenches: Floats | None
) -> tuple[Floats, Rolled]:
    """Inputs of a policy and their rollout; every step is solved afresh, so it equals others to the tolerance."""
    us = np.zeros((count, engine.nu))
    xs, reports = np.zeros((count + 1, engine.nx)), np.zeros((count, REPORT))
    contacts: list[Floats] = []
    (A, B), xs[0], knot = engine.no_predictions[:2], x, 0
    try:
        for k in range(count):
            name = f"Simulator.rollout: u of the policy at step {k}"
            us[k] = checks.array(name, policy(k * engine.settings.time_step, xs[k].copy()), (engine.nu,))
            one = engine.roll(xs[k], us[k : k + 1], None if wrenches is None else wrenches[k : k + 1])
            reports[k], xs[k + 1] = one.reports[0], one.xs[1]
            contacts.append(one.contacts[0])
            if one.solved_steps == 0:
                break
            knot = k + 1
    except KeyboardInterrupt:
        reports = interrupted(reports, knot)
        done = Rolled(knot, xs, reports, np.array(contacts), A, B)
        raise Interrupted((us, done) if knot else None) from None
    return us, Rolled(knot, xs, reports, np.array(contacts), A, B)
