"""Engines: one protocol, the same motion, honest ends."""

from __future__ import annotations

import os
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import dojo_opt as dojo
from benchmarks.engines import Ours, PhysicsEngine, Run, installed
from benchmarks.engines.failed_runs import ended
from benchmarks.studies import stability
from benchmarks.studies.stability import StabilityStudy
from benchmarks.studies.stability import joint_trials as joints
from dojo_opt.report import Progress
from dojo_opt.report.engine import nodes
from support.crashing_engine import Killing

ENGINES = [Ours(rounds=1), *installed()]
SECOND_ORDER = [e for e in ENGINES if e.name in ("dojo-opt", "MuJoCo RK4")]


def swing(
    engine: PhysicsEngine, time_step: float = 1e-3, duration: float = 0.5, samples: int = 5, **kwargs: object
) -> Run:
    mech = dojo.models.npendulum(2, spring=3.0)
    return engine.simulate(
        mech, time_step=time_step, q=[0.6, -0.4], v=[1.0, 2.0], duration=duration, samples=samples, **kwargs
    )


@pytest.mark.parametrize("engine", ENGINES, ids=lambda e: e.name)
def test_a_run_has_the_shapes_it_promises(engine: PhysicsEngine) -> None:
    run = swing(engine)
    np.testing.assert_allclose(run.time, np.linspace(0.0, 0.5, 6), atol=1e-12)
    shapes = [run.position.shape, run.quaternion.shape, run.velocity.shape, run.energy.shape, run.momentum.shape]
    assert shapes == [(6, 2, 3), (6, 2, 4), (6, 2, 6), (6,), (6, 6)]
    assert run.steps == 500 and run.seconds > 0.0 and run.message == ""
    np.testing.assert_allclose(run.energy, run.energy[0], atol=0.05)


@pytest.mark.parametrize("engine", ENGINES, ids=lambda e: e.name)
def test_the_start_is_the_same_for_all(engine: PhysicsEngine) -> None:
    """Poses, velocities, energy and momentum of the first sample, against the sums over the bodies by hand."""
    run, first = swing(engine), swing(ENGINES[0])
    for name in ("position", "quaternion", "velocity", "energy", "momentum"):
        np.testing.assert_allclose(getattr(run, name)[0], getattr(first, name)[0], atol=1e-10, err_msg=name)
    assert abs(first.velocity[0, 0, 3] - 1.0) < 1e-10 and abs(first.velocity[0, 1, 3] - 3.0) < 1e-10


@pytest.mark.parametrize("engine", SECOND_ORDER, ids=lambda e: e.name)
def test_velocity_is_the_derivative_of_position(engine: PhysicsEngine) -> None:
    run = swing(engine, duration=0.1, samples=100)
    rate = (run.position[2:] - run.position[:-2]) / 2e-3
    np.testing.assert_allclose(run.velocity[1:-1, :, :3], rate, atol=2e-4)


def test_energy_of_a_run_agrees_with_the_simulator() -> None:
    mech = dojo.models.quadruped(spring=5.0, limits=False)
    sim = dojo.Simulator(mech, time_step=0.01)
    rng = np.random.default_rng(2)
    q, v = sim.neutral()[: sim.nq] + np.r_[0, 0, 2.0, np.zeros(16)], rng.normal(size=sim.nv)
    x = sim.state_from_velocity(q, v)
    run = Ours(rounds=1).simulate(mech, time_step=0.01, q=q, v=v, duration=0.02, samples=2)
    trajectory = sim.rollout(x, np.zeros((2, sim.nu)))
    np.testing.assert_allclose(run.energy, sim.energy(trajectory.x), rtol=1e-10)
    np.testing.assert_allclose(run.momentum, np.hstack(sim.momentum(trajectory.x)), atol=1e-10)
    np.testing.assert_allclose(sim.velocity(x), v, atol=1e-10)


def test_inputs_are_held_or_given_step_by_step() -> None:
    u = np.array([0.3, -0.2])
    for engine in SECOND_ORDER:
        once, each = swing(engine, inputs=u), swing(engine, inputs=np.tile(u, (500, 1)))
        np.testing.assert_allclose(once.position, each.position, atol=1e-12)
        assert np.abs(once.position - swing(engine).position).max() > 1e-3


def test_a_lost_run_says_so_and_keeps_its_good_samples() -> None:
    mech = dojo.models.npendulum(2)
    args = {"time_step": 0.1, "q": [1.0, 0.0], "duration": 1.0, "samples": 10}
    ours = Ours(divide=False).simulate(mech, v=[400.0, 0.0], **args)
    assert len(ours.time) == 1 and "half a turn" in ours.message and ours.steps == 0
    if find_spec("mujoco"):
        euler = next(e for e in ENGINES if e.name == "MuJoCo Euler")
        stiff = dojo.models.npendulum(2, spring=1e7)
        run = euler.simulate(stiff, v=[5.0, 0.0], **args)
        assert "lost between" in run.message
        assert len(run.time) == len(run.energy) < 11 and np.isfinite(run.position).all()


def test_an_engine_that_raises_is_a_run_that_ends_at_its_start() -> None:
    """An engine that cannot represent a mechanism still says so."""

    class Breaking:
        name = "breaking"

        def __init__(self, error: Exception) -> None:
            self.error = error

        @ended
        def simulate(self, mechanism: dojo.Mechanism, **_: object) -> Run:
            raise self.error

    run = swing(Breaking(RuntimeError("no license\nat all")))
    assert run.message == "RuntimeError: no license" and run.steps == 0
    np.testing.assert_allclose(run.position, swing(ENGINES[0]).position[:1], atol=1e-12)
    with pytest.raises(ValueError, match="no springs"):
        swing(Breaking(ValueError("no springs")))


@pytest.mark.slow
def test_an_engine_that_kills_its_process_is_a_cell_and_the_report_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """The calls before it share a process, which is not this one, and those after it share another one."""
    first, second = (swing(Killing(deadly=0.3)) for _ in range(2))
    assert first.message == second.message != f"in process {os.getpid()}"
    run = swing(Killing(deadly=0.3), duration=0.3)
    assert run.message == "ended by signal 11 (Segmentation fault)" and run.steps == 0
    np.testing.assert_allclose(run.position, first.position[:1], atol=1e-12)
    third = swing(Killing(deadly=0.3))
    assert third.message.startswith("in process") and third.message != first.message
    np.testing.assert_array_equal(third.energy, first.energy)
    trial = replace(joints.spring(1e2, 1e-2), duration=0.3)
    monkeypatch.setattr(stability.stability_study, "installed", lambda: [Ours(), Killing(deadly=0.3)])
    monkeypatch.setattr(StabilityStudy, "trials", lambda _: [trial, replace(trial, name="after it", duration=0.5)])
    report = StabilityStudy(quick=True).run(Progress())
    assert [row[3][:9] for row in report.tables[0].rows] == ["ended by ", "failed at"]
    assert report.tables[0].rows[0][3] == "ended by signal 11 (Segmentation fault)"


def test_nothing_is_written_where_the_user_stands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    test_a_lost_run_says_so_and_keeps_its_good_samples()
    assert list(tmp_path.iterdir()) == []


def test_durations_samples_and_inputs_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match="whole steps of 0.03 s, got 1 s"):
        nodes(0.03, 1.0, 1)
    with pytest.raises(ValueError, match="expected 1 to 10 samples"):
        nodes(0.1, 1.0, 11)
    with pytest.raises(ValueError, match=r"inputs \(2,\) or \(500, 2\), got \(1, 3\)"):
        swing(ENGINES[0], inputs=[1.0, 2.0, 3.0])


def test_peers_have_names_of_their_own() -> None:
    names = [engine.name for engine in ENGINES]
    assert len(set(names)) == len(names)
