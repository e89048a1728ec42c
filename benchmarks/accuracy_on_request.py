"""Error asked for against error got, and processor time, beside the best fixed order and step with the same error.

    python benchmarks/accuracy_on_request.py            --match pendulum for some of the motions

An error is the largest of a joint coordinate in the end [m, rad], over the seconds of the motion. References: exact
solutions of the bouncing ball and of the sliding block; order 8 at a tenth of a millisecond, or order 2 at twice that
in contact, which is of first order there and good for the two coarsest accuracies alone. Cost: processor time of the
whole motion over that of the cheapest fixed order and step whose error is not larger; without one, it is not a number.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from command import deliver, number, parser, progress
from numpy.typing import NDArray

import dojo_opt as dojo
from dojo_opt.report.result import Report, Table
from support.scenes import ball, block

Vector = NDArray[np.float64]
_G = 9.81
_ASKED = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
_STEPS = (0.05, 0.02, 0.01, 0.005, 0.002, 0.001, 5e-4, 2e-4, 1e-4)


class Motion(NamedTuple):
    """A motion from a node, and where it should end."""

    name: str
    mechanism: dojo.Mechanism
    q: Vector
    v: Vector
    seconds: float
    exact: Vector | None  # coordinates in the end, those that are known; None: found by small steps
    touches: bool  # the ground, or a limit


def pendulum(links: int) -> Motion:
    """Released from rest."""
    q = np.full(links, 0.4)
    return Motion(f"pendulum of {links}", dojo.models.npendulum(links), q, np.zeros(links), 2.0, None, False)


def flight(name: str, mechanism: dojo.Mechanism, height: float, seconds: float, touches: bool) -> Motion:
    """Thrown at random speeds from a height."""
    sim = dojo.Simulator(mechanism)
    q, rng = sim.neutral()[: sim.nq].copy(), np.random.default_rng(4)
    q[1 if name.startswith("hopper") else 2] += height  # planar: x, z, pitch
    speeds = np.zeros(sim.nv) if touches else rng.normal(size=sim.nv)
    return Motion(name, mechanism, q, speeds, seconds, None, touches)


def bouncing(seconds: float = 2.0, share: float = 0.8) -> Motion:
    """A ball without friction, dropped from 1 m."""
    mech = ball(friction=0.0)
    mech = replace(mech, contacts=tuple(replace(c, restitution=share) for c in mech.contacts))
    when, speed = np.sqrt(2.0 / _G), share * np.sqrt(2.0 * _G)
    while when + 2.0 * speed / _G < seconds:
        when, speed = when + 2.0 * speed / _G, share * speed
    rest = seconds - when
    q = np.array([0.0, 0.0, 1.1, 1.0, 0.0, 0.0, 0.0])
    return Motion(
        "bouncing ball", mech, q, np.zeros(6), seconds, _at(q, 2, 0.1 + speed * rest - 0.5 * _G * rest**2), True
    )


def sliding() -> Motion:
    """A block that comes to rest after 0.68 s."""
    q = np.array([0.0, 0.0, 0.25, 1.0, 0.0, 0.0, 0.0])
    end = _at(q, 0, 2.0**2 / (2.0 * 0.3 * _G))
    return Motion("sliding block", block(friction=0.3), q, np.eye(6)[0] * 2.0, 1.0, end, True)


def _at(q: Vector, k: int, value: float) -> Vector:
    """The coordinates q with another value of coordinate k."""
    out = q.copy()
    out[k] = value
    return out


def motions(quick: bool) -> list[Callable[[], Motion]]:
    """All of them."""
    models = dojo.models
    found = [
        lambda: pendulum(1),
        bouncing,
        sliding,
        lambda: pendulum(2),
        lambda: pendulum(5),
        lambda: flight("free body", models.tennisracket(), 0.0, 2.0, False),
        lambda: flight("quadruped in flight", models.quadruped(), 20.0, 0.5, False),
        lambda: flight("hopper in flight", models.hopper(), 20.0, 0.5, True),
        lambda: flight("hopper landing", models.hopper(), 0.2, 0.4, True),
    ]
    return found[:3] if quick else found


def timed(sim: dojo.Simulator, motion: Motion, steps: int) -> tuple[Vector | None, float]:
    """(coordinates in the end, processor time [s]); None where it does not get there."""
    x = sim.start(motion.q, motion.v)
    sim.rollout(x, steps=steps)  # compiles
    begin = time.process_time()
    found = sim.rollout(x, steps=steps)
    return (found.x[-1] if found.success else None), time.process_time() - begin


def error(sim: dojo.Simulator, end: Vector | None, exact: Vector, seconds: float) -> float:
    """Largest of a coordinate, over the seconds; infinite without an end."""
    if end is None:
        return np.inf
    target = np.concatenate([exact, np.zeros(sim.nv)])
    return float(np.abs(sim.difference(end, target)[: sim.nv]).max() / seconds)


def fixed(motion: Motion, exact: Vector, steps: tuple[float, ...]) -> list[tuple[float, float, str]]:
    """(error, processor time, order and step) of fixed orders and steps."""
    out = []
    for order in (2, 4, 6, 8):
        for h in steps:
            try:
                sim = dojo.Simulator(motion.mechanism, time_step=h, order=order)
            except ValueError:  # a damper too stiff for an explicit step of this length
                continue
            end, cost = timed(sim, motion, steps=round(motion.seconds / h))
            out.append((error(sim, end, exact, motion.seconds), cost, f"order {order}, {1e3 * h:g} ms"))
    return out


def reference(motion: Motion) -> Vector:
    """Coordinates in the end."""
    if motion.exact is not None:
        return motion.exact
    order, h = (2, 2e-4) if motion.touches else (8, 1e-4)
    sim = dojo.Simulator(motion.mechanism, time_step=h, order=order)
    x = sim.start(motion.q, motion.v)
    return np.asarray(sim.rollout(x, steps=round(motion.seconds / h), throw=True).x[-1][: sim.nq])


def _asked(motion: Motion, quick: bool) -> tuple[float, ...]:
    """The accuracies that the reference of a motion can judge."""
    if motion.touches and motion.exact is None:
        return _ASKED[:2]
    asked = _ASKED[:5] if motion.touches else _ASKED  # contacts refuse a smaller one
    return asked[:4] if quick else asked


def run(args: argparse.Namespace) -> Report:
    """Every motion whose name contains `match`, at every accuracy."""
    report, lines = Report("Accuracy on request", ""), []
    for make in progress()([(f"motion {k}", m) for k, m in enumerate(motions(args.quick))], "motions"):
        motion = make()
        if args.match not in motion.name:
            continue
        exact = reference(motion)
        others = fixed(motion, exact, _STEPS[1:4] if args.quick else _STEPS)
        for asked in _asked(motion, args.quick):
            sim = dojo.Simulator(motion.mechanism, time_step=motion.seconds, accuracy=asked)
            end, cost = timed(sim, motion, steps=1)
            got = error(sim, end, exact, motion.seconds)
            rivals = [(c, what) for e, c, what in others if e <= max(got, 1e-13)]
            best, what = min(rivals) if rivals else (np.nan, "")
            lines.append([motion.name, asked, got, got / asked, 1e3 * cost, cost / best, what])
    ratios = np.array([line[3] for line in lines])
    costs = np.array([line[5] for line in lines], dtype=float)
    known = costs[np.isfinite(costs)]
    report.rows = [
        number("got over asked, largest", float(ratios.max()), 3.0),
        number("got over asked, median", float(np.median(ratios)), 1.0),
        number("cost over best fixed, median", float(np.median(known)) if len(known) else 0.0, 1.3),
        number("cost over best fixed, largest", float(known.max()) if len(known) else 0.0),
    ]
    header = ("motion", "asked", "got", "got/asked", "ms", "cost/best fixed", "best fixed")
    report.tables = [Table("Error per second of motion, and processor time", header, lines)]
    return report


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    arguments = parser(__doc__)
    arguments.add_argument("--match", default="", help="only motions whose name contains this")
    return deliver("accuracy_on_request", run, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
