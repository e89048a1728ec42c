"""Seeds: an algorithm run with several of them, one after the other or in workers."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import Executor
from dataclasses import replace
from typing import Any

from dojo_opt.learn.learned import Learned
from dojo_opt.learn.task import Task
from sim.mechanism.checks import whole_number
from solvers.status import Status

__all__ = ["seeds"]


def seeds(
    algorithm: Callable[..., Learned],
    task: Task,
    numbers: Iterable[int] = range(5),
    *,
    executor: Executor | None = None,
    **options: Any,
) -> list[Learned]:
    """Learn a task several times: runs differ between seeds, and one run tells little.

    A run depends on its seed alone, neither on the executor nor on the number of its workers; its time does.

    Args:
        algorithm: `shac`, `ars`, `gradient_search`, or another function of (task, seed=, **options).
        task: what to learn.
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
    if executor is not None and not hasattr(executor, "submit"):
        raise TypeError(f"seeds(executor=...): expected an Executor, with submit(), got {executor!r}")
    chosen = [whole_number("seeds(numbers)", number, 0) for number in numbers]
    futures = [] if executor is None else [executor.submit(_run, algorithm, task, k, options) for k in chosen]
    out: list[Learned] = []
    try:
        for i, number in enumerate(chosen):
            found = futures[i].result() if futures else _run(algorithm, task, number, options)
            out.append(replace(found, policy=replace(found.policy, task=task)))
            if found.status == Status.INTERRUPTED:
                break
    except KeyboardInterrupt:
        for future in futures:
            future.cancel()
    return out


def _run(algorithm: Callable[..., Learned], task: Task, number: int, options: dict[str, Any]) -> Learned:
    """One run, without its task, which the caller has; at module level, so that other processes can import it."""
    found = algorithm(task, seed=number, **options)
    return replace(found, policy=replace(found.policy, task=None))
