"""Networks of many rows: against their formula in NumPy, and on one thread and two."""

import numba
import numpy as np
import pytest

from dojo_opt.learn.critic_fit import fit_network
from dojo_opt.learn.network import Adam, Network, clipped
from solvers.compiler import threads


def plain(network, weights, x):
    """Outputs, and the values of all layers, by NumPy."""
    kept, layers = [x], network.layers(weights)
    for W, b in layers[:-1]:
        y = kept[-1] @ W + b
        kept.append(np.tanh(y) if network.activation == "tanh" else np.where(y > 0.0, y, np.expm1(np.minimum(y, 0.0))))
    return kept[-1] @ layers[-1][0] + layers[-1][1], kept


def plain_gradients(network, weights, kept, g):
    """By the inputs and by the weights."""
    out = np.zeros(network.count)
    layers, slots = network.layers(weights), network.layers(out)
    for k in range(len(kept) - 1, -1, -1):
        slots[k][0][:], slots[k][1][:] = kept[k].T @ g, g.sum(axis=0)
        g = g @ layers[k][0].T
        if k:
            g = g * (1.0 - kept[k] ** 2 if network.activation == "tanh" else np.where(kept[k] > 0.0, 1.0, kept[k] + 1))
    return g, out


@pytest.mark.parametrize("activation", ["tanh", "elu"])
@pytest.mark.parametrize("sizes", [(3, 2), (3, 9, 1), (5, 8, 17, 6)])
def test_outputs_and_gradients_are_those_of_the_formula(sizes, activation, rng):
    network = Network(sizes, activation)
    weights = rng.standard_normal(network.count)
    for rows in (0, 1, 7, 16, 50):
        x, g = rng.standard_normal((rows, sizes[0])), rng.standard_normal((rows, sizes[-1]))
        expected, kept = plain(network, weights, x)
        by_x, by_weights = plain_gradients(network, weights, kept, g)
        y, layers = network.forward(weights, x)
        found = np.ones(network.count)
        np.testing.assert_allclose(y, expected, rtol=0, atol=1e-12)
        np.testing.assert_allclose(network.backward(weights, layers, g, found), by_x, rtol=0, atol=1e-11)
        np.testing.assert_allclose(found, 1.0 + by_weights, rtol=0, atol=1e-11)
        np.testing.assert_allclose(network.forward(np.tile(weights, (rows, 1)), x)[0], expected, rtol=0, atol=1e-12)


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one thread")
def test_bits_do_not_depend_on_the_number_of_threads(rng):
    network, results = Network((4, 20, 20, 2)), []
    weights, x, g = rng.standard_normal(network.count), rng.standard_normal((70, 4)), rng.standard_normal((70, 2))
    for count in (1, 2):
        with threads(count):
            y, kept = network.forward(weights, x)
            by_weights = np.zeros(network.count)
            results.append((y, network.backward(weights, kept, g, by_weights), by_weights))
    for one, two in zip(*results, strict=True):
        np.testing.assert_array_equal(one, two)


def test_a_fit_is_that_of_its_formula_and_the_same_on_any_number_of_threads(rng):
    network, results = Network((3, 9, 5, 1), "elu"), []
    start, x, goals = rng.standard_normal(network.count), rng.standard_normal((70, 3)), rng.standard_normal(70)
    batches = [rng.permutation(70)[:count] for count in (37, 33, 0, 1, 50)]
    for count in (1, 2) if numba.config.NUMBA_NUM_THREADS > 1 else (1,):
        weights, adam = start.copy(), Adam(network.count, (0.7, 0.95))
        with threads(count):
            fit_network(network, weights, adam, (x, goals), batches, 1e-2, 0.5)
        results.append((weights, adam.moments))
    for one, two in zip(results[0], results[-1], strict=True):
        np.testing.assert_array_equal(one, two)
    weights, adam = start.copy(), Adam(network.count, (0.7, 0.95))
    for rows in filter(len, batches):
        out, kept = plain(network, weights, x[rows])
        gradient = plain_gradients(network, weights, kept, 2.0 * (out - goals[rows, None]) / len(rows))[1]
        adam.step(weights, clipped(gradient, 0.5)[0], 1e-2)
    np.testing.assert_allclose(results[0][0], weights, rtol=0, atol=1e-11)
    np.testing.assert_allclose(results[0][1], adam.moments, rtol=0, atol=1e-11)
