"""Policies of Gymnasium's tasks, learnt on one core: returns over processor time, with their spread over seeds.

python benchmarks/learning.py DIR HalfCheetah --algorithms shac ars --seeds 0 1 2 3 4      runs and saves
python benchmarks/learning.py DIR HalfCheetah --only-figure                                 draws what is saved
python benchmarks/learning.py DIR HalfCheetah --table           and tabulates it, with returns in MuJoCo, in TASK.json

`best_of` with seed k begins with the seeds 3k, 3k + 1, 3k + 2 of SHAC. A run is DIR/TASK_ALGORITHM_SEED.npz, and its
policy DIR/....policy.npz. For one core, set NUMBA_NUM_THREADS=1 and OPENBLAS_NUM_THREADS=1. Policies are also evaluated
at time steps and smoothings that they have not learnt on, and in MuJoCo by benchmarks/evaluate_policy.py, which imports
nothing of dojo-opt. Runs of other libraries are those of benchmarks/learning_peers.py in the same folder.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import dojo_opt as dojo
from dojo_opt.learn.gymnasium_tasks import BALANCE, TRANSFER
from dojo_opt.learn.registration import task_of

Floats = NDArray[np.float64]

_RARELY: dict[str, Any] = {"evaluations": 5, "episodes": 4}  # an evaluation takes as long as several epochs
SETTINGS: dict[str, dict[str, dict[str, Any]]] = {  # of shac, beside those of the task
    "HalfCheetah": {
        "shac": {},
        "best_of": {"epochs": 450},
        "ars": {"epochs": 30, "rate": 0.02, "randomisation": TRANSFER} | _RARELY,
        "gradient_search": {"epochs": 60, "horizon": 80, "randomisation": TRANSFER} | _RARELY,
    },
    "Hopper": {
        "shac": {},
        "ars": {"epochs": 100, "rate": 0.01, "noise": 0.025, "shift": 1.0, "randomisation": BALANCE} | _RARELY,
    },
    "Walker2d": {
        "shac": {},
        "ars": {"epochs": 100, "rate": 0.03, "noise": 0.025, "shift": 1.0, "randomisation": BALANCE} | _RARELY,
    },
    "Ant": {
        "shac": {},
        "ars": {"epochs": 30, "rate": 0.015, "noise": 0.025, "shift": 1.0} | _RARELY,
    },
    "Quadruped": {"shac": {}},
    "Pendulum": {"shac": {"epochs": 100}, "ars": {"epochs": 30}, "gradient_search": {"epochs": 100}},
    "Cartpole": {"shac": {"epochs": 100}, "ars": {"epochs": 30}},
}
PEERS = ("ppo", "sac")  # of learning_peers.py
JUDGED = ("HalfCheetah", "Hopper", "Walker2d", "Ant")
UNSEEN = ((10, 3e-5), (7, 2e-3))  # time steps per action, smoothing [N s m]


def run(folder: Path, name: str, algorithm: str, seed: int, given: dict[str, Any]) -> None:
    """One run, unless it is saved."""
    path = folder / f"{name}_{algorithm}_{seed}.npz"
    if path.exists():
        return
    task = task_of(name)
    options = SETTINGS[name][algorithm] | given
    if algorithm == "best_of":
        trio = range(3 * seed, 3 * seed + 3)
        learned = dojo.learn.best_of(dojo.learn.shac, task, trio, verbose=True, **options)
    else:
        learned = getattr(dojo.learn, algorithm)(task, seed=seed, verbose=True, **options)
    learned.save(path)
    learned.policy.save(path.with_suffix(".policy.npz"))
    print(f"{name} seed {seed}: {learned!r}")
    for substeps, kappa in UNSEEN:
        found = dojo.learn.evaluate(learned.policy, 8, 100, substeps=substeps, kappa=kappa)
        print(
            f"  {substeps} time steps per action, kappa {kappa:g}: {found.returns.mean():.1f} +- "
            f"{found.returns.std():.1f}, {found.lengths.mean():.0f} steps, {found.unsolved} unsolved",
            flush=True,
        )


def saved(folder: Path, name: str, algorithm: str) -> list[Path]:
    """Files of the runs."""
    return sorted(p for p in folder.glob(f"{name}_{algorithm}_*.npz") if not p.name.endswith(".policy.npz"))


def curve(path: Path) -> Floats:
    """(n, 2) processor time [s] and return of a run."""
    with np.load(path, allow_pickle=False) as data:
        if "returns" in data:
            return np.column_stack([data["seconds"], data["returns"]])
    history = dojo.learn.Learned.load(path).history
    return np.array([(r["seconds"], r["evaluated"]) for r in history if r["evaluated"] is not None])


def figure(folder: Path, names: list[str]) -> None:
    """Median and range over seeds of each algorithm, of what is saved; one panel per task."""
    from matplotlib.figure import Figure

    page = Figure(figsize=(5.0 * len(names) + 1.0, 4.0), layout="constrained")
    for axes, name in zip(page.subplots(1, len(names), squeeze=False)[0], names, strict=True):
        for algorithm in (*SETTINGS[name], *PEERS):
            curves = [c for c in map(curve, saved(folder, name, algorithm)) if len(c)]
            if not curves:
                continue
            rows = min(map(len, curves))
            seconds = np.median([c[:rows, 0] for c in curves], axis=0)
            returns = np.array([c[:rows, 1] for c in curves])
            label = f"{algorithm}, {len(curves)} seed{'s' if len(curves) > 1 else ''}"
            axes.plot(seconds, np.median(returns, axis=0), marker=".", label=label)
            axes.fill_between(seconds, returns.min(axis=0), returns.max(axis=0), alpha=0.2)
        axes.set(xlabel="processor time [s]", ylabel="return in the task", title=name, xlim=(0.0, None))
        if axes.lines:
            axes.legend()
    target = folder / f"{'_'.join(names)}.png"
    page.savefig(target, dpi=150)
    print(f"wrote {target}")


def table(folder: Path, name: str) -> None:
    """Returns of all saved runs: here, and in MuJoCo where Gymnasium has the task."""
    rows: dict[str, Any] = {}
    print(f"{name}: return here (mean, least over seeds), minutes of a core, in MuJoCo, at a fifth of its time step")
    for algorithm in PEERS:
        ends = [curve(path)[-1] for path in saved(folder, name, algorithm)]
        if ends:
            seconds, best = np.array(ends).T
            rows[algorithm] = {"returns": best.tolist(), "minutes": (seconds / 60.0).tolist()}
            minutes = seconds.mean() / 60.0
            print(
                f"{algorithm:16} {len(ends)} seeds {best.mean():8.1f} {best.min():8.1f} {minutes:6.2f} min (its last)"
            )
    for algorithm in SETTINGS[name]:
        paths = saved(folder, name, algorithm)
        if not paths:
            continue
        runs = [dojo.learn.Learned.load(path) for path in paths]
        best, minutes = np.array([r.best for r in runs]), np.array([r.seconds / 60.0 for r in runs])
        row: dict[str, Any] = {
            "returns": best.tolist(), "minutes": minutes.tolist(), "steps": [r.steps for r in runs],
            "unsolved": sum(r.unsolved for r in runs), "infinite": sum(r.infinite for r in runs),
        }  # fmt: skip
        text = f"{algorithm:16} {len(runs)} seeds {best.mean():8.1f} {best.min():8.1f} {minutes.mean():6.2f} min"
        if name in JUDGED:
            there = folder / f"{name}_{algorithm}.mujoco.json"
            judge = Path(__file__).with_name("evaluate_policy.py")
            policies = [str(path.with_suffix(".policy.npz")) for path in paths]
            command = [sys.executable, str(judge), f"{name}-v5", *policies, "--output", str(there)]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
            row["mujoco"] = list(json.loads(there.read_text()).values())
            means = np.mean(row["mujoco"], axis=0)
            text += f" {means[0]:8.1f} {means[1]:8.1f}"
        print(text, flush=True)
        rows[algorithm] = row
    (folder / f"{name}.json").write_text(json.dumps(rows, indent=1))


def main() -> None:
    """Run, save, draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("task", choices=SETTINGS)
    parser.add_argument("--algorithms", nargs="+", default=["shac"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[0, 1, 2, 3, 4])
    parser.add_argument("--epochs", type=int, default=None)
    parser.add_argument("--time-limit", type=float, default=None, help="of a run [s of processor time]")
    parser.add_argument("--only-figure", action="store_true")
    parser.add_argument("--beside", nargs="*", choices=SETTINGS, default=[], help="further tasks of the figure")
    parser.add_argument("--table", action="store_true")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    limits = {"epochs": given.epochs, "time_limit": given.time_limit}
    limits = {name: limit for name, limit in limits.items() if limit is not None}
    for algorithm in [] if given.only_figure or given.table else given.algorithms:
        for seed in given.seeds:
            run(given.folder, given.task, algorithm, seed, limits)
    figure(given.folder, [given.task, *given.beside])
    if given.table:
        table(given.folder, given.task)


if __name__ == "__main__":
    main()
