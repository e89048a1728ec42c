"""Load every URDF file of two packages, let each robot stand or fall for two seconds, and count what happened.

    pip install example-robot-data pybullet
    python benchmarks/urdf_zoo.py                      one line per file, and the counts
    python benchmarks/urdf_zoo.py --match a1 --json
    python benchmarks/urdf_zoo.py my_robot.urdf        files of your own instead

Each file is loaded as it is, on a floating base; when that is refused, with a fixed base, then with repaired inertias,
then with both. Nothing drives the joints. A robot on a fixed base is put so high that its lowest contact starts 1 cm
above the ground. `fine` means: every step was solved, no contact was deeper in the ground than 1e-6 m, and the energy
never was higher than at the start by more than 1 % of the largest kinetic energy and 3 kappa / h per contact, which is
what the smoothing of the contacts lifts a resting body by. The time step is 5 ms; a robot that does not do well with it
is tried with 1 ms and 0.2 ms, and the line says so: legs that only touch with their feet fall through the ground and
whip through their singular pose with 100 rad/s and more. The table shows the first reason of a refusal.

PyBullet's thousand random objects are one mesh each. All are loaded; those with equal masses and inertias, which is
all of them, are simulated once, and are one line of the table.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import warnings
from collections import Counter
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, files
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import numpy as np

import dojo_opt as dojo

PACKAGES = ("example-robot-data", "pybullet")
DURATION = 2.0  # [s]
TIME_STEPS = (0.005, 0.001, 0.0002)  # [s]
CLEARANCE = 0.01  # [m] of a robot on a fixed base
DEPTH = 1e-6  # [m]
GROWTH = 0.01  # of the largest kinetic energy


@dataclass
class Outcome:
    """What became of one file."""

    file: str
    verdict: str  # fine, refused, or what is wrong
    how: str = ""  # other settings than the default ones
    reason: str = ""
    bodies: int = 0
    dofs: int = 0
    contacts: int = 0
    iterations: int = 0  # most of a step
    growth: float = 0.0  # of energy, relative to what is allowed
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
    from sim.urdf.stance import gaps

    up = CLEARANCE - gaps(mech, np.array(mech.neutral)).min(initial=CLEARANCE)
    return dojo.load_urdf(path, floating=floating, repair=repair, position=(0.0, 0.0, up)) if up > 0.0 else mech


def run(path: Path) -> Outcome:
    """Load one file and simulate it."""
    mech, how, reason = load(path)
    name = "/".join(path.parts[-2:])
    if mech is None:
        return Outcome(name, "refused", reason=reason)
    out = fall(Outcome(name, "fine", how, reason), mech, TIME_STEPS[0])
    for before, time_step in pairwise(TIME_STEPS):
        if out.verdict == "fine":
            break
        tried = f"{time_step * 1e3:g} ms; with {before * 1e3:g} ms: {out.verdict}"
        out = fall(Outcome(name, "fine", ", ".join(filter(None, (how, tried))), reason), mech, time_step)
    return out


def fall(out: Outcome, mech: Any, time_step: float) -> Outcome:
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
        wrong.append(f"{t.status.name} at {t.knot * time_step:.2f} s")
    if not out.growth <= 1.0:
        wrong.append("energy grows")
    if not out.depth <= DEPTH:
        wrong.append("in the ground")
    out.verdict = ", ".join(wrong) or "fine"
    return out


HEADER = (
    f"{'file':<44} {'bodies':>6} {'dofs':>4} {'contacts':>8} {'iter':>4} {'growth':>8} {'depth':>8}  verdict (settings)"
)


def line(o: Outcome) -> str:
    """One row of the table."""
    copies = f" x {o.copies}" if o.copies > 1 else ""
    if o.verdict == "refused":
        return f"{o.file + copies:<44} refused: {' '.join(o.reason.split())[:160]}"
    settings = f" ({o.how})" if o.how else ""
    return (
        f"{o.file + copies:<44} {o.bodies:>6} {o.dofs:>4} {o.contacts:>8} {o.iterations:>4} {o.growth:>8.2g} "
        f"{o.depth:>8.1e}  {o.verdict}{settings}"
    )


def study(paths: list[Path], out: Any = None) -> list[Outcome]:
    """All files; of the random objects of PyBullet, those with the same body as one."""
    outcomes = [_told(run(path), out) for path in paths if "random_urdfs" not in path.parts]
    alike: dict[Any, list[Path]] = {}
    for path in paths:
        if "random_urdfs" in path.parts:
            mech, how, reason = load(path)
            key = (mech.bodies[0].mass, mech.bodies[0].inertia, len(mech.contacts), how) if mech else reason
            alike.setdefault(key, []).append(path)
    for copies in alike.values():
        outcome = run(copies[0])
        outcome.copies = len(copies)
        outcomes.append(_told(outcome, out))
    return outcomes


def _told(outcome: Outcome, out: Any) -> Outcome:
    """The outcome, after its line is printed."""
    if out:
        print(line(outcome), file=out, flush=True)
    return outcome


def counts(outcomes: list[Outcome]) -> Counter[str]:
    """Number of files by verdict and settings."""
    total: Counter[str] = Counter()
    for o in outcomes:
        kind = o.verdict if o.verdict in ("fine", "refused") else "not fine"
        how = o.how.partition("; ")[0]
        total[f"{kind}, {how}" if how else kind] += o.copies
    return total


def main(argv: list[str] | None = None) -> int:
    """Print the table and the counts; exit status 1 if a robot that was loaded did not do well."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", type=Path, help="URDF files; default: those of the two packages")
    parser.add_argument("--match", default="", help="only files with this in their path")
    parser.add_argument("--json", action="store_true", help="print the outcomes as JSON")
    args = parser.parse_args(argv)
    paths = [p for p in args.files or package_files() if args.match in str(p)]
    if not paths:
        print(f"urdf_zoo: no files; pip install {' '.join(PACKAGES)}", file=sys.stderr)
        return 2
    begin = time.perf_counter()
    if not args.json:
        print(HEADER)
    outcomes = study(paths, None if args.json else sys.stdout)
    if args.json:
        print(json.dumps([asdict(o) for o in outcomes]))
    else:
        print()
        for kind, number in counts(outcomes).most_common():
            print(f"{number:>5}  {kind}")
        touching = sum(o.copies for o in outcomes if o.contacts)
        print(f"{touching:>5}  can touch the ground; the others have meshes only, and fall freely, or are refused")
        print(f"{sum(o.copies for o in outcomes):>5}  files in {time.perf_counter() - begin:.0f} s")
    return 1 if any(o.verdict not in ("fine", "refused") for o in outcomes) else 0


if __name__ == "__main__":
    sys.exit(main())
