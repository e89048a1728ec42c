"""Policies of Gymnasium's tasks, learnt on one core: returns over processor time, with their spread over seeds.

python benchmarks/learning.py DIR HalfCheetah --algorithms shac ars --seeds 0 1 2 3 4      runs and saves
python benchmarks/learning.py DIR HalfCheetah --only-figure                                 draws saved results
python benchmarks/learning.py DIR HalfCheetah --beside Hopper --table       and tabulates it, in DIR/learning.json

`shac_long`, `shac_robust` and `shac_quiet` take two to three minutes; the second learns under pushes, growing ones in
every action or small ones and a cost of joints near their limits, which a policy needs to run in MuJoCo; its return is
that of the task without this cost. The last learns under growing pushes and ends with little noise. `best_of` with
seed k begins with the seeds 3k, 3k + 1, 3k + 2 of SHAC, and its times count all three. A run is
DIR/TASK_ALGORITHM_SEED.npz, and its policy DIR/....policy.npz. For one core, set
NUMBA_NUM_THREADS=1 and OPENBLAS_NUM_THREADS=1. The table has the returns of policies at a time step and a smoothing
that they have not learnt on, and in MuJoCo, by benchmarks/evaluate_policy.py, which imports nothing of dojo-opt. Runs
of other libraries are those of benchmarks/learning_peers.py in the same folder.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import dojo_opt as dojo
from dojo_opt.learn.gymnasium_tasks import BALANCE, COARSE, DISTURBED, PUSHED, TRANSFER
from dojo_opt.learn.registration import task_of
from dojo_opt.report.result import Report, Row, Table
from solvers.types import Floats

_RARELY: dict[str, Any] = {"evaluations": 5, "episodes": 4}  # an evaluation takes as long as several epochs
SETTINGS: dict[str, dict[str, dict[str, Any]]] = {  # of shac, beside those of the task
    "HalfCheetah": {
        "shac": {},
        "shac_long": {"epochs": 1800, "evaluations": 9},
        "shac_robust": {
            "epochs": 1800,
            "evaluations": 10,
            "randomization": DISTURBED,
            "push_factors": (0.25, 1.25),
            "robust": True,
        },
        "shac_quiet": {
            "epochs": 2200,
            "deviation": (0.4, 0.1),
            "evaluations": 10,
            "randomization": DISTURBED,
            "push_factors": (0.25, 1.25),
        },
        "best_of": {"epochs": 620},
        "ars": {"epochs": 20, "rate": 0.02, "randomization": TRANSFER} | _RARELY,
        "gradient_search": {"epochs": 1200, "horizon": 80, "randomization": TRANSFER} | _RARELY,
    },
    "Hopper": {
        "shac": {},
        "ars": {"epochs": 100, "rate": 0.01, "noise": 0.025, "shift": 1.0, "randomization": BALANCE} | _RARELY,
        "gradient_search": {"epochs": 1200, "horizon": 100, "randomization": BALANCE} | _RARELY,
    },
    "Walker2d": {
        "shac": {},
        "shac_robust": {"evaluations": 10, "randomization": PUSHED, "robust": True},
        "ars": {"epochs": 100, "rate": 0.03, "noise": 0.025, "shift": 1.0, "randomization": BALANCE} | _RARELY,
        "gradient_search": {"epochs": 1200, "horizon": 100, "randomization": BALANCE} | _RARELY,
    },
    "Ant": {
        "shac": {},
        "ars": {"epochs": 30, "rate": 0.015, "noise": 0.025, "shift": 1.0, "randomization": COARSE} | _RARELY,
        "gradient_search": {"epochs": 1200, "horizon": 80, "randomization": COARSE} | _RARELY,
    },
    "Quadruped": {"shac": {}},
    "Pendulum": {"shac": {"epochs": 100}, "ars": {"epochs": 30}, "gradient_search": {"epochs": 100}},
    "Cartpole": {"shac": {"epochs": 100}, "ars": {"epochs": 30}},
}
SHAPED: dict[tuple[str, str], dict[str, Any]] = {  # options of the task that is learnt, whose reward is another one
    ("Walker2d", "shac_robust"): {"limit_cost": 1.0}
}
PEERS = ("ppo", "sac", "ppo_dojo", "sac_dojo")  # of learning_peers.py, in MuJoCo or here
JUDGED = ("HalfCheetah", "Hopper", "Walker2d", "Ant")
UNSEEN = (10, 3e-5)  # time steps per action, smoothing [N s m]
BARS: dict[str, list[tuple[str, float]]] = {  # quantity of the seeds of shac or another, its least acceptable value
    "HalfCheetah": [
        ("mean return after 60 s", 5500.0), ("least return", 4500.0), ("mean return of shac_quiet", 6500.0),
        ("mean return in MuJoCo of shac_robust", 4500.0),
        ("mean return in MuJoCo, time step / 5 of shac_robust", 6000.0),
    ],
    "Hopper": [("mean return", 2400.0)],
    "Walker2d": [("mean return", 3000.0), ("mean return in MuJoCo of shac_robust", 1500.0)],
    "Ant": [("mean return", 2300.0)],
}  # fmt: skip
_HEADER = (
    "algorithm", "seed", "return", "after 60 s", "unseen step and smoothing", "MuJoCo", "MuJoCo, time step / 5",
    "MuJoCo, elliptic cones", "MuJoCo, stiff", "time [s]", "control steps", "unsolved", "gradients not finite",
)  # fmt: skip
_PLANTS = sum(column.startswith("MuJoCo") for column in _HEADER)
_COUNTS = {"unsolved steps": -2, "gradients not finite": -1}  # columns


def run(folder: Path, name: str, algorithm: str, seed: int, given: dict[str, Any]) -> None:
    """One run, unless it is saved."""
    path = folder / f"{name}_{algorithm}_{seed}.npz"
    if path.exists():
        return
    task = task_of(name, **SHAPED.get((name, algorithm), {}))
    options = SETTINGS[name][algorithm] | given
    if algorithm == "best_of":
        trio = range(3 * seed, 3 * seed + 3)
        learned = dojo.learn.best_of(dojo.learn.shac, task, trio, verbose=True, **options)
    else:
        function = algorithm.split("_")[0] if algorithm.startswith("shac") else algorithm
        learned = getattr(dojo.learn, function)(task, seed=seed, verbose=True, **options)
    learned.save(path)
    learned.policy.save(path.with_suffix(".policy.npz"))
    print(f"{name} seed {seed}: {learned!r}", flush=True)


def saved(folder: Path, name: str, algorithm: str) -> list[Path]:
    """Files of the runs."""
    first = f"{name}_{algorithm}_"
    return sorted(p for p in folder.glob(f"{first}*.npz") if p.stem.removeprefix(first).isdigit())


def curve(path: Path) -> Floats:
    """(n, 2) processor time [s] and return of a run."""
    with np.load(path, allow_pickle=False) as data:
        if "returns" in data:
            return np.column_stack([data["seconds"], data["returns"]])
    history = dojo.learn.Learned.load(path).history
    return np.array([(r["seconds"], r["evaluated"]) for r in history if r["evaluated"] is not None])


def label_of(algorithm: str) -> str:
    """Name of an algorithm in the figure; peers learn in MuJoCo, unless they are said to learn here."""
    return f"{algorithm} in MuJoCo" if algorithm in ("ppo", "sac") else algorithm.removesuffix("_dojo")


def figure(folder: Path, names: list[str]) -> None:
    """Median and range over seeds of each algorithm, of the saved results; one panel per task that has any."""
    from matplotlib.figure import Figure

    names = [name for name in names if any(saved(folder, name, a) for a in (*SETTINGS[name], *PEERS))]
    if not names:
        return
    page = Figure(figsize=(5.0 * len(names) + 1.0, 4.0), layout="constrained")
    for axes, name in zip(page.subplots(1, len(names), squeeze=False)[0], names, strict=True):
        for algorithm in (*SETTINGS[name], *PEERS):
            curves = [c for c in map(curve, saved(folder, name, algorithm)) if len(c)]
            if not curves:
                continue
            rows = min(map(len, curves))
            seconds = np.median([c[:rows, 0] for c in curves], axis=0)
            returns = np.array([c[:rows, 1] for c in curves])
            label = f"{label_of(algorithm)}, {len(curves)} seed{'s' if len(curves) > 1 else ''}"
            axes.plot(seconds, np.median(returns, axis=0), marker=".", label=label)
            axes.fill_between(seconds, returns.min(axis=0), returns.max(axis=0), alpha=0.2)
        axes.set(xlabel="processor time [s]", ylabel="return in the task", title=name, xlim=(0.0, None))
        if axes.lines:
            axes.legend()
    target = folder / "learning.png"
    page.savefig(target, dpi=150)
    print(f"wrote {target}")


def in_mujoco(name: str, policies: list[Path]) -> list[list[float]]:
    """Returns of policies in Gymnasium's environment, at a fifth of its time step, with elliptic friction cones, and
    with stiff contacts at a fifth of its time step, where Gymnasium has the task.
    """
    if name not in JUDGED:
        return [[float("nan")] * _PLANTS] * len(policies)
    judge = Path(__file__).with_name("evaluate_policy.py")
    with tempfile.TemporaryDirectory() as folder:
        there = Path(folder) / "returns.json"
        command = [sys.executable, str(judge), f"{name}-v5", *map(str, policies), "--output", str(there)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        return list(json.loads(there.read_text()).values())


def cells(folder: Path, name: str, algorithm: str) -> list[list[Any]]:
    """The rows of the table of a task that an algorithm has, one per seed, as in _HEADER."""
    out = []
    if algorithm in PEERS:
        for path in saved(folder, name, algorithm):
            with np.load(path, allow_pickle=False) as data:
                here = float(data["returns"][-1]) if algorithm.endswith("_dojo") else None
                there = [*map(float, data["mujoco"]), *[None] * _PLANTS][:_PLANTS]  # old runs have fewer
                ended = [float(data["seconds"][-1]), int(data["steps"][-1])]
            seed = int(path.stem.split("_")[-1])
            out.append([algorithm, seed, here, None, None, *there, *ended, None, None])
        return out
    paths = saved(folder, name, algorithm)
    policies = [path.with_suffix(".policy.npz") for path in paths]
    for path, policy, there in zip(paths, policies, in_mujoco(name, policies) if paths else [], strict=True):
        found, points = dojo.learn.Learned.load(path), curve(path)
        soon = points[points[:, 0] <= 60.0, 1].max(initial=-np.inf)
        learnt = dojo.learn.LearnedPolicy.load(policy, task_of(name))
        unseen = dojo.learn.evaluate(learnt, 8, 100, substeps=UNSEEN[0], kappa=UNSEEN[1]).returns.mean()
        counts, best = [found.steps, found.unsolved, found.infinite], found.best
        if (name, algorithm) in SHAPED:
            soon, best = None, float(dojo.learn.evaluate(learnt, 8, 100).returns.mean())
        out.append([algorithm, found.seed, best, soon, float(unseen), *there, found.seconds, *counts])
    return out


def summary(name: str, algorithm: str, lines: list[list[Any]]) -> list[Row]:
    """Means and least values of the seeds of an algorithm, with the bars of shac."""
    numbers = np.array([line[1:] for line in lines if line[0] == algorithm], dtype=np.float64)
    of = "" if algorithm == "shac" else f" of {algorithm}"
    rows = [Row(f"{name}, seeds of {algorithm}", float(len(numbers)), "")]
    if not len(numbers):
        return rows
    means = dict(zip(_HEADER[1:], numbers.mean(axis=0), strict=True))
    found = {} if np.isnan(means["return"]) else {"mean return": means["return"], "least return": numbers[:, 1].min()}
    for column, title in (
        ("after 60 s", "after 60 s"), ("unseen step and smoothing", "at an unseen step and smoothing"),
        *((column, f"in {column}") for column in _HEADER if column.startswith("MuJoCo")),
    ):  # fmt: skip
        if np.isfinite(means[column]):
            found[f"mean return {title}"] = means[column]
    bars = dict(BARS.get(name, ()))
    rows += [Row(f"{name}, {key}{of}", float(v), "", bars.get(f"{key}{of}"), True) for key, v in found.items()]
    rows.append(Row(f"{name}, mean time{of}", means["time [s]"], "s"))
    rows.append(Row(f"{name}, mean control steps{of}", means["control steps"], ""))
    rows.append(Row(f"{name}, time of a million{of}", means["time [s]"] / means["control steps"] * 1e6 / 60.0, "min"))
    if algorithm not in PEERS:
        rows += [Row(f"{name}, {key}{of}", numbers[:, i].sum(), "", 0.0) for key, i in _COUNTS.items()]
    return rows


def kept_cells(table: dict[str, Any], algorithm: str) -> list[list[Any]]:
    """The rows of an algorithm in a saved table, as in _HEADER."""
    rows = [dict(zip(table["header"], row, strict=True)) for row in table["rows"] if row[0] == algorithm]
    return [[row.get(column) for column in _HEADER] for row in rows]


def table(folder: Path, names: list[str]) -> Report:
    """Returns of all saved runs: here, and in MuJoCo where Gymnasium has the task. Algorithms without runs in the
    folder keep the numbers that its learning.json has, and a note names them.
    """
    report, path = Report("Policies of Gymnasium's tasks, one core"), folder / "learning.json"
    before = json.loads(path.read_text(encoding="utf-8"))["tables"] if path.exists() else []
    known = {found["title"]: found for found in before}
    for name in names:
        lines: list[list[Any]] = []
        kept: list[str] = []
        for algorithm in (*SETTINGS[name], *PEERS):
            found = cells(folder, name, algorithm)
            if not found:
                found = kept_cells(known.get(name, {"header": (), "rows": ()}), algorithm)
                kept += [algorithm] if found else []
            lines += found
        if kept:
            report.notes.append(f"{name}: not run again for this table: {', '.join(kept)}")
        if lines:
            report.tables.append(Table(name, _HEADER, lines))
            for algorithm in dict.fromkeys(("shac", *(line[0] for line in lines))):
                report.rows += summary(name, algorithm, lines)
    return report


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
        report = table(given.folder, [given.task, *given.beside])
        beside = f" --beside {' '.join(given.beside)}" if given.beside else ""
        report.command = f"python benchmarks/learning.py DIR {given.task}{beside} --table"
        print(report.as_text())
        (given.folder / "learning.json").write_text(report.as_json() + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
