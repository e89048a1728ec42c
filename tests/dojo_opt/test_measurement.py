"""Measurement: the state of the model that measured states amount to, and its prediction over a delay."""

import numpy as np
import pytest

from dojo_opt.mpc.delay import Delay, Prediction
from dojo_opt.mpc.measurement import Measurement
from sim.simulator.adjustable_simulator import AdjustableSimulator
from support.standing_hopper import HOPPER, standing_problem


def test_measured_velocity_becomes_the_mean_one_of_a_model_step():
    """In free fall the mean velocity of the last 50 ms is g/2 (50 ms) above the present one."""
    plant = HOPPER.replace(time_step=1e-3, kappa=1e-8)
    x = HOPPER.neutral()
    x[2] += 2.0
    fall = plant.rollout(plant.state_from_velocity(x[:8], np.zeros(7)), np.zeros((100, 3)), throw=True)
    measured = Measurement(HOPPER)
    for t, state in zip(fall.time, fall.x, strict=True):
        measured.add(float(t), state)
    now = measured.state()
    assert now[10] == pytest.approx(-9.81 * 0.075, abs=1e-6)
    assert fall.x[-1, 10] == pytest.approx(-9.81 * 0.0995, abs=1e-6)
    np.testing.assert_array_equal(now[:8], fall.x[-1, :8])
    assert Measurement(HOPPER, mean=False)._mean is False
    for settings in ({"order": 4}, {"accuracy": 1e-3}):  # velocities at nodes, as they are measured
        measured = Measurement(HOPPER.replace(**settings))
        for t, state in zip(fall.time, fall.x, strict=True):
            measured.add(float(t), state)
        np.testing.assert_array_equal(measured.state(), fall.x[-1])
        np.testing.assert_allclose(measured.of(HOPPER), now, atol=1e-12)


def test_measured_velocity_is_left_alone_when_no_sample_is_a_model_step_old():
    measured = Measurement(HOPPER)
    x = HOPPER.neutral()
    x[8] = 0.7
    measured.add(0.0, x)
    assert measured.state()[8] == 0.7
    measured.add(0.2, x)
    assert measured.state()[8] == 0.7


def test_predictions_have_the_parameters_of_a_model_that_has_changed():
    sim = AdjustableSimulator.like(HOPPER)
    measured, predict = Measurement(sim), Prediction(sim, 0.02)
    measured.add(0.0, HOPPER.neutral())
    before = predict(0.0, measured, lambda time, x: np.zeros(3))
    heavy = 2.0 * float(HOPPER.parameters(("mass",)).values[0])
    sim.set_parameters({f"mass:{HOPPER.mechanism.body_names[0]}": heavy})
    sim.model.contact_height[:] = 0.01
    changed = AdjustableSimulator.like(HOPPER.with_parameters({f"mass:{HOPPER.mechanism.body_names[0]}": heavy}))
    changed.model.contact_height[:] = 0.01
    expected = Prediction(changed, 0.02)(0.0, measured, lambda time, x: np.zeros(3))
    after = predict(0.0, measured, lambda time, x: np.zeros(3))
    assert np.abs(after - before).max() > 1e-3
    np.testing.assert_array_equal(after, expected)


def test_predictions_copy_a_model_only_after_changes():
    sim, mark = AdjustableSimulator.like(HOPPER), 0.02
    fine = AdjustableSimulator.like(HOPPER)
    fine.follow(sim)
    fine.model.contact_height[:] = mark
    fine.follow(sim)
    assert fine.model.contact_height[0] == mark
    for change in (lambda: sim.set_parameters({}), lambda: sim.follow(HOPPER)):
        change()
        fine.model.contact_height[:] = mark
        fine.follow(sim)
        assert fine.model.contact_height[0] == sim.model.contact_height[0] != mark


def test_prediction_over_the_delay_ends_a_free_fall_where_it_ends():
    sim = standing_problem().sim
    measured, delay = Measurement(sim), Delay(sim, 0.02)
    plant = HOPPER.replace(time_step=1e-3, kappa=1e-8)
    x = HOPPER.neutral()
    x[2] += 2.0
    fall = plant.rollout(plant.state_from_velocity(x[:8], np.zeros(7)), np.zeros((100, 3)), throw=True)
    for t, state in zip(fall.time[:81], fall.x[:81], strict=True):
        measured.add(float(t), state)
    delay.forget(np.zeros(3))
    ahead = delay.ahead(0.08, measured)
    assert ahead[2] == pytest.approx(fall.x[-1, 2], abs=1e-6)
    assert ahead[10] == pytest.approx(-9.81 * 0.075, abs=1e-4)
