"""A small version of benchmarks/robustness.py: random extreme states, no miss unreported and none at all."""

import numpy as np
import pytest
from benchmark import loaded


@pytest.fixture(scope="module")
def robustness():
    yield from loaded("robustness")


@pytest.mark.parametrize("name", ["block", "hopper", "quadruped", "quadruped12"])
def test_no_extreme_state_is_missed(robustness, name):
    whole = robustness.total(robustness.study(160, [name], seed=7), name)
    assert whole.unreported == 0
    assert not whole.misses, robustness.line(whole)
    assert np.median(whole.iterations) <= 6, robustness.line(whole)
