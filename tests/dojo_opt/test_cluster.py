"""A local Dask cluster finds what one process finds, though a worker is killed while it works.

One cluster for all studies: to start a worker takes longer than a study.
"""

from __future__ import annotations

import os
import signal
from concurrent.futures import ThreadPoolExecutor
from threading import Timer

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.learn.registration import task_of

_MOMENT = 0.05  # [s] after which a worker is killed
_PATIENCE = 120.0  # [s] until all workers are there


def _plans(executor=None):
    problems = [dojo.problems.hop((distance, 0.0)) for distance in (0.2, 0.5, 0.8)]
    plans = dojo.plan_library(problems, executor=executor)
    assert all(plan.success and plan.problem is problem for plan, problem in zip(plans, problems, strict=True))
    return [plan.u for plan in plans]


def _seeds(executor=None):
    options = {"epochs": 3, "directions": 4, "evaluations": 1, "episodes": 2}
    runs = dojo.learn.seeds(dojo.learn.ars, task_of("Pendulum"), (3, 4, 5), executor=executor, **options)
    return [run.policy.weights for run in runs]


def _starts(executor=None):
    def block(friction):
        return dojo.Simulator(dojo.models.block(friction=friction), time_step=0.02, kappa=1e-5)

    truth = block(0.3)
    first = truth.neutral()
    first[truth.nq] = 2.0
    motions = [truth.rollout(first, steps=30)]
    found = dojo.identify(block(0.6), motions, ("friction:*",), noise=1e-3, fits=4, seed=1, executor=executor)
    assert abs(found.values[0] - 0.3) < 0.02
    return [found.values, found.covariance]


def _lift(executor=None):
    """A problem with a refinement, whose plan has shorter time steps."""
    problem = dojo.problems.hop()
    problem.refinement = 2
    (plan,) = dojo.plan_library([problem], executor=executor)
    assert plan.success and plan.substeps == 2 * problem.substeps == plan.problem.substeps
    assert plan.simulator.time_step == pytest.approx(0.5 * problem.sim.time_step)
    return [plan.u]


def _directions(executor=None):
    """Random search asks for the returns of its directions in every epoch."""
    models = dojo.learn.Randomization(values={"mass:*": (0.9, 1.1)}, substeps=(1, 2), noise=0.02, models=3)
    options = {"epochs": 4, "directions": 20, "randomization": models, "evaluations": 1, "episodes": 2}
    return [dojo.learn.ars(task_of("Pendulum"), seed=3, executor=executor, **options).policy.weights]


def _closed_loops(executor=None):
    mpc = dojo.tasks.hopper_mpc(substeps=2)
    sampler = dojo.Disturbances(7, velocity=0.15, push=(2.0, 4.0), push_time=(0.1, 0.2))
    study = mpc.monte_carlo(dojo.tasks.plant(mpc, 5e-3), sampler, 0.2, runs=2, seed=2, executor=executor)
    return [outcome.x for outcome in study.outcomes]


class KillingPool:
    """An executor that kills a worker soon after the first call, which takes longer, as workers import their modules."""

    def __init__(self, executor, pid):
        self.executor, self.pid = executor, pid

    def submit(self, function, *args):
        future = self.executor.submit(function, *args)
        if self.pid is not None:
            Timer(_MOMENT, os.kill, (self.pid, signal.SIGKILL)).start()
            self.pid = None
        return future


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning", "ignore::UserWarning")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_cluster_finds_the_same_though_a_worker_is_killed():
    """A worker is lost while directions are tried; Dask puts a new one in its place."""
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        client.wait_for_workers(2, timeout=_PATIENCE)
        lost = next(iter(client.run(os.getpid).values()))
        pool = client.get_executor()
        found = {_directions: _directions(KillingPool(pool, lost))}
        assert lost not in client.run(os.getpid).values()
        for study in (_plans, _seeds, _starts, _closed_loops):
            found[study] = study(pool)
    for study, there in found.items():
        for a, b in zip(study(), there, strict=True):
            np.testing.assert_array_equal(a, b, err_msg=study.__name__)


@pytest.mark.slow
def test_threads_plan_a_library():
    with ThreadPoolExecutor(2) as pool:
        for study in (_plans, _lift):
            for a, b in zip(study(), study(pool), strict=True):
                np.testing.assert_array_equal(a, b)


def test_a_library_is_of_problems():
    for wrong in (3, "hop", [dojo.problems.hop(), 3]):
        with pytest.raises(TypeError, match=r"plan_library\(problems\)"):
            dojo.plan_library(wrong)
    with pytest.raises(TypeError, match=r"plan_library\(executor=\.\.\.\)"):
        dojo.plan_library([], executor=3)
    assert dojo.plan_library([]) == []
