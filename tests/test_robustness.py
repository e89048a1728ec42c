"""A small version of benchmarks/robustness.py: random extreme states, no miss unreported, and few of them."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

PATH = Path(__file__).parent.parent / "benchmarks" / "robustness.py"


@pytest.fixture(scope="module")
def robustness():
    spec = importlib.util.spec_from_file_location("robustness", PATH)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules[spec.name]


@pytest.mark.parametrize("name", ["block", "hopper", "quadruped", "quadruped12"])
def test_no_extreme_state_is_missed(robustness, name):
    whole = robustness.total(robustness.study(160, [name], seed=7), name)
    assert whole.unreported == 0
    assert not whole.misses, robustness.line(whole)
    assert np.median(whole.iterations) <= 6, robustness.line(whole)
