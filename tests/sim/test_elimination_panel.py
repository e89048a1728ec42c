"""Many right-hand sides at once: the same as one by one, on bushy and on deep trees, by either way."""

import numpy as np
import pytest

import dojo_opt as dojo
from sim.dynamics.elimination import solve
from sim.dynamics.elimination_panel import column_count, solve_panel
from sim.model.layout import data_view, model_view
from sim.model.slots import Slot
from solvers.compiler import local_kernel


@local_kernel
def both_ways(model_at, data_at, columns, by_one):
    """columns solved by `solve_panel`; by_one: by `solve`, a column at a time.   Returns their number."""
    model, work = model_view(model_at), data_view(data_at)
    count = column_count(model, work)
    for m in range(count):
        for d in range(work.rhs.shape[0]):
            work.rhs[d] = work.columns[d, m] = columns[d, m]
        solve(model, work, work.rhs, work.dnu)
        for d in range(work.rhs.shape[0]):
            by_one[d, m] = work.dnu[d]
    solve_panel(model, work)
    for m in range(work.columns.shape[1]):
        for d in range(work.rhs.shape[0]):
            columns[d, m] = work.columns[d, m]
    return count


@pytest.mark.slow  # `both_ways` is compiled
@pytest.mark.parametrize(
    ("build", "deep"),
    [
        (dojo.models.humanoid, False),
        (dojo.models.quadruped, False),
        (dojo.models.cartpole, False),
        (lambda: dojo.models.npendulum(60), True),
    ],
    ids=["humanoid", "quadruped", "cartpole", "chain"],
)
def test_columns_are_solved_as_one_by_one(build, deep, rng):
    sim = dojo.Simulator(build(), time_step=0.01)
    sim.linearize(sim.neutral(), rng.normal(size=sim.nu))  # leaves factors
    model_at, data_at = sim._engine.tables()
    bound = sim.model.optional[Slot.SOLVE_DEEP_PANEL]
    assert (bound != 0) == deep
    columns = rng.normal(size=data_view(data_at).columns.shape)
    for address in {bound, 0}:
        sim.model.optional[Slot.SOLVE_DEEP_PANEL] = address
        ours, by_one = columns.copy(), np.zeros_like(columns)
        count = both_ways(model_at, data_at, ours, by_one)
        assert count == 2 * sim.nv + sim.nu
        scale = np.abs(by_one[:, :count]).max()
        np.testing.assert_allclose(ours[:, :count], by_one[:, :count], rtol=0.0, atol=1e-11 * scale)
        np.testing.assert_array_equal(ours[:, count:], 0.0)
    sim.model.optional[Slot.SOLVE_DEEP_PANEL] = bound


def test_a_deep_tree_has_the_derivatives_of_its_steps(rng):
    sim = dojo.Simulator(dojo.models.npendulum(60), time_step=0.01, tolerance=1e-12)
    x, u = sim.integrate(sim.neutral(), 0.1 * rng.normal(size=sim.ndx)), rng.normal(size=sim.nu)
    A, _ = sim.linearize(x, u)
    along = rng.normal(size=sim.ndx)
    ends = [sim.step(sim.integrate(x, e * along), u).x for e in (1e-5, -1e-5)]
    expected = sim.difference(x1=ends[0], x0=ends[1]) / 2e-5
    np.testing.assert_allclose(A @ along, expected, rtol=0.0, atol=1e-6 * np.abs(expected).max())
