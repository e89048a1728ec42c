"""The sweep of costates back through a rollout, spread over the threads; policy_rollout.py has the formula.

Rows have nothing to do with one another but the gradient by the weights. It is added up in parts of PART rows, whatever
the number of threads, so that results are the same to the last bit on any of them. Arrays of T steps and n rows have
the rows of a step after those of the one before: k = t n + i.
"""

from __future__ import annotations

from math import copysign, sqrt
from typing import NamedTuple

from dojo_opt.learn.network_rows import PART, WIDTH, Packed, backward
from solvers.compiler import kernel, parallel_kernel, prange
from solvers.types import Cube, Flags, Integers, Matrix, Vector

__all__ = ["STEEP", "CostateSweep", "SweepLimits", "sweep_rows"]

STEEP = 1.5  # outputs that are squashed to actions beyond 0.9


class CostateSweep(NamedTuple):
    """A rollout with its derivatives, and the buffers of the sweep."""

    weights: Vector  # (T n,) of the rewards
    ends: Matrix  # (T n, ndx) derivatives of further terms by the states after the steps, or without rows
    cut: Flags  # (T n,) the next step starts from another state
    unsolved: Flags  # (T n,)
    decided_in: Integers  # (T n,) steps in which the applied actions were decided, -1 before
    A: Cube  # (T n, ndx, ndx)
    B: Cube  # (T n, ndx, nu) by inputs
    rates: Cube  # (T n, no, ndx) of observations
    rewards: Matrix  # (T n, ndx + nu + ndx) derivatives
    outputs: Matrix  # (T n, nu) of the network
    actions: Matrix  # (T n, nu)
    inside: Flags  # (T n, no) whether scaled observations are within their span
    layers: Cube  # (T, rows in blocks, width) of the network
    half: Vector  # (nu,) inputs per action
    deviation: Vector  # (no,) of observations
    by_decided: Matrix  # (T n, nu) zeros; out, derivatives by actions
    costates: Matrix  # (n, ndx) zeros; out, by the first states
    after: Matrix  # (n, ndx)
    slopes: Matrix  # (rows in blocks, width) zeros
    sums: Matrix  # (parts, packed weights) zeros; out, by the weights
    clipped: Integers  # (parts,) zeros; out, shortened costates
    largest: Vector  # (parts,) zeros; out, of the costates before


class SweepLimits(NamedTuple):
    """Options of a sweep."""

    costate: float  # largest length of one, beyond which it is shortened
    saturation: float  # cost of outputs y beyond STEEP, this times (|y| - STEEP)^2
    linear: bool  # actions are clamped outputs, not their tanh


@kernel
def _through_step(s: CostateSweep, k: int, i: int) -> None:
    """The costate of row i before its step k, from that after it; what the action contributes goes to the step in which
    it was decided.
    """
    n, ndx, nu = s.costates.shape[0], s.costates.shape[1], s.actions.shape[1]
    costate, after, A, B = s.costates[i], s.after[i], s.A[k], s.B[k]
    scale = 0.0 if s.unsolved[k] else s.weights[k]
    for j in range(ndx):
        after[j] = (0.0 if s.cut[k] else costate[j]) + scale * s.rewards[k, ndx + nu + j]
        if s.ends.shape[0] > 0:
            after[j] += s.ends[k, j]
    decided = s.decided_in[k] * n + i
    for j in range(nu if decided >= 0 else 0):
        by_input = 0.0
        for r in range(ndx):
            by_input += after[r] * B[r, j]
        s.by_decided[decided, j] += s.half[j] * by_input + scale * s.rewards[k, ndx + j]
    for j in range(ndx):
        costate[j] = scale * s.rewards[k, j]
    for r in range(ndx):
        for j in range(ndx):
            costate[j] += after[r] * A[r, j]


@kernel
def _by_outputs(s: CostateSweep, limits: SweepLimits, first: int, k: int, i: int) -> None:
    """Derivatives of row i by the outputs of the network in its step k, which `slopes` has from column `first` on."""
    for j in range(s.actions.shape[1]):
        a, y = s.actions[k, j], s.outputs[k, j]
        slope = (1.0 if abs(a) < 1.0 else 0.0) if limits.linear else 1.0 - a * a
        beyond = copysign(max(abs(y) - STEEP, 0.0), y)
        s.slopes[i, first + j] = s.by_decided[k, j] * slope - 2.0 * limits.saturation * beyond


@kernel
def _through_observation(s: CostateSweep, limit: float, k: int, i: int, p: int) -> None:
    """Add what the observation contributes to the costate of row i before its step k, and limit its length."""
    costate, rates, square = s.costates[i], s.rates[k], 0.0
    for c in range(rates.shape[0]):
        if s.inside[k, c]:
            g = s.slopes[i, c] / s.deviation[c]
            for j in range(costate.shape[0]):
                costate[j] += g * rates[c, j]
    for j in range(costate.shape[0]):
        square += costate[j] * costate[j]
    length = sqrt(square)
    s.largest[p] = max(s.largest[p], length)
    if length > limit:
        s.clipped[p] += 1
        for j in range(costate.shape[0]):
            costate[j] *= limit / length


@kernel
def _sweep_part(net: Packed, s: CostateSweep, limits: SweepLimits, p: int) -> None:
    """The sweep of the rows of part p."""
    n, steps = s.costates.shape[0], s.layers.shape[0]
    first, last = p * PART, min(p * PART + PART, n)
    outputs = s.slopes.shape[1] - net.shape[net.shape.shape[0] - 1, WIDTH]
    for t in range(steps - 1, -1, -1):
        for i in range(first, last):
            _through_step(s, t * n + i, i)
            _by_outputs(s, limits, outputs, t * n + i, i)
        backward(net, s.layers[t], s.slopes, s.sums, p, (first, last), True)
        for i in range(first, last):
            _through_observation(s, limits.costate, t * n + i, i, p)


@parallel_kernel
def sweep_rows(net: Packed, s: CostateSweep, limits: SweepLimits) -> None:
    """The sweep of all rows."""
    for p in prange(s.sums.shape[0]):
        _sweep_part(net, s, limits, p)
