"""A perceptron and its derivatives for many rows, spread over the threads.

Rows are divided into parts of PART, whatever the number of threads. A part adds up its own gradient, and those of the
parts are added in their order, so that results are the same to the last bit on any number of threads.

Rows of matrices are filled up with zeros to a multiple of LANES. Observations have rows for whole blocks of BLOCK:
those beyond the last observation are scratch. `layers` (in_blocks(n), sum of whole(size)) has the inputs, then the
outputs of each layer, side by side. Packed weights (1, count) are those of a layer after the other: the rows of W
(inputs, outputs), then b. `shape` has a row for the inputs and for each layer: its size, and its width, which is
whole(size).
"""

from __future__ import annotations

from itertools import pairwise
from math import exp
from typing import NamedTuple

import numpy as np

from solvers.compiler import kernel, parallel_kernel, prange
from solvers.lanes import LANES, load, store, whole
from solvers.types import IntegerMatrix, Integers, Matrix

__all__ = [
    "BLOCK", "FIRST", "PART", "SIZE", "STRIDE", "TURNED", "WIDTH", "Packed", "backward", "backward_rows", "blocks",
    "forward", "forward_rows", "in_blocks", "parts", "places", "shape_of", "turned_places", "weight_rows",
]  # fmt: skip

Span = tuple[int, int]

PART = 16
BLOCK = 4  # rows at a time: while one product is under way, others begin
SIZE, WIDTH = 0, 1  # columns of `shape`, and of `weight_rows`
FIRST, TURNED, STRIDE = 2, 3, 4  # further columns of `weight_rows`
_TANH = 0


class Packed(NamedTuple):
    """A network with its weights, as kernels take it."""

    shape: IntegerMatrix  # (1 + layers, 2)
    weights: Matrix  # (1, packed weights)
    turned: Matrix  # (1, ...) those of layers (W^T, 0)
    activation: int


def shape_of(sizes: tuple[int, ...]) -> IntegerMatrix:
    """The shape of a network of these sizes."""
    return np.array([(size, whole(size)) for size in sizes], dtype=np.int64)


def parts(rows: int) -> int:
    """Number of parts of so many rows."""
    return -(-rows // PART)


def blocks(rows: int) -> int:
    """Number of blocks of so many rows."""
    return -(-rows // BLOCK)


def in_blocks(rows: int) -> int:
    """Number of rows, filled up to whole blocks."""
    return blocks(rows) * BLOCK


def weight_rows(sizes: tuple[int, ...]) -> IntegerMatrix:
    """(rows of all W and b, 5) of packed weights: numbers, width, first place, that in `turned` of the first one and
    steps between them there, 0 for b.
    """
    found, first, turned = [], 0, 0
    for n, m in pairwise(sizes):
        for i in range(n + 1):
            there = (turned + i, whole(n)) if i < n else (0, 0)
            found.append((m, whole(m), first + i * whole(m), *there))
        first, turned = first + (n + 1) * whole(m), turned + (m + 1) * whole(n)
    return np.array(found, dtype=np.int64)


def places(sizes: tuple[int, ...]) -> Integers:
    """(count,) places of weights among packed ones."""
    return np.concatenate([first + np.arange(m) for m, _, first, *_ in weight_rows(sizes)])


def turned_places(sizes: tuple[int, ...]) -> tuple[Integers, Integers]:
    """Which weights are those of matrices, and their places in `turned`."""
    rows = weight_rows(sizes)
    inside = np.repeat(rows[:, STRIDE] > 0, rows[:, SIZE])
    there = np.concatenate([at + step * np.arange(m) for m, _, _, at, step in rows if step > 0])
    return np.flatnonzero(inside), there


@kernel
def _affine(w: Matrix, first: int, n: int, layers: Matrix, places: tuple[int, int, int], rows: Span) -> None:
    """y = x W + b of rows, and of the rest of their last block; W begins at `first`.

    places: in `layers`, of x (n), of y, and its end.
    """
    x, y, width = places[0], places[1], places[2] - places[1]
    for c in range(0, width, LANES):
        b = load(w, 0, first + n * width + c)
        for r in range(rows[0], rows[1], BLOCK):
            p, q, s, t = b, b, b, b
            for i in range(n):
                v = load(w, 0, first + i * width + c)
                p = p + layers[r, x + i] * v
                q = q + layers[r + 1, x + i] * v
                s = s + layers[r + 2, x + i] * v
                t = t + layers[r + 3, x + i] * v
            store(layers, r, y + c, p)
            store(layers, r + 1, y + c, q)
            store(layers, r + 2, y + c, s)
            store(layers, r + 3, y + c, t)


@kernel
def _activate(activation: int, layers: Matrix, columns: Span, rows: Span) -> None:
    """f of columns of rows, in place."""
    for r in range(rows[0], rows[1]):
        for k in range(columns[0], columns[1]):
            if activation == _TANH:
                layers[r, k] = 1.0 - 2.0 / (exp(2.0 * layers[r, k]) + 1.0)
            elif layers[r, k] < 0.0:
                layers[r, k] = exp(layers[r, k]) - 1.0


@kernel
def forward(net: Packed, layers: Matrix, rows: Span) -> None:
    """The outputs of all layers, of rows, from the inputs in `layers`."""
    shape, first, x = net.shape, 0, 0
    for k in range(shape.shape[0] - 1):
        n, width = shape[k, SIZE], shape[k + 1, WIDTH]
        y = x + shape[k, WIDTH]
        _affine(net.weights, first, n, layers, (x, y, y + width), rows)
        if k < shape.shape[0] - 2:
            _activate(net.activation, layers, (y, y + shape[k + 1, SIZE]), rows)
        first += (n + 1) * width
        x = y


@kernel
def _by_weights(
    sums: Matrix, at: tuple[int, int], n: int, layers: Matrix, g: Matrix, places: tuple[int, int, int], rows: Span
) -> None:
    """sums[p, first :] += gradient by W and b of a layer, of rows; four rows of W at a time.

    at: (p, first);  g: gradient by y;  n, places: as for `_affine`.
    """
    p, first = at
    x, y, width = places[0], places[1], places[2] - places[1]
    for c in range(0, width, LANES):
        for i in range(0, n - 3, 4):
            k = first + i * width + c
            a, b = load(sums, p, k), load(sums, p, k + width)
            d, e = load(sums, p, k + 2 * width), load(sums, p, k + 3 * width)
            for r in range(rows[0], rows[1]):
                v = load(g, r, y + c)
                a = a + layers[r, x + i] * v
                b = b + layers[r, x + i + 1] * v
                d = d + layers[r, x + i + 2] * v
                e = e + layers[r, x + i + 3] * v
            store(sums, p, k, a)
            store(sums, p, k + width, b)
            store(sums, p, k + 2 * width, d)
            store(sums, p, k + 3 * width, e)
        for i in range(n - n % 4, n):
            s = load(sums, p, first + i * width + c)
            for r in range(rows[0], rows[1]):
                s = s + layers[r, x + i] * load(g, r, y + c)
            store(sums, p, first + i * width + c, s)
        s = load(sums, p, first + n * width + c)
        for r in range(rows[0], rows[1]):
            s = s + load(g, r, y + c)
        store(sums, p, first + n * width + c, s)


@kernel
def _slope(activation: int, layers: Matrix, g: Matrix, columns: Span, rows: Span) -> None:
    """Columns of g times the slopes of f, from its values in `layers`."""
    for r in range(rows[0], rows[1]):
        for k in range(columns[0], columns[1]):
            f = layers[r, k]
            if activation == _TANH:
                g[r, k] *= 1.0 - f * f
            elif not f > 0.0:
                g[r, k] *= f + 1.0


@kernel
def backward(net: Packed, layers: Matrix, g: Matrix, sums: Matrix, p: int, rows: Span, by_inputs: bool) -> None:
    """Gradients by all layers, and by the inputs if asked for, from that by the outputs; those by the weights are added
    to sums[p], if there are sums.
    """
    shape = net.shape
    here, first = net.turned.shape[1], net.weights.shape[1]
    x = g.shape[1] - shape[shape.shape[0] - 1, WIDTH]
    for k in range(shape.shape[0] - 2, -1, -1):
        n, m, width = shape[k, SIZE], shape[k + 1, SIZE], shape[k + 1, WIDTH]
        y, x = x, x - shape[k, WIDTH]
        here -= (m + 1) * shape[k, WIDTH]
        first -= (n + 1) * width
        if sums.shape[0] > 0:
            _by_weights(sums, (p, first), n, layers, g, (x, y, y + width), rows)
        if k > 0 or by_inputs:
            _affine(net.turned, here, m, g, (y, x, y), rows)
        if k > 0:
            _slope(net.activation, layers, g, (x, x + n), rows)


@parallel_kernel
def forward_rows(net: Packed, layers: Matrix) -> None:
    """The outputs of all layers, from the inputs in `layers`."""
    n = layers.shape[0]
    for p in prange((n + PART - 1) // PART):
        forward(net, layers, (p * PART, min(p * PART + PART, n)))


@parallel_kernel
def backward_rows(net: Packed, layers: Matrix, g: Matrix, sums: Matrix) -> None:
    """Gradients by all columns of `layers` in g, from those by the outputs in it.

    sums: (parts, packed weights) zeros, to which the gradients by the weights of each part are added; without rows
    where they are not asked for.
    """
    n = layers.shape[0]
    for p in prange((n + PART - 1) // PART):
        backward(net, layers, g, sums, p, (p * PART, min(p * PART + PART, n)), True)
