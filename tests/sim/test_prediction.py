"""Initial guess of a step within a motion: the Delassus matrix, and the iterations that the prediction saves."""

import numpy as np
import pytest

import dojo_opt as dojo
from sim.contact.ground_contact import add_contact_wrench, contact_rate
from sim.dynamics.elimination import solve, subtree_sums
from sim.model.layout import data_view, model_view
from sim.simulator.link_kernels import link_step
from sim.solve.delassus import delassus
from solvers.compiler import local_kernel

FEET = 4


@local_kernel
def both_ways(model_at, data_at, h, points, size, by_solves):
    """work.delassus by the joints above two contacts or limits, and by whole solves."""
    model, work = model_view(model_at), data_view(data_at)
    for b in range(size):
        if b < 3 * points:
            for i in range(work.wrench.shape[0]):
                for k in range(6):
                    work.wrench[i, k] = 0.0
            e = b % 3
            n, x, y = 1.0 * (e == 0), 1.0 * (e == 1), 1.0 * (e == 2)
            add_contact_wrench(model, work, work.reach_of[b - e], -n, -x, -y, work.wrench)
            subtree_sums(model, work.wrench, work.subtree)
            for d in range(work.rhs.shape[0]):
                total = 0.0
                for k in range(6):
                    total += work.S2[d, k] * work.subtree[model.dof_body[d], k]
                work.rhs[d] = total
        else:
            for d in range(work.rhs.shape[0]):
                work.rhs[d] = 0.0
            work.rhs[model.limit_dof[work.reach_of[b]]] = model.limit_sign[work.reach_of[b]]
        solve(model, work, work.rhs, work.dnu)
        for a in range(points):
            row = contact_rate(model, work, work.reach_of[3 * a])
            by_solves[3 * a, b], by_solves[3 * a + 1, b], by_solves[3 * a + 2, b] = row
        for a in range(3 * points, size):
            k = work.reach_of[a]
            by_solves[a, b] = h * model.limit_sign[k] * work.dnu[model.limit_dof[k]]
    delassus(model, work, h, points, size)


@pytest.mark.slow
def test_the_delassus_matrix_agrees_with_whole_solves():
    sim = dojo.Simulator(dojo.models.quadruped(), time_step=0.01)
    us = np.random.default_rng(0).uniform(-5.0, 5.0, (3, sim.nu))
    sim.rollout(sim.neutral(), us, throw=True)  # leaves factors and Jacobians of a step
    model_at, data_at = sim._engine.tables(link_step)
    work = data_view(data_at)
    stops = [0, 3, 9]
    size = 3 * FEET + len(stops)
    work.reach_of[: 3 * FEET : 3] = range(FEET)
    work.reach_of[3 * FEET : size] = stops
    by_solves = np.zeros((size, size))
    both_ways(model_at, data_at, sim.time_step, FEET, size, by_solves)
    ours = work.delassus[:size, :size].T
    np.testing.assert_allclose(ours, by_solves, atol=1e-11 * np.abs(by_solves).max())
    assert np.abs(ours[:3, 3:6]).max() > 1e-3 * np.abs(ours).max()  # feet feel each other


@pytest.mark.parametrize("kappa", [1e-4, None])
def test_robots_thrown_about_take_few_iterations(kappa):
    sim = dojo.Simulator(dojo.models.quadruped(contacts="all"), time_step=0.01, kappa=kappa)
    us = np.random.default_rng(5).uniform(-10.0, 10.0, (60, sim.nu))
    motion = sim.rollout(sim.neutral(), us, throw=True)
    alone = [sim.step(x, u, throw=True).iterations for x, u in zip(motion.x[:-1], us, strict=True)]
    assert np.mean(motion.iterations[1:]) < 5.0
    assert sum(motion.iterations) < 0.7 * sum(alone)


def test_a_free_flight_goes_on_in_an_iteration_or_two():
    sim = dojo.Simulator(dojo.models.quadrotor(), time_step=0.01)
    x = sim.neutral()
    x[2] += 5.0
    x[sim.nq + 3 :][:3] = (1.0, 2.0, 3.0)
    motion = sim.rollout(x, np.zeros((20, sim.nu)), throw=True)
    assert max(motion.iterations[1:]) <= 2
