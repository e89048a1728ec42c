"""Parameter x situation: error of the derivative of a step, and what the derivatives by all parameters cost.

    python benchmarks/parameter_derivatives.py

Error: along a random direction of all parameters of a kind, against differences of the solver at the same kappa,
relative to the derivative. Cost: processor time of a quadruped that stands, also of `vjp`, per step of a rollout.
"""

from __future__ import annotations

from collections.abc import Callable
from time import process_time

import numpy as np

import dojo_opt as dojo
from dojo_opt.report.mechanics.parameters import check
from dojo_opt.report.mechanics.situations import CASES
from sim.parameters.parameters import KINDS, all_parameters
from sim.parameters.selection import select
from sim.parameters.sensitivity import parameter_columns

REPEATS = 40


def seconds(call: Callable[[], object]) -> float:
    """Least processor time of five rounds [s]."""
    rounds = []
    for _ in range(5):
        start = process_time()
        for _ in range(REPEATS):
            call()
        rounds.append((process_time() - start) / REPEATS)
    return min(rounds)


def cost() -> str:
    """A sentence about the standing quadruped."""
    sim = dojo.Simulator(dojo.models.quadruped(), time_step=0.02)
    x, u = sim.neutral(), np.zeros(sim.nu)
    calls = sim._calls
    every, plan = select("benchmark", all_parameters(sim.mechanism, sim.time_step), sim.parameters().names)
    T = 50
    us = np.zeros((T, sim.nu))
    t = sim.rollout(x, us, throw=True)
    loss = np.ones((T + 1, sim.ndx))
    kinds = [k for k in KINDS if any(n.startswith(k) for n in every.names)]
    A = calls.linearize_one(x, u, None)[0]
    columns = seconds(lambda: parameter_columns(calls, sim.mechanism, (x, u), A, plan))
    step = seconds(lambda: sim.rollout(x, us)) / T
    both = seconds(lambda: sim.linearize_rollout(x, us)) / T
    sweep = seconds(lambda: sim.vjp(t, loss)) / T
    full = seconds(lambda: sim.vjp(t, loss, wrt=("state", "input", *kinds))) / T
    return (
        f"quadruped, {len(every.names)} parameters [us]: step {1e6 * step:.1f}, step with state-input gradient "
        f"{1e6 * both:.1f}, all parameters {1e6 * columns:.1f} more; vjp per step {1e6 * sweep:.1f} "
        f"({sweep / both:.2f} of step with gradient), with all parameters {1e6 * full:.1f} ({full / both:.2f})"
    )


def main() -> None:
    """Print the table as Markdown, and the cost."""
    errors = {name: check(name) for name in CASES}
    print("| | " + " | ".join(errors) + " |")
    print("|---" * (len(errors) + 1) + "|")
    for kind in KINDS:
        cells = (f"{row[kind]:.0e}" if kind in row else "" for row in errors.values())
        print(f"| {kind} | " + " | ".join(cells) + " |")
    print()
    print(cost())


if __name__ == "__main__":
    main()
