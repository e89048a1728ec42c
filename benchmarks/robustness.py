"""Solve one step from thousands of random extreme states and count every miss.

    python benchmarks/robustness.py                     20,000 states of each of five seeds, the whole table
    python benchmarks/robustness.py --states 2000 --mechanism hopper

Mechanisms: block (8 corners), hopper (2 balls), quadruped with 4 and with 12 contacts. Orientation uniform, joints
uniform within their limits, linear, angular and joint speeds uniform up to 20 m/s and 20 rad/s; the lowest contact is
0 to 0.3 m above the ground, for half of the states within 1 cm. Friction 0, 0.5, 1, 2; time step 5 to 50 ms; kappa
1e-4 and 1e-8. Two kinds of states are counted apart: those with a body that turns by half a turn or more in one step,
which cannot be represented, and those where every solution found gains energy, so that only a shorter step goes on.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
from command import deliver, number, parser, progress

import dojo_opt as dojo
from dojo_opt.report.result import Cell as TableCell
from dojo_opt.report.result import Report, Table
from solvers.types import Vector

MECHANISMS = {
    "block": lambda friction: dojo.models.block(friction=friction),
    "hopper": lambda friction: dojo.models.raiberthopper(friction=friction, limits=(0.2, 0.8)),
    "quadruped": lambda friction: dojo.models.quadruped(friction=friction),
    "quadruped12": lambda friction: dojo.models.quadruped(friction=friction, contacts="all"),
}
FRICTIONS = (0.0, 0.5, 1.0, 2.0)
TIME_STEPS = (0.005, 0.01, 0.02, 0.05)
KAPPAS = (1e-4, 1e-8)
SEEDS = (0, 1, 2, 3, 4)
SPEED = 20.0  # [m/s, rad/s]
GAIN = 0.1  # of the kinetic energy


@dataclass
class Cell:
    """Counts of one combination of mechanism, friction, time step and kappa."""

    mechanism: str
    friction: float
    time_step: float
    kappa: float
    states: int = 0
    refused: int = 0  # states that a step cannot represent
    gaining: int = 0  # states with solutions that all gain energy
    divided: int = 0  # of the solved steps
    iterations: list[int] = field(default_factory=list)  # of the solved steps
    misses: Counter[str] = field(default_factory=Counter)  # by Status
    unreported: int = 0  # solved by status, but not finite, below the ground, or with more energy than before

    @property
    def solved(self) -> int:
        """Number of steps that met their tolerance."""
        return len(self.iterations)

    def add(self, other: Cell) -> None:
        """Count the states of another cell too."""
        self.states += other.states
        self.refused += other.refused
        self.gaining += other.gaining
        self.divided += other.divided
        self.iterations += other.iterations
        self.misses += other.misses
        self.unreported += other.unreported


def random_unit(rng: np.random.Generator, n: int) -> Vector:
    """Uniform direction in n dimensions."""
    v = rng.normal(size=n)
    return v / np.linalg.norm(v)


def random_state(sim: Any, rng: np.random.Generator) -> Vector:
    """Any orientation, joints within their limits, anything up to SPEED, lowest contact at a random height."""
    mech = sim.mechanism
    x = np.array(sim.neutral())
    x[:2], x[3:7] = 0.0, random_unit(rng, 4)
    for joint in mech.joints[1:]:
        bounds = joint.limits[0] if np.isfinite(joint.limits[0]).all() else (-1.0, 1.0)
        x[mech.q_slice(joint.name)] = rng.uniform(*bounds)
    x[sim.nq :] = rng.uniform(-SPEED, SPEED, size=sim.nv)
    for part in (slice(0, 3), slice(3, 6)):
        x[sim.nq :][part] = rng.uniform(0.0, SPEED) * random_unit(rng, 3)
    x[2] += rng.uniform(0.0, 0.01 if rng.random() < 0.5 else 0.3) - lowest(sim, x)
    return x


def rotated(q: Vector, v: Vector) -> Vector:
    """R(q) v."""
    t = 2.0 * np.cross(q[1:], v)
    return v + q[0] * t + np.cross(q[1:], t)


def lowest(sim: Any, x: Vector) -> float:
    """Smallest gap of the contacts [m]."""
    z, mech = sim.maximal(x), sim.mechanism
    gaps = []
    for contact in mech.contacts:
        body = z[mech.body_names.index(contact.body)]
        gaps.append(body[2] + rotated(body[6:10], np.asarray(contact.point))[2] - contact.radius)
    return float(min(gaps))


def representable(sim: Any, x: Vector) -> bool:
    """Whether every body turned by less than half a turn on its way here: Re(q1^* q2) > 0."""
    back = sim.integrate(x, np.concatenate((-sim.time_step * x[sim.nq :], np.zeros(sim.nv))))
    before, now = sim.maximal(back)[:, 6:10], sim.maximal(x)[:, 6:10]
    return bool(np.all(np.sum(before * now, axis=1) > 0.0))


def run_cell(name: str, friction: float, h: float, kappa: float, states: int, seed: int) -> Cell:
    """One cell of the table; the states depend on the seed, the mechanism and the time step only."""
    sim = dojo.Simulator(MECHANISMS[name](friction), time_step=h, kappa=kappa)
    rng = np.random.default_rng([seed, list(MECHANISMS).index(name), round(1e4 * h)])
    cell, u = Cell(name, friction, h, kappa, states), np.zeros(sim.nu)
    for _ in range(states):
        x = random_state(sim, rng)
        result = sim.step(x, u)
        status = dojo.Status(result.status)
        if not representable(sim, x):
            cell.refused += 1
            cell.unreported += status == dojo.Status.SOLVED
        elif status == dojo.Status.SOLVED:
            cell.iterations.append(int(result.iterations))
            cell.divided += result.parts > 1
            gain = sim.energy(result.x) - sim.energy(x)
            fine = np.isfinite(result.x).all() and lowest(sim, result.x) > -1e-6
            smoothing = kappa / h * len(sim.mechanism.contacts)
            cell.unreported += not (fine and gain <= GAIN * sim.kinetic_energy(x) + smoothing)
        elif status == dojo.Status.ENERGY_GAIN:
            cell.gaining += 1
        else:
            cell.misses[status.name] += 1
    return cell


HEADER = (
    "",
    "states",
    "cannot be represented",
    "gains energy",
    "solved",
    "divided",
    "not solved",
    "median",
    "99 %",
    "most",
    "not solved by status",
)


def line(cell: Cell, label: str) -> list[TableCell]:
    """One row of a table."""
    its = cell.iterations or [0]
    spread = [float(np.median(its)), float(np.percentile(its, 99)), max(its)]
    misses = ", ".join(f"{name} {count}" for name, count in cell.misses.items())
    counts = [cell.states, cell.refused, cell.gaining, cell.solved, cell.divided, cell.misses.total()]
    return [label, *counts, *spread, misses]


def total(cells: list[Cell], name: str) -> Cell:
    """Sum of cells."""
    out = Cell(name, -1.0, -1.0, -1.0)
    for cell in cells:
        out.add(cell)
    return out


def run_seeds(name: str, friction: float, h: float, kappa: float, states: int, seeds: Sequence[int]) -> Cell:
    """One cell of the table, with the states of every seed."""
    cell = Cell(name, friction, h, kappa)
    for seed in seeds:
        cell.add(run_cell(name, friction, h, kappa, states, seed))
    return cell


def study(states: int, mechanisms: list[str], seeds: Sequence[int]) -> list[Cell]:
    """All cells; about `states` states of each seed over all mechanisms."""
    per_cell = max(1, round(states / (len(mechanisms) * len(FRICTIONS) * len(TIME_STEPS) * len(KAPPAS))))
    settings = product(mechanisms, FRICTIONS, TIME_STEPS, KAPPAS)
    named = [
        (f"{name}, friction {mu:g}, {1e3 * h:g} ms, kappa {kappa:g}", (name, mu, h, kappa, per_cell, seeds))
        for name, mu, h, kappa in settings
    ]
    return [run_seeds(*setting) for setting in progress()(named, "robustness")]


def summary(cells: list[Cell]) -> Report:
    """The sums as a table, the misses as rows, the cells as details."""
    report = Report("One step from random extreme states", "")
    whole = total(cells, "all")
    its = whole.iterations or [0]
    report.rows = [
        number("states", whole.states),
        number("not solved", whole.misses.total(), 0),
        number(
            "called solved without being so", whole.unreported, 0, note="not finite, below the ground, or gains energy"
        ),
        number("refused: every solution found gains energy", whole.gaining, 0),
        number("refused: not to be represented", whole.refused, 0),
        number("divided", whole.divided),
        number("iterations, median", float(np.median(its))),
        number("iterations, 99 %", float(np.percentile(its, 99))),
        number("iterations, most", max(its)),
    ]
    parts = {name: [c for c in cells if c.mechanism == name] for name in MECHANISMS}
    parts |= {f"h = {h:g} s": [c for c in cells if c.time_step == h] for h in TIME_STEPS}
    parts |= {f"kappa {kappa:g}": [c for c in cells if c.kappa == kappa] for kappa in KAPPAS}
    lines = [line(total(part, name), name) for name, part in parts.items() if part]
    report.tables = [Table("Iterations", HEADER, [*lines, line(whole, "all")])]
    report.details = {"cells": [{**vars(c), "iterations": dict(sorted(Counter(c.iterations).items()))} for c in cells]}
    return report


def run(args: argparse.Namespace) -> Report:
    """The whole table."""
    states, seeds = (256, args.seeds[:1]) if args.quick else (args.states, args.seeds)
    return summary(study(states, args.mechanism or list(MECHANISMS), seeds))


def main(argv: list[str] | None = None) -> int:
    """Print or write the report; exit status 1 if a state was missed."""
    arguments = parser(__doc__)
    arguments.add_argument("--states", type=int, default=20_000, help="states of a seed, over all cells")
    arguments.add_argument("--mechanism", choices=MECHANISMS, action="append", help="only this one (may be repeated)")
    arguments.add_argument("--seeds", type=int, nargs="+", default=SEEDS)
    return deliver("robustness", run, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
