"""Humanoids in closed loop: runs under pushes, payload, other friction and uneven ground, and the times of their ticks.

    NUMBA_NUM_THREADS=1 python benchmarks/humanoids.py [CASE ...] [--runs N] [--first SEED] [--robot NAME]

Atlas, 174 kg and 30 hinges, is that of `models.atlas`; g1 and talos come from the URDF files of example-robot-data.
`tasks.humanoid_mpc` gives a cadence and a velocity, and no footholds. Every run takes 10 s on a plant with steps of
1 ms and a kappa of 1e-8. It is pushed at its pelvis by 30 N s in a random direction at a random time between 3 and 6 s,
carries a payload of up to a twentieth of its weight there, and has a friction between .5 and .8. `uneven` has
waves of the ground in two directions, 5 cm from their lowest to their highest place, which the controller is not told.
A run succeeds if the robot does not fall, its mean speed over the last 5 s is within .1 m/s of the command and, if
it turns, its mean rate of turn within .1 rad/s. Ticks are timed by the processor, on one core.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from typing import Any

import numpy as np
from command import deliver, number, parser, progress
from urdf_zoo import package_files

import dojo_opt as dojo
from dojo_opt.plant.closed_loop import ClosedLoop
from dojo_opt.plant.tick import milliseconds
from dojo_opt.report.result import Cell, Report, Row, Table

CASES: dict[str, tuple[float, float, float]] = {
    "stand": (0.0, 0.0, 0.0),
    "walk_2": (0.2, 0.0, 0.0),
    "walk_4": (0.4, 0.0, 0.0),
    "walk_6": (0.6, 0.0, 0.0),
    "sideways": (0.0, 0.2, 0.0),
    "turn": (0.3, 0.0, 0.4),
    "uneven": (0.3, 0.0, 0.0),
}  # [m/s, m/s, rad/s]
FILES = {"g1": "g1_29dof_rev_1_0.urdf", "talos": "talos_reduced.urdf"}
PUSH, PAYLOAD, FRICTION, ROUGH = 30.0, 0.05, (0.5, 0.8), 0.05  # [N s], share of the mass, [m]
OFF, OFF_TURN, ALLOWED = 0.1, 0.1, 20.0  # [m/s], [rad/s], [ms]
SECONDS, QUICK = 10.0, 0.3
LEAST = 0.9  # share of the runs that have to succeed
HEADER = (
    *("case", "succeed", "of", "stay up", "tick [ms]", "99 % [ms]", "knot [ms]", "fell back", "of ticks"),
    *("speed [m/s]", "turn [rad/s]", "largest torque [N m]", "other ends"),
)


def robot(name: str) -> Any:
    """A robot by its name."""
    if name == "atlas":
        return None
    found = [file for file in package_files() if file.name == FILES[name]]
    if not found:
        raise SystemExit(f"{name} needs example-robot-data: pip install 'dojo-opt[robots]'")
    return dojo.load_urdf(found[0])


def uneven(rng: np.random.Generator) -> dojo.Terrain:
    """Waves of .8 to 1.6 m in two directions, level around the start, `ROUGH` from lowest to highest."""
    k, phase = 2.0 * np.pi / rng.uniform(0.8, 1.6, 2), rng.uniform(0.0, 2.0 * np.pi, 2)

    def height(x: Any, y: Any) -> Any:
        away = np.clip(np.hypot(x, y) - 0.5, 0.0, 1.0)
        return 0.25 * ROUGH * away * (np.sin(k[0] * x + phase[0]) + np.sin(k[1] * y + phase[1]))

    return dojo.Terrain.from_function(height, np.arange(-4.0, 8.0, 0.05), np.arange(-4.0, 4.0, 0.05))


def runs(case: str, name: str, seeds: range, seconds: float) -> list[ClosedLoop]:
    """The perturbed runs of one case."""
    mpc = dojo.tasks.humanoid_mpc(CASES[case], robot=robot(name))
    plant = dojo.tasks.plant(mpc)
    mass = sum(body.mass for body in mpc.nominal.mechanism.bodies)
    sampler = dojo.Disturbances(
        mpc.nominal.nv, push=(PUSH, PUSH), push_time=(3.0, 6.0), payload=(0.0, PAYLOAD * mass), friction=FRICTION
    )
    out = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        drawn = sampler(rng)
        if case == "uneven":
            drawn = replace(drawn, terrain=uneven(rng))
        mpc.reset()
        out.append(dojo.closed_loop(mpc, plant.perturbed(drawn), seconds))
    return out


def velocities(loop: ClosedLoop) -> tuple[float, float, float]:
    """Mean velocity over ground in the last half of a run, forward and to the left [m/s], and rate of turn [rad/s].

    On a circle at a constant rate the direction of the chord is that of the velocity halfway.
    """
    half = loop.x[len(loop.x) // 2 :]
    seconds = max(len(half) - 1, 1) * loop.simulator.time_step
    heading = np.unwrap(2.0 * np.arctan2(half[:, 6], half[:, 3]), period=2.0 * np.pi)
    turned, halfway = float(heading[-1] - heading[0]), 0.5 * float(heading[-1] + heading[0])
    x, y = (half[-1, :2] - half[0, :2]) / max(abs(np.sinc(0.5 * turned / np.pi)), 0.1) / seconds
    c, s = np.cos(halfway), np.sin(halfway)
    return float(c * x + s * y), float(c * y - s * x), turned / seconds


def speeds(case: str, loop: ClosedLoop) -> tuple[float, float]:
    """Mean speed in the direction that was asked for [m/s], or in any where none was, and rate of turn [rad/s]."""
    asked, (forward, left, turn) = np.array(CASES[case][:2]), velocities(loop)
    length = float(np.hypot(*asked))
    return float(asked @ (forward, left)) / length if length else float(np.hypot(forward, left)), turn


def succeeds(case: str, loop: ClosedLoop) -> bool:
    """Whether a run stays up, at the speed and rate of turn that were asked for."""
    forward, left, turn = CASES[case]
    speed, rate = speeds(case, loop)
    return bool(loop.survived and abs(speed - np.hypot(forward, left)) < OFF and abs(rate - turn) < OFF_TURN)


def line(case: str, name: str, loops: list[ClosedLoop], nu: int) -> list[Cell]:
    """A line of the table."""
    cpu = np.concatenate([milliseconds(loop.log, cpu=True) for loop in loops])
    median, late = (float(np.median(cpu)), float(np.percentile(cpu, 99))) if cpu.size else (np.nan, np.nan)
    period = float(np.median(np.diff([tick.time for tick in loops[0].log]))) if len(loops[0].log) > 1 else np.nan
    up = sum(loop.survived for loop in loops)
    fallbacks, ticks = sum(tick.fallback for loop in loops for tick in loop.log), sum(len(loop.log) for loop in loops)
    moved = np.array([speeds(case, loop) for loop in loops if loop.survived]).reshape(-1, 2)
    speed, rate = moved.mean(axis=0) if len(moved) else (np.nan, np.nan)
    torque = max(float(np.abs(loop.u[:, :nu]).max(initial=0.0)) for loop in loops)
    ends = "; ".join(sorted({loop.message for loop in loops if not loop.survived})[:3])
    good = sum(succeeds(case, loop) for loop in loops)
    cells: list[Cell] = [case, good, len(loops), up, median, late, 1e3 * period, fallbacks, ticks]
    return [*cells, float(speed), float(rate), torque, ends]


def run(args: argparse.Namespace) -> Report:
    """The requested cases."""
    report = Report(f"Humanoids in closed loop: {args.robot}", "")
    count, seconds = (1, QUICK) if args.quick else (args.runs, SECONDS)
    lines = []
    for case in progress()([(case, case) for case in args.cases], args.robot):
        loops = runs(case, args.robot, range(args.first, args.first + count), seconds)
        lines.append(line(case, args.robot, loops, loops[0].simulator.nu - 3))
        report.rows += rows(f"{args.robot}, {case}", lines[-1], bars=not args.quick)
    report.tables.append(Table(f"robot: {args.robot}", HEADER, lines))
    return report


def rows(name: str, cells: list[Cell], bars: bool) -> list[Row]:
    """The numbers of a line with their bars."""
    _, good, count, up, median, late, *_ = cells
    least = int(np.ceil(LEAST * float(count or 0))) if bars else None
    return [
        Row(f"{name}: succeed", float(good or 0), f"of {count}", least, at_least=True),
        number(f"{name}: stay up", float(up or 0), unit=f"of {count}"),
        number(f"{name}: tick, median", float(median or 0.0), ALLOWED if bars else None, unit="ms"),
        number(f"{name}: tick, 99 %", float(late or 0.0), unit="ms"),
    ]


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    arguments = parser(__doc__)
    arguments.add_argument("cases", nargs="*", default=list(CASES), metavar="CASE", help=", ".join(CASES))
    arguments.add_argument("--runs", type=int, default=20, help="runs per case")
    arguments.add_argument("--first", type=int, default=0, help="seed of the first run")
    arguments.add_argument("--robot", choices=("atlas", *FILES), default="atlas", help="the robot")
    return deliver("humanoids", run, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
