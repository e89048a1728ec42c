"""Requested against achieved error, and processor time, compared with the best fixed order and step, and MuJoCo's RK4.

    python benchmarks/accuracy.py --match pendulum                  some of the motions
    python benchmarks/accuracy.py --figure accuracy.png             error against processor time

An error is the largest final error of a joint coordinate [m, rad], over the seconds of the motion. References: exact
solutions of balls and blocks; order 8 with small steps without contact, and of closed loops order 2, extrapolated;
else order 2 at 10 us with the least kappa. The error of a reference is its difference from a run with steps twice as
long: accuracies below three times it are omitted.

Cost: processor time of the whole motion, relative to the cheapest fixed order and step, or step of RK4, with an error
no larger; nan where there is none. Bounces of MuJoCo are not comparable. `told`: the estimated error of the result
(`errors`) over the requested one: above 1, the motion reports a miss.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from command import deliver, number, parser, progress
from numpy.typing import NDArray

import dojo_opt as dojo
from dojo_opt.report.result import Report, Table
from support.linkage import plain_fourbar
from support.scenes import ball, block

Vector = NDArray[np.float64]
Points = list[tuple[float, float, str]]  # (error, processor time [s], order and step)
_G = 9.81
_ASKED = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
_STEPS = (0.05, 0.02, 0.01, 0.005, 0.002, 0.001, 5e-4, 2e-4, 1e-4)
_FINE = (2e-5, 1e-5)  # [s] steps of references in contact
_LEAST = 1e-6  # accuracy with contacts or loops


class Motion(NamedTuple):
    """A motion from a node, and its expected end."""

    name: str
    mechanism: dojo.Mechanism
    q: Vector
    v: Vector
    seconds: float
    exact: Vector | None  # coordinates in the end; None: found by small steps


def pendulum(links: int) -> Motion:
    """Released from rest."""
    q = np.full(links, 0.4)
    return Motion(f"pendulum of {links}", dojo.models.npendulum(links), q, np.zeros(links), 2.0, None)


def free_body() -> Motion:
    """Turning about all axes."""
    mech = dojo.models.tennisracket()
    q = np.array(mech.neutral, dtype=np.float64)
    return Motion("free body", mech, q, np.random.default_rng(4).normal(size=6), 2.0, None)


def tree() -> Motion:
    """A quadruped without a ground."""
    mech = replace(dojo.models.quadruped(damper=0.0, limits=False), contacts=(), name="tree")
    rng = np.random.default_rng(1)
    q = np.array(mech.neutral, dtype=np.float64)
    q[7:] += 0.3 * rng.normal(size=12)
    return Motion("tree of 13 bodies", mech, q, rng.normal(size=18), 0.5, None)


def bouncing(seconds: float = 2.0, share: float = 0.8) -> Motion:
    """A ball without friction, dropped from 1 m."""
    mech = ball(friction=0.0)
    mech = replace(mech, contacts=tuple(replace(c, restitution=share) for c in mech.contacts))
    when, speed = np.sqrt(2.0 / _G), share * np.sqrt(2.0 * _G)
    while when + 2.0 * speed / _G < seconds:
        when, speed = when + 2.0 * speed / _G, share * speed
    rest = seconds - when
    q = np.array([0.0, 0.0, 1.1, 1.0, 0.0, 0.0, 0.0])
    end = _at(q, 2, 0.1 + speed * rest - 0.5 * _G * rest**2)
    return Motion("bouncing ball", mech, q, np.zeros(6), seconds, end)


def sliding() -> Motion:
    """A block that comes to rest after 0.68 s."""
    q = np.array([0.0, 0.0, 0.25, 1.0, 0.0, 0.0, 0.0])
    end = _at(q, 0, 2.0**2 / (2.0 * 0.3 * _G))
    return Motion("sliding block", block(friction=0.3), q, np.eye(6)[0] * 2.0, 1.0, end)


def rolling(height: float, speed: float, seconds: float) -> Motion:
    """A ball of radius .1 m falls from a height with a speed along x, loses mu w of this speed at the impact w, slides,
    and rolls as soon as the point in contact is at rest.
    """
    mu = 0.3
    fall, impact = np.sqrt(2.0 * height / _G), np.sqrt(2.0 * height * _G)
    start, spin = speed - mu * impact, 25.0 * mu * impact
    slide = (start - 0.1 * spin) / (3.5 * mu * _G)
    rest = seconds - fall - slide
    x = speed * fall + start * slide - 0.5 * mu * _G * slide**2 + (start - mu * _G * slide) * rest
    turn = spin * slide + 12.5 * mu * _G * slide**2 + (spin + 25.0 * mu * _G * slide) * rest
    q = np.array([0.0, 0.0, 0.1 + height, 1.0, 0.0, 0.0, 0.0])
    end = np.array([x, 0.0, 0.1, np.cos(0.5 * turn), 0.0, np.sin(0.5 * turn), 0.0])
    name = "thrown ball" if height else "rolling ball"
    return Motion(name, ball(friction=mu), q, np.eye(6)[0] * speed, seconds, end)


def tumbling() -> Motion:
    """A block that falls onto a corner."""
    turn = np.array([1.0, 0.2, 0.1, 0.05])
    q = np.r_[0.0, 0.0, 0.6, turn / np.linalg.norm(turn)]
    return Motion("tumbling block", block(friction=0.5), q, np.array([0.5, 0.0, 0.0, 1.0, 2.0, 0.0]), 0.6, None)


def landing(name: str, mechanism: dojo.Mechanism, bend: Vector, seconds: float) -> Motion:
    """A robot with bent legs, 10 cm above the ground."""
    sim = dojo.Simulator(mechanism)
    q, rng = np.array(mechanism.neutral, dtype=np.float64), np.random.default_rng(1)
    up = 1 if name == "hopper landing" else 2  # planar: x, z, pitch
    q[sim.nq - len(bend) :] += bend
    q[up] += 5.0
    q[up] += 0.1 - sim.step(np.r_[q, np.zeros(sim.nv)]).contacts.gap.min()
    return Motion(name, mechanism, q, 0.5 * rng.normal(size=sim.nv), seconds, None)


def _at(q: Vector, k: int, value: float) -> Vector:
    """The coordinates q with another value of coordinate k."""
    out = q.copy()
    out[k] = value
    return out


def motions(quick: bool) -> list[Callable[[], Motion]]:
    """All motions."""
    bend = 0.1 * np.random.default_rng(2).normal(size=12)
    found = [
        lambda: pendulum(1),
        bouncing,
        sliding,
        lambda: pendulum(2),
        lambda: pendulum(5),
        lambda: pendulum(50),
        free_body,
        tree,
        lambda: rolling(0.0, 2.0, 0.5),
        lambda: rolling(0.2, 3.0, 0.8),
        tumbling,
        fourbar,
        lambda: landing("hopper landing", dojo.models.hopper(), np.array([0.1, 0.5, 0.9, 0.3]), 0.4),
        lambda: landing("quadruped landing", dojo.models.quadruped(), bend, 0.3),
    ]
    return found[:3] if quick else found


def fourbar() -> Motion:
    """Let go: a closed loop."""
    mech = plain_fourbar()
    return Motion("four-bar", mech, np.array(mech.neutral, dtype=np.float64), np.zeros(3), 0.5, None)


def error(sim: dojo.Simulator, end: Vector | None, exact: Vector, seconds: float) -> float:
    """Largest error of a coordinate, over the seconds; infinite if the motion has no end."""
    if end is None or not np.isfinite(end).all():
        return np.inf
    zero = np.zeros(sim.nv)
    return float(np.abs(sim.difference(np.r_[end, zero], np.r_[exact, zero])[: sim.nv]).max() / seconds)


def fixed(motion: Motion, exact: Vector, steps: tuple[float, ...]) -> Points:
    """Points of fixed orders and steps."""
    out = []
    for order in (2, 4, 6, 8):
        for h in steps:
            try:
                sim = dojo.Simulator(motion.mechanism, time_step=h, order=order)
            except ValueError:  # closed loops have order 2
                continue
            x, count = sim.start(motion.q, motion.v), round(motion.seconds / h)
            sim.rollout(x, steps=count)  # compiles
            begin = time.process_time()
            found = sim.rollout(x, steps=count)
            cost = time.process_time() - begin
            end = found.x[-1][: sim.nq] if found.success else None
            out.append((error(sim, end, exact, motion.seconds), cost, f"order {order}, {1e3 * h:g} ms"))
    return out


def runge_kutta(motion: Motion, exact: Vector, steps: tuple[float, ...]) -> Points:
    """Points of MuJoCo's RK4, with its default contacts; empty if it is not installed."""
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
        model: Any = mujoco_scene.load(sim.model, h, integrator="RK4")
        with quiet():
            data: Any = mujoco_scene.state(model, np.r_[motion.q, motion.v])
            begin = time.process_time()
            mujoco.mj_step(model, data, round(motion.seconds / h))
            cost = time.process_time() - begin
        out.append((error(sim, data.qpos.copy(), exact, motion.seconds), cost, f"{1e3 * h:g} ms"))
    return out


def reference(motion: Motion) -> tuple[Vector, float]:
    """(coordinates in the end, their error over the seconds)."""
    if motion.exact is not None:
        return motion.exact, 0.0
    touches, loops = bool(motion.mechanism.contacts), bool(motion.mechanism.loops)
    ends: list[Vector] = []
    for h in _FINE if touches else ((4e-4, 2e-4, 1e-4) if loops else (2e-4, 1e-4)):
        settings: dict[str, Any] = {"kappa": 1e-13} if touches else {"order": 8}
        if loops:
            settings = {"tolerance": 1e-12}
        sim = dojo.Simulator(motion.mechanism, time_step=h, **settings)
        x = sim.start(motion.q, motion.v)
        ends.append(np.asarray(sim.rollout(x, steps=round(motion.seconds / h), throw=True).x[-1][: sim.nq]))
    if loops:  # of order 2
        ends = [fine + (fine - coarse) / 3.0 for coarse, fine in pairwise(ends)]
    return ends[1], error(sim, ends[0], ends[1], motion.seconds)


def _asked(motion: Motion, unsure: float, quick: bool) -> tuple[float, ...]:
    """The accuracies that exist and that the reference of a motion can judge."""
    held = motion.mechanism.contacts or motion.mechanism.loops
    least = max(3.0 * unsure, 0.99 * _LEAST if held else 0.0)
    asked = tuple(a for a in _ASKED if a >= least) or _ASKED[:1]
    return asked[:4] if quick else asked


def _best(points: Points, got: float) -> tuple[float, str]:
    """The cheapest point of at least this accuracy; nan without one."""
    found = [(cost, what) for e, cost, what in points if e <= max(got, 1e-13)]
    return min(found) if found else (np.nan, "")


def study(motion: Motion, quick: bool) -> tuple[list[list[Any]], dict[str, Points]]:
    """Lines of the table, and points of the figure."""
    exact, unsure = reference(motion)
    steps = _STEPS[1:4] if quick else _STEPS
    others, peer = fixed(motion, exact, steps), runge_kutta(motion, exact, steps)
    lines, ours = [], []
    for asked in _asked(motion, unsure, quick):
        sim = dojo.Simulator(motion.mechanism, time_step=motion.seconds, accuracy=asked)
        x = sim.start(motion.q, motion.v)
        sim.rollout(x, steps=1)  # compiles
        begin = time.process_time()
        found = sim.rollout(x, steps=1)
        cost = time.process_time() - begin
        got = error(sim, found.x[-1][: sim.nq], exact, motion.seconds) if found.success else np.inf
        told = float(found.errors[0]) if found.success else np.inf
        (best, what), (rival, step) = _best(others, got), _best(peer, got)
        line = [motion.name, asked, got, got / asked, told, 1e3 * cost, cost / best, what, cost / rival, step]
        lines.append([*line, found.status.name])
        ours.append((got, cost, f"{asked:g}"))
    return lines, {"accuracy=": ours, "fixed order and step": others, "MuJoCo RK4": peer}


def draw(curves: dict[str, dict[str, Points]]) -> Any:
    """Error against processor time, a panel for each motion."""
    from matplotlib.figure import Figure

    columns = min(4, len(curves))
    rows = -(-len(curves) // columns)
    page = Figure(figsize=(3.2 * columns, 2.8 * rows), layout="constrained")
    axes = page.subplots(rows, columns, squeeze=False).flat
    for panel, (name, found) in zip(axes, curves.items(), strict=False):
        for (label, points), mark in zip(found.items(), ("o-", ".", "x"), strict=True):
            shown = sorted((cost, e) for e, cost, _ in points if 0.0 < e < 1e2 and cost > 0.0)
            if shown:
                panel.loglog(*zip(*shown, strict=True), mark, label=label, alpha=0.8)
        panel.set_title(name, fontsize=9)
        panel.set_xlabel("processor time [s]", fontsize=8)
        panel.set_ylabel("error per second [m, rad]", fontsize=8)
    page.axes[0].legend(fontsize=7)
    for panel in page.axes[len(curves) :]:
        panel.set_axis_off()
    return page


def run(args: argparse.Namespace) -> Report:
    """Every motion with `match` in its name, at every accuracy."""
    report, lines, curves = Report("Accuracy on request", ""), [], {}
    for make in progress()([(f"motion {k}", m) for k, m in enumerate(motions(args.quick))], "motions"):
        motion = make()
        if args.match in motion.name:
            found, curves[motion.name] = study(motion, args.quick)
            lines += found
    solved = [line for line in lines if line[-1] == "SOLVED"]
    silent = [line[3] for line in solved if line[4] <= 1.0]
    costs = np.array([line[6] for line in solved if line[4] <= 1.0], dtype=float)
    known = costs[np.isfinite(costs)]
    report.rows = [
        number("got over asked where nothing is told, largest", max(silent, default=0.0), 3.0),
        number("got over asked where nothing is told, median", float(np.median(silent)) if silent else 0.0, 1.0),
        number(
            "got over told where a miss is told, largest",
            max((x[3] / max(1.0, x[4]) for x in solved), default=0.0),
            3.0,
        ),
        number("motions that tell a miss", float(len(solved) - len(silent)), note=f"of {len(lines)}"),
        number("motions that are refused", float(len(lines) - len(solved)), note=f"of {len(lines)}"),
        number("cost over best fixed, median", float(np.median(known)) if len(known) else 0.0),
        number("cost over best fixed, largest", float(known.max()) if len(known) else 0.0),
    ]
    header = ("motion", "asked", "got", "got/asked", "told", "ms", "cost/fixed", "fixed", "cost/RK4", "RK4", "status")
    report.tables = [Table("Error per second of motion, and processor time", header, lines)]
    report.details = curves
    if curves:
        report.figure = draw(curves)
        if args.figure:
            report.figure.savefig(args.figure, dpi=130)
    return report


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    arguments = parser(__doc__)
    arguments.add_argument("--match", default="", help="only motions with this in their name")
    arguments.add_argument("--figure", metavar="FILE", help="draw error against processor time")
    return deliver("accuracy", run, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
