"""Interleaved rounds: every case once per round, so that the load of the machine affects all cases equally."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray


def interleave(
    cases: Mapping[str, Callable[[], Any]], rounds: int, clock: Callable[[], float] = time.process_time
) -> dict[str, NDArray[np.float64]]:
    """Seconds of each case in each round, shape (rounds,).

    In every round a case runs once before it is clocked: measured is the steady state, not how long caches take to fill
    again after the case before. (50 steps of the hopper take 0.16 ms warm, and three times that after MuJoCo.)
    """
    seconds: dict[str, list[float]] = {name: [] for name in cases}
    for _ in range(rounds):
        for name, run in cases.items():
            run()
            start = clock()
            run()
            seconds[name].append(clock() - start)
    return {name: np.array(values) for name, values in seconds.items()}


def ratio(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Median of the ratios taken round by round."""
    return float(np.median(a / b))


def slope(x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """Least-squares slope of log y against log x."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])
