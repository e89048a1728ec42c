"""Learned: the policy of an algorithm, the history of the training, and its state for a continuation."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dojo_opt.learn.policy import LearnedPolicy, policy_head, policy_of
from dojo_opt.learn.task import Task
from sim.mechanism.short_repr import short_table
from sim.simulator.npz_file import check_head, read_npz, reading, write_npz
from solvers.status import MESSAGES, Status

__all__ = ["Learned", "LearningProgress"]

_SAVED: dict[str, Any] = {  # fields in the head of a file
    **{"success": bool, "status": int, "message": str, "algorithm": str, "seed": int, "best": float, "steps": int},
    **{"unsolved": int, "infinite": int, "seconds": float, "history": list},
}
COLUMNS = ("epoch", "steps", "return", "evaluated", "gradient", "clipped", "unsolved", "infinite", "seconds")
HEADER = "{:>6} {:>10} {:>9} {:>9} {:>9} {:>8} {:>8} {:>8} {:>8}".format(*COLUMNS)


def table_line(record: dict[str, Any]) -> str:
    """One aligned line of the table of epochs; "-" where nothing was evaluated, or no episode ended."""
    r = record
    numbers = [f"{r[k]:9.1f}" if r[k] is not None else f"{'-':>9}" for k in ("return", "evaluated")]
    return (
        f"{r['epoch']:6d} {r['steps']:10d} {numbers[0]} {numbers[1]} {r['gradient']:9.2e} {r['clipped']:8.4f} "
        f"{r['unsolved']:8d} {r['infinite']:8d} {r['seconds']:8.1f}"
    )


@dataclass(repr=False)
class Learned:
    """The result of `shac`, `ars`, `gradient_search` and `imitate`. `policy` is the best of the evaluated policies.

    Attributes:
        policy: the best policy.
        success: whether all epochs were done; `message` tells if the policy before the first is the best.
        status: SOLVED, or the reason for an early end.
        message: the same as a sentence.
        algorithm: its name.
        seed: of all random numbers.
        best: mean return of `policy` in the task, without noise.
        steps: control steps of all environments; of `imitate`, evaluations of the policy.
        unsolved: steps of environments that were not solved; these environments started anew.
        infinite: epochs whose gradient was not finite; they left the policy as it was.
        seconds: processor time.
        history: one record per epoch.
        state: arrays and numbers to resume from.
    """

    policy: LearnedPolicy
    success: bool
    status: Status
    message: str
    algorithm: str
    seed: int
    best: float
    steps: int
    unsolved: int
    infinite: int
    seconds: float
    history: list[dict[str, Any]] = field(default_factory=list)
    state: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"Learned({self.closing_line()})"

    def _repr_html_(self) -> str:
        return short_table(self.closing_line(), COLUMNS, [[r[name] for name in COLUMNS] for r in self.history])

    def closing_line(self) -> str:
        """The end of the training in one line.

        Returns:
            The line.
        """
        return (
            f"{self.algorithm}, {self.status.name}: {self.message} Return {self.best:.1f} after {self.steps} steps in "
            f"{self.seconds:.1f} s, {self.unsolved} unsolved, {self.infinite} gradients not finite"
        )

    def summary(self) -> str:
        """The table of epochs and a closing line.

        Returns:
            Lines of text.
        """
        return "\n".join([HEADER, *(table_line(r) for r in self.history), self.closing_line()])

    def save(self, path: str | Path) -> None:
        """Write everything but the task to an .npz file.

        Args:
            path: of the file.
        """
        meta = {name: getattr(self, name) for name in _SAVED} | {"status": int(self.status)}
        arrays: dict[str, Any] = {f"state_{k}": v for k, v in self.state.items() if isinstance(v, np.ndarray)}
        meta["state"] = {k: v for k, v in self.state.items() if not isinstance(v, np.ndarray)}
        p = self.policy
        meta["network"] = policy_head(p)
        arrays |= {"weights": p.weights, "mean": p.mean, "deviation": p.deviation}
        write_npz("Learned.save(path)", path, meta, arrays)

    @classmethod
    def load(cls, path: str | Path, task: Task | None = None) -> Learned:
        """Read a file that `save` wrote; with its task, the policy can return inputs.

        Args:
            path: of the file.
            task: the task that it has learnt (default None).

        Returns:
            The run.

        Raises:
            OSError: the file cannot be read.
            ValueError: it is another file, damaged, or its policy does not fit the task.
        """
        call = "Learned.load"
        with reading(call, path, "run of learning"):
            meta, data = read_npz(call, path)
            check_head(meta, _SAVED | {"network": dict, "state": dict})
            for record in meta["history"]:
                table_line(record)
            policy = policy_of(meta.pop("network"), data, task)
            state = meta.pop("state") | {k[6:]: array for k, array in data.items() if k.startswith("state_")}
            meta["status"] = Status(meta["status"])
            return cls(policy=policy, state=state, **meta)

    def plot(self, axes: Any = None) -> Any:
        """Returns over processor time; makes a figure unless axes are given, and returns the axes.

        Args:
            axes: of matplotlib (default None: those of a new figure).

        Returns:
            The axes.
        """
        if axes is None:
            from matplotlib.figure import Figure

            axes = Figure(figsize=(6.0, 3.5), layout="constrained").subplots()
        for name, label in (("return", "while learning"), ("evaluated", "without noise, in the task")):
            seen = [(r["seconds"], r[name]) for r in self.history if r[name] is not None]
            if seen:
                axes.plot(*zip(*seen, strict=True), label=label)
        axes.set(xlabel="processor time [s]", ylabel="return")
        axes.legend()
        return axes


class LearningProgress:
    """The table of epochs while an algorithm runs, its clock and its limits."""

    def __init__(self, options: Any, history: list[dict[str, Any]], before: float) -> None:
        self._options, self.records = options, list(history)
        self._began, self._before, self._headed = time.process_time(), before, False

    @property
    def seconds(self) -> float:
        """Processor time, that of the runs resumed from included."""
        return self._before + time.process_time() - self._began

    def add(self, **record: Any) -> Status:
        """Record an epoch, and print it if it was evaluated; SOLVED if there is time left."""
        record["seconds"] = self.seconds
        self.records.append(record)
        if self._options.verbose and record["evaluated"] is not None:
            for line in [table_line(record)] if self._headed else [HEADER, table_line(record)]:
                print(line, file=self._options.stream or sys.stdout, flush=True)
            self._headed = True
        callback: Callable[[dict[str, Any]], None] | None = self._options.callback
        if callback is not None:
            try:
                callback(record)
            except StopIteration:
                return Status.STOPPED
        return Status.TIME_LIMIT if record["seconds"] >= self._options.time_limit else Status.SOLVED

    def message(self, status: Status) -> str:
        """The sentence of how it ended."""
        return "All epochs are done." if status == Status.SOLVED else MESSAGES[status]
