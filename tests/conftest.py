"""Fixtures for all tests."""

import numpy as np
import pytest


@pytest.fixture
def rng() -> np.random.Generator:
    """One seed for all random tests."""
    return np.random.default_rng(20240501)
