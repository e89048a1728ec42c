"""Closed-loop MPC: survival and tick times of the hopper and of the quadruped, in tables.

    NUMBA_NUM_THREADS=1 python benchmarks/mpc.py [hopper] [quadruped] [monte_carlo] [terrain] [--runs N] [--seed N]

hopper       six cases times six seeds, one iteration per 50 ms, plant at 1 kHz with kappa 1e-8; and a control run:
             its ticks start from an open-loop rollout of the shifted inputs
quadruped    a trot at 0.2 m/s for 6 s, one iteration of 20 knots per 40 ms, plant at 2 ms with kappa 1e-8, case by case
monte_carlo  the quadruped under all disturbances at once, drawn from a seed
terrain      the same trot for 6 s over five grounds. The model knows the height of the ground, or estimates it from
             the standing feet, or assumes level ground all the time. A run passes when the robot stays up, its root
             mean square distance from the path is at most 0.08 m, and its trunk's mean height above the ground below
             it is within 0.03 m of the initial one

Distances from the path are root mean squares of a run in x, y and z, over terrain in x and y. The table has the median
and the worst of the runs that survive. Ticks are timed by the clock and by the processor, because the clock misleads on
a machine with other work; with NUMBA_NUM_THREADS=1 processor times are times of one core.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from command import deliver, number, parser, progress

import dojo_opt as dojo
from dojo_opt.plant.tick import milliseconds
from dojo_opt.report.result import Cell, Report, Row, Table

MASS = 4.7  # of the hopper [kg]
HOPPER = {
    "nominal": {},
    "payload +25 %": {"payload": 0.25 * MASS},
    "payload +50 %": {"payload": 0.5 * MASS},
    "friction .5 -> .25": {"friction": 0.25},
    "push 4 N s": {"push": 4.0},
    "push 6 N s": {"push": 6.0},
}
SIDE = np.array([0.0, 1.0, 0.0])
QUADRUPED: dict[str, dict[str, Any]] = {
    "nominal": {},
    "payload +3 kg": {"payload": 3.0, "payload_inertia": 0.03},
    "friction .8 -> .4": {"friction": 0.4},
    "slope 5 deg, up": {"slope": np.radians(5.0)},
    "slope 5 deg, down": {"slope": -np.radians(5.0)},
    "slope 5 deg, side": {"slope": np.radians(5.0), "slope_heading": 0.5 * np.pi},
    "push 8 N s, left": {"pushes": [dojo.Push(2.0, 8.0 * SIDE)]},
    "push 8 N s, right": {"pushes": [dojo.Push(2.0, -8.0 * SIDE)]},
    "delay 20 ms": {"delay": 0.02},
    "delay 20 ms, known": {"delay": 0.02},
}
LINES = np.arange(-1.0, 2.5, 0.05)
TERRAIN = {
    "slope 5 deg, up": dojo.Terrain.slope(np.radians(5.0)),
    "slope 5 deg, down": dojo.Terrain.slope(-np.radians(5.0)),
    "step 40 mm, up": dojo.Terrain.steps([0.04], start=0.6),
    "stairs 2 x 30 mm, down": dojo.Terrain.steps([-0.03, -0.03], depth=0.4, start=0.5),
    "waves +-20 mm, 0.6 m": dojo.Terrain.from_function(
        lambda x, y: 0.02 * np.sin(2.0 * np.pi * x / 0.6) + 0.0 * y, LINES, [0.0]
    ),
}
MODELS = ("knows", "learns", "blind")
PATH = 0.08  # [m] off the path that a run over terrain may be
PUSHED = 0.11  # [m] off the path, heights included, that a run may be after the hardest push
PLACE = (0, 1, 2)  # coordinates of a base that are lengths: a distance from the path is their norm
LEVEL = (0, 1)  # of them, those along level ground: over terrain, heights above it are reported apart
ABOVE = 0.03  # [m] that its mean height above the ground may change
HEADER = (
    *("case", "survive", "of", "off the path [m]", "worst [m]", "tick [ms]", "99 % [ms]", "tick, cpu [ms]"),
    *("99 %, cpu [ms]", "fell back", "of ticks", ""),
)


def hopper_perturbation(case: dict[str, float], seed: int) -> dojo.Perturbation:
    """Initial velocity within 0.15 m/s along x and y; a push at a random time in a random direction."""
    rng = np.random.default_rng(seed)
    offset = np.zeros(14)
    offset[7:9] = rng.uniform(-0.15, 0.15, 2)
    angle, when = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(1.0, 2.5)
    fields = {key: value for key, value in case.items() if key != "push"}
    pushes = [dojo.Push(when, case["push"] * np.array([np.cos(angle), np.sin(angle), 0.0]))] if "push" in case else []
    return dojo.Perturbation(offset=offset, pushes=pushes, **fields)


def row(name: str, loops: Sequence[Any], distances: Sequence[float] | None = None) -> list[Cell]:
    """One line of a table; the distances from the path are those that the loops say, or these [m]."""
    distances = distances or [loop.rms(PLACE) for loop in loops]
    rms = [d for loop, d in zip(loops, distances, strict=True) if loop.survived] or [np.nan]
    ms, cpu = (np.concatenate([milliseconds(loop.log, cpu=c) for loop in loops]) for c in (False, True))
    ticks, fallbacks = sum(len(loop.log) for loop in loops), sum(t.fallback for loop in loops for t in loop.log)
    times = [float(f(a)) for a in (ms, cpu) for f in (np.median, lambda a: np.percentile(a, 99))]
    end = "; ".join(sorted({loop.message for loop in loops if not loop.survived}))
    survived = sum(loop.survived for loop in loops)
    return [name, survived, len(loops), float(np.median(rms)), max(rms), *times, fallbacks, ticks, end]


def rows(name: str, line: Sequence[Any], bars: bool = True) -> list[Row]:
    """The numbers of one line of a table as rows; with bars, every run has to survive, at most PUSHED off."""
    _, survived, runs, median, worst, _, _, tick, late, *_ = line
    return [
        Row(f"{name}: survive", survived, f"of {runs}", runs if bars else None, at_least=True),
        number(f"{name}: runs", runs),
        number(f"{name}: off the path, median", median, unit="m"),
        number(f"{name}: off the path, worst", worst, PUSHED if bars else None, unit="m"),
        number(f"{name}: tick, median", tick, unit="ms"),
        number(f"{name}: tick, 99 %", late, unit="ms"),
    ]


def hopper(report: Report, seeds: int, duration: float) -> None:
    """Three tables of the hopper."""
    for name, title, settings in (
        ("hopper", "shifted states as guess", {}),
        ("hopper without feedback", "the same without feedback between ticks", {"gain_scale": 0.0}),
        ("hopper, control", "open-loop rollout of the shifted inputs as guess", {"guess": "open loop"}),
    ):
        mpc = dojo.tasks.hopper_mpc(**settings)
        plant = dojo.tasks.plant(mpc, 1e-3)
        everything, lines = [], []
        for case in progress()([(c, c) for c in HOPPER], name):
            perturbations = [hopper_perturbation(HOPPER[case], seed) for seed in range(seeds)]
            loops = [dojo.closed_loop(mpc, plant.perturbed(p), duration) for p in perturbations]
            everything += loops
            lines.append(row(case, loops))
        lines.append(row("all", everything))
        report.tables.append(Table(f"Hopper, {title}", HEADER, lines))
        report.rows += rows(name, lines[-1], bars=name == "hopper")


def quadruped(report: Report, duration: float) -> None:
    """The table of the quadruped."""
    everything, lines = [], []
    for case in progress()([(c, c) for c in QUADRUPED], "quadruped"):
        mpc = dojo.tasks.quadruped_mpc(delay=0.02 if case.endswith("known") else 0.0)
        loop = dojo.closed_loop(mpc, dojo.tasks.plant(mpc, 2e-3, **QUADRUPED[case]), duration)
        everything.append(loop)
        lines.append(row(case, [loop]))
    lines.append(row("all", everything))
    report.tables.append(Table(f"Quadruped, trot at 0.2 m/s for {duration:g} s", HEADER, lines))
    report.rows += rows("quadruped", lines[-1])


def monte_carlo(report: Report, runs: int, duration: float, seed: int) -> None:
    """The study of the quadruped."""
    mpc = dojo.tasks.quadruped_mpc()
    disturbances = dojo.Disturbances(
        nv=mpc.sim.nv,
        velocity=0.15,
        push=(0.0, 8.0),
        push_time=(1.0, 4.0),
        payload=(0.0, 3.0),
        payload_inertia=0.01,
        friction=(0.4, 0.8),
        slope=(0.0, float(np.radians(5.0))),
    )
    for _ in progress()([(f"{runs} runs", None)], "Monte Carlo"):
        plant = dojo.tasks.plant(mpc, 2e-3)
        study = mpc.monte_carlo(plant, disturbances, duration, runs=runs, seed=seed, components=PLACE)
    line = row("every disturbance in every run", study.outcomes, [o.rms for o in study.outcomes])
    report.tables.append(Table(f"Quadruped, {duration:g} s, seed {seed}", HEADER, [line], str(disturbances)))
    report.rows += rows("Monte Carlo", line)
    report.rows.append(
        number("Monte Carlo: steps of the plant with softer contact", sum(o.softened for o in study.outcomes))
    )
    report.notes += [f"Monte Carlo, {study.summary()}"]
    report.details["Monte Carlo"] = [
        {"survived": o.survived, "message": o.message, "rms": o.rms, "perturbation": asdict(o.perturbation)}
        for o in study.outcomes
    ]


def terrain(report: Report, duration: float) -> None:
    """The table of the quadruped on ground that is not level."""
    lines: list[list[Cell]] = []
    cases = [(f"{name}, {model}", (name, model)) for name in TERRAIN for model in MODELS]
    for name, model in progress()(cases, "terrain"):
        ground, knows = TERRAIN[name], model == "knows"
        mpc = dojo.tasks.quadruped_mpc(terrain=ground if knows else None, learn_ground=model == "learns")
        plant = dojo.tasks.plant(mpc, 2e-3, **({} if knows else {"terrain": ground}))
        loop = dojo.closed_loop(mpc, plant, duration)
        over = loop.x[:, 2] - ground.height(loop.x[:, 0], loop.x[:, 1])
        above, cpu = float(over.mean() - over[0]), milliseconds(loop.log, cpu=True)
        passed = bool(loop.survived and loop.rms(LEVEL) <= PATH and abs(above) <= ABOVE)
        ticks = [float(np.median(cpu)), float(np.percentile(cpu, 99)), sum(t.fallback for t in loop.log)]
        lines.append([name, model, passed, loop.rms(LEVEL), above, *ticks, "" if loop.survived else loop.message])
    header = (
        "ground",
        "model",
        "passes",
        "off the path [m]",
        "above [m]",
        "tick, cpu [ms]",
        "99 % [ms]",
        "fell back",
        "",
    )
    report.tables.append(Table(f"Quadruped on terrain, {duration:g} s", header, lines))
    report.rows.append(number("terrain: grounds", len(TERRAIN)))
    for model in MODELS:
        passing = sum(bool(line[2]) for line in lines if line[1] == model)
        bar = None if model == "blind" else len(TERRAIN)
        report.rows.append(Row(f"terrain, {model}: passes", passing, f"of {len(TERRAIN)}", bar, at_least=True))


def run(args: argparse.Namespace) -> Report:
    """Measure the requested tables."""
    report = Report("Closed loops of MPC", "")
    if "hopper" in args.tables:
        hopper(report, 1 if args.quick else 6, 1.0 if args.quick else 4.0)
    if "quadruped" in args.tables:
        quadruped(report, 0.4 if args.quick else 6.0)
    if "monte_carlo" in args.tables:
        monte_carlo(report, 2 if args.quick else args.runs, 0.4 if args.quick else 6.0, args.seed)
    if "terrain" in args.tables:
        terrain(report, 0.4 if args.quick else 6.0)
    return report


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    arguments = parser(__doc__)
    tables = ["hopper", "quadruped", "monte_carlo", "terrain"]
    arguments.add_argument("tables", nargs="*", default=tables, metavar="TABLE", help=", ".join(tables))
    arguments.add_argument("--runs", type=int, default=100)
    arguments.add_argument("--seed", type=int, default=0, help="of the Monte Carlo study")
    return deliver("mpc", run, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
