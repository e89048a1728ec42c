"""Mechanisms with closed loops over many steps: violation of the loops, error of the energy, time of a step.

    python benchmarks/loops.py [steps]        100,000 by default; in chunks, so that memory stays small

gap        largest violation of any loop constraint, every tenth step [m, rad]
energy     largest change from the energy at the first step, over the largest kinetic energy; for the models without
           their contacts, limits and dampers
us         processor time per step [us] of these models, and of the same mechanism with its loops cut, as a tree
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace

import numpy as np
from command import deliver, number, parser, progress

import dojo_opt as dojo
from dojo_opt.report.result import Report, Table

NAMES = ("fourbar", "fivebar", "minitaur_leg", "stewart", "delta")
STEP, CHUNK = 0.005, 5000
# settings that keep the motion away from singular configurations, where branches of the loop meet
HELD = {
    "fivebar": {"spring": 20.0},
    "minitaur_leg": {"gravity": (0.0, 0.0, 0.0)},
    "stewart": {"spring": 500.0, "gravity": (0.0, 0.0, 0.0)},
    "delta": {"gravity": (0.0, 0.0, 0.0)},
}
MOTOR_SPRING = {"delta": 20.0}  # [N m/rad], at rest in the neutral state


def passive(name: str) -> dojo.Mechanism:
    """The model without contacts, limits, dampers and armature."""
    mech = getattr(dojo.models, name)(**HELD.get(name, {}))
    joints = [replace(j, damper=0.0, limits=None, armature=0.0) for j in mech.joints]
    if name in MOTOR_SPRING:
        at = {j.name: float(mech.neutral[mech.q_slice(j.name).start]) for j in joints}
        held = {"spring": MOTOR_SPRING[name]}
        joints = [replace(j, **held, rest=at[j.name]) if j.name.startswith("motor") else j for j in joints]
    return replace(mech, contacts=(), joints=joints)


def start(sim: dojo.Simulator, speed: float) -> np.ndarray:
    """The neutral state, on the move."""
    x = sim.neutral()
    x[sim.nq :] = speed * np.random.default_rng(0).normal(size=sim.nv)
    return sim.close(x)


def seconds(sim: dojo.Simulator, x: np.ndarray, steps: int = 2000) -> float:
    """Processor time of a step."""
    us = np.zeros((steps, sim.nu))
    sim.rollout(x, us[:10])
    begin = time.process_time()
    done = sim.rollout(x, us)
    return (time.process_time() - begin) / max(1, done.solved_steps)


def gap(sim: dojo.Simulator, x: np.ndarray) -> float:
    """Largest violation of a loop."""
    return max(float(np.abs(g).max()) for g in sim.loop_gaps(x).values())


def motion(name: str, steps: int) -> tuple[int, float, float, float, float, str]:
    """(steps solved, largest gap, energy error, us per step, us per step of the tree, why it ended early)."""
    sim = dojo.Simulator(passive(name), time_step=STEP, tolerance=1e-11)
    x = start(sim, 0.3)
    cost = 1e6 * seconds(sim, x)
    tree = dojo.Simulator(replace(sim.mechanism, loops=()), time_step=STEP, tolerance=1e-11)
    apart = 1e6 * seconds(tree, x)
    done, worst, energies, kinetic, end = 0, 0.0, [], 0.0, ""
    while done < steps:
        t = sim.rollout(x, np.zeros((min(CHUNK, steps - done), sim.nu)))
        worst = max(worst, *(gap(sim, y) for y in t.x[1::10]))
        energies.append(sim.energy(t.x[1:]))
        kinetic = max(kinetic, float(sim.kinetic_energy(t.x[1:]).max()))
        x, done = t.x[-1], done + t.solved_steps
        if not t.success:
            end = str(t.message)
            break
    energy = np.concatenate(energies)
    return done, worst, float(np.abs(energy - energy[0]).max() / kinetic), cost, apart, end


def run(args: argparse.Namespace) -> Report:
    """All mechanisms."""
    report = Report("Closed loops over many steps", "")
    steps = 1000 if args.quick else args.steps
    lines = []
    for name in progress()([(name, name) for name in NAMES], "loops"):
        *numbers, end = motion(name, steps)
        lines.append([name, *numbers])
        report.notes += [f"{name}: {end}"] if end else []
    done, gaps, energies, costs, trees = zip(*(line[1:] for line in lines), strict=True)
    report.rows = [
        number("steps of each mechanism", steps),
        number("steps that are missing", len(NAMES) * steps - sum(done), 0),
        number("largest gap", max(gaps), 1e-10, unit="m, rad"),
        number("largest change of energy", max(energies), unit="of the kinetic energy"),
        number("a step over that of the tree, most", max(c / t for c, t in zip(costs, trees, strict=True))),
    ]
    report.tables = [Table(f"{steps:,} steps of 5 ms", ("", "steps", "gap", "energy", "us", "tree us"), lines)]
    return report


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    arguments = parser(__doc__)
    arguments.add_argument("steps", nargs="?", type=int, default=100_000)
    return deliver("loops", run, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
