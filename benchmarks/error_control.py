"""Requested against achieved error, and processor time, compared with the best fixed order and step, MuJoCo's RK4, and
Drake's integrators with error control (RK3, and CENIC for convex contact).

    python benchmarks/error_control.py --match pendulum                  some of the motions
    python benchmarks/error_control.py --figure error_control.png           error against processor time

An error is the largest final error of a joint coordinate [m, rad], over the seconds of the motion. References: exact
solutions of balls and blocks; order 8 with small steps without contact, and of closed loops order 2, extrapolated;
else order 2 at 10 us, extrapolated to hard contact: a contact or limit that opens pushes with sqrt(kappa/h). The error
of a reference is its largest difference from runs with steps that are twice as long and 7 percent longer, in which
impacts lie elsewhere, and from an extrapolation of lower order: accuracies below three times it are omitted.

Cost: processor time of the whole motion, relative to the cheapest fixed order and step, or step of RK4, or accuracy of
Drake's, with an error no larger; nan where there is none. Drake's accuracies end with the first for which a motion
fails or takes more than 20 s. Bounces of MuJoCo are not comparable. `told`: the estimated error of the result
(`errors`) over the requested one: above 1, the motion reports a miss.
"""

from __future__ import annotations

import argparse
import re
import sys
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from command import deliver, number, parser, progress
from reference_motions import ReferenceMotion, motions

import dojo_opt as dojo
from dojo_opt.report.engine import clocked
from dojo_opt.report.result import Report, Table
from solvers.types import Vector

Points = list[tuple[float, float, str]]  # (error, processor time [s], order and step)
_ASKED = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
_STEPS = (0.05, 0.02, 0.01, 0.005, 0.002, 0.001, 5e-4, 2e-4, 1e-4)
_FINE = (2e-5, 1.07e-5, 1e-5)  # [s] about the steps of references in contact
_PRESSED = (1e-8, 4e-8, 16e-8)  # [N m] kappa/h of references in contact
_KINDS = {  # by their names
    "pendulums of 1 to 50 links": "pendulum",
    "bodies and robots in flight": "free body|tree|in flight",
    "balls and a block with exact solutions": "ball|sliding",
    "stack, tumbling block, chain on the ground": "stack|tumbling|chain",
    "closed loop": "four-bar",
    "robots that fall": "falling",
}
_LEAST = 1e-6  # accuracy with contacts or loops


def error(sim: dojo.Simulator, end: Vector | None, exact: Vector, seconds: float) -> float:
    """Largest error of a coordinate, over the seconds; infinite if the motion has no end."""
    if end is None or not np.isfinite(end).all():
        return np.inf
    zero = np.zeros(sim.nv)
    return float(np.abs(sim.difference(np.r_[end, zero], np.r_[exact, zero])[: sim.nv]).max() / seconds)


def fixed(motion: ReferenceMotion, exact: Vector, steps: tuple[float, ...]) -> Points:
    """Points of fixed orders and steps."""
    out = []
    for order in (2, 4, 6, 8):
        for h in steps:
            try:
                sim = dojo.Simulator(motion.mechanism, time_step=h, order=order)
            except ValueError:  # closed loops have order 2
                continue
            x, count = sim.state_from_velocity(motion.q, motion.v), round(motion.seconds / h)
            sim.rollout(x, steps=1)  # compiles
            found, cost = clocked(partial(sim.rollout, x, steps=count))
            end = found.x[-1][: sim.nq] if found.success else None
            out.append((error(sim, end, exact, motion.seconds), cost, f"order {order}, {1e3 * h:g} ms"))
    return out


def runge_kutta(motion: ReferenceMotion, exact: Vector, steps: tuple[float, ...]) -> Points:
    """Points of MuJoCo's RK4, with its default contacts; empty if it is not installed, or has no such scene."""
    try:
        import mujoco
    except ImportError:
        return []
    from benchmarks.engines import mujoco_scene
    from benchmarks.engines.mujoco_warnings import quiet

    out, sim = [], dojo.Simulator(motion.mechanism)
    if any(c.restitution for c in motion.mechanism.contacts) or motion.mechanism.loops:
        return []
    for h in steps:
        try:
            model: Any = mujoco_scene.load(sim.model, h, integrator="RK4")
        except ValueError:  # a joint or a collision that MuJoCo has not
            return []

        def end(model: Any = model, count: int = round(motion.seconds / h)) -> Vector:
            data: Any = mujoco_scene.state(model, np.r_[motion.q, motion.v])
            mujoco.mj_step(model, data, count)
            return np.asarray(data.qpos)

        with quiet():
            coordinates, cost = clocked(end)
        out.append((error(sim, coordinates, exact, motion.seconds), cost, f"{1e3 * h:g} ms"))
    return out


def drake(motion: ReferenceMotion, exact: Vector, scheme: str, quick: bool) -> Points:
    """Points of an integrator of Drake's with error control, with its default contacts; empty where it has none."""
    try:
        import pydrake.systems.analysis  # noqa: F401
    except ImportError:
        return []
    from benchmarks.engines.drake import controlled

    out, sim = [], dojo.Simulator(motion.mechanism)
    for accuracy in _ASKED[: 2 if quick else None]:
        try:
            end, cost = controlled(motion.mechanism, np.r_[motion.q, motion.v], motion.seconds, accuracy, scheme)
            if end is None and cost == np.inf and out:
                break  # it fails, or takes too long, at all higher ones
            out.append((error(sim, end, exact, motion.seconds), cost, f"{accuracy:g}"))
        except ValueError:  # not for this contact; or coordinates of a joint that Drake has not
            return []
    return out


def _touches(mech: dojo.Mechanism) -> bool:
    return bool(mech.contacts or mech.collisions)


def _end(motion: ReferenceMotion, about: float, pressed: float = 0.0, **settings: Any) -> Vector:
    """Coordinates after steps of about this length [s], in contact with kappa = pressed h."""
    steps = round(motion.seconds / about)
    h = motion.seconds / steps
    sim = dojo.Simulator(motion.mechanism, time_step=h, kappa=pressed * h if pressed else None, **settings)
    x = sim.state_from_velocity(motion.q, motion.v)
    return np.asarray(sim.rollout(x, steps=steps, throw=True).x[-1][: sim.nq])


def _hard_reference(motion: ReferenceMotion) -> tuple[Vector, float]:
    """`reference` in contact: an end at sqrt(kappa/h) = s, 2 s, 4 s is extrapolated to 0, with terms s and s^2."""
    sim = dojo.Simulator(motion.mechanism)
    *others, least = (_end(motion, about, _PRESSED[0]) for about in _FINE)
    twice, four = (_end(motion, _FINE[-1], pressed) for pressed in _PRESSED[1:])
    hard, linear = (8.0 * least - 6.0 * twice + four) / 3.0, 2.0 * least - twice
    unsure = [error(sim, end, least, motion.seconds) for end in others]
    return hard, max(*unsure, error(sim, linear, hard, motion.seconds))


def reference(motion: ReferenceMotion) -> tuple[Vector, float]:
    """(coordinates in the end, their error over the seconds)."""
    if motion.exact is not None:
        return motion.exact, 0.0
    if _touches(motion.mechanism):
        return _hard_reference(motion)
    sim = dojo.Simulator(motion.mechanism)
    if motion.mechanism.loops:  # of order 2
        ends = [_end(motion, about, tolerance=1e-12) for about in (4e-4, 2e-4, 1e-4)]
        ends = [fine + (fine - coarse) / 3.0 for coarse, fine in pairwise(ends)]
    else:
        ends = [_end(motion, about, order=8) for about in (2e-4, 1e-4)]
    return ends[-1], max(error(sim, end, ends[-1], motion.seconds) for end in ends[:-1])


def _asked(motion: ReferenceMotion, unsure: float, quick: bool) -> tuple[float, ...]:
    """The accuracies that exist and that the reference of a motion can judge; none where small steps do not agree."""
    held = _touches(motion.mechanism) or motion.mechanism.loops
    least = max(3.0 * unsure, 0.99 * _LEAST if held else 0.0)
    asked = tuple(a for a in _ASKED if a >= least)
    return asked[:4] if quick else asked


def _best(points: Points, got: float) -> tuple[float, str]:
    """The cheapest point of at least this accuracy; nan without one."""
    found = [(cost, setting) for e, cost, setting in points if e <= max(got, 1e-13)]
    return min(found) if found else (np.nan, "")


def study(motion: ReferenceMotion, quick: bool) -> tuple[list[list[Any]], dict[str, Points]]:
    """Lines of the table, and points of the figure."""
    exact, unsure = reference(motion)
    if not _asked(motion, unsure, quick):
        return [[motion.name, *[np.nan] * 6, "", np.nan, "", np.nan, np.nan, f"reference off by {unsure:.1g}"]], {}
    steps = _STEPS[1:4] if quick else _STEPS
    others, peer = fixed(motion, exact, steps), runge_kutta(motion, exact, steps)
    rk3, cenic = (drake(motion, exact, scheme, quick) for scheme in ("runge_kutta3", "cenic"))
    lines: list[list[Any]] = []
    ours: Points = []
    for asked in _asked(motion, unsure, quick):
        sim = dojo.Simulator(motion.mechanism, time_step=motion.seconds, accuracy=asked)
        x = sim.state_from_velocity(motion.q, motion.v)
        if not lines:
            sim.rollout(x, steps=1)  # compiles
        found, cost = clocked(partial(sim.rollout, x, steps=1))
        got = error(sim, found.x[-1][: sim.nq], exact, motion.seconds) if found.success else np.inf
        told = float(found.errors[0]) if found.success else np.inf
        (best, setting), (rival, step) = _best(others, got), _best(peer, got)
        shares = [cost / _best(points, got)[0] for points in (rk3, cenic)]
        line = [
            motion.name,
            asked,
            got,
            got / asked,
            told,
            1e3 * cost,
            cost / best,
            setting,
            cost / rival,
            step,
            *shares,
        ]
        lines.append([*line, found.status.name])
        ours.append((got, cost, f"{asked:g}"))
    curves = {"accuracy=": ours, "fixed order and step": others, "MuJoCo RK4": peer}
    return lines, curves | {"Drake RK3": rk3, "Drake CENIC": cenic}


def draw(curves: dict[str, dict[str, Points]]) -> Any:
    """Error against processor time, a panel for each motion."""
    from matplotlib.figure import Figure

    columns = min(4, len(curves))
    rows = -(-len(curves) // columns)
    page = Figure(figsize=(3.2 * columns, 2.8 * rows), layout="constrained")
    axes = page.subplots(rows, columns, squeeze=False).flat
    for panel, (name, found) in zip(axes, curves.items(), strict=False):
        for (label, points), mark in zip(found.items(), ("o-", ".", "x", "+", "1"), strict=True):
            shown = sorted((cost, e) for e, cost, _ in points if 0.0 < e < 1e2 and cost > 0.0)
            if shown:
                panel.loglog(*zip(*shown, strict=True), mark, label=label, alpha=0.8)
        panel.set_title(name, fontsize=9)
        panel.set_xlabel("processor time [s]", fontsize=8)
        panel.set_ylabel("error per second [m, rad]", fontsize=8)
    page.legend(*page.axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=5, fontsize=8)
    for panel in page.axes[len(curves) :]:
        panel.set_axis_off()
    return page


def run(args: argparse.Namespace) -> Report:
    """Every motion with `match` in its name, at every accuracy."""
    lines: list[list[Any]] = []
    curves: dict[str, dict[str, Points]] = {}
    for make in progress()([(f"motion {k}", m) for k, m in enumerate(motions(args.quick))], "motions"):
        motion = make()
        if args.match in motion.name:
            found, points = study(motion, args.quick)
            lines += found
            curves |= {motion.name: points} if points else {}
    report = summary(lines, curves)
    if args.figure and report.figure is not None:
        report.figure.savefig(args.figure, dpi=130)
    return report


def summary(lines: list[list[Any]], curves: dict[str, dict[str, Points]]) -> Report:
    """Rows, table and figure of all motions."""
    report = Report("Accuracy on request", "")
    judged = [line for line in lines if np.isfinite(line[1])]
    solved = [line for line in judged if line[-1] == "SOLVED"]
    silent = [line[3] for line in solved if line[4] <= 1.0]
    costs = np.array([line[6] for line in solved if line[4] <= 1.0], dtype=float)
    known = costs[np.isfinite(costs)]
    report.rows = [
        number("runs", float(len(judged))),
        number("got over asked where nothing is told, largest", max(silent, default=0.0), 3.0),
        number("got over asked where nothing is told, median", float(np.median(silent)) if silent else 0.0, 1.0),
        number(
            "got over told where a miss is told, largest",
            max((x[3] / max(1.0, x[4]) for x in solved), default=0.0),
            3.0,
        ),
        number("motions that tell a miss", float(len(solved) - len(silent)), note=f"of {len(judged)}"),
        number("motions that are refused", float(len(judged) - len(solved)), note=f"of {len(judged)}"),
        number("cost over best fixed, median", float(np.median(known)) if len(known) else 0.0),
        number("cost over best fixed, largest", float(known.max()) if len(known) else 0.0),
        number("motions without a reference", float(len(lines) - len(judged)), note="small steps do not agree"),
    ]
    header = (
        *("motion", "asked", "got", "got/asked", "told", "ms"),
        *("cost/fixed", "fixed", "cost/RK4", "RK4", "cost/RK3", "cost/CENIC", "status"),
    )
    report.tables = [Table("Error per second of motion, and processor time", header, lines)]
    report.tables.append(by_kind(judged))
    report.details = curves
    if curves:
        report.figure = draw(curves)
    return report


def by_kind(lines: list[list[Any]]) -> Table:
    """Largest ratio of errors, and medians of costs, of each kind of motion; nothing where no peer is as accurate."""
    table = []
    for kind, pattern in _KINDS.items():
        mine = [line for line in lines if re.search(pattern, line[0])]
        if mine:
            ratios = np.array([[line[k] for k in (3, 6, 8, 10)] for line in mine], dtype=float)
            silent = [line[3] for line in mine if line[4] <= 1.0]
            costs = [float(np.median(c)) if len(c := r[np.isfinite(r)]) else "" for r in ratios.T[1:]]
            table.append([kind, len(mine), len(mine) - len(silent), max(silent, default=0.0), *costs])
    header = ("motions", "runs", "miss told", "got/asked, largest of the others", "cost/fixed", "cost/RK4", "cost/RK3")
    return Table("By kind of motion: medians of costs", header, table)


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    arguments = parser(__doc__)
    arguments.add_argument("--match", default="", help="only motions with this in their name")
    arguments.add_argument("--figure", metavar="FILE", help="draw error against processor time")
    return deliver("error_control", run, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
