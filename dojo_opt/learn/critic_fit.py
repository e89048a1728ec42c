"""Fits of a network to numbers: steps of Adam on minibatches, spread over the threads.

A minibatch is divided into parts, whatever the number of threads (network_rows.py). Their gradients are added in their
order, by rows of packed weights, each of which then moves by itself: results are the same to the last bit on any number
of threads.
"""

from __future__ import annotations

from math import isfinite, sqrt
from typing import NamedTuple

import numpy as np

from dojo_opt.learn.network import Adam, Network
from dojo_opt.learn.network_rows import (
    FIRST,
    PART,
    SIZE,
    STRIDE,
    TURNED,
    WIDTH,
    Packed,
    backward,
    forward,
    parts,
)
from solvers.compiler import kernel, parallel_kernel, prange
from solvers.lanes import LANES, load, root, spread, store, total
from solvers.types import Floats, IntegerMatrix, Integers, Matrix, Vector

__all__ = ["fit_network"]


class Samples(NamedTuple):
    """Inputs and the outputs to learn, in minibatches."""

    inputs: Matrix  # (n, inputs)
    goals: Vector  # (n,)
    order: Integers  # samples of one minibatch after the other
    ends: Integers  # (minibatches,) where they end in there


class FitBuffers(NamedTuple):
    """Numbers on the way, and the moments of Adam."""

    moments: Matrix  # (2, packed weights) means and squares
    rows: IntegerMatrix  # of packed weights
    sums: Matrix  # (parts, packed weights); the gradient in the first one
    layers: Matrix
    slopes: Matrix  # gradients by layers, zeros
    squares: Vector  # (rows of weights,)


class Rates(NamedTuple):
    """Of Adam."""

    rate: float
    norm: float  # largest length of a gradient
    first: float  # betas
    second: float


@kernel
def _fit_part(net: Packed, samples: Samples, buffers: FitBuffers, span: tuple[int, int], p: int) -> None:
    """Gradient of the mean square error of a minibatch, samples span[0] up to span[1] of the order, by part p of it."""
    count, width = span[1] - span[0], net.shape[0, SIZE]
    first, last = p * PART, min(p * PART + PART, count)
    layers, slopes = buffers.layers, buffers.slopes
    y = layers.shape[1] - net.shape[net.shape.shape[0] - 1, WIDTH]
    for r in range(first, last):
        for k in range(width):
            layers[r, k] = samples.inputs[samples.order[span[0] + r], k]
    forward(net, layers, (first, last))
    for r in range(first, last):
        slopes[r, y] = 2.0 * (layers[r, y] - samples.goals[samples.order[span[0] + r]]) / count
    for k in range(buffers.sums.shape[1]):
        buffers.sums[p, k] = 0.0
    backward(net, layers, slopes, buffers.sums, p, (first, last), False)


@kernel
def _add_parts(buffers: FitBuffers, count: int, k: int) -> None:
    """Gradient by row k of the weights, the sum over parts, and its square."""
    sums, first, square = buffers.sums, buffers.rows[k, FIRST], spread(0.0)
    for c in range(first, first + buffers.rows[k, WIDTH], LANES):
        s = load(sums, 0, c)
        for p in range(1, count):
            s = s + load(sums, p, c)
        store(sums, 0, c, s)
        square = square + s * s
    buffers.squares[k] = total(square)


@kernel
def _move(net: Packed, buffers: FitBuffers, rates: Rates, scale: float, steps: float, k: int) -> None:
    """Adam's step of row k of the weights, along the gradient times `scale`."""
    m, first = buffers.moments, buffers.rows[k, FIRST]
    rate, grown = rates.rate / (1.0 - rates.first**steps), 1.0 / (1.0 - rates.second**steps)
    for c in range(first, first + buffers.rows[k, WIDTH], LANES):
        g = scale * load(buffers.sums, 0, c)
        mean, square = load(m, 0, c), load(m, 1, c)
        mean = mean + (1.0 - rates.first) * (g - mean)
        square = square + (1.0 - rates.second) * (g * g - square)
        store(m, 0, c, mean)
        store(m, 1, c, square)
        store(net.weights, 0, c, load(net.weights, 0, c) - rate * mean / (root(grown * square) + spread(1e-8)))
    stride = buffers.rows[k, STRIDE]
    if stride > 0:
        for j in range(buffers.rows[k, SIZE]):
            net.turned[0, buffers.rows[k, TURNED] + j * stride] = net.weights[0, first + j]


@parallel_kernel
def fit_batches(net: Packed, samples: Samples, buffers: FitBuffers, rates: Rates, steps: float) -> float:
    """A step on every minibatch; the number of steps so far, `steps` of which were before.

    Gradients that are not finite are left out, as minibatches without samples are.
    """
    first, rows = 0, buffers.rows.shape[0]
    for b in range(samples.ends.shape[0]):
        last = samples.ends[b]
        count = (last - first + PART - 1) // PART
        for p in prange(count):
            _fit_part(net, samples, buffers, (first, last), p)
        for k in prange(rows if count > 0 else 0):
            _add_parts(buffers, count, k)
        square = 0.0
        for k in range(rows):
            square += buffers.squares[k]
        length = sqrt(square)
        if count > 0 and isfinite(length):
            steps += 1.0
            scale = rates.norm / length if length > rates.norm else 1.0
            for k in prange(rows):
                _move(net, buffers, rates, scale, steps, k)
        first = last
    return steps


def fit_network(
    network: Network,
    weights: Floats,
    adam: Adam,
    samples: tuple[Floats, Floats],
    batches: list[Integers],
    rate: float,
    norm: float,
) -> None:
    """Steps of Adam on the mean square error of a network with one output, one for each minibatch.

    Args:
        network: its shape.
        weights: (count,) its weights, in and out.
        adam: its moments, in and out.
        samples: inputs (n, no) and outputs (n,).
        batches: samples of each minibatch.
        rate: learning rate.
        norm: largest length of a gradient; longer ones are shortened.
    """
    most = max(map(len, batches), default=0)
    moments = np.zeros((2, network.sums(1).shape[1]))
    moments[:, network.places] = adam.moments[:2]
    rows, sums = network.weight_rows, network.sums(max(parts(most), 1))
    buffers = FitBuffers(moments, rows, sums, network.rows(most), network.rows(most), np.zeros(len(rows)))
    order, ends = np.concatenate(batches), np.cumsum([len(batch) for batch in batches])
    net, rates = network.packed(weights), Rates(rate, norm, *adam.betas)
    steps = fit_batches(net, Samples(*samples, order, ends), buffers, rates, adam.moments[2, 0])
    weights[:] = net.weights[0, network.places]
    adam.moments[:2], adam.moments[2] = moments[:, network.places], steps
