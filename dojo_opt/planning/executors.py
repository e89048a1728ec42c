"""Calls of one function that do not depend on one another, here or in the workers of an executor."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from typing import Any, TypeVar

Value = TypeVar("Value")

__all__ = ["check_executor", "results_in_order"]


def check_executor(call: str, executor: Any) -> None:
    """Refuse objects without submit(); None is no executor."""
    if executor is not None and not hasattr(executor, "submit"):
        raise TypeError(f"{call}(executor=...): expected an Executor, with submit(), got {executor!r}")


def results_in_order(
    function: Callable[..., Value], calls: Sequence[tuple[Any, ...]], executor: Executor | None
) -> Iterator[Value]:
    """The results of the calls, in their order, each as soon as it and those before are there.

    An error, Ctrl-C and a caller that stops early cancel the calls that no worker has begun.

    Args:
        function: at module level, so that other processes can import it.
        calls: its arguments.
        executor: whose workers run all calls; None: each is run here when its result is requested.

    Yields:
        One result per call.
    """
    if executor is None:
        yield from (function(*call) for call in calls)
        return
    futures: list[Any] = []
    try:
        for call in calls:
            futures.append(executor.submit(function, *call))  # those submitted before Ctrl-C can be cancelled
        for future in futures:
            yield future.result()
    finally:
        for future in futures:
            future.cancel()
