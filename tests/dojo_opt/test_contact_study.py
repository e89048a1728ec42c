"""The contact study: its values have the right size, and its bars can be missed."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.engines import Ours
from benchmarks.studies.contact import contact_measures as measure
from benchmarks.studies.contact import contact_scenes as scenes
from benchmarks.studies.contact import simbenchmark

HARD = Ours(kappa=1e-10, rounds=1)


def test_sliding_has_the_distance_of_the_formula_in_every_direction() -> None:
    found = measure.sliding(HARD, 1e-2, measure.DIRECTIONS[[0, 1, 3]])
    assert abs(found["stop"]) < 1e-5 and found["spread"] < 1e-8 and found["lateral"] < 1e-8
    assert found["lift"] < 1e-7
    soft = measure.sliding(Ours(kappa=1e-4, rounds=1), 1e-2, measure.DIRECTIONS[:1])
    assert soft["lift"] > 1e-4 and abs(soft["stop"]) > 1e-4


def test_creep_is_proportional_to_kappa() -> None:
    drifts = [measure.creep(Ours(kappa=kappa, rounds=1), 1e-2, 2.0)["drift"] for kappa in (1e-6, 1e-8, 1e-10)]
    np.testing.assert_allclose(np.divide(drifts[:-1], drifts[1:]), 100.0, rtol=0.05)


def test_a_push_moves_the_cube_as_the_integral_says() -> None:
    """Second order in the time step, where the push is sampled at its start."""
    errors = [abs(measure.pushed(HARD, h)) for h in (1e-2, 5e-3, 2.5e-3)]
    assert errors[-1] < 1e-4 < 0.1 < scenes.ramp_displacement()
    assert errors[0] > 8.0 * errors[2]


@pytest.mark.parametrize("time_step", [1e-3, 1e-2])
@pytest.mark.parametrize("kappa", [1e-8, 1e-10, 1e-11])
def test_hard_contact_at_100_meters_per_second(time_step: float, kappa: float) -> None:
    """Friction laws of 100 N s at 100 m/s are rounded by more than 1e-3 kappa: solved all the same."""
    engine = Ours(kappa=kappa, rounds=1)
    for found in (measure.ball_impact(engine, time_step), measure.box_impact(engine, time_step)):
        assert found["depth"] < 1e-9, found


def test_an_engine_that_stops_is_not_a_number() -> None:
    assert np.isnan(measure.creep(Ours(kappa=1e-10, tolerance=1e-30, rounds=1), 1e-2, 0.1)["drift"])


def test_elastic_balls_keep_their_energy() -> None:
    assert simbenchmark.bouncing(1e-2, 2, 3.0) < 1e-8


def test_a_ball_that_hits_a_robot_transfers_its_momentum() -> None:
    assert simbenchmark.momentum(1e-2, 0.5) < 1e-11


@pytest.mark.slow
def test_balls_roll_on_a_pulled_box() -> None:
    """The error is of first order in the time step, the same in all directions."""
    pulled, balls = simbenchmark.accelerations()
    assert 10.0 * pulled + 25.0 * balls == pytest.approx(150.0 - 0.4 * 35.0 * 9.81)
    found = [simbenchmark.rolling(h, simbenchmark.DIRECTIONS["askew"], 1.0) for h in (1e-2, 5e-3)]
    assert found[1]["box"] < 0.6 * found[0]["box"] and found[1]["balls"] < 0.6 * found[0]["balls"]
    assert found[1]["askew"] < 1e-6 < found[1]["box"]
