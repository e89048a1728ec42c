"""The cube of benchmarks/cube.py in MuJoCo: a fit by its finite differences finds the cube of its own tosses."""

from __future__ import annotations

import numpy as np
import pytest

import dojo_opt as dojo

pytest.importorskip("mujoco")
from benchmarks.engines.mujoco_cube import MujocoCube, fit  # noqa: E402


@pytest.mark.slow
def test_mujoco_finds_its_own_cube():
    body, free = dojo.Body("cube", 0.37, (8.1e-4,) * 3), dojo.Joint("floating", None, "cube")
    sim = dojo.Simulator(dojo.Mechanism([body], [free]), time_step=1.0 / 148.0)
    truth = np.array([0.25, 0.05, 0.012, 0.7, 9e-4])
    cube, rng = MujocoCube(truth, sim.time_step, sim), np.random.default_rng(0)
    starts = np.tile(sim.neutral(), (4, 1))
    starts[:, 2], starts[:, 7:10] = 0.15, rng.normal(0.0, 0.7, (4, 3))
    starts[:, 10:] = rng.normal(0.0, 3.0, (4, 3))
    films = list(cube.paths(starts, 40))
    motion = cube.rollout(starts[0], np.zeros((40, 0)))
    assert motion.success
    np.testing.assert_array_equal(motion.x, films[0])
    found, rms = fit(films, sim.time_step, np.repeat((2e-3, 0.03, 0.1, 2.0), 3), 10, 4, sim)
    np.testing.assert_allclose(found.values[:2], truth[:2], rtol=0.05)
    assert rms < 0.5
