"""The study `gradients`: its references are right, and its numbers match their names."""

from __future__ import annotations

import json

import numpy as np
import pytest

import dojo_opt as dojo
from benchmarks.engines import Ours
from benchmarks.studies.gradients import GradientsStudy, peer_steps, sliding, smoothing, touchdown
from benchmarks.studies.gradients import gradients_study as study
from dojo_opt.report import Progress, Report
from dojo_opt.report.gradients import one_step, resting
from dojo_opt.report.gradients.differences import Stepper, extrapolated, relative_error


def test_extrapolation_is_far_better_than_differences_and_knows_how_good_it_is():
    """sin at 0.3, with the round-off of a step in every value."""
    rng = np.random.default_rng(0)

    def central(eps: float):
        noise = 1e-16 * rng.normal(size=2)
        return np.array([[(np.sin(0.3 + eps) - np.sin(0.3 - eps) + noise[0] - noise[1]) / (2.0 * eps)]])

    reference = extrapolated(central)
    error = abs(reference.value[0, 0] - np.cos(0.3))
    assert error < 1e-11
    assert error < 10.0 * reference.doubt < 1e-9


def test_extrapolation_passes_over_differences_that_fail():
    reference = extrapolated(lambda eps: np.array([[np.nan if eps > 1e-4 else 2.0]]))
    assert reference.value[0, 0] == 2.0
    with pytest.raises(RuntimeError, match="no step near the state can be solved"):
        extrapolated(lambda eps: np.array([[np.nan]]))


def test_differences_of_a_linear_step_are_its_matrices():
    """A slider without gravity: v+ = v + h u / m, q+ = q + h v+."""
    body = dojo.Body("body", 2.0, inertia=np.ones(3))
    joint = dojo.Joint("prismatic", None, "body", name="rail")
    mech = dojo.Mechanism([body], [joint], inputs=[dojo.Input("rail")], gravity=(0, 0, 0))
    sim = dojo.Simulator(mech, time_step=0.1)
    expected = [[1.0, 0.1, 0.005], [0.0, 1.0, 0.05]]
    for centered in (True, False):
        stepper = Stepper(sim, [0.3, -0.2], [0.5])
        np.testing.assert_allclose(stepper.jacobian(1e-4, centered=centered), expected, atol=1e-10)


def test_ways_to_a_jacobian_agree():
    """A sliding block without MuJoCo: exact Jacobians are exact, and differences have the errors of their order."""
    scene = peer_steps.scenes()[0]
    points, notes = one_step.measure(scene, 1)
    assert notes == []
    assert all(p.microseconds > 1.0 and p.doubt < 1e-8 for p in points)
    assert {p.kappa for p in points if p.method == one_step.TIGHTLY} == set(one_step.KAPPAS)
    assert max(p.error for p in points if p.method == one_step.TIGHTLY) < 1e-8
    error = {(p.method, p.eps): p.error for p in points if p.eps}
    assert error[one_step.FORWARD, 1e-6] / error[one_step.FORWARD, 1e-7] == pytest.approx(10.0, rel=0.1)
    assert error[one_step.CENTERED, 1e-6] < 0.01 * error[one_step.FORWARD, 1e-6]
    bias = one_step.smoothed(scene)
    assert np.all(np.diff(bias) < 0.0) and bias[-1] < 1e-3 < 0.1 < bias[0]


@pytest.mark.parametrize("motion", sliding.motions(), ids=lambda motion: motion.name)
def test_chained_jacobians_are_the_derivative_of_the_motion_and_coulombs(motion):
    h = 0.02
    chained = sliding.chained(motion, h, 1e-8)
    assert chained.value == pytest.approx(sliding.ours_differenced(motion, h, 1e-6, 1e-8).value, abs=1e-4)
    assert chained.error < 2.0 * h
    assert chained.exact == motion.exact


def test_engines_are_differenced_from_their_own_rest():
    """Our own engine: it rests 25 cm up, and the derivative equals the chained one."""
    motion = sliding.motions()[-1]
    found = sliding.differenced(Ours(kappa=1e-8), motion, 0.02, 1e-5)
    assert found.value == pytest.approx(sliding.chained(motion, 0.02, 1e-8).value, abs=1e-3)


def test_an_engine_that_cannot_is_a_note(monkeypatch):
    class Unable(Ours):
        name = "unable"

        def simulate(self, mechanism, **settings):
            raise ValueError("no blocks")

    monkeypatch.setattr(study, "installed", lambda: [Unable(), Ours()])
    report = Report("title", "command")
    assert [engine.name for engine in study._able(report, quick=False)] == ["dojo-opt"]
    assert report.notes == ["motions: without unable: no blocks"]


def test_mujoco_jacobians_are_chained_as_its_motion_is_differenced():
    pytest.importorskip("mujoco")
    from benchmarks.engines.mujoco import MuJoCo

    motion = sliding.motions()[0]  # sticking: the one that it gets right both ways
    chained = sliding.mujoco_chained(motion, 0.01, "implicitfast")
    assert chained.value == pytest.approx(
        sliding.differenced(MuJoCo("implicitfast"), motion, 0.01, 1e-5).value, rel=1e-4
    )


def test_drake_gets_the_same_robot():
    """A tumbling hopper in the air: one step of Drake, to first order ours; and its Jacobian against its differences."""
    pytest.importorskip("pydrake")
    from benchmarks.studies.gradients.drake_step import DrakeStep

    h = 1e-4
    sim = dojo.Simulator(dojo.models.raiberthopper(spring=50.0), time_step=h)
    x = sim.integrate(sim.neutral(), np.random.default_rng(1).normal(size=sim.ndx))
    x[2] += 5.0
    u = np.array([0.0, 0.0, 20.0])
    step = DrakeStep(sim.model, h, "Lagged")
    step.settle(x, u, 20)
    ours = sim.rollout(x, np.tile(u, (20, 1))).x[-1]
    np.testing.assert_allclose(step.x, step.state(ours), atol=2e-2 * 20 * h)
    assert relative_error(step.autodiff()(), step.reference().value) < 1e-8


@pytest.mark.parametrize("which", [1, 4])  # pulled off, sliding at an angle
def test_drake_carries_the_derivative_that_its_motion_has(which):
    pytest.importorskip("pydrake")
    from benchmarks.engines.drake import Drake
    from benchmarks.studies.gradients.drake_motion import carried

    motion = sliding.motions()[which]
    found, expected = carried(motion, 0.01, "Tamsi"), sliding.differenced(Drake("Tamsi"), motion, 0.01, 1e-5)
    assert found.way == pytest.approx(expected.way, rel=1e-6)
    assert found.value == pytest.approx(expected.value, rel=1e-4)


def test_drake_touches_down_with_the_slope_of_its_own_curve():
    pytest.importorskip("pydrake")
    from benchmarks.studies.gradients.drake_motion import touchdown as drake

    heights = np.array([-2e-3, -2e-3 + 1e-7, touchdown.TOUCH + 0.05])
    curve = drake(heights, "Lagged")
    assert curve.gradient[0] == pytest.approx(np.diff(curve.velocity[:2])[0] / 1e-7, rel=1e-3)
    assert curve.gradient[2] == 0.0 and curve.velocity[2] == pytest.approx(-1.0 - 9.81 * touchdown.H)


def test_scenes_that_drake_cannot_represent_are_refused():
    pytest.importorskip("pydrake")
    from benchmarks.studies.gradients.drake_step import DrakeStep

    step = DrakeStep(dojo.Simulator(dojo.models.block()).model, 0.01, "Sap")
    with pytest.raises(ValueError, match="no input that does not act on a joint"):
        step.settle(np.zeros(13), np.ones(3), 1)
    ball = dojo.Mechanism([dojo.Body("b", 1.0, inertia=np.ones(3))], [dojo.Joint("spherical", None, "b", spring=1.0)])
    with pytest.raises(ValueError, match="a ball joint has no spring"):
        DrakeStep(dojo.Simulator(ball).model, 0.01, "Sap")


def test_touch_down_is_half_way_at_the_touch_and_bounded_by_hard_contact():
    heights = np.array([-0.01, touchdown.TOUCH, 0.1])
    for kappa in touchdown.KAPPAS:
        gradient = touchdown.H * touchdown.ours(heights, kappa).gradient
        assert gradient[1] == pytest.approx(-0.5, abs=1e-9)
        assert -1.0 < gradient[0] < -0.5 < gradient[2] < 0.0


def test_bias_agrees_with_the_central_path():
    """First order in kappa; a resting contact has b / (1 + b), b = kappa / (m g^2 h^3)."""
    for regime in smoothing.regimes():
        small, large = smoothing.bias(regime, (1e-8, 1e-7))
        if regime.name == "touching":
            assert max(small, large) < 1e-12
        else:
            assert large / small == pytest.approx(10.0, rel=0.02)
            assert large < 1e-3
    for h in (1e-3, 2e-2):
        b = 0.3
        kappa = b * smoothing.MASS * smoothing.GRAVITY**2 * h**3
        assert smoothing.resting_bias(kappa, h) == pytest.approx(b / (1.0 + b), rel=1e-6)
        assert resting.resting_kappa(2.0, h) == pytest.approx(2.0 * resting.ALLOWED / b * kappa)


def test_a_contact_is_felt_from_where_the_formula_says():
    for kappa in (1e-6, 1e-3):
        assert smoothing.gradient_at(kappa, smoothing.reach(kappa)) == pytest.approx(smoothing.FELT, rel=1e-6)


def test_relative_error_refers_to_the_whole_matrix():
    assert relative_error(np.diag([3.0, 1.0]), np.diag([3.0, 0.0])) == pytest.approx(1.0 / 3.0)


def test_a_users_mechanism_is_measured_in_one_step_and_told_its_kappa():
    report = GradientsStudy(quick=True, mechanism=dojo.models.sphere()).run(Progress())
    assert report.met() and len(report.rows) == 2 and report.figure is not None
    assert any("are within 1 % of hard contact" in note for note in report.notes)
    json.loads(report.as_json())
