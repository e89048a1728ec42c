"""Seeds: runs of an algorithm with several seeds, one after the other or in workers, to the end or until one leads."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import replace
from typing import Any

from dojo_opt.learn.task import Task
from dojo_opt.learn.training_result import Learned
from dojo_opt.planning.executors import check_executor, results_in_order
from sim.mechanism import checks
from solvers.status import Status

__all__ = ["best_of", "seeds"]


def seeds(
    algorithm: Callable[..., Learned],
    task: Task,
    numbers: Iterable[int] = range(5),
    *,
    executor: Executor | None = None,
    **options: Any,
) -> list[Learned]:
    """Learn a task with several seeds, because runs differ between seeds.

    The result of a run depends on its seed alone, neither on the executor nor on the number of its workers.

    Args:
        algorithm: `shac`, `ars`, `gradient_search`, or another function of (task, seed=, **options).
        task: the task to learn.
        numbers: seeds (default 0 to 4).
        executor: anything with the interface of `concurrent.futures.Executor`, as for `dojo.monte_carlo` (default None:
            one run after the other).
        **options: of the algorithm.

    Returns:
        One run per seed, in their order; fewer after Ctrl-C, the last one interrupted.

    Raises:
        TypeError: for an argument of the wrong kind.
        ValueError: for a number out of range.
    """
    if not callable(algorithm):
        raise TypeError(f"seeds(algorithm): expected a function such as dojo.learn.shac, got {algorithm!r}")
    check_executor("seeds", executor)
    if not isinstance(numbers, Iterable):
        raise TypeError(f"seeds(numbers): expected whole numbers, got {numbers!r}")
    chosen = [checks.whole_number("seeds(numbers)", number, 0) for number in numbers]
    out: list[Learned] = []
    with suppress(KeyboardInterrupt):
        for found in results_in_order(_run, [(algorithm, task, number, options) for number in chosen], executor):
            out.append(replace(found, policy=replace(found.policy, task=task)))
            if found.status == Status.INTERRUPTED:
                break
    return out


def _run(algorithm: Callable[..., Learned], task: Task, number: int, options: dict[str, Any]) -> Learned:
    """One run, without its task, which the caller has; at module level, so that other processes can import it."""
    found = algorithm(task, seed=number, **options)
    return replace(found, policy=replace(found.policy, task=None))


class _StopAt:
    """A callback that ends a run after an epoch."""

    def __init__(self, epoch: int) -> None:
        self.epoch = epoch

    def __call__(self, record: dict[str, Any]) -> None:
        if record["epoch"] >= self.epoch:
            raise StopIteration


def best_of(
    algorithm: Callable[..., Learned],
    task: Task,
    numbers: Iterable[int] = range(3),
    *,
    epochs: int,
    share: float = 0.2,
    executor: Executor | None = None,
    **options: Any,
) -> Learned:
    """Begin with several seeds, and continue with the one of the highest return.

    Some runs settle early in a poor motion, and show it early.

    Args:
        algorithm: `shac`, `ars` or `gradient_search`.
        task: the task to learn.
        numbers: seeds (default 0 to 2).
        epochs: epochs of the continued run.
        share: share of these epochs after which it is chosen (default 0.2).
        executor: whose workers begin, as in `seeds` (default None: one run after the other).
        **options: of the algorithm.

    Returns:
        The run to its end, the same to the last bit as that of its seed alone; its steps, unsolved steps and processor
        time, also those in its history, include those of the others.

    Raises:
        TypeError: for an argument of the wrong kind.
        ValueError: for a number out of range, or no seed.
        KeyboardInterrupt: Ctrl-C came before the first run had a policy.
    """
    if "callback" in options or "resume" in options:
        raise TypeError("best_of(...): callback and resume are its own; give them to the algorithm")
    first = max(1, round(checks.fraction("best_of(share=...)", share) * checks.whole_number("best_of(epochs)", epochs)))
    numbers = list(numbers) if isinstance(numbers, Iterable) else numbers
    begun = seeds(algorithm, task, numbers, executor=executor, epochs=epochs, callback=_StopAt(first), **options)
    if not begun and numbers:
        raise KeyboardInterrupt  # before the first run had a policy
    if not begun:
        raise ValueError("best_of(numbers): expected at least one seed")
    chosen = max(begun, key=_earned)
    ended = begun[-1].status == Status.INTERRUPTED or chosen.success
    found = chosen if ended else algorithm(task, seed=chosen.seed, resume=chosen, epochs=epochs, **options)
    others = [run for run in begun if run is not chosen]
    more = {name: sum(getattr(run, name) for run in others) for name in ("steps", "unsolved", "seconds")}
    history = [record | {name: record[name] + more[name] for name in more} for record in found.history]
    return replace(found, history=history, **{name: getattr(found, name) + more[name] for name in more})


def _earned(run: Learned) -> float:
    """The last mean return while learning; that of the evaluated policy before any episode has ended."""
    last = run.history[-1]["return"] if run.history else None
    return run.best if last is None else float(last)
