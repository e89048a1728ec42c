"""The real cube: parameters identified from films of its tosses, and predictions of tosses that were not used.

python benchmarks/cube.py FOLDER [--tosses 4 8 16 32 64 300] [--held-out 100] [--mujoco 8 64 300] [--no-prior] [--all]

FOLDER holds tosses_train.npz: `states` (N, 13) of position, quaternion, velocity, angular velocity (body) at 148 Hz, in
half widths of 52.4 mm, of all tosses stacked, and `lengths`: 400 of the 570 tosses of ContactNets (Pfrommer, Halm,
Posa 2020). The last `--held-out` of a fixed permutation are never fitted to. Errors are those of a prediction from the
first frame with its filmed velocity, of the position [mm] and of the rotation [rad]: after so many steps, and as the
time average over the first 80; mean and median over tosses, of those that are as long. `--all` also fits to all 400,
whose errors are those of the tosses that it was fitted to. With the published parameters, Bullet and MuJoCo predict the
tosses, too, where they are installed; MuJoCo has its default contacts, which know no restitution.

Windows of 40 steps and the prior were chosen on tosses 200 to 299 of the permutation, which the fits to at most 64
tosses do not use, and not on those held out. Every toss ends at rest on a face, so the films tell the half width once
more, by the height of the centre there. Windows of 80 steps, in which a cube tumbles several times, end in local
minima; fits to 8 and 16 tosses then depend on the path of the iterations.
"""

from __future__ import annotations

import argparse
import sys
import time
from contextlib import redirect_stdout
from importlib.util import find_spec
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from command import deliver, number, parser

import dojo_opt as dojo
from dojo_opt.report.result import Report, Table
from solvers.types import Floats

H, HALF = 1.0 / 148.0, 0.0524  # [s], [m]
PUBLISHED = (0.18, 0.125, HALF)  # friction, restitution, half width
GRID = (1, 2, 4, 8, 16, 40, 80, 120)
NOISE = np.repeat((2e-3, 0.03, 0.1, 2.0), 3)  # [m, rad, m/s, rad/s]
KAPPAS = (1e-5, 1e-6)
PRIOR = {  # of a block of which a ruler, scales and a table of materials tell something
    "friction:*": (0.3, 0.3),  # dry plastics: 0.1 to 0.6
    "restitution:*": (0.2, 0.2),
    "contact_point": 1e-3,  # [m] its corners, by a ruler
    "inertia:cube[xx]": (9.0e-4, 1.3e-4),  # [kg m^2] a solid cube has m (2 a)^2/6 = 6.8e-4, a hollow one 5/3 of that
    "inertia:cube[yy]": (9.0e-4, 1.3e-4),
    "inertia:cube[zz]": (9.0e-4, 1.3e-4),
    "inertia:cube[xy]": 3e-5,
    "inertia:cube[xz]": 3e-5,
    "inertia:cube[yz]": 3e-5,
    "com:cube": 1e-3,  # [m] of a side of 105
}


def cube(friction: float, restitution: float, half: float) -> dojo.Simulator:
    """The cube on the ground."""
    corners = half * np.array(list(product((-1.0, 1.0), repeat=3)))
    body, free = dojo.Body("cube", 0.37, (8.1e-4,) * 3), dojo.Joint("floating", None, "cube")
    contacts = [dojo.Contact("cube", tuple(c), friction=friction, restitution=restitution) for c in corners]
    return dojo.Simulator(dojo.Mechanism([body], [free], contacts), time_step=H, kappa=KAPPAS[-1])


def tosses(folder: Path) -> list[Floats]:
    """States (T + 1, 13) of every toss, in SI units."""
    data = np.load(folder / "tosses_train.npz")
    states = data["states"].astype(np.float64)
    states[:, :3] *= HALF
    states[:, 7:10] *= HALF
    states[:, 3:7] /= np.linalg.norm(states[:, 3:7], axis=1)[:, None]
    return np.split(states, np.cumsum(data["lengths"])[:-1])


def errors(sim: Any, motions: list[Floats]) -> dict[str, Any]:
    """Table of errors."""
    position, rotation = {n: [] for n in GRID}, {n: [] for n in GRID}
    average: list[tuple[float, float]] = []
    unsolved = 0
    for xs in motions:
        found = sim.rollout(xs[0], np.zeros((len(xs) - 1, 0)))
        unsolved += not found.success
        gap = sim.difference(found.x, xs[: len(found.x)])
        p, r = 1e3 * np.linalg.norm(gap[:, :3], axis=1), np.linalg.norm(gap[:, 3:6], axis=1)
        for n in (n for n in GRID if n < len(p)):
            position[n].append(p[n])
            rotation[n].append(r[n])
        average.append((float(p[1:81].mean()), float(r[1:81].mean())))
    table = {
        str(n): [float(f(a[n])) for a in (position, rotation) for f in (np.mean, np.median)]
        for n in GRID
        if position[n]
    }  # fmt: skip
    means, medians = np.mean(average, axis=0), np.median(average, axis=0)
    table["average"] = [float(v) for v in (means[0], medians[0], means[1], medians[1])]
    return {"errors": table, "tosses": len(motions), "unsolved": unsolved}


def resting_height(motions: list[Floats]) -> Floats:
    """Heights of the centre at the ends of tosses [mm], which are the half width of a cube that lies on a face."""
    return np.array([1e3 * xs[-1, 2] for xs in motions])


def fit(
    motions: list[Floats], window: int, names: tuple[str, ...], known: bool, shortest: int | None = None
) -> dojo.Identified:
    """Friction, restitution, eight corners, and further parameters, from a guess that is far off.

    known: with a prior, whose corners are those of the block, and not of the guess; shortest: steps of the windows that
    the fit begins with (default None: it has those of `window` only)
    """
    start = cube(0.3, 0.05, 0.9 * HALF)
    prior: dict[str, Any] = {}
    if known:
        labels = dojo.ParameterSpace(start, ("friction:*", "restitution:*", "contact_point", *names)).labels
        prior = {k: v for k, v in PRIOR.items() if any(label.startswith(k) for label in labels)}
        prior["contact_point"] = (HALF * np.array(list(product((-1.0, 1.0), repeat=3))).ravel(), PRIOR["contact_point"])
    data = [(xs, np.zeros((len(xs) - 1, 0))) for xs in motions]
    return dojo.identify(
        start, data, ("friction:*", "restitution:*", "contact_point", *names),
        prior=prior, noise=NOISE, window=window, shortest=shortest, redraws=3 if shortest else 0, every=4,
        kappas=KAPPAS, tolerance=3e-4, max_iterations=40, verbose=True,
    )  # fmt: skip


def fitted(motions: list[Floats], judged: list[Floats], given: argparse.Namespace) -> dict[str, Any]:
    """A fit to tosses, its parameters, and its errors on others."""
    began = time.process_time()
    with redirect_stdout(sys.stderr):  # the table of iterations; the report may be JSON
        found = fit(motions, given.window, tuple(given.further), not given.no_prior, given.shortest)
    seconds = time.process_time() - began
    corners = found.values[2:26].reshape(8, 3)
    print(f"{len(motions)} tosses: {found!r}", file=sys.stderr)
    return errors(found.simulator, judged) | {
        "seconds": seconds,
        "friction": [float(found.values[0]), float(found.deviation[0])],
        "restitution": [float(found.values[1]), float(found.deviation[1])],
        "further": dict(zip(found.labels[26:], found.values[26:].tolist(), strict=True)),
        "half widths": [float(w) for w in 1e3 * np.abs(corners).mean(axis=0)],
        "rms": found.rms,
    }


def fitted_by_mujoco(motions: list[Floats], judged: list[Floats], given: argparse.Namespace) -> dict[str, Any]:
    """The same by MuJoCo's least squares with finite differences: friction, one half width, two numbers of its soft
    contact, one moment of inertia; windows begin at the filmed states.
    """
    from benchmarks.engines.mujoco_cube import fit as fit_mujoco

    began = time.process_time()
    found, rms = fit_mujoco(motions, H, NOISE, given.window, 4, cube(*PUBLISHED))
    seconds = time.process_time() - began
    friction, half, *_ = (float(value) for value in found.values)
    print(f"MuJoCo, {len(motions)} tosses: {found.values}", file=sys.stderr)
    names = ("friction", "half width [m]", "time constant [s]", "damping ratio", "inertia [kg m^2]")
    return errors(found, judged) | {
        "seconds": seconds,
        "friction": [friction, None],
        "restitution": [None, None],
        "further": dict(zip(names, found.values.tolist(), strict=True)),
        "half widths": [1e3 * half] * 3,
        "rms": rms,
    }


def published(judged: list[Floats]) -> dict[str, Any]:
    """Errors with the published parameters: here, in Bullet, and in MuJoCo, where they are installed."""
    sim = cube(*PUBLISHED)
    rows = {"published": errors(sim, judged)}
    if find_spec("pybullet") is not None:
        from benchmarks.engines.bullet_cube import BulletCube

        bullet = BulletCube(*PUBLISHED, H, sim)
        rows["published, in Bullet"] = errors(bullet, judged)
        bullet.close()
    if find_spec("mujoco") is not None:
        from benchmarks.engines.mujoco_cube import default_cube

        rows["published, in MuJoCo"] = errors(default_cube(PUBLISHED[0], PUBLISHED[2], H, sim), judged)
    return rows


_COLUMNS = (*map(str, GRID), "average")
_ERRORS = ("position, mean [mm]", "position, median [mm]", "rotation, mean [rad]", "rotation, median [rad]")
_FEW, _MOST = 8, 300  # tosses that the bars are about


def bars(rows: dict[str, Any], held_out: int) -> list[Any]:
    """Bars of the fits that were made: those of 300 tosses, and of 8 beside them."""
    best, few = rows.get(f"{_MOST} tosses"), rows.get(f"{_FEW} tosses")
    if best is None or held_out != 100:
        return []
    p, _, r, _ = best["errors"]["average"]
    out = [number("position, 300 tosses", p, 9.5, unit="mm"), number("rotation, 300 tosses", r, 0.2, unit="rad")]
    if few is not None:
        p_few, _, r_few, _ = few["errors"]["average"]
        out += [
            number("position, 8 tosses over 300", p_few / p, 1.1),
            number("rotation, 8 tosses over 300", r_few / r, 1.1),
        ]
    return out


def run(given: argparse.Namespace) -> Report:
    """Fits to so many tosses, and their errors on those held out."""
    motions = tosses(given.folder)
    order = np.random.default_rng(0).permutation(len(motions))
    unseen = [motions[i] for i in order[-given.held_out :]]
    rows = published(unseen)
    for count in [8] if given.quick else given.tosses:
        if count > len(motions) - given.held_out:
            raise SystemExit(f"--tosses {count}: {len(motions) - given.held_out} are left beside those held out")
        rows[f"{count} tosses"] = fitted([motions[i] for i in order[:count]], unseen, given)
    for count in given.mujoco:
        rows[f"MuJoCo, {count} tosses"] = fitted_by_mujoco([motions[i] for i in order[:count]], unseen, given)
    if given.all:
        rows[f"all {len(motions)} tosses, in sample"] = fitted(motions, motions, given)
    report = Report(f"The real cube: errors on {len(unseen)} tosses held out, {given.window} steps a window")
    report.rows = bars(rows, given.held_out)
    heights = resting_height(motions)
    height = float(heights.mean())
    if (most := rows.get(f"{_MOST} tosses")) is not None:
        off = abs(float(np.mean(most["half widths"])) / height - 1.0)
        report.rows.append(number("half width, 300 tosses, beside the height at rest", 100.0 * off, 2.0, unit="%"))
    if given.all:
        seconds = rows[f"all {len(motions)} tosses, in sample"]["seconds"]
        report.rows.append(number(f"fit to {len(motions)} tosses", seconds, 60.0, unit="s"))
    for k, title in enumerate(_ERRORS):
        cells = [[name, *(row["errors"].get(n, [None] * 4)[k] for n in _COLUMNS)] for name, row in rows.items()]
        report.tables.append(Table(title, ("after steps", *_COLUMNS), cells))
    fits = {name: row for name, row in rows.items() if "seconds" in row}
    header = ("fit", "time [s]", "friction", "restitution", "half widths [mm]", "rms of the errors", "unsolved")
    cells = []
    for name, f in fits.items():
        sizes = float(np.mean(f["half widths"]))
        cells.append([name, f["seconds"], f["friction"][0], f["restitution"][0], sizes, f["rms"], f["unsolved"]])
    report.tables.append(Table("Fits", header, cells))
    at_rest = [["all tosses", height, float(heights.std()), 1e3 * HALF]]
    header = ("films", "height of the centre [mm]", "deviation [mm]", "published half width [mm]")
    report.tables.append(Table("At rest", header, at_rest))
    report.details = {"fits": {name: {k: v for k, v in f.items() if k != "errors"} for name, f in fits.items()}}
    return report


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    arguments = parser(__doc__)
    arguments.add_argument("folder", type=Path)
    arguments.add_argument("--tosses", nargs="+", type=int, default=[4, 8, 16, 32, 64, 300])
    arguments.add_argument("--held-out", type=int, default=100)
    arguments.add_argument("--window", type=int, default=40)
    arguments.add_argument(
        "--shortest", type=int, help="begin with windows of so many steps, and draw starts of missed ones again"
    )
    arguments.add_argument("--further", nargs="*", default=["inertia:cube", "com:cube"])
    arguments.add_argument(
        "--no-prior", action="store_true", help="without the prior from a ruler, scales and tables: PRIOR"
    )
    arguments.add_argument(
        "--mujoco", nargs="*", type=int, default=[], help="also fit to so many tosses in MuJoCo, by mujoco.minimize"
    )
    arguments.add_argument("--all", action="store_true", help="also fit to all tosses, held-out ones included")
    return deliver("cube", run, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
