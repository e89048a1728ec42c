"""The timing report measures the quantities in the names of its rows."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.studies.timing import timing_study as timing
from dojo_opt.report.result import Report


@pytest.mark.parametrize("time_step", [0.01, 0.05])
def test_the_standing_quadruped_is_at_rest_for_its_own_time_step(time_step):
    """Else a gradient, measured at this very state, would be charged the iterations of a step that the rollout leaves."""
    sim, x = timing._standing(time_step)
    step = sim.step(x, np.zeros(sim.nu))
    assert step.iterations == 1
    np.testing.assert_allclose(step.x, x, atol=1e-5)


def test_one_thread_leaves_the_batch_out(monkeypatch):
    monkeypatch.setenv("NUMBA_NUM_THREADS", "1")
    report = Report("title", "command")
    timing._batch(report, 1)
    assert not report.rows
    assert "batch" in report.notes[0]
