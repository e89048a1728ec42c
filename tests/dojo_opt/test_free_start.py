"""A start that is free, and an end that has to be the start again: against a dense solution of the same problem."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dojo_opt.constraint import Goal, Periodic
from dojo_opt.cost import Effort, Tracking
from dojo_opt.planning.ilqr import ilqr
from dojo_opt.planning.options import Stage
from dojo_opt.planning.problem import Problem
from support.doubles import DoubleIntegrator, FreeBody

ONE_STAGE = (Stage(1e-4, 1e-4),)
T = 12


def problem(**settings):
    reference = np.stack([np.sin(np.arange(T + 1.0)), np.cos(np.arange(T + 1.0))], axis=1)
    cost = [Tracking(reference, [1.0, 0.3]), Effort(0.1)]
    return Problem(DoubleIntegrator(), [1.0, 0.0], T, cost=cost, **settings), reference


def dense(reference, free, shift):
    """(x, u) by the KKT system of the same problem; x_T = x_0 + shift when shift is given."""
    h = 0.1
    A, B = np.array([[1.0, h], [0.0, 1.0]]), np.array([h * h, h])
    nz = 2 * (T + 1) + T
    H, g, rows, right = np.zeros((nz, nz)), np.zeros(nz), [], []
    for t in range(T + 1):
        at = slice(2 * t, 2 * t + 2)
        H[at, at] = 2.0 * np.diag([1.0, 0.3])
        g[at] = -H[at, at] @ reference[t]
    H[2 * (T + 1) :, 2 * (T + 1) :] = 0.2 * np.eye(T)
    for t in range(T):
        row = np.zeros((2, nz))
        row[:, 2 * t : 2 * t + 2], row[:, 2 * t + 2 : 2 * t + 4] = -A, np.eye(2)
        row[:, 2 * (T + 1) + t] = -B
        rows.append(row)
        right.append(np.zeros(2))
    fixed = np.setdiff1d([0, 1], free)
    row = np.zeros((len(fixed), nz))
    row[np.arange(len(fixed)), fixed] = 1.0
    rows.append(row)
    right.append(np.array([1.0, 0.0])[fixed])
    if shift is not None:
        row = np.zeros((2, nz))
        row[:, 2 * T : 2 * T + 2], row[:, :2] = np.eye(2), -np.eye(2)
        rows.append(row)
        right.append(np.asarray(shift, dtype=float))
    C, c = np.concatenate(rows), np.concatenate(right)
    K = np.block([[H, C.T], [C, np.zeros((len(C), len(C)))]])
    z = np.linalg.lstsq(K, np.concatenate([-g, c]), rcond=None)[0][:nz]
    return z[: 2 * (T + 1)].reshape(-1, 2), z[2 * (T + 1) :]


@pytest.mark.parametrize("free", [[0, 1], [1], [0]])
def test_the_best_start_in_one_iteration(free):
    p, reference = problem(free_start=free)
    plan = ilqr(p, stages=ONE_STAGE, tolerance=1e-9)
    x, u = dense(reference, free, None)
    assert plan.success and plan.nit <= 2
    np.testing.assert_allclose(plan.x, x, atol=1e-8)
    np.testing.assert_allclose(plan.u[:, 0], u, atol=1e-7)


@pytest.mark.parametrize("shift", [[0.0, 0.0], [0.5, 0.0]])
def test_periodic_motion_is_the_best_of_its_kind(shift):
    p, reference = problem(free_start=True, constraints=[Periodic(shift)])
    plan = ilqr(p, stages=ONE_STAGE, tolerance=1e-9, violation_tolerance=1e-8)
    x, u = dense(reference, [0, 1], shift)
    assert plan.success and plan.violation <= 1e-8
    np.testing.assert_allclose(plan.x, x, atol=1e-6)
    np.testing.assert_allclose(plan.u[:, 0], u, atol=1e-5)
    np.testing.assert_allclose(plan.x[-1] - plan.x[0], shift, atol=1e-8)


def test_coordinates_that_are_not_free_stay():
    p, _ = problem(free_start=[1], constraints=[Goal([0.0, 0.0])])
    plan = ilqr(p, stages=ONE_STAGE)
    assert plan.success and plan.x[0, 0] == 1.0 and plan.x[0, 1] != 0.0


def test_a_given_start_is_kept():
    p, _ = problem(constraints=[Periodic()])
    plan = ilqr(p, stages=ONE_STAGE)
    assert plan.success
    np.testing.assert_array_equal(plan.x[0], [1.0, 0.0])
    np.testing.assert_allclose(plan.x[-1], [1.0, 0.0], atol=1e-3)


def test_coupling_is_the_derivative_of_the_residual(rng):
    sim = FreeBody()
    base = np.concatenate([np.zeros(3), [1.0, 0.0, 0.0, 0.0], np.zeros(6)])
    xs = np.array([sim.integrate(base, rng.normal(size=12)) for _ in range(3)])
    shift = np.concatenate([[1.0, 2.0, 3.0], np.zeros(3), rng.normal(size=6)])
    p = Problem(sim, base, 2, constraints=[Periodic(shift)], free_start=True)
    term = p.constraints[0]
    us = np.zeros((2, 6))
    end, start, _, _ = term.coupling(xs, us)
    for row, jacobian in ((2, end), (0, start)):
        for i in range(12):
            values = []
            for step in (1e-6, -1e-6):
                moved = xs.copy()
                moved[row] = sim.integrate(xs[row], step * np.eye(12)[i])
                term.update(moved, us)
                values.append(term.residual[0].copy())
            np.testing.assert_allclose((values[0] - values[1]) / 2e-6, jacobian[:, i], atol=1e-7)


def test_a_body_turns_and_returns():
    """Attitudes too: the wanted turn is not periodic, the plan is."""
    sim = FreeBody()
    turned = Rotation.from_rotvec([0.3, -0.8, 0.2]).as_quat(scalar_first=True)
    target = np.concatenate([[0.2, 0.0, 0.1], turned, np.zeros(6)])
    start = np.concatenate([np.zeros(3), [1.0, 0.0, 0.0, 0.0], np.zeros(6)])
    reference = np.array([start] * 4 + [target] * 5)
    p = Problem(
        sim,
        start,
        8,
        cost=[Tracking(reference, 1.0), Effort(0.01)],
        constraints=[Periodic()],
        free_start=True,
    )
    plan = ilqr(p, stages=ONE_STAGE)
    assert plan.success, plan.message
    assert np.abs(sim.difference(plan.x[-1], plan.x[0])).max() <= 1e-3
    given = ilqr(Problem(sim, start, 8, cost=p.specs[0], constraints=[Periodic()]), stages=ONE_STAGE)
    assert plan.fun < given.fun


@pytest.mark.parametrize(
    "settings, message",
    [
        ({"free_start": [2]}, r"Problem\(free_start=...\): expected components in \[0, 2\), got \[2\]"),
        ({"constraints": [Periodic([1.0])]}, r"Periodic\(shift=...\): expected shape"),
    ],
)
def test_impossible_free_starts_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        problem(**settings)


def test_a_rotation_has_no_shift():
    base = np.concatenate([np.zeros(3), [1.0, 0.0, 0.0, 0.0], np.zeros(6)])
    with pytest.raises(ValueError, match="zeros for rotations"):
        Problem(FreeBody(), base, 2, constraints=[Periodic(np.ones(12))])
