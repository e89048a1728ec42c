"""The process that compiles beside this one: each kernel is compiled by one of the two, or by this one if need be."""

from __future__ import annotations

import json
import os
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import dojo_opt as dojo
from solvers.compiler import helper_process
from support.programs import python


class FakeJob(NamedTuple):
    name: str
    func: Callable[..., Any]
    kept: bool = False

    def at_hand(self) -> bool:
        return self.kept

    def address(self) -> int:
        raise NotImplementedError


def small(x: float) -> float:
    return x


def large(x: float) -> float:
    return x + small(x) * small(x + 1.0) + small(x + 2.0)


JOBS = [FakeJob("a:kept", small, True), *(FakeJob(f"a:small{k}", small) for k in range(4)), FakeJob("a:large", large)]
RECORDING = """
import sys
print("done", flush=True)
for line in sys.stdin:
    with open(PATH, "a") as file:
        file.write(line)
    print("done", flush=True)
"""


@pytest.fixture
def told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A file with the jobs that a helper was given; two cores are assumed."""
    path = tmp_path / "told"
    path.write_text("")
    monkeypatch.setattr(helper_process, "_PROGRAM", RECORDING.replace("PATH", repr(str(path))))
    monkeypatch.setattr(helper_process, "_possible", lambda: True)
    yield path


def test_each_job_is_done_once_and_those_of_the_helper_come_last(told: Path) -> None:
    seen = []
    for job in helper_process.divided(JOBS):
        seen.append(job.name)
        while job.name == "a:large" and told.read_text().count("\n") < 2:  # as long as the helper does two of them
            time.sleep(0.01)
    theirs = told.read_text().split()
    assert seen[:2] == ["a:kept", "a:large"]
    assert len(theirs) >= 2 and seen[-len(theirs) :] == theirs
    assert sorted(seen) == sorted(job.name for job in JOBS)


@pytest.mark.slow
def test_a_helper_that_fails_leaves_its_jobs(told: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(helper_process, "_PROGRAM", "print('done', flush=True); input(); raise SystemExit(1)")
    seen = []
    for job in helper_process.divided(JOBS):
        seen.append(job.name)
        time.sleep(0.2)
    assert sorted(seen) == sorted(job.name for job in JOBS)


def test_an_interrupted_compilation_ends_the_helper(told: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = f"import time; open({str(told)!r}, 'w').write('here'); print('done', flush=True); time.sleep(100.0)"
    monkeypatch.setattr(helper_process, "_PROGRAM", program)
    started: list[subprocess.Popen[str]] = []

    class WatchedPopen(subprocess.Popen):  # type: ignore[type-arg]
        def __init__(self, *args: Any, **settings: Any) -> None:
            super().__init__(*args, **settings)
            started.append(self)

    monkeypatch.setattr(helper_process.subprocess, "Popen", WatchedPopen)
    with closing(helper_process.divided(JOBS)) as queue:
        next(queue), next(queue)
        while not told.read_text():
            time.sleep(0.01)
    (process,) = started
    assert process.returncode not in (None, 0)  # it was ended, and did not end by itself


@pytest.mark.slow
@pytest.mark.skipif(
    not hasattr(os, "sched_getaffinity") or len(os.sched_getaffinity(0)) < 2, reason="one core, so no helper"
)
def test_a_scene_runs_the_code_of_the_helper(tmp_path: Path) -> None:
    program = """
import json, numpy as np, dojo_opt as dojo
from solvers.compiler import compiled
sim = dojo.Simulator(dojo.models.pendulum(), time_step=0.01)
print(json.dumps([sim.step(sim.neutral() + 0.1).x.tolist(), len(compiled())]))
"""
    own = {"NUMBA_CACHE_DIR": str(tmp_path), "DOJO_OPT_SHIPPED": "0", "DOJO_OPT_JOBS": "2"}
    tmp_path.chmod(0o700)
    own["NUMBA_OPT"] = "0"  # the division of the work does not depend on it
    end, here = json.loads(python(program, **own))
    sim = dojo.Simulator(dojo.models.pendulum(), time_step=0.01)
    np.testing.assert_allclose(end, sim.step(sim.neutral() + 0.1).x, rtol=1e-12)
    kept = len(list(tmp_path.rglob("*.nbc")))  # by both processes
    assert 0.2 * kept < here < 0.8 * kept


def test_a_kernel_ahead_has_the_types_of_its_calls() -> None:
    from solvers.compiler.optional import _Ahead
    from solvers.riccati import backward_knots

    dojo.ilqr(dojo.problems.swingup(), max_iterations=1)
    assert {_Ahead(backward_knots).types()} == set(backward_knots.entry.overloads)  # type: ignore[attr-defined]
