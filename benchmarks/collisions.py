"""Random collisions of two free bodies: how many motions are solved to the end, keep momentum, and gain no energy.

    python benchmarks/collisions.py             60 motions per pair of shapes; then the cost of far pairs
    python benchmarks/collisions.py --motions 240

Every motion: two bodies of 1 and 2 kg, a metre apart, turned and spinning at random, towards one another at 4 m/s,
friction 0.5, no gravity, 60 steps of 10 ms.

Far pairs: 20 balls in space that hardly move, on a grid; one pair of them may collide, or 19, or all 190.
"""

from __future__ import annotations

import argparse
import sys
import time
from itertools import combinations

import numpy as np
from command import deliver, number, parser, progress

import dojo_opt as dojo
from dojo_opt.report.result import Cell, Report, Table
from support.two_bodies import ALL, approaching, two

BALLS = [f"b{k}" for k in range(20)]
GAIN = 1e-2  # [J] more than kappa pushes from afar


HEADER = ("", "not solved", "gain energy", "drift of momentum", "iterations in contact, median", "99 %", "most")


def pair(a: str, b: str, motions: int) -> list[Cell]:
    """A row of the table."""
    sim = dojo.Simulator(two(ALL[a], ALL[b]), time_step=0.01)
    runs = [sim.rollout(approaching(sim, seed, 1.0), np.zeros((60, sim.nu))) for seed in range(motions)]
    gains = sum(bool(np.diff(sim.energy(run.x)).max() > GAIN) for run in runs)
    drift = max(float(np.ptp(np.hstack(sim.momentum(run.x)), axis=0).max()) for run in runs)
    touching = [np.abs(run.contacts.impulse).max(axis=(1, 2)) > 1e-2 for run in runs]
    steps = np.concatenate([run.iterations[now] for run, now in zip(runs, touching, strict=True)])
    unsolved = sum(not run.success for run in runs)
    spread = (float(np.median(steps)), float(np.percentile(steps, 99)), int(steps.max()))
    return [f"{a}, {b}", unsolved, gains, drift, *spread]


def cost(pairs: list[tuple[str, str]], spacing: float, kappa: float) -> float:
    """Processor time of a step of 20 balls [us], the least of five rollouts of 50 steps."""
    bodies = [dojo.Body(name, 1.0, shape=dojo.Sphere(0.1)) for name in BALLS]
    joints = [dojo.Joint("floating", None, name) for name in BALLS]
    mech = dojo.Mechanism(bodies, joints, collisions=[dojo.Collision(a, b) for a, b in pairs], gravity=(0, 0, 0))
    sim = dojo.Simulator(mech, time_step=0.01, kappa=kappa)
    grid = spacing * np.array([(k // 10, k // 5 % 2, k % 5) for k in range(len(BALLS))])
    q = np.hstack([grid, np.tile([1.0, 0.0, 0.0, 0.0], (len(BALLS), 1))]).ravel()
    x = np.concatenate([q, 0.1 * np.random.default_rng(0).normal(size=sim.nv)])
    us = np.zeros((50, sim.nu))
    best = np.inf
    for _ in range(5):
        begin = time.process_time()
        sim.rollout(x, us, throw=True)
        best = min(best, time.process_time() - begin)
    return 1e6 * best / len(us)


def far_pairs(kappas: tuple[float, ...]) -> Table:
    """Cost of pairs that may collide, by their distance."""
    settings = [(kappa, spacing) for kappa in kappas for spacing in (0.4, 1.0, 3.0)]
    sets = [(BALLS[0], BALLS[1])], list(zip(BALLS[:-1], BALLS[1:], strict=True)), list(combinations(BALLS, 2))
    lines: list[list[Cell]] = []
    named = [(f"kappa {kappa:g}, {spacing:g} m apart", (kappa, spacing)) for kappa, spacing in settings]
    for (kappa, spacing), (label, _) in zip(progress()(named, "far pairs"), named, strict=True):
        one, chain, every = (cost(pairs, spacing, kappa) for pairs in sets)
        lines.append([label, one, chain, every, (every - one) / 189])
    header = ("", "1 pair", "19 pairs", "190 pairs", "more, per pair")
    return Table("us per step of 20 balls", header, lines)


def run(args: argparse.Namespace) -> Report:
    """Both tables."""
    report = Report("Random collisions of two bodies", "")
    names = list(ALL)[: 2 if args.quick else None]
    motions = 5 if args.quick else args.motions
    pairs = [(a, b) for k, a in enumerate(names) for b in names[k:]]
    lines = [pair(a, b, motions) for a, b in progress()([(f"{a}, {b}", (a, b)) for a, b in pairs], "collisions")]
    unsolved, gains, drift = ([line[k] for line in lines] for k in (1, 2, 3))
    report.rows = [
        number("motions of a pair", motions),
        number("collisions", motions * len(pairs)),
        number("not solved", sum(unsolved), note="; ".join(str(line[0]) for line in lines if line[1])),
        number("gain energy", sum(gains), 0, note=f"more than {GAIN:g} J in a step"),
        number("drift of momentum", max(drift), unit="N s, N m s"),
    ]
    report.tables = [Table("Collisions", HEADER, lines), far_pairs((1e-8,) if args.quick else (1e-10, 1e-8, 1e-6))]
    return report


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    arguments = parser(__doc__)
    arguments.add_argument("--motions", type=int, default=60, help="per pair of shapes")
    return deliver("collisions", run, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
