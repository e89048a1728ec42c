"""Gaits of a quadruped by iLQR: iterations, cost, and the motion of a plan at a fifth of its time step.

    python benchmarks/gaits.py           the table below, 72 random gaits, 32 leaps, 40 random leaps (three minutes)
    python benchmarks/gaits.py --quick   the table with fewer rows, 6 random gaits, 1 leap, 1 random leap

Columns: iterations, rejected ones included, and the rejected ones; cost; largest violation of the constraints;
least cosine between the base's z axis and the vertical; largest torque [N m]; how far the base rises [m]. Then, for
the plan under its own gains with every knot cut into five steps: how far the base ends from the plan [m], its least
cosine, the largest torque, the way that loaded feet slide [m, all feet together], and the greatest height of the lowest
foot [m]. Periodic plans are repeated twenty times for that. Jumps and leaps end with every time step cut into
`refinement`; their iterations are the sum over both solves, and their motion is that at a fifth of the shorter step. A
leap succeeds when its base rises to within 1 cm of the height asked for.

MuJoCo 4 with finite differences and a hand-written iLQR, same weights, on the first two rows: 4 iterations and cost
.0161 at damping 5 (8 to 12 from a rollout); 27 to 50 and .041 to .049 at damping .5, with its feet pressed 2 mm into
the ground, and upside-down from a rollout.
"""

from __future__ import annotations

import argparse
import sys
from itertools import product
from typing import Any

import numpy as np
from command import deliver, number, parser, progress

import dojo_opt as dojo
from dojo_opt.report.result import Cell, Report, Row, Table

STANDING = {"guess": "standing"}
TABLE: list[tuple[str, dict[str, Any]]] = [
    ("trot", {"damping": 5.0}),
    ("trot", {}),
    ("jump", {"refinement": 1}),
    ("jump", {}),
    ("bound", {}),
    ("trot", STANDING),
    ("jump", STANDING),
    ("bound", STANDING),
    ("jump", {"distance": -0.1, "refinement": 1}),
    ("jump", {"distance": -0.1}),
    ("leap", {"refinement": 1}),
    ("leap", {}),
    ("leap", {"distance": 0.5}),
    ("leap", {"height": 0.3}),
    ("leap", {"distance": 0.0, "height": 0.3}),
    ("leap", {"distance": 0.5, "height": 0.3}),
    ("trot", {"cycles": 1, "periodic": True}),
    ("trot", {"cycles": 2, "periodic": True}),
    ("trot", {"speed": 0.0}),
    ("trot", {"speed": 0.4}),
    ("trot", {"damping": 0.05}),
    ("trot", {"damping": 5.0, **STANDING}),
    ("trot", {"speed": 0.0, **STANDING}),
    ("trot", {"speed": 0.4, **STANDING}),
    ("jump", {"distance": 0.0, "height": 0.3, "crouch": 0.12}),
    ("jump", {"distance": -0.2}),
    ("pace", {}),
    ("walk", {}),
    ("turn", {}),
    ("pace", {"cycles": 1, "periodic": True}),
    ("walk", {"cycles": 1, "periodic": True}),
    ("bound", {"cycles": 1, "periodic": True}),
    ("trot", {"cycles": 1, "periodic": True, "speed": 0.4}),
    ("trot", {"cycles": 1, "periodic": True, "damping": 0.05}),
]


def upright(x: Any) -> float:
    """Least cosine between the z axis of the base and the vertical."""
    return float((1.0 - 2.0 * (x[:, 4] ** 2 + x[:, 5] ** 2)).min())


HEADER = (
    *("", "success", "iterations", "rejected", "cost", "violation", "upright", "torque", "rise"),
    *("replayed", "off", "upright then", "torque then", "slid", "lift"),
)
REPEATS = 20  # of periodic plans
PARTS = 5  # of a time step, in replays
DISTANCES = (-0.2, -0.1, 0.0, 0.1, 0.2, 0.3, 0.4, 0.5)  # of leaps [m]
HEIGHTS = (0.15, 0.2, 0.25, 0.3)  # [m]


def replay(plan: Any) -> list[Cell]:
    """The plan under its gains at a fifth of the time step, a periodic one many times in a row."""
    plan = plan if plan.stride is None else plan.repeated(REPEATS)
    short = plan.time_step / PARTS
    shot = plan.replay(time_step=short)
    if not shot.success:
        return [f"{shot.status.name} at knot {shot.solved_knots}", *[None] * 5]
    held = np.repeat(shot.u[:, None], PARTS * plan.substeps, axis=1)
    knots = [shot.simulator.rollout(x, us).contacts for x, us in zip(shot.x[:-1], held, strict=True)]
    loaded = np.concatenate([c.normal_force for c in knots]) > 1.0
    slid = float((np.concatenate([c.slip for c in knots]) * loaded).sum() * short)
    lift = max(float(c.gap.min(axis=1).max()) for c in knots)
    off = float(np.abs(shot.x[-1, :3] - plan.x[-1, :3]).max())
    return ["to the end", off, upright(shot.x), float(np.abs(shot.u).max()), slid, lift]


def planned(name: str, settings: dict[str, Any]) -> list[Cell]:
    """A row of the table."""
    plan = dojo.ilqr(getattr(dojo.problems, name)(**settings))
    rejected = sum(record["alpha"] == 0.0 for record in plan.history)
    numbers = [plan.fun, plan.violation, upright(plan.x), np.abs(plan.u).max(), plan.x[:, 2].max() - plan.x[0, 2]]
    end = plan.success if plan.success else plan.status.name
    return [label(name, settings), end, plan.nit, rejected, *map(float, numbers), *replay(plan)]


def replays(report: Report, lines: list[list[Cell]]) -> None:
    """The plans of the table followed at a fifth of their time step, as rows."""
    after = {str(line[0]): dict(zip(HEADER[9:], line[9:], strict=True)) for line in lines}
    finished = {name: replay for name, replay in after.items() if replay["off"] is not None}
    planned = {str(line[0]) for line in lines if line[1] is True}
    cut = [
        r["off"]
        for n, r in finished.items()
        if n.startswith(("jump", "leap")) and "refinement=1" not in n and n in planned
    ]
    periodic = [r["upright then"] for n, r in finished.items() if "periodic" in n]
    report.rows += [
        Row("plans replayed to the end", len(finished), f"of {len(after)}", len(after), at_least=True),
        number("planned jumps and leaps: off when replayed, most", max(cut, default=np.nan), unit="m"),
        number("periodic gaits", sum("periodic" in name for name in after)),
        number(f"periodic gaits, {REPEATS} times in a row: least cosine", min(periodic, default=np.nan)),
    ]


def label(name: str, settings: dict[str, Any]) -> str:
    """A gait, and its problem."""
    return " ".join([name, *(f"{key}={value}" for key, value in settings.items())])


def random_gait(index: int, rng: np.random.Generator) -> tuple[str, dict[str, Any]]:
    """A gait of random speed and damping; every other one of its kind starts from standing still."""
    names = ["trot", "bound", "pace", "walk", "turn", "jump"]
    name = names[index % len(names)]
    settings: dict[str, Any] = {"damping": 10 ** rng.uniform(-1.3, 0.0)}
    settings["guess"] = "standing" if index // len(names) % 2 else "reference"
    if name == "turn":
        settings["heading_rate"] = rng.uniform(-1.0, 1.0)
    elif name == "jump":
        settings |= {"distance": rng.uniform(-0.2, 0.4), "height": rng.uniform(0.1, 0.3)}
    else:
        settings["speed"] = rng.uniform(0.0, {"trot": 0.4, "bound": 0.8, "pace": 0.5, "walk": 0.2}[name])
    if name == "trot":
        settings |= {"period": 0.5, "time_step": 0.025, "step_height": 0.05, "footholds": None, "height": None}
    return name, settings


def random_gaits(report: Report, count: int) -> None:
    """Gaits of random speed, damping and guess: how many are planned without falling over."""
    rng = np.random.default_rng(1)
    found = []
    for name, settings in progress()([(f"{i + 1}", random_gait(i, rng)) for i in range(count)], "random gaits"):
        plan = dojo.ilqr(getattr(dojo.problems, name)(**settings))
        good = bool(plan.success and upright(plan.x) > 0.85)
        found.append({"gait": name, **settings, "planned": good, "status": plan.status.name, "iterations": plan.nit})
        if not good:
            report.notes.append(f"not planned: {label(name, settings)}: {plan.status.name}, {upright(plan.x):.3f}")
    iterations = [gait["iterations"] for gait in found]
    report.details["random gaits"] = found
    report.rows += [
        number("random gaits", count),
        Row("random gaits planned and upright", sum(g["planned"] for g in found), "", count, at_least=True),
        number("random gaits: iterations, median", float(np.median(iterations))),
        number("random gaits: iterations, most", max(iterations)),
    ]


def random_leaps(count: int) -> list[dict[str, float]]:
    """Leaps by distance [m], height [m], crouch [m], duration [s] and damping [N m s/rad]."""
    rng = np.random.default_rng(5)
    ranges = {"distance": (-0.3, 0.55), "height": (0.1, 0.33), "crouch": (0.05, 0.14), "duration": (0.8, 1.2)}
    return [
        {key: rng.uniform(*ends) for key, ends in ranges.items()} | {"damping": 10 ** rng.uniform(-1.3, 0.0)}
        for _ in range(count)
    ]


def leaps(report: Report, kind: str, asked: list[dict[str, float]]) -> None:
    """How many leaps are planned, upright and within 1 cm as high as asked for."""
    lines: list[list[Cell]] = []
    named = [(f"{leap['distance']:.2g} m far, {leap['height']:.2g} m high", leap) for leap in asked]
    for settings in progress()(named, kind):
        plan = dojo.ilqr(dojo.problems.leap(**settings))
        off = float(plan.x[:, 2].max() - plan.x[0, 2]) - settings["height"]
        good = bool(plan.success and upright(plan.x) > 0.85 and off > -0.01)
        lines.append([settings["distance"], settings["height"], good, plan.nit, off])
    header = ("far [m]", "high [m]", "as asked", "iterations", "off the height [m]")
    report.tables.append(Table(kind.capitalize(), header, lines))
    iterations = [line[3] for line in lines]
    report.rows += [
        number(kind, len(lines)),
        number(f"{kind} planned", sum(bool(line[2]) for line in lines)),
        number(f"{kind}: iterations, median", float(np.median(iterations))),
        number(f"{kind}: iterations, most", max(iterations)),
    ]


def run(args: argparse.Namespace) -> Report:
    """The table, random gaits, leaps."""
    report = Report("Gaits of a quadruped", "")
    table = TABLE[:5] if args.quick else TABLE
    lines = [planned(*gait) for gait in progress()([(label(*gait), gait) for gait in table], "gaits")]
    report.tables.append(Table("Gaits", HEADER, lines, "torque in N m; rise, off, slid and lift in m"))
    replays(report, lines)
    random_gaits(report, 6 if args.quick else 72)
    grid = [{"distance": far, "height": high} for far, high in product(DISTANCES, HEIGHTS)]
    leaps(report, "leaps", grid[-1:] if args.quick else grid)
    leaps(report, "random leaps", random_leaps(1 if args.quick else 40))
    return report


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    return deliver("gaits", run, parser(__doc__), argv)


if __name__ == "__main__":
    sys.exit(main())
