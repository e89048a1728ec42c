"""Monte Carlo studies: their disturbances, their interval, and the same outcomes wherever they run."""

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.plant.monte_carlo import wilson_interval
from dojo_opt.plant.plant import Plant

HOPPER = dojo.Simulator(dojo.models.raiberthopper(), time_step=5e-3, kappa=1e-8)


def test_wilson_interval_inverts_the_score_test():
    """Its ends are the p at which the observed share is 1.96 standard deviations away."""
    for k, n in ((0, 10), (3, 10), (95, 100), (100, 100)):
        lo, hi = wilson_interval(k, n)
        for p in (lo, hi):
            if 1e-12 < p < 1.0 - 1e-12:
                assert abs(k / n - p) == pytest.approx(1.959964 * np.sqrt(p * (1 - p) / n), rel=1e-6)
        assert lo <= k / n <= hi
    with pytest.raises(ValueError, match="11 of 10"):
        wilson_interval(11, 10)


def test_disturbances_are_in_their_ranges_and_paired():
    wide = dojo.Disturbances(
        7, velocity=0.2, push=(2.0, 4.0), payload=(1.0, 2.0), friction=(0.2, 0.4), slope=(0.0, 0.1)
    )
    other = dojo.Disturbances(7, velocity=0.2, push=(4.0, 8.0))
    for i in range(50):
        a, b = (d(np.random.default_rng(i)) for d in (wide, other))
        assert 1.0 <= a.payload <= 2.0 and 0.2 <= a.friction <= 0.4 and 0.0 <= a.slope <= 0.1
        assert 2.0 <= np.linalg.norm(a.pushes[0].impulse) <= 4.0 and a.pushes[0].impulse[2] == 0.0
        assert np.abs(a.offset).max() <= 0.2 and np.count_nonzero(a.offset) <= 2
        np.testing.assert_array_equal(a.offset, b.offset)
        assert b.payload == 0.0 and b.friction is None and not b.slope


def _hold(time, x):
    """Keeps the hopper up and lets it tip over."""
    return np.array([-3.0 * x[4] - 0.4 * x[11], -3.0 * x[5] - 0.4 * x[12], 45.0])


def _study(executor=None, runs=6):
    sampler = dojo.Disturbances(7, velocity=0.4, push=(0.0, 8.0), push_time=(0.1, 0.2))
    return dojo.monte_carlo(_hold, Plant(HOPPER), sampler, 0.6, runs=runs, seed=11, executor=executor)


def _same(a, b):
    assert [o.survived for o in a.outcomes] == [o.survived for o in b.outcomes]
    for one, two in zip(a.outcomes, b.outcomes, strict=True):
        np.testing.assert_array_equal(one.x, two.x)


def test_monte_carlo_is_the_same_with_threads_and_again():
    study = _study()
    assert 0 < study.survived < 6, "the runs should not all end alike"
    assert f"{study.survived} of 6 survive" in study.summary()
    _same(study, _study())
    with ThreadPoolExecutor(2) as pool:
        _same(study, _study(pool))
    for one, two in zip(_study(runs=3).outcomes, study.outcomes, strict=False):
        np.testing.assert_array_equal(one.x, two.x)


def test_runs_perturb_a_plant_that_is_perturbed_already():
    """What is drawn takes the place of what the plant has, field by field."""
    plant = Plant(HOPPER, payload=1.0, payload_body="foot", delay=0.01, control_limits=(-1.0, 1.0), slope=0.1)
    sampler = dojo.Disturbances(7, velocity=0.1, push=(1.0, 1.0), delay=0.02)
    (run,) = dojo.monte_carlo(_hold, plant, sampler, 0.05, runs=1, seed=3).outcomes
    drawn = run.perturbation
    assert (drawn.payload, drawn.payload_body, drawn.delay, drawn.slope) == (1.0, "foot", 0.02, 0.1)
    assert drawn.control_limits == (-1.0, 1.0) and len(drawn.pushes) == 1 and np.any(drawn.offset)
    whole = dojo.Perturbation(payload=2.0, ground_height=0.3).over(plant.perturbation)
    assert (whole.payload, whole.payload_body, whole.slope, whole.ground_height) == (2.0, None, 0.0, 0.3)
    assert dojo.Perturbation(seed=5).over(plant.perturbation) == replace(plant.perturbation, seed=5)


@pytest.mark.slow
def test_monte_carlo_of_mpc_is_the_same_in_processes():
    mpc = dojo.tasks.hopper_mpc(substeps=2)
    plant = dojo.tasks.plant(mpc, 5e-3)
    sampler = dojo.Disturbances(7, velocity=0.15, push=(2.0, 4.0), push_time=(0.1, 0.2))
    here = mpc.monte_carlo(plant, sampler, 0.4, runs=3, seed=1)
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        there = mpc.monte_carlo(plant, sampler, 0.4, runs=3, seed=1, executor=pool)
    _same(here, there)
    assert here.milliseconds.size == 3 * 7
    assert np.isfinite(here.rms).all()
