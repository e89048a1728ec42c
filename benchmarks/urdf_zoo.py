"""Load every URDF file of two packages, let each robot stand or fall for two seconds, and count the outcomes.

    pip install example-robot-data pybullet
    python benchmarks/urdf_zoo.py                      one line per file, and the counts
    python benchmarks/urdf_zoo.py --match a1
    python benchmarks/urdf_zoo.py my_robot.urdf        files of your own instead

Each file is loaded unchanged, on a floating base; when that is refused, with a fixed base, then with repaired inertias,
then with both. Nothing drives the joints. A robot on a fixed base is put so high that its lowest contact starts 1 cm
above the ground. `fine` means: every step was solved, no contact was deeper in the ground than 1e-6 m, and the energy
never exceeded its initial value by more than 1 % of the largest kinetic energy and 3 kappa / h per contact, the energy
by which smoothing of the contacts lifts a resting body. The time step is 5 ms. A robot that fails with it is tried with
1 ms and 0.2 ms, and the line says so: legs that collide only at their feet fall through the ground and whip through
their singular pose at 100 rad/s and more. The table shows the first reason of a refusal.

PyBullet's thousand random objects are one mesh each. All are loaded. Objects with equal masses and inertias are
simulated once and share a line of the table; here these are all of them.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, files
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import numpy as np
from command import deliver, number, parser, progress

import dojo_opt as dojo
from dojo_opt.report.result import Cell, Report, Row, Table

PACKAGES = ("example-robot-data", "pybullet")
DURATION = 2.0  # [s]
TIME_STEPS = (0.005, 0.001, 0.0002)  # [s]
CLEARANCE = 0.01  # [m] of a robot on a fixed base
DEPTH = 1e-6  # [m]
GROWTH = 0.01  # of the largest kinetic energy
STILL = ("no joint is free to move", "no moving link has a mass")  # reasons of a refusal


@dataclass
class ZooOutcome:
    """Outcome of one file."""

    file: str
    verdict: str  # fine, refused, or the failure
    how: str = ""  # other settings than the default ones
    reason: str = ""
    bodies: int = 0
    dofs: int = 0
    contacts: int = 0
    iterations: int = 0  # most of a step
    growth: float = 0.0  # of energy, relative to the bound
    depth: float = 0.0  # [m] largest
    copies: int = 1


def package_files() -> list[Path]:
    """The URDF files of the packages that are installed."""
    found: list[Path] = []
    for package in PACKAGES:
        try:
            listed = files(package) or []
        except PackageNotFoundError:
            continue
        found += [Path(str(f.locate())) for f in listed if f.suffix == ".urdf"]
    return sorted(found)


def load(path: Path) -> tuple[Any, str, str]:
    """(mechanism or None, settings that it took, first reason of a refusal)."""
    reason = ""
    for repair, floating in product((False, True), (True, False)):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", dojo.UrdfWarning)
                mech = dojo.load_urdf(path, floating=floating, repair=repair)
                if mech.joints[0].kind != "floating":
                    mech = _raised(path, mech, floating, repair)
        except dojo.UrdfError as error:
            reason = reason or str(error).replace(f"load_urdf: {path.name}", "").lstrip(":, ")
            continue
        how = [word for word, on in (("fixed base", not floating), ("repair", repair)) if on]
        return mech, ", ".join(how), reason
    return None, "", reason


def _raised(path: Path, mech: Any, floating: bool, repair: bool) -> Any:
    """The mechanism with its fixed base so high that its lowest contact has some clearance."""
    from sim.mechanism.stance import gaps

    up = CLEARANCE - gaps(mech, np.array(mech.neutral)).min(initial=CLEARANCE)
    return dojo.load_urdf(path, floating=floating, repair=repair, position=(0.0, 0.0, up)) if up > 0.0 else mech


def run(path: Path) -> ZooOutcome:
    """Load one file and simulate it."""
    mech, how, reason = load(path)
    name = "/".join(path.parts[-2:])
    if mech is None:
        return ZooOutcome(name, "refused", reason=reason)
    out = fall(ZooOutcome(name, "fine", how, reason), mech, TIME_STEPS[0])
    for before, time_step in pairwise(TIME_STEPS):
        if out.verdict == "fine":
            break
        tried = f"{time_step * 1e3:g} ms; with {before * 1e3:g} ms: {out.verdict}"
        out = fall(ZooOutcome(name, "fine", ", ".join(filter(None, (how, tried))), reason), mech, time_step)
    return out


def fall(out: ZooOutcome, mech: Any, time_step: float) -> ZooOutcome:
    """Simulate without inputs, and fill in the outcome."""
    sim = dojo.Simulator(mech, time_step=time_step)
    t = sim.rollout(sim.neutral(), np.zeros((round(DURATION / time_step), sim.nu)))
    energy, kinetic = sim.energy(t.x), sim.kinetic_energy(t.x)
    out.bodies, out.dofs, out.contacts = sim.nbody, sim.nv, sim.ncontact
    out.iterations = int(t.iterations.max(initial=0))
    allowed = GROWTH * kinetic.max() + 3.0 * sim.ncontact * sim.kappa / time_step + 1e-9
    out.growth = float((energy - energy[0]).max() / allowed)
    out.depth = max(0.0, -float(t.contacts.gap.min(initial=0.0)))
    wrong = []
    if not t.success:
        wrong.append(f"{t.status.name} at {t.solved_steps * time_step:.2f} s")
    if not out.growth <= 1.0:
        wrong.append("energy grows")
    if not out.depth <= DEPTH:
        wrong.append("in the ground")
    out.verdict = ", ".join(wrong) or "fine"
    return out


HEADER = (
    "file",
    "alike",
    "bodies",
    "dofs",
    "contacts",
    "most iterations",
    "growth",
    "depth",
    "verdict",
    "settings",
    "why",
)


def line(o: ZooOutcome) -> list[Cell]:
    """One row of the table."""
    why = " ".join(o.reason.split())[:160]
    if o.verdict == "refused":
        return [o.file, o.copies, *[None] * 6, o.verdict, o.how, why]
    return [o.file, o.copies, o.bodies, o.dofs, o.contacts, o.iterations, o.growth, o.depth, o.verdict, o.how, why]


def study(paths: list[Path]) -> list[ZooOutcome]:
    """All files; of the random objects of PyBullet, those with the same body as one."""
    several = [path for path in paths if "random_urdfs" not in path.parts]
    outcomes = [run(path) for path in progress()([(path.name, path) for path in several], "files")]
    alike: dict[Any, list[Path]] = {}
    for path in paths:
        if "random_urdfs" in path.parts:
            mech, how, reason = load(path)
            key = (mech.bodies[0].mass, mech.bodies[0].inertia, len(mech.contacts), how) if mech else reason
            alike.setdefault(key, []).append(path)
    for copies in alike.values():
        outcome = run(copies[0])
        outcome.copies = len(copies)
        outcomes.append(outcome)
    return outcomes


def number_of(outcomes: Iterable[ZooOutcome]) -> int:
    """How many files they stand for."""
    return sum(o.copies for o in outcomes)


def summary(outcomes: list[ZooOutcome]) -> Report:
    """Counts as rows, one line per file as a table."""
    report = Report("URDF files of others", "")
    fine = [o for o in outcomes if o.verdict == "fine"]
    refused = [o for o in outcomes if o.verdict == "refused"]
    still = [o for o in refused if any(reason in o.reason for reason in STILL)]

    def row(name: str, chosen: Iterable[ZooOutcome], bar: float | None = None) -> Row:
        return number(name, number_of(chosen), bar)

    report.rows = [
        row("files", outcomes),
        row("files, alike", (o for o in outcomes if o.copies > 1)),
        row("fine", fine),
        row("fine, alike", (o for o in fine if o.copies > 1)),
        row("fine, with repair=True", (o for o in fine if "repair" in o.how)),
        row("fine, with repair=True, alike", (o for o in fine if "repair" in o.how and o.copies > 1)),
        *(row(f"fine, with {1e3 * h:g} ms", (o for o in fine if f"{1e3 * h:g} ms; " in o.how)) for h in TIME_STEPS[1:]),
        row("fine, with a fixed base", (o for o in fine if "fixed base" in o.how)),
        row("refused", refused),
        row("refused: nothing in it can move", still),
        row("refused for another reason", (o for o in refused if o not in still)),
        row("not fine", (o for o in outcomes if o not in fine + refused), 0),
        row("can touch the ground", (o for o in outcomes if o.contacts)),
    ]
    lines = [line(o) for o in outcomes]
    report.tables = [Table("Files", HEADER, lines, "growth of energy over its bound; depth in m")]
    report.details = {"files": [asdict(o) for o in outcomes]}
    return report


def measure(args: argparse.Namespace) -> Report:
    """All files with `match` in their path.  SystemExit: there are none."""
    paths = [p for p in args.files or package_files() if args.match in str(p)][: 20 if args.quick else None]
    if not paths:
        print(f"urdf_zoo: no files; pip install {' '.join(PACKAGES)}", file=sys.stderr)
        raise SystemExit(2)
    return summary(study(paths))


def main(argv: list[str] | None = None) -> int:
    """Print or write the report; exit status 1 if a robot that was loaded did not do well."""
    arguments = parser(__doc__)
    arguments.add_argument("files", nargs="*", type=Path, help="URDF files; default: all files of the two packages")
    arguments.add_argument("--match", default="", help="only files with this in their path")
    return deliver("urdf_zoo", measure, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
