"""Let robots fall for a second, and count the motions in which a step was not solved.

    pip install gymnasium mujoco        for gymnasium's robots, in addition to the models of the toolkit
    python benchmarks/falls.py          --match quadruped for some of them

Every robot falls from its neutral state, at rest and with two random velocities (normal, 1 m/s and 1 rad/s per degree
of freedom), for time steps of 5, 10 and 20 ms and at three kappa, the default among them. Random states, as in
robustness.py, do not find the jammed landings that occur in motions.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from command import deliver, number, parser, progress

import dojo_opt as dojo
from dojo_opt.report.result import Report, Table

MODELS = (
    "ant", "atlas", "block", "exoskeleton", "halfcheetah", "hopper", "humanoid", "quadruped", "rexhopper", "snake",
    "twister", "walker", "youbot",
)  # fmt: skip
TIME_STEPS = (0.005, 0.01, 0.02)  # [s]
KAPPAS = (None, 1e-6, 1e-10)  # [N s m]; None: the default
BARS = (0, 0, None)  # falls that may end unsolved
STARTS = 3


def robots() -> Iterator[tuple[str, Callable[[], dojo.Mechanism]]]:
    """Names and builders."""
    for name in MODELS:
        yield name, getattr(dojo.models, name)
    gym = find_spec("gymnasium")
    if gym is not None and gym.origin is not None and find_spec("mujoco") is not None:
        for file in sorted((Path(gym.origin).parent / "envs/mujoco/assets").glob("*.xml")):
            yield file.name, lambda file=file: dojo.load_mjcf(file)


def unsolved(mechanism: dojo.Mechanism, time_step: float, kappa: float | None) -> list[str]:
    """Messages of the motions that stopped early."""
    sim = dojo.Simulator(mechanism, time_step, kappa)
    messages = []
    for seed in range(STARTS):
        x = sim.neutral()
        x[sim.nq :] += (seed > 0) * np.random.default_rng(seed).normal(size=sim.nv)
        t = sim.rollout(x, np.zeros((round(1.0 / time_step), sim.nu)))
        if not t.success:
            messages.append(f"{1e3 * time_step:g} ms, kappa {sim.kappa:.1e}, start {seed}: {t.message}")
    return messages


def run(args: argparse.Namespace) -> Report:
    """Every robot with `match` in its name."""
    warnings.simplefilter("ignore")  # MuJoCo's warnings about gymnasium's files
    report = Report("Falls of a second", "")
    time_steps = TIME_STEPS[-1:] if args.quick else TIME_STEPS
    chosen = [(name, (name, build)) for name, build in robots() if args.match in name][: 2 if args.quick else None]
    lines, falls = [], 0
    for name, build in progress()(chosen, "falls"):
        mechanism = build()
        falls += STARTS * len(time_steps)
        messages = {kappa: [m for h in time_steps for m in unsolved(mechanism, h, kappa)] for kappa in KAPPAS}
        lines.append([name, *(len(found) for found in messages.values())])
        report.details[name] = {label(kappa): found for kappa, found in messages.items()}
        report.notes += [f"{name}: {message}" for found in messages.values() for message in found]
    report.rows = [number("robots", len(lines)), number("falls at each kappa", falls)]
    for k, (kappa, bar) in enumerate(zip(KAPPAS, BARS, strict=True), start=1):
        report.rows.append(number(f"not solved to the end, {label(kappa)}", sum(line[k] for line in lines), bar))
    report.tables = [Table("Falls not solved to the end", ("", *map(label, KAPPAS)), lines)]
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
