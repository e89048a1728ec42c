"""Ctrl-C during plans, closed loops and studies: the process goes on, and keeps the results up to then."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.planning.subproblem import Subproblem
from solvers.compiler import local_kernel
from solvers.status import Status
from support.interrupts import dropped, heard
from support.programs import HOME, python

ENDLESS: dict[str, Any] = {"tolerance": 1e-12, "violation_tolerance": 1e-14}


@pytest.fixture(scope="module")
def long_trot() -> dojo.Problem:
    return dojo.problems.trot(cycles=30)


@pytest.mark.slow
@pytest.mark.parametrize("after", [0.02, 0.1, 0.2, 0.5, 1.0])
def test_a_plan_ended_by_ctrl_c_is_its_last_iterate(long_trot: dojo.Problem, after: float) -> None:
    dojo.ilqr(dojo.problems.trot(), max_iterations=2)
    plan = heard(lambda: dojo.ilqr(long_trot, **ENDLESS), after)
    if plan is None:  # while the first iterate was made
        assert after < 0.2
        return
    assert plan.status == dojo.Status.INTERRUPTED
    assert not plan.success
    assert "Ctrl-C" in plan.message
    assert plan.x.shape == (long_trot.horizon + 1, long_trot.sim.nx)
    again = dojo.ilqr(long_trot, warm_start=plan, max_iterations=1)
    assert np.isfinite(again.fun)


@pytest.mark.slow
def test_a_plan_after_interrupted_ones_is_the_same() -> None:
    problem = dojo.problems.hop()
    expected = dojo.ilqr(problem)
    long = dojo.problems.trot(cycles=10)
    for after in (0.01, 0.03, 0.1):
        heard(lambda: dojo.ilqr(long, **ENDLESS), after)
    np.testing.assert_array_equal(dojo.ilqr(problem).x, expected.x)


@pytest.mark.slow
def test_closed_loops_and_studies_keep_their_results() -> None:
    mpc = dojo.tasks.hopper_mpc()
    plant = dojo.tasks.plant(mpc, 2e-3)
    dojo.closed_loop(mpc, plant, 0.05)
    loop = heard(lambda: dojo.closed_loop(mpc, plant, 1000.0), 0.5)
    assert loop.message == "Ctrl-C interrupted the computation."
    assert not loop.survived
    assert len(loop.x) == len(loop.u) + 1 == len(loop.time) == len(loop.contacts.gap) + 1 > 1
    expected = dojo.closed_loop(mpc, plant, loop.duration)
    np.testing.assert_array_equal(expected.x, loop.x)
    study = heard(lambda: mpc.monte_carlo(plant, lambda rng: dojo.Perturbation(), 0.02, runs=2_000), 0.5)
    assert len(study.outcomes) > 0


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT for a single process")
def test_ctrl_c_from_outside_never_crashes_a_plan() -> None:
    program = (
        "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"  # ignored in a shell's background jobs
        "import dojo_opt as dojo\nproblem = dojo.problems.trot(cycles=30)\n"
        "dojo.ilqr(problem, tolerance=1e-12, violation=1e-14, time_limit=0.5)\n"  # compile the code needed below
        "print('start', flush=True)\n"
        "try:\n    dojo.ilqr(problem, tolerance=1e-12, violation=1e-14)\n"
        "except KeyboardInterrupt as stop:\n    print(type(stop).__name__, stop.result.status.name)\n"
    )
    child = subprocess.Popen(
        [sys.executable, "-c", program],
        env={**os.environ, "PYTHONPATH": str(HOME)},
        stdout=subprocess.PIPE,
        text=True,
    )
    assert child.stdout is not None
    assert child.stdout.readline() == "start\n"
    try:
        child.wait(0.5 + np.random.default_rng(0).random())
    except subprocess.TimeoutExpired:
        child.send_signal(signal.SIGINT)
    out, _ = child.communicate()
    assert (child.returncode, out) == (0, "Interrupted INTERRUPTED\n")


HOPPER = dojo.Simulator(dojo.models.raiberthopper(), 0.02)
REST, PUSHES = HOPPER.neutral(), np.full((8, HOPPER.nu), 0.5)
CALLS = {
    "step": lambda: HOPPER.step(REST),
    "rollout": lambda: HOPPER.rollout(REST, PUSHES),
    "batch": lambda: HOPPER.rollout_batch(np.tile(REST, (2, 1)), np.tile(PUSHES, (2, 1, 1))),
    "rows": lambda: HOPPER.step_batch(np.tile(REST, (2, 1)), PUSHES[:2], derivatives=True),
    "derivatives": lambda: HOPPER.linearize_trajectory(np.tile(REST, (8, 1)), PUSHES),
    "gradient": lambda: HOPPER.vjp((np.tile(REST, (9, 1)), PUSHES), np.zeros((9, HOPPER.ndx))),
    "accuracy": lambda: HOPPER.replace(accuracy=1e-3).rollout(REST, PUSHES),
    "plan": lambda: dojo.ilqr(HOP, max_iterations=1),
    "comparison": lambda: np.zeros(2, dtype=np.int64) == dojo.Status.SOLVED,
    "choice": lambda: np.where(np.zeros(2, dtype=bool), dojo.Status.SOLVED, dojo.Status.SINGULAR),
}
HOP = dojo.problems.hop()


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name == "accuracy" else []) for name in CALLS]
)
def test_no_ctrl_c_is_dropped_wherever_it_comes(name: str) -> None:
    assert dropped(CALLS[name], most=200) == []
    other = threading.Thread(target=CALLS[name], daemon=True)
    other.start()
    other.join(100.0)
    assert not other.is_alive(), "a lock is kept"


@pytest.mark.sweep(3)
@pytest.mark.parametrize("module", ["asyncio.events", "tornado.ioloop", "meshcat.geometry"])
def test_ctrl_c_in_the_first_animation_leaves_no_half_of_a_library(module: str, tmp_path: Path) -> None:
    """The next animation failed with a NameError of asyncio, which was imported in part."""
    pytest.importorskip("meshcat")
    program = f"""
import os, signal, sys
import numpy as np, dojo_opt as dojo

class Finder:
    def find_spec(self, name, *others):
        if name == {module!r} and self in sys.meta_path:
            sys.meta_path.remove(self)
            os.kill(os.getpid(), signal.SIGINT)

signal.signal(signal.SIGINT, signal.default_int_handler)
sim = dojo.Simulator(dojo.models.pendulum(), 0.05)
motion = sim.rollout(np.zeros(2), np.zeros((2, 1)))
sys.meta_path.insert(0, Finder())
try:
    dojo.viewer.save_html(motion, "page.html")
except KeyboardInterrupt:
    print("heard")
print(dojo.viewer.save_html(motion, "page.html"))
"""
    assert python(program, cwd=tmp_path).split() == ["heard", "page.html"]


def test_ctrl_c_before_the_first_iterate_leaves_no_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Subproblem, "forget", stop)
    with pytest.raises(dojo.Interrupted) as found:
        dojo.ilqr(HOP)
    assert found.value.result is None


class ArrayAndNumber(NamedTuple):
    first: float
    second: float


UNSAFE = {
    "fields": lambda x: ArrayAndNumber(x, 2.0),
    "fields inside": lambda x: (1, ArrayAndNumber(x, 2.0)),
    "enum": lambda x: Status.SOLVED,
    "enum inside": lambda x: (Status.SOLVED, x),
}


@pytest.mark.parametrize("name", UNSAFE)
def test_no_kernel_returns_python_objects(name: str) -> None:
    with pytest.raises(TypeError, match="expected to return numbers and plain tuples to Python"):
        local_kernel(UNSAFE[name])(1.0)


def test_plain_results_are_returned() -> None:
    assert local_kernel(lambda x: (x, (1, True), None))(1.0) == (1.0, (1, True), None)
