"""Fixtures for all tests."""

from __future__ import annotations

import gc
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Generator

    import numpy as np

sys.path.append(str(Path(__file__).parent.parent))  # benchmarks; at the end, so that an installed dojo_opt is tested
# threads of a worker that wait do not take the cores from the other workers: half the processor time of batches
os.environ.setdefault("OMP_WAIT_POLICY", "passive")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read when NumPy is imported, so not here
os.environ.setdefault("DOJO_OPT_JOBS", "1")  # workers of pytest-xdist share the cores already
os.environ["PYTHONSAFEPATH"] = "1"  # nor do processes that tests start import the folder they run in: it has no kernels
_AT_IMPORT: list[str] = []
_APART = ("test_shipped.py", "test_cache.py")


def pytest_configure(config: pytest.Config) -> None:
    """Keep bytecode beside pytest's own files where Python is told not to write it, as in most container images.

    Without bytecode each worker parses all tests again, and each process that a test starts all modules: ten seconds
    a worker, and half a second a process.
    """
    if sys.dont_write_bytecode and getattr(config, "cache", None) is not None:
        sys.pycache_prefix, sys.dont_write_bytecode = str(config.cache.mkdir("bytecode")), False


def pytest_collection_finish() -> None:
    """Collect garbage seldom, and never among modules and tests: that took a tenth of the processor time."""
    gc.freeze()
    gc.set_threshold(50_000, 20, 100)
    if "solvers.compiler" in sys.modules:
        _AT_IMPORT.extend(sys.modules["solvers.compiler"].compiled_signatures())


def pytest_sessionfinish() -> None:
    """Collect garbage once: pytest does so five times, for exceptions that only then are raised."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(wrapper=True, tryfirst=True)  # before `-m` chooses, and after
def pytest_collection_modifyitems(items: list[pytest.Item]) -> Generator[None, None, None]:
    """Of the cases of a function marked `sweep(n)`, `-m "not slow"` takes every n-th."""
    seen: dict[str, int] = {}
    for item in items:
        sweep = item.get_closest_marker("sweep")
        if sweep is not None:
            function = item.nodeid.partition("[")[0]
            case = seen[function] = seen.get(function, -1) + 1
            if case % sweep.args[0]:
                item.add_marker(pytest.mark.slow)
    yield
    items[:] = _divided(items, int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1")))


def _divided(items: list[pytest.Item], workers: int) -> list[pytest.Item]:
    """The items in parts, of which each worker gets one. All but the first begin with tests that compile in caches of
    their own: workers that all begin with steps compile the same ones at the same time.
    """
    rest = [item for item in items if item.path.name not in _APART]
    out: list[pytest.Item] = []
    for k in range(workers):
        names = _APART[k - 1 :: workers - 1] if k else ()
        first = [item for name in names for item in items if item.path.name == name]
        count = max((len(items) - len(out)) // (workers - k) - len(first), 0)
        out += first + (rest[:count] if k < workers - 1 else rest)
        del rest[:count]
    return out if workers > 1 else items


@pytest.fixture
def kernels_at_import() -> list[str]:
    """Kernels that were compiled or loaded while modules of tests were imported."""
    return _AT_IMPORT


@pytest.fixture
def rng() -> np.random.Generator:
    """One seed for all random tests."""
    import numpy as np

    return np.random.default_rng(20240501)
