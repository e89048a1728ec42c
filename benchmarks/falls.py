"""Let robots fall for a second, and count the motions in which a step was not solved.

    pip install gymnasium mujoco        for gymnasium's robots, in addition to the models of the toolkit
    python benchmarks/falls.py          --match quadruped for some of them

Every robot falls from its neutral state, at rest and with nine random velocities (normal, 1 m/s and 1 rad/s per degree
of freedom), for time steps of 5, 10 and 20 ms and at three kappa, the default among them. Random states, as in
robustness.py, do not find the jammed landings that occur in motions. The last columns have the falls with a divided
step, and those with a step that lost relative momentum of bodies, of all kappa.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from command import deliver, number, parser, progress

import dojo_opt as dojo
from dojo_opt.report.result import Cell, Report, Table

MODELS = (
    "ant", "atlas", "block", "exoskeleton", "halfcheetah", "hopper", "humanoid", "quadruped", "rexhopper", "snake",
    "twister", "walker", "youbot",
)  # fmt: skip
TIME_STEPS = (0.005, 0.01, 0.02)  # [s]
KAPPAS = (None, 1e-6, 1e-10)  # [N s m]; None: the default
STARTS = 10


def robots() -> Iterator[tuple[str, Callable[[], dojo.Mechanism]]]:
    """Names and builders."""
    for name in MODELS:
        yield name, getattr(dojo.models, name)
    gym = find_spec("gymnasium")
    if gym is not None and gym.origin is not None and find_spec("mujoco") is not None:
        for file in sorted((Path(gym.origin).parent / "envs/mujoco/assets").glob("*.xml")):
            yield file.name, lambda file=file: dojo.load_mjcf(file)


class Falls(NamedTuple):
    """The falls of a robot at one kappa."""

    unsolved: list[str]  # messages of those that stopped early
    divided: int  # those with a divided step
    shared: int  # those with a step that lost relative momentum of bodies


def fall(mechanism: dojo.Mechanism, time_steps: Sequence[float], kappa: float | None) -> Falls:
    """The falls of a robot from every start."""
    messages, divided, shared = [], 0, 0
    for time_step, seed in product(time_steps, range(STARTS)):
        sim = dojo.Simulator(mechanism, time_step, kappa)
        x = sim.neutral()
        x[sim.nq :] += (seed > 0) * np.random.default_rng(seed).normal(size=sim.nv)
        t = sim.rollout(x, np.zeros((round(1.0 / time_step), sim.nu)))
        divided += bool((t.parts > 1).any())
        shared += bool((t.momentum_fractions < 1.0).any())
        if not t.success:
            messages.append(f"{1e3 * time_step:g} ms, kappa {sim.kappa:.1e}, start {seed}: {t.message}")
    return Falls(messages, divided, shared)


def run(args: argparse.Namespace) -> Report:
    """Every robot with `match` in its name."""
    warnings.simplefilter("ignore")  # MuJoCo's warnings about gymnasium's files
    report = Report("Falls of a second", "")
    time_steps = TIME_STEPS[-1:] if args.quick else TIME_STEPS
    chosen = [(name, (name, build)) for name, build in robots() if args.match in name][: 2 if args.quick else None]
    lines: list[list[Cell]] = []
    for name, build in progress()(chosen, "falls"):
        mechanism = build()
        found = {label(kappa): fall(mechanism, time_steps, kappa) for kappa in KAPPAS}
        unsolved = {kappa: falls.unsolved for kappa, falls in found.items()}
        counts = [len(messages) for messages in unsolved.values()]
        divided, shared = (sum(column) for column in list(zip(*found.values(), strict=True))[1:])
        lines.append([name, STARTS * len(time_steps), *counts, divided, shared])
        report.details[name] = unsolved
        report.notes += [f"{name}: {message}" for messages in unsolved.values() for message in messages]
    totals = [sum(column) for column in list(zip(*lines, strict=True))[1:]]
    report.rows = [number("robots", len(lines)), number("falls at each kappa", totals[0])]
    report.rows += [
        number(f"not solved to the end, {label(kappa)}", count, 0)
        for kappa, count in zip(KAPPAS, totals[1:], strict=False)
    ]
    report.rows += [number("with a divided step, all kappa", totals[-2]), number("with a share", totals[-1])]
    header = ("", "falls at each kappa", *map(label, KAPPAS), "with a divided step", "with a share")
    report.tables = [Table("Falls not solved to the end", header, [*lines, ["all", *totals]])]
    return report


def label(kappa: float | None) -> str:
    """The name of a kappa."""
    return "default kappa" if kappa is None else f"kappa {kappa:g}"


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    arguments = parser(__doc__)
    arguments.add_argument("--match", default="", help="only robots with this in their name")
    return deliver("falls", run, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
