"""Network: a perceptron with its derivatives, for batches in NumPy and for one observation as a kernel; Adam."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, tanh
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.mechanism import checks
from sim.mechanism.memory_limit import check_room
from solvers.compiler import kernel
from solvers.types import Integers, Vector

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
        return sum(n * m + m for n, m in zip(self.sizes[:-1], self.sizes[1:], strict=True))

    def start(self, rng: np.random.Generator, last: float = 1.0) -> Floats:
        """Orthogonal weights with gain sqrt(2), `last` in the last layer, and zero offsets (Saxe 2014)."""
        out = []
        for k, (n, m) in enumerate(zip(self.sizes[:-1], self.sizes[1:], strict=True)):
            square = np.linalg.qr(rng.standard_normal((max(n, m), max(n, m))))[0]
            gain = last if k == len(self.sizes) - 2 else np.sqrt(2.0)
            out += [gain * square[:n, :m].ravel(), np.zeros(m)]
        return np.concatenate(out)

    def layers(self, weights: Floats) -> list[tuple[Floats, Floats]]:
        """(W (..., inputs, outputs), b (..., outputs)) of every layer, views of weights (..., count)."""
        out, first = [], 0
        for n, m in zip(self.sizes[:-1], self.sizes[1:], strict=True):
            mid, last = first + n * m, first + n * m + m
            out.append((weights[..., first:mid].reshape(*weights.shape[:-1], n, m), weights[..., mid:last]))
            first = last
        return out

    def forward(self, weights: Floats, x: Floats) -> tuple[Floats, list[Floats]]:
        """(outputs (n, m), inputs of all layers), for rows x (n, inputs); weights (count,), or (n, count) by row."""
        kept, layers = [x], self.layers(weights)
        for W, b in layers[:-1]:
            y = _affine(W, b, kept[-1])
            kept.append(np.tanh(y) if self.activation == "tanh" else np.where(y > 0.0, y, np.expm1(np.minimum(y, 0.0))))
        return _affine(*layers[-1], kept[-1]), kept

    def backward(self, weights: Floats, kept: list[Floats], g: Floats, out: Floats | None = None) -> Floats:
        """Gradient by x (n, inputs) from that by the outputs, g (n, m); adds that by the weights to `out`."""
        layers = self.layers(weights)
        slots = [] if out is None else self.layers(out)
        for k in range(len(kept) - 1, -1, -1):
            if slots:
                slots[k][0][:] += kept[k].T @ g
                slots[k][1][:] += g.sum(axis=0)
            g = g @ layers[k][0].T
            if k:
                g = g * (1.0 - kept[k] ** 2 if self.activation == "tanh" else np.where(kept[k] > 0.0, 1.0, kept[k] + 1))
        return g


def _affine(W: Floats, b: Floats, x: Floats) -> Floats:
    """x W + b of rows x (n, inputs); W (inputs, outputs), or (n, inputs, outputs) by row."""
    return x @ W + b if W.ndim == 2 else np.matmul(x[:, None], W)[:, 0] + b


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
