"""Start strategies of the interior point: how many solutions each of them found, by kind of scene.

    python benchmarks/start_strategies.py            20,000 extreme states, 400 mechanisms, 400 falls, 39 robots
    python benchmarks/start_strategies.py --quick

extreme states   of robustness.py, one step each
mechanisms       one step of the random mechanisms of attacks.py
motions          passive falls of attacks.py
robots           falls of falls.py, at the default kappa

Steps that are divided count with their parts. A strategy that finds nothing here has no reason to be in the list.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable, Iterator
from itertools import product
from typing import Any

import numpy as np
from attacks import ANYTHING, PASSIVE, SECONDS, random_mechanism
from attacks import TIME_STEPS as MOTION_STEPS
from attacks import random_state as attack_state
from command import deliver, number, parser, progress
from falls import STARTS, TIME_STEPS, robots
from numpy.typing import NDArray
from robustness import FRICTIONS, KAPPAS, MECHANISMS, random_state
from robustness import TIME_STEPS as EXTREME_STEPS

import dojo_opt as dojo
from dojo_opt.report.result import Cell, Report, Table
from sim.simulator.state_space import strategy_solves
from sim.solve.globalization import ATTEMPTS, STRATEGIES, UNKNOWN, Start

Counts = NDArray[np.int64]


def solves(sim: Any) -> Counts:
    """(ATTEMPTS,) solutions by strategy of all steps of a simulator so far, and of the parts of its divided steps."""
    return strategy_solves(sim)[:ATTEMPTS]


def extreme(states: int, seed: int) -> Iterator[Counts]:
    """Steps from extreme states."""
    settings = list(product(MECHANISMS, FRICTIONS, EXTREME_STEPS, KAPPAS))
    for name, friction, h, kappa in settings:
        sim = dojo.Simulator(MECHANISMS[name](friction), time_step=h, kappa=kappa)
        rng = np.random.default_rng([seed, list(MECHANISMS).index(name), round(1e4 * h)])
        for _ in range(max(1, states // len(settings))):
            sim.step(random_state(sim, rng))
        yield solves(sim)


def mechanisms(count: int, seed: int) -> Iterator[Counts]:
    """One step of random mechanisms, as in attacks.py."""
    for k in range(count):
        rng = np.random.default_rng([seed + k, 1])
        mech = random_mechanism(rng, ANYTHING)
        kappa = None if rng.random() < 0.7 else 1e-4
        sim = dojo.Simulator(mech, time_step=float(rng.choice([0.001, 0.005, *MOTION_STEPS])), kappa=kappa)
        sim.step(attack_state(sim, rng))
        yield solves(sim)


def motions(count: int, seed: int) -> Iterator[Counts]:
    """Passive falls of random mechanisms, as in attacks.py."""
    for k in range(seed, seed + count):
        rng = np.random.default_rng([k, 2])
        h = MOTION_STEPS[k % len(MOTION_STEPS)]
        sim = dojo.Simulator(random_mechanism(rng, PASSIVE), time_step=h)
        sim.rollout(attack_state(sim, rng), np.zeros((round(SECONDS / h), sim.nu)))
        yield solves(sim)


def falls(count: int | None) -> Iterator[Counts]:
    """Falls of robots, as in falls.py, at the default kappa."""
    for (_, build), h in product(list(robots())[:count], TIME_STEPS):
        sim = dojo.Simulator(build(), h)
        for seed in range(STARTS):
            x = sim.neutral()
            x[sim.nq :] += (seed > 0) * np.random.default_rng(seed).normal(size=sim.nv)
            sim.rollout(x, np.zeros((round(1.0 / h), sim.nu)))
        yield solves(sim)


def run(args: argparse.Namespace) -> Report:
    """All kinds of scenes."""
    warnings.simplefilter("ignore")  # MuJoCo's warnings about gymnasium's files
    states, cases, seed = (128, 4, args.seed) if args.quick else (args.states, args.cases, args.seed)
    scenes: dict[str, Callable[[], Iterator[Counts]]] = {
        "extreme states": lambda: extreme(states, seed),
        "mechanisms": lambda: mechanisms(cases, 1000 * seed),
        "motions": lambda: motions(cases, 1000 * seed),
        "robots": lambda: falls(1 if args.quick else None),
    }
    chosen = [(name, (name, scenes[name])) for name in args.only or scenes]
    found = {name: sum(count(), np.zeros(ATTEMPTS, int)) for name, count in progress()(chosen, "start strategies")}
    whole = np.sum(list(found.values()), axis=0)
    report = Report("Solutions by start strategy", "")
    report.rows = [
        number("solutions", int(whole.sum())),
        number("by the first strategy", 100.0 * whole[0] / whole.sum(), unit="%"),
        number("by rescues, all but KNOWN and INCOMING", int(whole.sum() - whole[0] - whole[UNKNOWN])),
        number("strategies without a solution", int((whole == 0).sum())),
        number("last strategy with a solution, from 0", int(np.flatnonzero(whole)[-1])),
    ]
    lines: list[list[Cell]] = []
    for k, s in enumerate(STRATEGIES):
        ways = ("continuation", "undamped", "overlap")
        how = ", ".join([Start(s.start).name.lower(), *(way for way in ways if getattr(s, way))])
        lines.append([str(k), how, s.growth, *(int(each[k]) for each in found.values())])
    report.tables = [Table("Solutions", ("", "strategy", "growth of kappa0", *found), lines)]
    report.details = {name: each.tolist() for name, each in found.items()}
    return report


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    arguments = parser(__doc__)
    arguments.add_argument("--states", type=int, default=20_000, help="extreme states")
    arguments.add_argument("--cases", type=int, default=400, help="random mechanisms, and motions of them")
    arguments.add_argument("--only", action="append", metavar="KIND", help="one kind of scene (may be repeated)")
    arguments.add_argument("--seed", type=int, default=0)
    return deliver("start_strategies", run, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
