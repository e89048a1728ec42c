"""A perceptron and its derivatives for many rows, spread over the threads.

Rows are divided into parts of PART, whatever the number of threads. A part adds up its own gradient, and those of the
parts are added in their order, so that results are the same to the last bit on any number of threads.

Rows of matrices are filled up with zeros to a multiple of LANES, rows of observations to one of BLOCK. `layers`
(n, sum of whole(size)) has the inputs, then the outputs of each layer, side by side. Packed weights (1, count) are
those of a layer after the other: the rows of W (inputs, outputs), then b. `shape` has a row for the inputs and for
each layer: its size, and its width, which is whole(size).
"""

from __future__ import annotations

from math import exp

import numpy as np

from solvers.compiler import kernel, parallel_kernel, prange
from solvers.lanes import LANES, load, spread, store, whole
from solvers.types import Floats, IntegerMatrix, Matrix

__all__ = ["BLOCK", "backward_rows", "forward_rows", "pack", "parts", "shape_of", "unpack"]

Span = tuple[int, int]

PART = 16
BLOCK = 4  # rows at a time: while one product is under way, others begin
SIZE, WIDTH = 0, 1  # columns of `shape`
_TANH = 0


def shape_of(sizes: tuple[int, ...]) -> IntegerMatrix:
    """The shape of a network of these sizes."""
    return np.array([(size, whole(size)) for size in sizes], dtype=np.int64)


def parts(rows: int) -> int:
    """Number of parts of so many rows."""
    return -(-rows // PART)


def pack(layers: list[tuple[Floats, Floats]]) -> Floats:
    """Packed weights of layers (W, b)."""
    blocks = [np.zeros((len(W) + 1, whole(len(b)))) for W, b in layers]
    for block, (W, b) in zip(blocks, layers, strict=True):
        block[:-1, : len(b)], block[-1, : len(b)] = W, b
    return np.concatenate([block.ravel() for block in blocks])[None]


def unpack(packed: Floats, layers: list[tuple[Floats, Floats]]) -> None:
    """Add packed weights (count,) to layers (W, b)."""
    first = 0
    for W, b in layers:
        width = whole(len(b))
        block = packed[first : first + (len(W) + 1) * width].reshape(-1, width)
        W += block[:-1, : len(b)]
        b += block[-1, : len(b)]
        first += block.size


@kernel
def _affine(w: Matrix, first: int, n: int, layers: Matrix, places: tuple[int, int, int], rows: Span) -> None:
    """y = x W + b of rows; W begins at `first`; places in `layers`: of x (n), of y, and its end."""
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
def _forward(shape: IntegerMatrix, w: Matrix, activation: int, layers: Matrix, rows: Span) -> None:
    """The outputs of all layers, of rows."""
    first, x = 0, 0
    for k in range(shape.shape[0] - 1):
        n, width = shape[k, SIZE], shape[k + 1, WIDTH]
        y = x + shape[k, WIDTH]
        _affine(w, first, n, layers, (x, y, y + width), rows)
        if k < shape.shape[0] - 2:
            _activate(activation, layers, (y, y + shape[k + 1, SIZE]), rows)
        first += (n + 1) * width
        x = y


@kernel
def _by_weights(
    sums: Matrix, at: tuple[int, int], n: int, layers: Matrix, g: Matrix, places: tuple[int, int, int], rows: Span
) -> None:
    """sums[p, first :] = gradient by W and b of a layer, added up over rows.

    at: (p, first);  g: gradient by y;  n, places: as for `_affine`.
    """
    p, first = at
    x, y, width = places[0], places[1], places[2] - places[1]
    for c in range(0, width, LANES):
        for i in range(n):
            s = spread(0.0)
            for r in range(rows[0], rows[1], BLOCK):
                a = layers[r, x + i] * load(g, r, y + c) + layers[r + 1, x + i] * load(g, r + 1, y + c)
                b = layers[r + 2, x + i] * load(g, r + 2, y + c) + layers[r + 3, x + i] * load(g, r + 3, y + c)
                s = s + (a + b)
            store(sums, p, first + i * width + c, s)
        s = spread(0.0)
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
def _backward(
    shape: IntegerMatrix, w: Matrix, activation: int, layers: Matrix, g: Matrix, sums: Matrix, p: int, rows: Span
) -> None:
    """Gradients by all layers and by x, from that by the outputs; sums[p] where there are sums.   w: transposed."""
    here, first = w.shape[1], sums.shape[1]
    x = g.shape[1] - shape[shape.shape[0] - 1, WIDTH]
    for k in range(shape.shape[0] - 2, -1, -1):
        n, m, width = shape[k, SIZE], shape[k + 1, SIZE], shape[k + 1, WIDTH]
        y, x = x, x - shape[k, WIDTH]
        here -= (m + 1) * shape[k, WIDTH]
        first -= (n + 1) * width
        if sums.shape[0] > 0:
            _by_weights(sums, (p, first), n, layers, g, (x, y, y + width), rows)
        _affine(w, here, m, g, (y, x, y), rows)
        if k > 0:
            _slope(activation, layers, g, (x, x + n), rows)


@parallel_kernel
def forward_rows(shape: IntegerMatrix, w: Matrix, activation: int, layers: Matrix) -> None:
    """The outputs of all layers, from the inputs in `layers`.   w: packed weights."""
    n = layers.shape[0]
    for p in prange((n + PART - 1) // PART):
        _forward(shape, w, activation, layers, (p * PART, min(p * PART + PART, n)))


@parallel_kernel
def backward_rows(shape: IntegerMatrix, w: Matrix, activation: int, layers: Matrix, g: Matrix, sums: Matrix) -> None:
    """Gradients by all columns of `layers` in g, from those by the outputs in it.

    w: packed layers (W^T, 0).
    sums: (parts, packed weights) gradients by the weights of each part, out; without rows where they are not asked for.
    """
    n = layers.shape[0]
    for p in prange((n + PART - 1) // PART):
        _backward(shape, w, activation, layers, g, sums, p, (p * PART, min(p * PART + PART, n)))
