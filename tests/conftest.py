"""Fixtures for all tests."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).parent.parent))  # benchmarks; at the end, so that an installed dojo_opt is tested


@pytest.fixture
def rng() -> np.random.Generator:
    """One seed for all random tests."""
    return np.random.default_rng(20240501)
