"""Motions that a fixed time step cannot follow: refused with whole steps, solved with divided steps.

    pip install --no-deps "example-robot-data>=6" && pip install pybullet        for robots from files
    python benchmarks/division.py            --match "chain of 5 |spin" for some of them

Every motion runs twice: with divide=False, up to the first refused step, and with the default. The table has the number
of divided steps, the largest number of parts, the number of steps that lost relative momentum
of bodies, and the processor time of a step in both runs.

Pendulums, which lose nothing, and spinning bodies also run with accuracy=1e-4 on the same grid of states: a second
table has the largest change of the energy, over the largest kinetic energy, with divided steps and with the accuracy.
The bar of the latter is 1 %.
"""

from __future__ import annotations

import argparse
import re
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from command import deliver, number, parser, progress
from urdf_zoo import package_files

import dojo_opt as dojo
from dojo_opt.report.result import Report, Table
from solvers.types import Vector

ACCURACY = 1e-4  # [m, rad] per second
Motion = tuple[dojo.Simulator, Vector, Vector]  # simulator, first state, inputs (T, nu)


def chain(links: int, heavy: float = 1.0) -> dojo.Mechanism:
    """An undamped pendulum of 2 m and 2 kg; heavy: factor of the mass of its last link."""
    length, mass, radius = 2.0 / links, 2.0 / links, 0.02 * min(1.0, 10.0 / links)
    across, along = mass / 12.0 * (3.0 * radius**2 + length**2), 0.5 * mass * radius**2
    bodies = [dojo.Body(f"link{k}", mass, (across, across, along)) for k in range(links)]
    bodies[-1] = replace(bodies[-1], mass=heavy * mass, inertia=heavy * np.asarray(bodies[-1].inertia))
    below = (0.0, 0.0, 0.5 * length)
    joints = [
        dojo.Joint(
            "revolute",
            f"link{k - 1}" if k else None,
            f"link{k}",
            parent_point=(0.0, 0.0, -0.5 * length if k else 0.0),
            child_point=below,
            axis=(0.0, -1.0, 0.0),
        )
        for k in range(links)
    ]
    return dojo.Mechanism(bodies, joints, inputs=())


def released(mechanism: dojo.Mechanism, time_step: float, seconds: float) -> Motion:
    """A pendulum from the horizontal."""
    sim = dojo.Simulator(mechanism, time_step)
    q = np.zeros(sim.nq)
    q[0] = 0.5 * np.pi
    return sim, sim.state_from_velocity(q, np.zeros(sim.nv)), np.zeros((round(seconds / time_step), sim.nu))


def spin(rate: float) -> Motion:
    """A body that spins nearly about its middle axis, at 10 ms."""
    body = dojo.Body("body", 1.0, (0.1, 0.2, 0.3))
    sim = dojo.Simulator(dojo.Mechanism([body], [dojo.Joint("floating", None, "body")], gravity=(0, 0, 0)), 0.01)
    x = sim.neutral()
    x[-3:] = (0.1, rate, 0.2)
    return sim, sim.state_from_velocity(x[: sim.nq], x[sim.nq :]), np.zeros((100, 0))


def on_the_ground() -> Motion:
    """A free chain of 100 links falls on the ground, 10 ms."""
    from benchmarks.studies.stability.chain_trials import on_the_ground as trial

    found = trial(0.01)
    sim = dojo.Simulator(found.mechanism, 0.01)
    return sim, sim.state_from_velocity(found.q, found.v), np.zeros((200, sim.nu))


def tower(kappa: float) -> Motion:
    """Ten boxes on one another, 10 ms."""
    from support.towers import EDGE
    from support.towers import tower as boxes

    sim = dojo.Simulator(boxes(dojo.Box(EDGE, EDGE, EDGE), [1.0] * 10), 0.01, kappa)
    return sim, sim.neutral(), np.zeros((200, sim.nu))


def dropped(file: Path, time_step: float, seconds: float) -> Motion:
    """A robot from a file falls from its neutral state."""
    sim = dojo.Simulator(dojo.load_urdf(file, repair=True), time_step)
    return sim, sim.neutral(), np.zeros((round(seconds / time_step), sim.nu))


def _files() -> list[tuple[str, Callable[[], Motion]]]:
    """Robots from files; their motions used to end early."""
    found: list[tuple[str, Callable[[], Motion]]] = []
    for file in package_files():
        if file.name in ("laikago_toes.urdf", "g1_29dof_with_hand_rev_1_0.urdf"):
            for h in (0.005, 0.01):
                found.append((f"{file.stem} falls, {1e3 * h:g} ms", lambda f=file, h=h: dropped(f, h, 2.0)))
    return found


def motions() -> list[tuple[str, Callable[[], Motion]]]:
    """Names and functions that set up the motions."""
    chains = ((5, 10.0, 100.0), (10, 10.0, 100.0), (50, 2.5, 100.0), (100, 1.0, 100.0))
    return [
        *(
            (f"chain of {n} links, {h:g} ms, {s:g} s", lambda n=n, h=h, s=s: released(chain(n), 1e-3 * h, s))
            for n, h, s in chains
        ),
        ("tip 500 times heavier, 1 ms, 5 s", lambda: released(chain(10, 500.0), 1e-3, 5.0)),
        *((f"spin of {rate:g} rad/s, 10 ms", lambda rate=rate: spin(rate)) for rate in (100.0, 1000.0, 3000.0)),
        ("free chain of 100 links on the ground, 10 ms", on_the_ground),
        *((f"tower of 10 boxes, kappa {kappa:g}", lambda kappa=kappa: tower(kappa)) for kappa in (1e-6, 1e-5)),
        *_files(),
    ]


def clocked(sim: dojo.Simulator, x: Vector, us: Vector) -> tuple[dojo.Trajectory, float]:
    """(motion, processor time of a step [us])."""
    sim.rollout(x, us[:500])  # compile, the division of early steps too
    begin = time.process_time()
    motion = sim.rollout(x, us)
    return motion, 1e6 * (time.process_time() - begin) / max(motion.solved_steps, 1)


def energy_change(motion: dojo.Trajectory) -> float:
    """Largest change of the energy over the largest kinetic energy; of 500 states, the first and the last included."""
    sim = motion.simulator
    states = motion.x[np.linspace(0, len(motion.x) - 1, 500).astype(int)]
    energy = np.asarray(sim.energy(states))
    return float(np.abs(energy - energy[0]).max() / np.asarray(sim.kinetic_energy(states)).max())


def smooth(sim: dojo.Simulator) -> bool:
    """Whether nothing of a mechanism touches anything."""
    return not sim.mechanism.contacts and not sim.mechanism.collisions


def run(args: argparse.Namespace) -> Report:
    """Every motion whose name has a match."""
    warnings.simplefilter("ignore")  # warnings about robots' files
    report = Report("Steps that are divided", "")
    chosen = [(name, (name, build)) for name, build in motions() if re.search(args.match, name)]
    lines, kept, refused = [], [], 0
    for name, build in progress()((chosen[6:7] or chosen[:1]) if args.quick else chosen, "motions"):
        sim, x, us = build()
        whole, cost = clocked(sim.replace(divide=False), x, us)
        motion, divided_cost = clocked(sim, x, us)
        refused += not motion.success
        ended = "end" if whole.success else f"{whole.solved_steps * sim.time_step:.3g} s, {whole.status.name}"
        reached = "end" if motion.success else f"{motion.solved_steps * sim.time_step:.3g} s, {motion.status.name}"
        parts = motion.parts
        if smooth(sim):
            exact, exact_cost = clocked(sim.replace(accuracy=ACCURACY), x, us)
            refused += not exact.success
            kept.append([name, energy_change(motion), energy_change(exact), divided_cost, exact_cost])
        lines.append(
            [
                name,
                ended,
                reached,
                int((parts > 1).sum()),
                int(parts.max(initial=1)),
                int((motion.momentum_fractions < 1.0).sum()),
            ]
            + [cost, divided_cost]
        )
    report.rows = [number("motions", len(lines)), number("motions that end early", refused, 0)]
    if kept:
        report.rows.append(number("change of energy with an accuracy, largest", max(row[2] for row in kept), 0.01))
    header = (
        "motion",
        "whole steps until",
        "divided until",
        "divided steps",
        "parts",
        "with a share",
        "us",
        "us divided",
    )
    report.tables = [Table("Motions", header, lines)]
    header = ("motion", "change of energy, divided", "with accuracy=1e-4", "us divided", "us with accuracy")
    report.tables.append(Table("Energy", header, kept))
    return report


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    arguments = parser(__doc__)
    arguments.add_argument("--match", default="", help="only motions whose name has a match of this regular expression")
    return deliver("division", run, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
