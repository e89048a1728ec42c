"""Network: a perceptron with its derivatives, for batches in NumPy and for one observation as a kernel; Adam."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import exp, tanh
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_opt.learn.network_rows import (
    Packed,
    backward_rows,
    forward_rows,
    in_blocks,
    parts,
    places,
    shape_of,
    turned_places,
    weight_rows,
)
from sim.mechanism import checks
from sim.mechanism.memory_limit import check_room
from solvers.compiler import kernel
from solvers.lanes import whole
from solvers.types import IntegerMatrix, Integers, Vector

Floats = NDArray[np.float64]

__all__ = ["ACTIVATIONS", "Adam", "Network", "perceptron"]

ACTIVATIONS = ("tanh", "elu")
_TANH, _ELU = range(2)


@kernel
def perceptron(sizes: Integers, weights: Vector, activation: int, x: Vector, work: Vector) -> int:
    """y = W_k f(... f(W_1 x + b_1) ...) + b_k; work (2 max(sizes),) holds y from the returned index on."""
    width = work.shape[0] // 2
    for i in range(sizes[0]):
        work[i] = x[i]
    here, first = 0, 0
    for layer in range(sizes.shape[0] - 1):
        n, m = sizes[layer], sizes[layer + 1]
        there = width - here
        for j in range(m):
            s = weights[first + n * m + j]
            for i in range(n):
                s += weights[first + i * m + j] * work[here + i]
            if layer < sizes.shape[0] - 2:
                if activation == _TANH:
                    s = tanh(s)
                elif s < 0.0:
                    s = exp(s) - 1.0
            work[there + j] = s
        first += n * m + m
        here = there
    return here


@dataclass(frozen=True)
class Network:
    """The shape of a perceptron: its weights are one vector, layer by layer W (inputs, outputs), then b (outputs,)."""

    sizes: tuple[int, ...]  # inputs, hidden layers, outputs; two numbers: a linear map
    activation: str = "tanh"

    def __post_init__(self) -> None:
        sizes = self.sizes if isinstance(self.sizes, tuple | list) else ()
        if len(sizes) < 2:
            raise ValueError(f"Network(sizes): expected inputs, hidden layers and outputs, got {self.sizes!r}")
        for size in sizes:
            checks.whole_number("Network(sizes)", size)
        checks.one_of("Network(activation=...)", self.activation, ACTIVATIONS)
        # orthogonal weights are squares
        check_room("Network(sizes)", max(sizes) ** 2, 8.0, "choose smaller layers", "weights")

    @property
    def count(self) -> int:
        """Number of weights."""
        return sum(n * m + m for n, m in pairwise(self.sizes))

    def start(self, rng: np.random.Generator, last: float = 1.0) -> Floats:
        """Orthogonal weights with gain sqrt(2), `last` in the last layer, and zero offsets (Saxe 2014)."""
        out = []
        for k, (n, m) in enumerate(pairwise(self.sizes)):
            square = np.linalg.qr(rng.standard_normal((max(n, m), max(n, m))))[0]
            gain = last if k == len(self.sizes) - 2 else np.sqrt(2.0)
            out += [gain * square[:n, :m].ravel(), np.zeros(m)]
        return np.concatenate(out)

    def layers(self, weights: Floats) -> list[tuple[Floats, Floats]]:
        """(W (..., inputs, outputs), b (..., outputs)) of every layer, views of weights (..., count)."""
        out, first = [], 0
        for n, m in pairwise(self.sizes):
            mid, last = first + n * m, first + n * m + m
            out.append((weights[..., first:mid].reshape(*weights.shape[:-1], n, m), weights[..., mid:last]))
            first = last
        return out

    def forward(self, weights: Floats, x: Floats) -> tuple[Floats, Floats]:
        """(outputs (n, m), values of all layers for `backward`), for rows x (n, inputs), on all threads.

        weights: (count,), or (n, count) by row, without values of layers.
        """
        if weights.ndim == 2:
            return self._by_row(weights, x), np.zeros((0, 0))
        layers = self.rows(len(x))
        layers[: len(x), : self.sizes[0]] = x
        forward_rows(self.packed(weights), layers)
        return self.outputs(layers, len(x)), layers

    def backward(self, weights: Floats, kept: Floats, g: Floats, out: Floats | None = None) -> Floats:
        """Gradient by x (n, inputs) from that by the outputs, g (n, m); adds that by the weights to `out`.

        kept: values of all layers, as `forward` returns them for the weights (count,).
        """
        slopes = self.rows(len(g))
        self.outputs(slopes, len(g))[:] = g
        sums = self.sums(0 if out is None else parts(len(slopes)))
        backward_rows(self.packed(weights), kept, slopes, sums)
        if out is not None:
            out += sums.sum(axis=0)[self.places]
        return slopes[: len(g), : self.sizes[0]]

    def packed(self, weights: Floats) -> Packed:
        """The network with these weights (count,), for kernels."""
        (chosen, there), numbers = self._turned, np.zeros(self._room)
        numbers[self.places] = weights
        turned = np.zeros(sum((m + 1) * whole(n) for n, m in pairwise(self.sizes)))
        turned[there] = weights[chosen]
        return Packed(self._shape, numbers[None], turned[None], number_of(self.activation))

    def sums(self, count: int) -> Floats:
        """Zeros for gradients by packed weights."""
        return np.zeros((count, self._room))

    @cached_property
    def _shape(self) -> IntegerMatrix:
        return shape_of(self.sizes)

    @cached_property
    def places(self) -> Integers:
        """(count,) places of weights among packed ones."""
        return places(self.sizes)

    @cached_property
    def weight_rows(self) -> IntegerMatrix:
        """Rows of packed weights; see network_rows.py."""
        return weight_rows(self.sizes)

    @cached_property
    def _turned(self) -> tuple[Integers, Integers]:
        return turned_places(self.sizes)

    @cached_property
    def _room(self) -> int:
        """Number of packed weights."""
        return sum((n + 1) * whole(m) for n, m in pairwise(self.sizes))

    @cached_property
    def width(self) -> int:
        """Numbers of a row of all layers."""
        return sum(whole(size) for size in self.sizes)

    def rows(self, count: int) -> Floats:
        """Zeros for the layers of so many rows; see network_rows.py."""
        return np.zeros((in_blocks(count), self.width))

    def outputs(self, layers: Floats, count: int) -> Floats:
        """The outputs (count, m) in there."""
        first = layers.shape[1] - whole(self.sizes[-1])
        return layers[:count, first : first + self.sizes[-1]]

    def _by_row(self, weights: Floats, x: Floats) -> Floats:
        """Outputs (n, m) of rows with weights (n, count) of their own."""
        *hidden, last = self.layers(weights)
        for W, b in hidden:
            y = np.matmul(x[:, None], W)[:, 0] + b
            x = np.tanh(y) if self.activation == "tanh" else np.where(y > 0.0, y, np.expm1(np.minimum(y, 0.0)))
        return np.asarray(np.matmul(x[:, None], last[0])[:, 0] + last[1])


class Adam:
    """Adam (Kingma and Ba 2015) without its state hidden: `moments` (3, count) are means, squares, number of steps."""

    def __init__(self, count: int, betas: tuple[float, float]) -> None:
        self.betas = betas
        self.moments = np.zeros((3, count))

    def step(self, weights: Floats, gradient: Floats, rate: float) -> None:
        """Move the weights against the gradient."""
        (m, v, steps), (b1, b2) = self.moments, self.betas
        steps += 1.0
        t = float(steps[0])  # powers of a whole row, smaller than any number after a while, took longer than the rest
        m += (1.0 - b1) * (gradient - m)
        v += (1.0 - b2) * (gradient**2 - v)
        weights -= (rate / (1.0 - b1**t)) * m / (np.sqrt(v / (1.0 - b2**t)) + 1e-8)


def clipped(gradient: Floats, norm: float) -> tuple[Floats, float]:
    """The gradient, no longer than `norm`, and its length before."""
    length = float(np.linalg.norm(gradient))
    return (gradient * (norm / length) if length > norm else gradient), length


def number_of(activation: Any) -> int:
    """Of an activation, as kernels take it."""
    return ACTIVATIONS.index(activation)
