"""Cost of the derivatives with respect to all parameters: a standing quadruped, also by `vjp`, per step of a rollout.

    python benchmarks/parameter_derivatives.py

How exact they are: `python benchmarks/compare.py mechanics`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from time import process_time

import numpy as np
from command import deliver, number, parser

import dojo_opt as dojo
from dojo_opt.report.result import Report
from sim.derivatives.parameters.parameters import KINDS, all_parameters
from sim.derivatives.parameters.selection import by_names, select
from sim.simulator.engines.engine_choice import engine_of
from sim.simulator.sensitivity import parameter_columns
from sim.simulator.settings import Settings

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


def run(args: argparse.Namespace) -> Report:
    """The standing quadruped, over 50 steps (5 quick)."""
    sim = dojo.Simulator(dojo.models.quadruped(), time_step=0.02)
    x, u = sim.neutral(), np.zeros(sim.nu)
    calls = engine_of(sim.model, sim.mechanism, Settings(sim.time_step, sim.kappa, sim.tolerance, sim.max_iterations))
    known = by_names(all_parameters(sim.mechanism, sim.time_step))
    every, plan = select("benchmark", known, sim.parameters().names, sim.model)
    T = 5 if args.quick else 50
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
    report = Report("Derivatives by parameters of a standing quadruped", "")
    report.rows = [
        number("parameters", len(every.names)),
        number("step", 1e6 * step, unit="us"),
        number("step with gradient", 1e6 * both, unit="us"),
        number("derivatives by all parameters", 1e6 * columns, unit="us"),
        number("vjp, per step", 1e6 * sweep, unit="us"),
        number("vjp, per step / step with gradient", sweep / both),
        number("vjp by all parameters, per step", 1e6 * full, unit="us"),
        number("vjp by all parameters, per step / step with gradient", full / both),
    ]
    return report


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    return deliver("parameter_derivatives", run, parser(__doc__), argv)


if __name__ == "__main__":
    sys.exit(main())
