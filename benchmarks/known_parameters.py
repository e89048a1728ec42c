"""Identification of known parameters from noisy motions in contact: how often a fit finds the truth.

    NUMBA_NUM_THREADS=1 python benchmarks/known_parameters.py [CASE ...] [--seeds N]

The measured states of simulated motions have a noise, given in m and rad and ten times as large in m/s and rad/s, and
`identify` knows it. Whole motions are predicted from their first states, by default settings. `go2` slides with random
torques for .4 s, three times (friction, mass of the base); `quadruped` trots in feedback with a payload (its mass,
friction, damping of a thigh); `cube` is tossed four times for .54 s (friction, restitution, inertia); `panda` swings
with a payload in its hand, without contact, twice for .4 s (mass of the hand, damping of a joint). A fit is right if
it is solved and all parameters are within three standard deviations of the truth, and dishonest if it is solved and one
is further off than five. Without example-robot-data there are no go2 and panda.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from command import deliver, number, parser, progress
from cube import HALF
from cube import cube as tossed_cube
from urdf_zoo import package_files

import dojo_opt as dojo
from dojo_opt.report.result import Cell, Report, Table

NOISE = (1e-4, 1e-3, 1e-2)  # [m, rad]
RATES = 10.0  # times the noise: that of velocities
WITHIN, DISHONEST = 3.0, 5.0  # standard deviations
MISSED = 0.25  # share of the fits that may miss the truth
HEADER = ("case", "noise", "seed", "status", "deviations off", "largest error [%]", "rms", "iterations", "time [s]")


class KnownCase(NamedTuple):
    """A simulator to begin with, motions of the true one, and its values."""

    guess: dojo.Simulator
    motions: list[dojo.Trajectory]
    truth: dict[str, float]


def urdf(name: str, **settings: Any) -> dojo.Mechanism:
    """A robot of example-robot-data."""
    return dojo.load_urdf(next(file for file in package_files() if file.name == name), **settings)


def go2(rng: np.random.Generator) -> KnownCase:
    """Go2 on ball feet slides sideways at 1 m/s."""
    feet = [dojo.Contact(f"{leg}_foot", radius=0.022) for leg in ("FL", "FR", "RL", "RR")]
    guess, truth = (
        dojo.Simulator(urdf("go2.urdf", contacts=feet), time_step=0.005),
        {"friction:*": 0.33, "mass:base": 9.0},
    )
    x, u = dojo.equilibrium(guess)
    x[guess.nq] = 1.0
    real = guess.with_parameters(truth)
    return KnownCase(guess, [real.rollout(x, u + rng.normal(size=(80, guess.nu)), throw=True) for _ in range(3)], truth)


def quadruped(rng: np.random.Generator) -> KnownCase:
    """The library's quadruped trots with a payload on its back."""
    problem = dojo.problems.trot()
    plan, guess = dojo.ilqr(problem), problem.sim
    truth = {"mass:trunk": 7.5, "friction:*": 0.35, "damper:FL_thigh": 0.15}
    start = guess.integrate(plan.x[0], 0.01 * rng.standard_normal(guess.ndx))
    real = guess.with_parameters(truth)
    return KnownCase(guess, [real.rollout_feedback(start, plan.u, plan.x, Ks=plan.K, throw=True)], truth)


def cube(rng: np.random.Generator) -> KnownCase:
    """A cube is tossed as in ContactNets, and tumbles."""
    truth = {"friction:*": 0.18, "restitution:*": 0.125, "inertia:cube[xx]": 8.1e-4}
    guess = tossed_cube(0.3, 0.05, HALF).replace(kappa=None).with_parameters({"inertia:cube[xx]": 6.5e-4})
    real, motions = guess.with_parameters(truth), []
    for _ in range(4):
        x = real.neutral()
        turn = rng.standard_normal(4)
        x[2], x[3:7] = 0.15, turn / np.linalg.norm(turn)
        x[7:10], x[10:13] = rng.uniform((-1.0, -1.0, -1.0), (1.0, 1.0, 0.0)), rng.uniform(-6.0, 6.0, 3)
        motions.append(real.rollout(x, np.zeros((80, 0)), throw=True))
    return KnownCase(guess, motions, truth)


def panda(rng: np.random.Generator) -> KnownCase:
    """Panda swings with 1.5 kg more in its hand, by random torques."""
    fingers = ["panda_finger_joint1", "panda_finger_joint2"]
    guess = dojo.Simulator(urdf("panda.urdf", floating=False, locked=fingers), time_step=0.005)
    hand = f"mass:{guess.mechanism.bodies[-1].name}"
    truth = {hand: float(guess.parameters((hand,)).values[0]) + 1.5, "damper:panda_joint4": 2.0}
    x, real, motions = guess.neutral(), guess.with_parameters(truth), []
    x[:7] = 0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.7
    for _ in range(2):
        us = 0.3 * np.cumsum(rng.normal(size=(80, guess.nu)), axis=0)
        motions.append(real.rollout(x, us, throw=True))
    return KnownCase(guess, motions, truth)


CASES: dict[str, Callable[[np.random.Generator], KnownCase]] = {
    "go2": go2,
    "quadruped": quadruped,
    "cube": cube,
    "panda": panda,
}
FROM_FILES = ("go2", "panda")


def fitted(case: KnownCase, noise: float, seed: int) -> tuple[dojo.Identified, float]:
    """A fit to noisy measurements, and the largest error over its standard deviation."""
    sim, rng = case.guess, np.random.default_rng(100 + seed)
    deviation = np.repeat((noise, RATES * noise), (sim.nv, sim.nv))
    logs = []
    for motion in case.motions:
        measured = sim.integrate(motion.x, deviation * rng.standard_normal((len(motion.x), sim.ndx)))
        logs.append((measured, motion.u))
    found = dojo.identify(sim, logs, tuple(case.truth), noise=deviation)
    off = np.abs(found.values - list(case.truth.values()))
    known = np.isfinite(found.deviation)
    return found, float(np.max(np.where(known, off / found.deviation, np.inf)))


def line(name: str, case: KnownCase, noise: float, seed: int) -> list[Cell]:
    """A line of the table."""
    found, off = fitted(case, noise, seed)
    share = 100.0 * float(np.max(np.abs(found.values / list(case.truth.values()) - 1.0)))
    return [name, noise, seed, found.status.name, off, share, found.rms, len(found.history), found.cpu_seconds]


def run(given: argparse.Namespace) -> Report:
    """Fits of all cases, noises and seeds."""
    seeds, noises = (1, NOISE[:1]) if given.quick else (given.seeds, NOISE)
    names = [name for name in given.cases or CASES if name not in FROM_FILES or package_files()]
    if given.quick:
        names = names[-1:]
    jobs = [(f"{name} {seed}", (name, seed)) for name, seed in product(names, range(seeds))]
    rows: list[list[Cell]] = []
    for name, seed in progress()(jobs, "fits"):
        case = CASES[name](np.random.default_rng(seed))
        rows += [line(name, case, noise, seed) for noise in noises]
    solved = np.array([row[3] == "SOLVED" for row in rows])
    off, owner = np.array([row[4] for row in rows], dtype=float), np.array([row[0] for row in rows])
    right = solved & (off < WITHIN)
    report = Report("Identification: known parameters from noisy motions")
    for name in names:
        count = f"{int(right[owner == name].sum())} of {int((owner == name).sum())} right"
        report.rows.append(number(f"{name}: fits that miss", float(np.mean(~right[owner == name])), MISSED, note=count))
    report.rows.append(number("fits", len(rows)))
    report.rows.append(number("fits that are right", int(right.sum())))
    report.rows.append(number("solved, but further off", float(np.sum(solved & (off > DISHONEST))), 0.0))
    report.tables = [Table("Fits", HEADER, rows)]
    return report


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    arguments = parser(__doc__)
    arguments.add_argument("cases", nargs="*", default=[], metavar="CASE", help=", ".join(CASES))
    arguments.add_argument("--seeds", type=int, default=3, help="seeds of motions and noise (default 3)")
    return deliver("known_parameters", run, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
