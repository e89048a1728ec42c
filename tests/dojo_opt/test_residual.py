"""Residuals that a user writes: plain functions or kernels, tried before they are compiled."""

from __future__ import annotations

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.constraint import Goal, ResidualConstraint
from dojo_opt.cost import Effort, ResidualCost

SIM = dojo.Simulator(dojo.models.cartpole(), time_step=0.05)
X = SIM.neutral()


def problem(*costs, constraints=()):
    goal = X.copy()
    goal[0] = 1.0
    return dojo.Problem(SIM, X, 30, cost=[Effort(0.01), *costs], constraints=[Goal(goal), *constraints])


def too_fast(x, u, out):
    out[0] = x[2] ** 2 - 0.9**2


@dojo.kernel
def tip(x):
    return np.array([x[0] + 0.5 * np.sin(x[1]), -0.5 * np.cos(x[1])])  # allocates


@dojo.kernel
def high(x, u, out):
    out[:] = 0.1 * (tip(x) - np.array([1.0, -0.5]))


def test_a_plain_function_is_a_constraint_that_holds():
    free = dojo.ilqr(problem())
    held = dojo.ilqr(problem(constraints=[ResidualConstraint(too_fast, 1, equality=False)]))
    assert free.success and held.success
    assert np.abs(free.x[:, 2]).max() > 0.95
    assert np.abs(held.x[:, 2]).max() < 0.901


def test_a_kernel_may_allocate_and_call_another_one():
    term = problem(ResidualCost(high, 2)).costs[1]
    xs, us = np.random.default_rng(0).normal(size=(31, 4)), np.zeros((30, 1))
    expected = sum(0.01 * np.sum((tip.py_func(x) - [1.0, -0.5]) ** 2) for x in xs)
    np.testing.assert_allclose(term.value(xs, us), expected, rtol=1e-12)


def too_long(x, u, out):
    out[0], out[1] = x[0], x[1]


def forgotten(x, u, out):
    out[0] = x[0]


def misspelt(x, u, out):
    out[0] = y[0]  # noqa: F821


def untyped(x, u, out):
    out[0] = float(str(x[0]).strip("abc").title().swapcase() != object())


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        (lambda: ResidualCost(too_long, 1), r"ResidualCost\(function=\.\.\.\): 'too_long': IndexError: .*out \(1,\)"),
        (lambda: ResidualCost(forgotten, 2), r"ResidualCost\(function=\.\.\.\): 'forgotten' does not write out\[1\]"),
        (lambda: ResidualCost(misspelt, 1), r"'misspelt': NameError: name 'y' is not defined"),
        (lambda: ResidualCost(too_fast, 0), r"ResidualCost\(dimension=\.\.\.\): expected a whole number >= 1, got 0"),
        (lambda: ResidualCost("x[0]", 1), r"expected a function of \(x, u, out\), got 'x\[0\]'"),
        (lambda: ResidualCost(too_fast, 1, jacobian=too_long), r"ResidualCost\(jacobian=\.\.\.\): 'too_long': "),
    ],
)
def test_a_residual_that_cannot_be_is_refused_by_name(spec, message):
    with pytest.raises(ValueError, match=message):
        problem(spec())


def test_an_error_of_the_compiler_names_the_function():
    with pytest.raises(ValueError, match="residual 'untyped': Numba cannot compile it: "):
        dojo.ilqr(problem(ResidualCost(untyped, 1)))
