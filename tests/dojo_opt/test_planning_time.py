"""Rows of the timing report about planning, and the peers they are compared with."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest

import dojo_opt as dojo
from benchmarks.studies.timing import planning_time
from dojo_opt.gaits.feet import Feet
from dojo_opt.report.result import Report

CROCODDYL = find_spec("crocoddyl") is not None and not planning_time._missing("crocoddyl")
OURS = {
    "hopper: iLQR iteration": 0.8,
    "quadruped trot: iLQR iteration": 5.0,
    "quadruped MPC: tick, median": 3.0,
    "quadruped MPC: tick, 99 %": None,
}


@pytest.fixture(scope="module")
def trot():
    return dojo.problems.trot()


@pytest.mark.slow
def test_rows_exist_without_the_peers_and_a_note_names_the_missing_ones(monkeypatch):
    monkeypatch.setattr(planning_time, "find_spec", lambda name: None)
    report = Report("title", "command")
    planning_time.add_planning(report, quick=True)
    assert {row.name: row.bar for row in report.rows} == OURS
    ours = report.details["trot"]["ours"]
    iteration, ticks = 1e3 * np.median(ours["seconds"]) / ours["iterations"], report.details["ticks"]
    values = {row.name: row.value for row in report.rows if row.unit == "ms"}
    assert values["quadruped trot: iLQR iteration"] == pytest.approx(iteration)
    assert values["quadruped MPC: tick, 99 %"] == pytest.approx(np.percentile(ticks, 99))
    median, worst = report.rows[-2:]
    assert median.value <= worst.value
    assert [note for note in report.notes if "MuJoCo" in note]
    assert [note for note in report.notes if "crocoddyl" in note]
    assert ours["iterations"] > 1
    assert set(report.details["trot"]) == {"ours"}


def test_crocoddyl_with_another_pin_is_left_out(monkeypatch):
    """Its wheels end the process when they do not fit."""
    monkeypatch.setattr(planning_time, "find_spec", lambda name: name)
    monkeypatch.setattr(planning_time, "version", {"crocoddyl": "3.2.1", "pin": "4.1.0"}.__getitem__)
    assert "4.1.0" in planning_time._missing("crocoddyl")
    monkeypatch.setattr(planning_time, "version", {"crocoddyl": "3.2.1", "pin": "4.0.0"}.__getitem__)
    assert planning_time._missing("crocoddyl") == ""


@pytest.mark.slow
@pytest.mark.skipif(find_spec("mujoco") is None, reason="needs MuJoCo")
def test_mujoco_and_numpy_plan_the_same_trot(trot):
    """The yardstick meets our requirements: it reaches the goal, upright, without gaps, at a cost of the same size."""
    solver = planning_time.MujocoIlqr(trot)
    solution = solver.solve(max_iterations=60)
    assert solution.iterations < 60
    assert solution.violation < 1e-3
    assert solution.gap < 1e-8
    assert solution.x[-1, 3] > 0.99
    assert np.abs(solution.u).max() <= 33.5
    assert solution.cost == pytest.approx(trot.cost(solution.x, solution.u))
    assert solution.cost < 2.0 * dojo.ilqr(trot).fun
    assert len(solution.seconds) == solution.iterations


@pytest.mark.skipif(find_spec("mujoco") is None, reason="needs MuJoCo")
def test_derivatives_of_a_knot_are_chained_over_its_steps():
    """The hopper tumbles in the air: four steps against central differences over all four."""
    hop = dojo.problems.hop()
    start = hop.sim.integrate(hop.start, np.random.default_rng(1).normal(size=hop.sim.ndx))
    start[2] += 5.0
    solver = planning_time.MujocoIlqr(dojo.Problem(hop.sim, start, 2, cost=hop.specs[0][1:], controls0=[0.5, 0.3, 4.0]))
    assert solver.substeps == 4
    xs, us = solver._guess()
    A, B, gaps = solver._linearize(xs, us)
    np.testing.assert_allclose(gaps, 0.0, atol=1e-12)

    def end(dx, du):
        moved, pushed = xs.copy(), us.copy()
        moved[0], pushed[0] = hop.sim.integrate(xs[0], dx), us[0] + du
        return hop.sim.difference(solver.rollout(moved, pushed, None, None, None, 1.0)[0][1], xs[1])

    eps, still, idle = 1e-5, np.zeros(hop.sim.ndx), np.zeros(hop.sim.nu)
    for i, dx in enumerate(eps * np.eye(hop.sim.ndx)):
        np.testing.assert_allclose(A[0][:, i], (end(dx, idle) - end(-dx, idle)) / (2.0 * eps), atol=1e-4)
    for i, du in enumerate(eps * np.eye(hop.sim.nu)):
        np.testing.assert_allclose(B[0][:, i], (end(still, du) - end(still, -du)) / (2.0 * eps), atol=1e-4)


@pytest.mark.skipif(not CROCODDYL, reason="needs crocoddyl and the pin that fits it")
@pytest.mark.filterwarnings("ignore:zmq.eventloop.ioloop:DeprecationWarning")
def test_crocoddyl_gets_the_same_robot_and_arrives(trot):
    import pinocchio

    from benchmarks.engines.crocoddyl_trot import CrocoddylTrot, pinocchio_model, pinocchio_state

    model, frames = pinocchio_model(trot.sim.model)
    data = model.createData()
    x = np.array(trot.states0[7])
    x[3:7] = 0.5
    x[trot.sim.nq :] = np.random.default_rng(0).normal(size=trot.sim.nv)
    state = pinocchio_state(x)
    q, v = state[: model.nq], state[model.nq :]
    pinocchio.framesForwardKinematics(model, data, q)
    feet = [data.oMf[f].translation for f in frames]
    np.testing.assert_allclose(feet, Feet(trot.sim).positions(x), atol=1e-12)
    weightless = trot.sim.replace(mechanism=dojo.models.quadruped(damper=0.0, gravity=(0, 0, 0)), time_step=1e-6)
    x[2] += 1.0
    pinocchio.computeCentroidalMomentum(model, data, q, v)
    np.testing.assert_allclose(data.hg.linear, weightless.momentum(x)[0], atol=1e-4)
    peer = CrocoddylTrot(trot)
    assert peer.solve() < 20
    assert peer.solver.isFeasible
    np.testing.assert_allclose(peer.solver.xs[-1][:3], trot.states0[-1][:3], atol=5e-3)
    assert peer.solver.problem.nthreads == 1
