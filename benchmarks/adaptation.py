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
from dataclasses import dataclass
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
TRUNK = 6.0  # [kg] without a payload
SHEAR = 1.3  # [1/s]
SURE = 0.9  # share of the runs whose bounds hold, two standard deviations wide
HEADER = (
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
        """Time from which on the mass of the loaded trunk, `total` [kg], is estimated to within `CLOSE` [s].

        Infinite if it is not at the end.
        """
        off = [now for now, values, *_ in self.history if abs(values["mass:trunk"] - total) > CLOSE * total]
        return float("inf") if off and off[-1] == self.history[-1][0] else max(off, default=0.0)

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


@dataclass(frozen=True)
class AdaptationRun:
    """One run with each of the controllers: fixed, adaptive, and adaptive with shear."""

    drawn: dict[str, Any]
    fixed: dojo.ClosedLoop
    loop: dojo.ClosedLoop
    watched: Watched
    sheared: dojo.ClosedLoop
    prober: Watched
    slowdown: float  # processor time of the adaptive controller over that of the fixed model

    @property
    def total(self) -> float:
        """Mass of the loaded trunk [kg]."""
        return self.drawn["payload"] + TRUNK

    @property
    def known(self) -> bool:
        """Whether the adaptive controller knows the friction after `CHECKED` s."""
        return self.watched.deviations.get("friction:*", np.inf) < KNOWN

    @property
    def mass_error(self) -> float:
        """Relative error of the loaded trunk's mass after `CHECKED` s; NaN where the robot fell before."""
        return abs(self.watched.values.get("mass:trunk", np.nan) - self.total) / self.total

    def line(self) -> list[Cell]:
        """Its row in the table of runs, in the order of `HEADER`."""
        values, found = self.watched.values, ("", "", "")
        if values:
            found = (values["mass:trunk"] - TRUNK, values["friction:*"], "yes" if self.known else "no")
        low = self.watched.bounded(self.drawn["friction"], CHECKED)[1]
        lasts = self.fixed.duration, self.loop.duration
        cells = self.drawn["payload"], self.drawn["friction"], *lasts, *found, low
        return [*cells, self.sheared.duration, self.prober.knows()]


def outcome(run: int) -> AdaptationRun:
    """A run with the three controllers."""
    noise = NOISE if run % 2 else (1e-5, 1e-4)
    fixed, _, cost = trial(run, None)
    loop, watched, adaptive = trial(run, dojo.Adaptation(ADAPT, noise=noise))
    sheared, prober, _ = trial(run, dojo.Adaptation(ADAPT, noise=noise, shear=SHEAR))
    return AdaptationRun(perturbation(run), fixed, loop, watched, sheared, prober, adaptive / cost)


def adaptive_rows(outcomes: list[AdaptationRun], whole: bool) -> list[Row]:
    """Figures of the adaptive controller; those that two runs tell nothing of have a bar in a whole study only."""
    mass = 100.0 * np.array([o.mass_error for o in outcomes])
    found = np.array([o.watched.found(o.total) for o in outcomes])
    after = [
        np.array([o.watched.bounded(o.drawn["friction"], time) for o in outcomes]).T for time in (CHECKED, SECONDS)
    ]
    (hold, low), (hold_last, low_last) = after
    errors = np.array([o.watched.error(o.drawn["friction"]) for o in outcomes if o.known])
    sure = SURE * len(outcomes) if whole else None
    last, typical = (errors.max(), float(np.median(errors))) if len(errors) else (float("nan"), float("nan"))
    knows = np.isfinite([o.watched.knows() for o in outcomes])
    return [
        number("runs that fall before the mass is read", float(np.isnan(mass).sum()), 0.0 if whole else None),
        number("error of the loaded trunk's mass after 1 s, median", float(np.nanmedian(mass)), 5.0, unit="%"),
        number("error of the loaded trunk's mass after 1 s, largest", float(np.nanmax(mass)), unit="%"),
        number("time until the loaded trunk's mass stays within 5 %, median", float(np.median(found)), unit="s"),
        number(
            "time until the loaded trunk's mass stays within 5 %, longest",
            float(found.max()),
            1.0 if whole else None,
            unit="s",
        ),
        number("runs in which friction is known after 4 s", float(knows.sum())),
        number("runs in which friction is known after 1 s", float(len(errors))),
        Row("runs whose bounds of the friction hold after 1 s", float(hold.sum()), "", sure, True),
        Row("runs whose bounds of the friction hold after 4 s", float(hold_last.sum()), "", sure, True),
        number("lower bound over the friction after 1 s, median", float(np.median(low))),
        number("lower bound over the friction after 4 s, median", float(np.median(low_last))),
        number("error of a known friction, largest", float(last)),
        # in two runs, no foot may have slid
        number("error of a known friction, median", typical, 0.1 if len(errors) else None),
    ]


def shear_rows(outcomes: list[AdaptationRun], whole: bool) -> list[Row]:
    """Figures of the adaptive controller that presses its feet apart."""
    soon = np.array([o.prober.knows() for o in outcomes])
    off = np.array([o.prober.error(o.drawn["friction"]) for o in outcomes])
    safe = sum(o.prober.bounded(o.drawn["friction"], CHECKED)[0] for o in outcomes)
    sure = SURE * len(outcomes) if whole else None
    return [
        Row("runs that the model with shear survives", float(sum(o.sheared.survived for o in outcomes)), "", None),
        number("runs in which friction is known after 1 s, with shear", float(np.isfinite(off).sum())),
        number(
            "time until friction is known with shear, median",
            float(np.median(soon)),
            CHECKED if whole else None,
            unit="s",
        ),
        number("time until friction is known with shear, longest", float(soon.max()), unit="s"),
        number("error of a friction known after 1 s with shear, median", float(np.nanmedian(off)), 0.1),
        number("error of a friction known after 1 s with shear, largest", float(np.nanmax(off))),
        Row("runs whose bounds of the friction hold after 1 s, with shear", float(safe), "", sure, True),
    ]


def run(args: argparse.Namespace) -> Report:
    """All runs, with the three controllers."""
    count = 2 if args.quick else args.runs
    jobs = [(f"run {k}", partial(outcome, k)) for k in range(count)]
    outcomes = [job() for job in progress()(jobs, "runs")]
    report = Report("Adaptive control", "")
    report.rows = [
        number("runs", float(count)),
        Row("runs that the fixed model survives", float(sum(o.fixed.survived for o in outcomes)), "", None),
        Row("runs that the adaptive model survives", float(sum(o.loop.survived for o in outcomes)), "", None),
        *adaptive_rows(outcomes, not args.quick),
        *shear_rows(outcomes, not args.quick),
        number("processor time over that of the fixed model, median", float(np.median([o.slowdown for o in outcomes]))),
    ]
    report.tables = [Table("Runs", HEADER, [o.line() for o in outcomes])]
    return report


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    arguments = parser(__doc__)
    arguments.add_argument("--runs", type=int, default=40, metavar="N", help="number of runs (default 40)")
    return deliver("adaptation", run, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
