"""The return to the central path."""

import numpy as np
import pytest

from solvers.cones import onto_path, return_pair

pytestmark = pytest.mark.kernel


@pytest.mark.parametrize("kappa", [1e-12, 1e-4, 1.0])
@pytest.mark.parametrize("weight", [1e-3, 1.0, 50.0])
@pytest.mark.parametrize("pair", [(-1.0, 2.0), (3.0, -0.5), (-1e-9, -1e-9), (0.0, 0.0), (-1e6, 1e3)])
def test_product_and_difference(pair, weight, kappa):
    x, y = onto_path(*pair, weight, kappa)
    assert x > 0.0 and y > 0.0
    assert x * y == pytest.approx(kappa, rel=1e-12)
    difference = pair[0] - weight * pair[1]
    assert x - weight * y == pytest.approx(difference, rel=1e-9, abs=1e-9 * np.sqrt(weight * kappa))


def test_towards_zero_it_is_the_projection():
    assert onto_path(2.0, -1.0, 1.0, 1e-16)[0] == pytest.approx(3.0)
    assert onto_path(-2.0, 1.0, 1.0, 1e-16)[1] == pytest.approx(3.0)


def test_only_pairs_that_left_are_moved():
    before = np.array([1.0, 1.0, 1.0, 1.0])
    now = np.array([0.1, 5.0, -0.2, 3.0])
    return_pair(now, before, 0, 1, 1.0, 0.01)
    assert now[:2].tolist() == [0.1, 5.0]
    return_pair(now, before, 2, 3, 1.0, 0.01)
    assert now[2] * now[3] == pytest.approx(0.01)
    assert now[2] - now[3] == pytest.approx(-3.2)
