"""A quadruped under an unknown payload on unknown ground: MPC with a fixed model, and with models that adapt.

    NUMBA_NUM_THREADS=1 python benchmarks/adaptation.py [--runs N]

`dojo.tasks.quadruped_mpc` trots at 0.2 m/s for 4 s on a plant with 2 ms and hard contact. Each run draws a payload of 0
to 24 kg on a robot of 11.9 kg, a friction of 0.2 to 0.8, and a push of up to 8 N s between 1 and 2 s; half of the runs
measure with noise (0.2 mm and mrad; 2 mm/s and mrad/s). The model has no payload and a friction of 0.8, of which plans
count on 0.4 at most. The adapting controller estimates the mass of the trunk and the friction. Friction is known where
its standard deviation is below 0.1, which takes a foot that slides; until then it has a lower bound, the friction that
standing feet have used. A third controller adapts, too, and presses its feet apart until one of them slides
(`Adaptation(shear=1.3)`).
"""

from __future__ import annotations

import argparse
import sys
import time
from functools import partial
from typing import Any

import numpy as np
from command import deliver, number, parser, progress

import dojo_opt as dojo
from dojo_opt.report.result import Cell, Report, Row, Table

ADAPT = ("mass:trunk", "friction:*")
NOISE = (2e-4, 2e-3)  # [m, rad], [m/s, rad/s]
SECONDS, KNOWN, CHECKED = 4.0, 0.1, 1.0  # [s], [1], [s]
CLOSE = 0.05  # share of the mass
SHEAR = 1.3  # [1/s]
SURE = 0.9  # share of the runs whose bounds hold, two standard deviations wide


def perturbation(run: int) -> dict[str, Any]:
    """The unknowns of a run."""
    rng = np.random.default_rng(1000 + run)
    push, angle = rng.uniform(0.0, 8.0), rng.uniform(0.0, 2.0 * np.pi)
    impulse = (push * np.cos(angle), push * np.sin(angle), 0.0)
    return {
        "payload": rng.uniform(0.0, 24.0),
        "friction": rng.uniform(0.2, 0.8),
        "pushes": [dojo.Push(rng.uniform(1.0, 2.0), impulse)],
        "noise": np.repeat(NOISE, 18) if run % 2 else 0.0,
        "seed": run,
    }


class Watched:
    """A controller whose estimates are kept: after `CHECKED` s, and as a history (time [s], values, deviations, and the
    bounds of the friction).
    """

    def __init__(self, mpc: dojo.MPC) -> None:
        self.mpc, self.values, self.deviations = mpc, {}, {}
        self.history: list[tuple[float, Any, Any, tuple[float, float]]] = []

    def reset(self) -> None:
        """As MPC.reset."""
        self.mpc.reset()

    def __call__(self, now: float, x: Any) -> Any:
        u = self.mpc(now, x)
        if self.mpc.estimator is not None:
            found = self.mpc.estimator.values, self.mpc.estimator.deviations
            self.history.append((now, *found, self.mpc.estimator.bounds["friction:*"]))
            if abs(now - CHECKED) < 1e-9:
                self.values, self.deviations = found
        return u

    def found(self, total: float) -> float:
        """Time from which on the mass of the loaded trunk, `total` [kg], is estimated to within `CLOSE` [s]."""
        off = [now for now, values, *_ in self.history if abs(values["mass:trunk"] - total) > CLOSE * total]
        return max(off, default=0.0)

    def knows(self) -> float:
        """Time at which friction is known first [s]; infinite if never."""
        return next((now for now, _, deviations, _ in self.history if deviations["friction:*"] < KNOWN), float("inf"))

    def error(self, friction: float) -> float:
        """Error of the friction after `CHECKED` s; NaN where it is not known."""
        known = self.deviations.get("friction:*", np.inf) < KNOWN
        return abs(self.values["friction:*"] - friction) if known else float("nan")

    def bounded(self, friction: float, time: float) -> tuple[bool, float]:
        """(whether the bounds of the friction held at a time [s], the lower one over the friction)."""
        low, high = next(row[3] for row in reversed(self.history) if row[0] < time + 1e-9)
        return low <= friction <= high, low / friction


def trial(run: int, adapt: dojo.Adaptation | None) -> tuple[dojo.ClosedLoop, Watched, float]:
    """A run, its controller, and its processor time per second of motion."""
    mpc = dojo.tasks.quadruped_mpc(adapt=adapt)
    watched, plant = Watched(mpc), dojo.tasks.plant(mpc, 2e-3, **perturbation(run))
    begin = time.process_time()
    loop = dojo.closed_loop(watched, plant, SECONDS, reference=mpc.references.state)
    return loop, watched, (time.process_time() - begin) / loop.duration


def run(args: argparse.Namespace) -> Report:
    """All runs, with the three controllers."""
    report = Report("Adaptive control", "")
    lines: list[list[Cell]] = []
    payload, friction, costs, survivors = [], [], [], np.zeros(3, dtype=int)
    sheared: list[tuple[float, float, bool]] = []  # time until the friction is known, its error then, bounds hold
    times: list[tuple[float, float]] = []
    bounds: list[list[tuple[bool, float]]] = []
    count = 2 if args.quick else args.runs
    for k in progress()([(f"run {k}", partial(int, k)) for k in range(count)], "runs"):
        number_of_run = k()
        drawn = perturbation(number_of_run)
        noise = NOISE if number_of_run % 2 else (1e-5, 1e-4)
        fixed, _, cost = trial(number_of_run, None)
        loop, watched, adaptive = trial(number_of_run, dojo.Adaptation(ADAPT, noise=noise))
        probed, prober, _ = trial(number_of_run, dojo.Adaptation(ADAPT, noise=noise, shear=SHEAR))
        sheared.append((prober.knows(), prober.error(drawn["friction"]), prober.bounded(drawn["friction"], CHECKED)[0]))
        survivors += (fixed.survived, loop.survived, probed.survived)
        costs.append(adaptive / cost)
        times.append((watched.found(drawn["payload"] + 6.0), watched.knows()))
        bounds.append([watched.bounded(drawn["friction"], time) for time in (CHECKED, SECONDS)])
        line: list[Cell] = [drawn["payload"], drawn["friction"], fixed.duration, loop.duration]
        if watched.values:
            total = drawn["payload"] + 6.0
            payload.append(abs(watched.values["mass:trunk"] - total) / total)
            known = watched.deviations["friction:*"] < KNOWN
            friction += [abs(watched.values["friction:*"] - drawn["friction"])] if known else []
            line += [watched.values["mass:trunk"] - 6.0, watched.values["friction:*"], "yes" if known else "no"]
        lines.append([*line, *([""] * (7 - len(line))), bounds[-1][0][1], probed.duration, prober.knows()])
    sure = None if args.quick else SURE * count
    soon, off, safe = np.array(sheared).T
    hold, low = np.array(bounds).transpose(2, 1, 0)  # (2, runs) each
    report.rows = [
        number("runs", float(count)),
        Row("runs that the fixed model survives", float(survivors[0]), "", None),
        Row("runs that the adaptive model survives", float(survivors[1]), "", None),
        number("error of the loaded trunk's mass after 1 s, median", 100.0 * float(np.median(payload)), 5.0, unit="%"),
        number("error of the loaded trunk's mass after 1 s, largest", 100.0 * max(payload), unit="%"),
        number(
            "time until the loaded trunk's mass stays within 5 %, median", float(np.median(times, axis=0)[0]), unit="s"
        ),
        number(
            "time until the loaded trunk's mass stays within 5 %, longest",
            float(np.max(times, axis=0)[0]),
            None if args.quick else 1.0,  # two runs tell nothing of the longest
            unit="s",
        ),
        number("runs in which friction is known after 4 s", float(np.sum(np.isfinite(times), axis=0)[1])),
        number("runs in which friction is known after 1 s", float(len(friction))),
        Row("runs whose bounds of the friction hold after 1 s", float(hold[0].sum()), "", sure, True),
        Row("runs whose bounds of the friction hold after 4 s", float(hold[1].sum()), "", sure, True),
        number("lower bound over the friction after 1 s, median", float(np.median(low[0]))),
        number("lower bound over the friction after 4 s, median", float(np.median(low[1]))),
        number("error of a known friction, largest", max(friction, default=float("nan"))),
        number(
            "error of a known friction, median",
            float(np.median(friction)) if friction else float("nan"),
            0.1 if friction else None,  # in two runs, no foot may have slid
        ),
        Row("runs that the model with shear survives", float(survivors[2]), "", None),
        number("runs in which friction is known after 1 s, with shear", float(np.isfinite(off).sum())),
        number(
            "time until friction is known with shear, median",
            float(np.median(soon)),
            None if args.quick else CHECKED,
            unit="s",
        ),
        number("time until friction is known with shear, longest", float(soon.max()), unit="s"),
        number("error of a friction known after 1 s with shear, median", float(np.nanmedian(off)), 0.1),
        number("error of a friction known after 1 s with shear, largest", float(np.nanmax(off))),
        Row("runs whose bounds of the friction hold after 1 s, with shear", float(safe.sum()), "", sure, True),
        number("processor time over that of the fixed model, median", float(np.median(costs))),
    ]
    header = (
        "payload [kg]",
        "friction",
        "fixed lasts [s]",
        "adaptive lasts [s]",
        "payload after 1 s",
        "friction",
        "known",
        "lower bound / friction",
        "with shear lasts [s]",
        "known from [s]",
    )
    report.tables = [Table("Runs", header, lines)]
    return report


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    arguments = parser(__doc__)
    arguments.add_argument("--runs", type=int, default=40, metavar="N", help="number of runs (default 40)")
    return deliver("adaptation", run, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
