"""Residuals that a user writes: plain functions or kernels, tried before they are compiled."""

from __future__ import annotations

from pathlib import Path

import numba
import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.constraint import Goal, ResidualConstraint
from dojo_opt.cost import Effort, ResidualCost
from support.programs import python

SIM = dojo.Simulator(dojo.models.cartpole(), time_step=0.05)
X = SIM.neutral()


def problem(*costs, constraints=()):
    goal = X.copy()
    goal[0] = 1.0
    return dojo.Problem(SIM, X, 30, cost=[Effort(0.01), *costs], constraints=[Goal(goal), *constraints])


def too_fast(x, u, out):
    out[0] = x[2] ** 2 - 0.9**2


@dojo.jit
def tip(x):
    return np.array([x[0] + 0.5 * np.sin(x[1]), -0.5 * np.cos(x[1])])  # allocates


@dojo.jit
def high(x, u, out):
    out[:] = 0.1 * (tip(x) - np.array([1.0, -0.5]))


@pytest.mark.slow
def test_a_plain_function_is_a_constraint_that_holds():
    free = dojo.ilqr(problem())
    held = dojo.ilqr(problem(constraints=[ResidualConstraint(too_fast, 1, equality=False)]))
    assert free.success and held.success
    assert np.abs(free.x[:, 2]).max() > 0.95
    assert np.abs(held.x[:, 2]).max() < 0.901


@pytest.mark.slow
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
    with pytest.raises(ValueError, match="residual 'untyped' cannot be compiled by Numba: "):
        dojo.ilqr(problem(ResidualCost(untyped, 1)))


# -- arguments are the planner's own -----------------------------------------------------------------------------------


@dojo.jit
def clear(x):
    x[0] = 1.0


@dojo.jit
def spread_out(x):
    return np.array([x[0], 2.0 * x[1]])


def always(x, u, out):
    x[1] -= 2.0
    out[0] = x[1]


def elsewhere(x, u, out):
    if x[1] > 0.5:
        x[1] -= 2.0
    out[0] = x[1]


def through_a_view(x, u, out):
    y = x[1:]
    if x[1] > 0.5:
        y[0] = 3.0
    out[0] = y[0]


def through_a_helper(x, u, out):
    if x[1] > 0.5:
        clear(x)
    out[0] = x[1]


def into_the_input(x, u, out):
    if x[1] > 0.5:
        u[0] = 0.0
    out[0] = x[1]


@numba.njit
def compiled_by_the_user(x, u, out):
    if x[1] > 0.5:
        x[1] = 0.0
    out[0] = x[1]


WRITERS = [always, elsewhere, through_a_view, through_a_helper, into_the_input, compiled_by_the_user]


@pytest.mark.parametrize("function", WRITERS, ids=lambda f: f.__name__)
def test_a_function_that_writes_into_its_arguments_is_refused_by_name(function):
    name = function.__name__
    with pytest.raises(ValueError, match=f"'{name}' writes into its argument x or u"):
        dojo.ilqr(problem(ResidualCost(function, 1)))


def one_in(x, u, out):
    for k in range(out.shape[1]):
        out[0, k] = 1.0 if k == 0 else 0.0


def one_in_that_writes(x, u, out):
    for k in range(out.shape[1]):
        out[0, k] = 1.0 if k == 0 else 0.0
    if x[1] > 0.5:
        x[0] = 0.0


def test_a_jacobian_that_writes_into_its_arguments_is_refused_by_name():
    with pytest.raises(ValueError, match="'one_in_that_writes' writes into its argument"):
        dojo.ilqr(problem(ResidualCost(forgotten, 1, jacobian=one_in_that_writes)))


def of_copies(x, u, out):
    y = x.copy()
    y[0] = 0.0
    z = spread_out(x) + np.concatenate((x, u))[:2]
    w = np.eye(4) @ x
    out[0] = y[1] + z[0] + w[0] + np.dot(x, x) + np.linalg.norm(u) + x.reshape(2, 2)[0, 1]


@pytest.mark.slow
def test_copies_may_be_written_to_and_numpy_takes_the_arguments():
    term = problem(ResidualCost(of_copies, 1)).costs[1]
    xs, us = np.random.default_rng(1).normal(size=(31, 4)), np.zeros((30, 1))
    expected = sum((2.0 * x[1] + 3.0 * x[0] + x @ x) ** 2 for x in xs)
    np.testing.assert_allclose(term.value(xs, us), expected, rtol=1e-12)


# -- bounds ------------------------------------------------------------------------------------------------------------


def far_beyond(x, u, out):
    i = 0
    if x[0] > 0.5:
        i = 50_000_000
    out[0] = x[i]


@numba.njit
def far_beyond_compiled(x, u, out):
    i = 0
    if x[0] > 0.5:
        i = 50_000_000
    out[0] = x[i]


def far_out(x, u, out):
    out[0] = x[0]
    if x[0] > 0.5:
        out[50_000_000] = 1.0


def far_in(x, u, out):
    for k in range(out.shape[1]):
        out[0, k] = 1.0 if k == 0 else 0.0
    if x[0] > 0.5:
        out[0, 50_000_000] = 1.0


@pytest.mark.sweep(2)
@pytest.mark.parametrize("function", [far_beyond, far_beyond_compiled, far_out], ids=lambda f: f.__name__)
def test_an_index_beyond_the_end_names_function_and_knot(function):
    states = np.zeros((31, 4))
    states[7:, 0] = 1.0
    term = problem(ResidualCost(function, 1)).costs[1]
    with pytest.raises(ValueError, match=f"residual '{function.__name__}' at knot 7: IndexError: "):
        term.value(states, np.zeros((30, 1)))
    size = SIM.ndx + SIM.nu
    exact = problem(ResidualCost(forgotten, 1, jacobian=far_in)).costs[1]
    with pytest.raises(ValueError, match="residual 'far_in' at knot 7: IndexError: "):
        exact.expand(states, np.zeros((30, 1)), np.zeros((31, size)), np.zeros((31, size, size)))


def test_bounds_are_not_checked_where_the_user_asks_for_that():
    assert dojo.jit(boundscheck=False)(forgotten).entry.targetoptions["boundscheck"] is False
    assert dojo.jit(forgotten).entry.targetoptions["boundscheck"] is True
    assert dojo.jit(boundscheck=False)(dojo.jit(forgotten)).entry.targetoptions["boundscheck"] is True
    unchecked = numba.njit(boundscheck=False)(forgotten)
    assert dojo.jit(unchecked) is unchecked


# -- compiled once -----------------------------------------------------------------------------------------------------


def above(height, scale):
    def residual(x, u, out):
        out[0] = scale[0] * (x[0] - height)

    return residual


def test_functions_with_the_same_text_and_values_share_their_code():
    def loop(height, scale):
        return problem(ResidualCost(above(height, scale), 1)).costs[1]._kernels._residual[1]

    one = np.ones(1)
    assert loop(1.0, one) is loop(1.0, np.ones(1))
    assert loop(1.0, one) is not loop(2.0, one)
    assert loop(1.0, one) is not loop(1.0, np.array([2.0]))


GAIN = 1.0


def by_a_global(x, u, out):
    out[0] = GAIN * x[0]


@pytest.mark.slow
def test_a_global_that_has_changed_is_not_taken_for_the_old_one(monkeypatch):
    xs, us = np.ones((31, 4)), np.zeros((30, 1))
    before = problem(ResidualCost(by_a_global, 1)).costs[1].value(xs, us)
    monkeypatch.setattr("test_residual.GAIN" if __name__ == "test_residual" else f"{__name__}.GAIN", 3.0)
    assert problem(ResidualCost(by_a_global, 1)).costs[1].value(xs, us) == pytest.approx(9.0 * before)


MEMORY = """
import gc, resource, time, numpy as np, dojo_opt as dojo
never = time.time()  # a value that no process has kept on disk, so that the first plans compile, too
sim = dojo.Simulator(dojo.models.pendulum(), 0.05)
def rss():
    gc.collect()
    return int(open("/proc/self/statm").read().split()[1]) * resource.getpagesize() / 2**20
def plan(height):
    def residual(x, u, out):
        out[0] = x[1] - height
    dojo.ilqr(dojo.Problem(sim, sim.neutral(), 5, cost=[dojo.cost.ResidualCost(residual, 1), dojo.cost.Effort(1.0)]))
for i in range(2):
    plan(never - i)
def growth(heights):
    first = rss()
    for height in heights:
        plan(height)
    return (rss() - first) / len(heights)
print(growth([never] * 3), growth([never + 1.0 + i for i in range(4)]))
"""


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads the memory of a process as Linux says it")
def test_memory_of_new_residuals_is_bounded():
    """Numba frees no code: a residual with a new value keeps some; a residual with a known value keeps none."""
    again, anew = map(float, python(MEMORY).split())
    assert again < 0.1
    assert anew < 3.0
