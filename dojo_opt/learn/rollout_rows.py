"""Steps of a rollout under a policy, spread over the threads: what rows observe and do, and what comes of it.

Functions of the task are called by their address, for the rows of a block. A row does not depend on its neighbours, nor
on the number of threads. Arrays of a rollout have T steps and n rows; those that are not kept have no rows.
"""

from __future__ import annotations

from math import tanh
from typing import NamedTuple

from dojo_opt.learn.network_rows import BLOCK, WIDTH, Packed, forward
from solvers.compiler import AddressCall, kernel, parallel_kernel, prange
from solvers.types import Cube, Flags, Floats, Integers, Matrix, Vector

__all__ = ["END", "OBSERVATION", "REWARD", "SPAN", "SURVIVAL", "Acting", "Judging", "act_rows", "judge_rows"]

SPAN = 10.0  # standard deviations: scaled observations beyond are cut off, without a derivative
OBSERVATION = AddressCall("Span", "Integers", "Matrix", "Matrix", "Matrix", "Cube")
REWARD = AddressCall("Span", "Integers", "Matrix", "Matrix", "Matrix", "Matrix", "Vector", "Matrix")
END = AddressCall("Span", "Matrix", "Flags")
SURVIVAL = AddressCall("Span", "Integers", "Matrix", "Matrix", "Vector", "Matrix")


class Acting(NamedTuple):
    """From states to actions."""

    observation: int  # address
    layout: Integers
    states: Cube  # (T + 1, n, nx)
    noise: Cube  # (T, n, no) of scaled observations
    exploration: Cube  # (T, n, nu) noise of outputs
    mean: Vector  # (no,)
    deviation: Vector  # (no,)
    observations: Cube  # (T, n, no) out, as all below
    rates: Floats  # (T, n, no, ndx) derivatives of the observations
    inside: Flags  # (T, n, no) whether scaled observations are within their span
    layers: Cube  # (T, rows in blocks, width), or (1, ...) of the last step
    outputs: Cube  # (T, n, nu) of the network
    actions: Cube  # (T, n, nu)
    work: Cube  # (blocks, 3, ...) scratch
    failed: Integers  # (blocks,) whether a function has raised an error


class Judging(NamedTuple):
    """From actions to rewards and ends."""

    reward: int  # address
    end: int  # address
    survival: int  # address, or 0
    layout: Integers
    states: Cube  # (T + 1, n, nx)
    applied: Cube  # (T, n, nu) actions of the steps
    after: Cube  # (T, n, nx) states after the steps
    rewards: Matrix  # (T, n) out, as all below
    by_reward: Cube  # (T, n, ndx + nu + ndx) derivatives
    terminated: Flags  # (T, n)
    survival_of: Matrix  # (T, n) probabilities that episodes go on
    by_survival: Cube  # (T, n, ndx) derivatives
    work: Cube  # (blocks, 3, ...) scratch
    failed: Integers  # (blocks,)


@kernel
def _look(a: Acting, layers: Matrix, t: int, i: int) -> None:
    """Scaled observations of row i, as inputs of the network."""
    for c in range(a.mean.shape[0]):
        z = (a.observations[t, i, c] - a.mean[c]) / a.deviation[c]
        if a.noise.shape[1] > 0:
            z += a.noise[t, i, c]
        if a.inside.shape[1] > 0:
            a.inside[t, i, c] = abs(z) < SPAN
        layers[i, c] = SPAN if z > SPAN else -SPAN if z < -SPAN else z


@kernel
def _act(a: Acting, layers: Matrix, first: int, linear: bool, t: int, i: int) -> None:
    """The action of row i, from the outputs of the network in column `first`."""
    for j in range(a.actions.shape[2]):
        y = layers[i, first + j]
        if a.exploration.shape[1] > 0:
            y += a.exploration[t, i, j]
        a.outputs[t, i, j] = y
        if not linear:
            a.actions[t, i, j] = tanh(y)
        else:
            a.actions[t, i, j] = 1.0 if y > 1.0 else -1.0 if y < -1.0 else y


@kernel
def _act_block(net: Packed, a: Acting, linear: bool, t: int, p: int) -> None:
    """Actions of the rows of block p in step t."""
    first, last = p * BLOCK, min(p * BLOCK + BLOCK, a.actions.shape[1])
    layers = a.layers[t % a.layers.shape[0]]
    arguments = ((first, last), a.layout, a.states[t], a.work[p], a.observations[t], a.rates[t])
    a.failed[p] = OBSERVATION(a.observation, arguments)
    for i in range(first, last):
        _look(a, layers, t, i)
    forward(net, layers, (first, last))
    outputs = layers.shape[1] - net.shape[net.shape.shape[0] - 1, WIDTH]
    for i in range(first, last):
        _act(a, layers, outputs, linear, t, i)


@parallel_kernel
def act_rows(net: Packed, a: Acting, linear: bool, t: int) -> None:
    """Actions of all rows in step t; those of a linear policy are clamped outputs, not their tanh."""
    for p in prange(a.failed.shape[0]):
        _act_block(net, a, linear, t, p)


@kernel
def _judge_block(j: Judging, t: int, p: int) -> None:
    """Rewards of step t, and whether episodes end after it, of the rows of block p."""
    part, after = (p * BLOCK, min(p * BLOCK + BLOCK, j.rewards.shape[1])), j.after[t]
    acted = (part, j.layout, j.states[t], j.applied[t], after, j.work[p], j.rewards[t], j.by_reward[t])
    failed = REWARD(j.reward, acted) + END(j.end, (part, after, j.terminated[t]))
    for i in range(part[0], part[1]):
        j.survival_of[t, i] = 0.0 if j.terminated[t, i] else 1.0
    if j.survival != 0:
        failed += SURVIVAL(j.survival, (part, j.layout, after, j.work[p], j.survival_of[t], j.by_survival[t]))
    j.failed[p] = failed


@parallel_kernel
def judge_rows(j: Judging, t: int) -> None:
    """Rewards and ends of all rows in step t."""
    for p in prange(j.failed.shape[0]):
        _judge_block(j, t, p)
