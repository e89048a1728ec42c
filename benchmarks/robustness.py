"""Solve one step from thousands of random extreme states and count every miss.

    python benchmarks/robustness.py                     20,000 states, the whole table
    python benchmarks/robustness.py --states 2000 --mechanism hopper --json

Mechanisms: block (8 corners), hopper (2 balls), quadruped with 4 and with 12 contacts. Orientation uniform, joints
uniform within their limits, linear, angular and joint speeds uniform up to 20 m/s and 20 rad/s; the lowest contact is
0 to 0.3 m above the ground, for half of the states within 1 cm. Friction 0, 0.5, 1, 2; time step 5 to 50 ms; kappa
1e-4 and 1e-8. A state whose body turns by half a turn or more in one step cannot be represented: counted apart.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from dataclasses import asdict, dataclass, field
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

import dojo_opt as dojo

Vector = NDArray[np.float64]

MECHANISMS = {
    "block": lambda friction: dojo.models.block(friction=friction),
    "hopper": lambda friction: dojo.models.raiberthopper(friction=friction, limits=(0.2, 0.8)),
    "quadruped": lambda friction: dojo.models.quadruped(friction=friction),
    "quadruped12": lambda friction: dojo.models.quadruped(friction=friction, contacts="all"),
}
FRICTIONS = (0.0, 0.5, 1.0, 2.0)
TIME_STEPS = (0.005, 0.01, 0.02, 0.05)
KAPPAS = (1e-4, 1e-8)
SPEED = 20.0  # [m/s, rad/s]


@dataclass
class Cell:
    """Counts of one combination of mechanism, friction, time step and kappa."""

    mechanism: str
    friction: float
    time_step: float
    kappa: float
    states: int = 0
    refused: int = 0  # states that a step cannot represent
    iterations: list[int] = field(default_factory=list)  # of the solved steps
    misses: Counter[str] = field(default_factory=Counter)  # by Status
    unreported: int = 0  # solved by status, but not finite or below the ground

    @property
    def solved(self) -> int:
        """Number of steps that met their tolerance."""
        return len(self.iterations)

    def add(self, other: Cell) -> None:
        """Count the states of another cell too."""
        self.states += other.states
        self.refused += other.refused
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
            cell.unreported += not (np.isfinite(result.x).all() and lowest(sim, result.x) > -1e-6)
        else:
            cell.misses[status.name] += 1
    return cell


HEADER = (
    f"{'mechanism':<12} {'friction':>8} {'h':>6} {'kappa':>7} {'states':>7} {'refused':>8} {'solved':>9} "
    f"{'median':>6} {'99 %':>5} {'max':>4}  misses"
)


def line(cell: Cell) -> str:
    """One row of the table; a sum over settings shows them as '-'."""
    tried = cell.states - cell.refused
    its = np.array(cell.iterations) if cell.iterations else np.array([0])
    share = 100.0 * cell.solved / tried if tried else 100.0
    settings = [f"{value:g}" if value > -1.0 else "-" for value in (cell.friction, cell.time_step, cell.kappa)]
    misses = ", ".join(f"{name} {count}" for name, count in cell.misses.items())
    if cell.unreported:
        misses += f"  UNREPORTED {cell.unreported}"
    return (
        f"{cell.mechanism:<12} {settings[0]:>8} {settings[1]:>6} {settings[2]:>7} {cell.states:>7} {cell.refused:>8} "
        f"{share:>8.2f}% {np.median(its):>6.0f} {np.percentile(its, 99):>5.0f} {its.max():>4}  {misses}"
    )


def total(cells: list[Cell], name: str) -> Cell:
    """Sum of cells."""
    out = Cell(name, -1.0, -1.0, -1.0)
    for cell in cells:
        out.add(cell)
    return out


def study(states: int, mechanisms: list[str], seed: int, out: Any = None) -> list[Cell]:
    """All cells; about `states` states over all mechanisms."""
    per_cell = max(1, round(states / (len(mechanisms) * len(FRICTIONS) * len(TIME_STEPS) * len(KAPPAS))))
    cells: list[Cell] = []
    if out:
        print(HEADER, file=out)
    for name, friction, h, kappa in product(mechanisms, FRICTIONS, TIME_STEPS, KAPPAS):
        cells.append(run_cell(name, friction, h, kappa, per_cell, seed))
        if out:
            print(line(cells[-1]), file=out, flush=True)
    return cells


def main(argv: list[str] | None = None) -> int:
    """Print the table and the sums; exit status 1 if a miss was not reported."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--states", type=int, default=20_000, help="states over all cells")
    parser.add_argument("--mechanism", choices=MECHANISMS, action="append", help="only this one (may be repeated)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true", help="print the cells as JSON")
    args = parser.parse_args(argv)
    names = args.mechanism or list(MECHANISMS)
    begin = time.perf_counter()
    cells = study(args.states, names, args.seed, None if args.json else sys.stdout)
    if args.json:
        print(json.dumps([asdict(cell) for cell in cells]))
    else:
        print()
        print(HEADER)
        for name in names:
            print(line(total([cell for cell in cells if cell.mechanism == name], name)))
        for h in TIME_STEPS:
            print(line(total([cell for cell in cells if cell.time_step == h], f"h = {h:g}")))
        for kappa in KAPPAS:
            print(line(total([cell for cell in cells if cell.kappa == kappa], f"kappa {kappa:g}")))
        print(line(total(cells, "all")))
        print(f"{time.perf_counter() - begin:.1f} s")
    return 1 if any(cell.unreported for cell in cells) else 0


if __name__ == "__main__":
    sys.exit(main())
