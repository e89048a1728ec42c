"""Environments, the live page, bridges and the command line refuse hostile calls by name."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt import __main__ as cli
from support.programs import HOME
from support.refusals import check_refused

SIM = dojo.Simulator(dojo.models.pendulum(), time_step=0.05)
NUMBERS: dict[str, Any] = {  # in place of an array of numbers
    "nan": np.full(1, np.nan),
    "infinite": [np.inf],
    "none": None,
    "text": "a",
    "complex": np.zeros(1, dtype=complex),
    "object": object(),
    "too long": np.zeros(99),
    "empty": [],
    "ragged": [[1], [1, 2]],
    "more axes": np.zeros((1, 1, 1)),
    "masked": np.ma.masked_all(1),
    "huge": [10**400],
}


def still(time: float, x: Any) -> Any:
    return np.ones(1)


def observed(x: Any, out: Any) -> None:
    out[0], out[1] = x[0], x[1]


def paid(x: Any, a: Any, after: Any) -> float:
    return 0.0


def never(x: Any) -> bool:
    return False


TASK = dojo.learn.Task(SIM, 1, observed, 2, paid, -np.ones(1), np.ones(1), still, never, steps=5)


@pytest.fixture(scope="module")
def environments() -> dict[str, Any]:
    """Environments of a problem and of a task; and two of a task, as one."""
    pytest.importorskip("gymnasium")
    from dojo_opt.learn.vector_environment import VectorEnvironment

    problem = dojo.Problem(SIM, SIM.neutral(), horizon=5, cost=[dojo.cost.Effort(1.0)])
    task = dojo.learn.pendulum()
    return {
        "Environment.step": dojo.Environment(problem),
        "Environment.step(": dojo.Environment(task),
        "VectorEnvironment.step": VectorEnvironment(task, 2),
    }


@pytest.mark.slow
def test_actions_are_refused_by_name(environments: dict[str, Any]) -> None:
    for call, environment in environments.items():
        with pytest.raises(RuntimeError, match=r"call reset\(\)"):
            environment.step(np.zeros(environment.action_space.shape))
        environment.reset(seed=0)
        for bad in NUMBERS.values():
            check_refused(lambda bad=bad, step=environment.step: step(bad), call)
        environment.step(np.zeros(environment.action_space.shape))


def vectors(**options: Any) -> Any:
    pytest.importorskip("gymnasium")
    from dojo_opt.learn.vector_environment import VectorEnvironment

    return VectorEnvironment(**{"task": dojo.learn.pendulum(), "num_envs": 2, **options})


VECTORS = [
    *[("task", bad) for bad in (None, 3)],
    *[("num_envs", bad) for bad in (0, -1, 1.5, "a", None, 10**15)],
    *[("autoreset_mode", bad) for bad in (0, "a", 3.5, [])],
    *[("max_episode_steps", bad) for bad in (0, -1, 1.5, "a", np.nan)],
]


@pytest.mark.parametrize(("name", "bad"), VECTORS)
def test_options_of_vector_environments_are_refused_by_name(name: str, bad: Any) -> None:
    check_refused(lambda: vectors(**{name: bad}), f"VectorEnvironment({name}")


def test_resets_of_vector_environments_are_refused_by_name(environments: dict[str, Any]) -> None:
    environment = environments["VectorEnvironment.step"]
    for seed in (-1, 1.5, "a", [1], [1, 2, 3], [-1, 2], {}):
        check_refused(lambda seed=seed: environment.reset(seed=seed), "VectorEnvironment.reset(seed=...)")
    for mask in (None, 1, "a", [True], [True] * 3, [1.5, 2]):
        check_refused(lambda mask=mask: environment.reset(options={"reset_mask": mask}), "reset_mask")
    check_refused(lambda: environment.reset(options=3), "VectorEnvironment.reset(options=...)")


def test_the_live_page_refuses_by_name() -> None:
    pytest.importorskip("meshcat")
    for rate in (0, -1, np.nan, np.inf, "a", None):
        check_refused(lambda rate=rate: dojo.viewer.live(SIM, rate=rate), "viewer.live(rate=...)")
    for port in (-1, 1.5, True, "a", None, 70_000):
        check_refused(lambda port=port: dojo.viewer.live(SIM, port=port), "viewer.live(port=...)")
    with dojo.viewer.live(SIM) as view:
        for bad in NUMBERS.values():
            check_refused(lambda bad=bad: view.show(bad), "Live.show(x)")
        check_refused(lambda: view.watch(3), "Live.watch(controller)")
        with pytest.raises(OSError, match=r"viewer.live\(port="):
            dojo.viewer.live(SIM, port=int(view.url.rstrip("/").rpartition(":")[2]))
    view.close()
    check_refused(lambda: view.show(SIM.neutral()), "Live.show")
    assert "<iframe" not in view._repr_html_()


def test_jax_refuses_what_are_no_real_numbers() -> None:
    jax = pytest.importorskip("jax")
    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", True)
    try:
        step, rollout = dojo.bridges.to_jax(SIM)
        for name in ("none", "text", "complex", "object", "ragged", "too long", "empty"):
            bad = NUMBERS[name]
            check_refused(lambda bad=bad: step(bad, np.zeros(1)), "to_jax: argument x")
            check_refused(lambda bad=bad: step(np.zeros(2), bad), "to_jax: argument u")
            check_refused(lambda bad=bad: rollout(np.zeros(2), bad), "to_jax: argument us")
    finally:
        jax.config.update("jax_enable_x64", before)


NAMELESS = {
    "Body(name=...)": lambda: dojo.Body("\ud800", 1.0),
    "Joint(name=...)": lambda: dojo.Joint("floating", None, "a", "\udcff"),
    "Kinematics(sim)": lambda: dojo.Kinematics(None),
    "Kinematics.moved(q)": lambda: dojo.Kinematics(SIM).moved(None, np.zeros(1)),
    "Kinematics.moved(dq)": lambda: dojo.Kinematics(SIM).moved(np.zeros(1), np.nan),
    "gaits.step(sim)": lambda: dojo.gaits.step(SIM.mechanism),
    "JointLimits(joints=...)": lambda: dojo.Problem(
        SIM,
        SIM.neutral(),
        horizon=3,
        cost=[dojo.cost.Effort(1.0)],
        constraints=[dojo.constraint.JointLimits(joints=3.0)],
    ),
}


@pytest.mark.parametrize("name", NAMELESS)
def test_constructors_refuse_by_name(name: str) -> None:
    check_refused(NAMELESS[name], name)


# -- the command line --------------------------------------------------------------------------------------------------

COMMANDS: dict[str, tuple[list[str], str]] = {
    "too many seconds": (["show", "pendulum", "--seconds", "1e15"], "GiB"),
    "steps of no length": (["show", "pendulum", "--time-step", "1e-300"], "GiB"),
    "no figure": (["show", "pendulum", "--out", "{}/a.foo"], "--out: the ending"),
    "figure without an ending": (["run", "hop", "--out", "{}/a"], "--out: the ending"),
    "figure in place of a folder": (["run", "hop", "--out", "{}"], "is a folder"),
    "page in place of a folder": (["show", "pendulum", "--html", "{}"], "is a folder"),
    "no such file": (["show", "{}/a.urdf"], "a.urdf"),
    "a file that is none": (["show", "{}"], "neither"),
    "pictures in place of a file": (["models", "--thumbnails", os.devnull], "expected a folder"),
    "page in place of a file": (["report", "timing", "--out", os.devnull], "expected a folder"),
    "a deep literal": (["run", "hop", "--set", "gait=" + "(" * 5000], "gait"),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_a_hostile_command_exits_with_2_and_the_reason(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command, reason = COMMANDS[name]
    assert cli.main([word.format(tmp_path) for word in command]) == 2
    said = capsys.readouterr()
    assert said.err.startswith(f"dojo-opt {command[0]}: ") and reason in said.err, said.err
    assert list(tmp_path.iterdir()) == []


def test_a_failure_of_the_engine_is_a_sentence(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def failing(error: Exception) -> Callable[..., int]:
        def command(_: Any) -> int:
            raise error

        return command

    unsolved = dojo.SimulationError("step 3", dojo.Status.MAX_ITERATIONS)
    for error, words in ((unsolved, "step 3"), (MemoryError(), "out of memory")):
        monkeypatch.setitem(cli._COMMANDS, "models", failing(error))
        assert cli.main(["models"]) == 1
        assert capsys.readouterr().err == f"dojo-opt models: {words}\n"


def outcome(command: str) -> tuple[int, str]:
    """Exit status of `dojo-opt models` and the rest of a command of the shell, and what it says of errors."""
    text = f'set -o pipefail; "{sys.executable}" -m dojo_opt models {command}'
    done = subprocess.run(
        ["bash", "-c", text],
        env={**os.environ, "PYTHONPATH": str(HOME)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    return done.returncode, done.stderr


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="of Linux")
def test_output_that_nobody_takes_is_no_traceback() -> None:
    assert outcome("| true") in ((1, ""), (0, ""))  # whichever is faster
    assert outcome(">&-") == (0, "")
    status, said = outcome("> /dev/full")
    assert (status, said.count("\n")) == (2, 1) and said.startswith("dojo-opt models: ")
