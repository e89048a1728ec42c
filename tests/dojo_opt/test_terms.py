"""Costs and constraints: values from their definition, derivatives against central differences on the manifold."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dojo_opt.constraint import ControlBounds, Goal, ResidualConstraint, StateBounds
from dojo_opt.cost import Effort, ResidualCost, Tracking
from dojo_opt.planning.manifold import tangent_layout
from solvers.compiler import kernel
from support.doubles import DoubleIntegrator, FreeBody

T = 4


@kernel
def height_times_force(x, u, out):
    """(z f_z, x^2, quaternion w y)"""
    out[0] = x[2] * u[2]
    out[1] = x[0] * x[0]
    out[2] = x[3] * x[5]


@kernel
def speed(x, u, out):
    """v - 1"""
    out[0] = x[1] - 1.0


@kernel
def speed_jacobian(x, u, out):
    out[0, 1] = 1.0


def random_states(sim, count, seed=0):
    rng = np.random.default_rng(seed)
    base = np.concatenate([np.zeros(3), [1.0, 0.0, 0.0, 0.0], np.zeros(6)])
    return np.array([sim.integrate(base, rng.normal(size=sim.ndx)) for _ in range(count)])


def check_expansion(sim, term, xs, us, hessian=True):
    """Gradient against differences of the value; an exact Hessian against differences of the gradient; all central."""
    n, m = sim.ndx, sim.nu
    g, H = np.zeros((T + 1, n + m)), np.zeros((T + 1, n + m, n + m))
    term.expand(xs, us, g, H)
    step = 1e-5
    for t in range(T + 1):
        for i in range(n + m):
            if t == T and i >= n:
                continue
            values, slopes = [], []
            for sign in (1.0, -1.0):
                x, u = xs.copy(), us.copy()
                if i < n:
                    x[t] = sim.integrate(xs[t], sign * step * np.eye(n)[i])
                else:
                    u[t, i - n] += sign * step
                values.append(term.value(x, u))
                slope = np.zeros((T + 1, n + m))
                term.expand(x, u, slope, np.zeros_like(H))
                slopes.append(slope)
            difference = (values[0] - values[1]) / (2 * step)
            assert abs(difference - g[t, i]) <= 1e-6 * max(1.0, np.abs(g).max()), (t, i, difference, g[t, i])
            if hessian:
                row = (slopes[0] - slopes[1])[t] / (2 * step)
                np.testing.assert_allclose(row, H[t, i], atol=1e-5 * max(1.0, np.abs(H).max()))
    np.testing.assert_allclose(H, np.swapaxes(H, 1, 2), atol=1e-12)


def test_layout_finds_scalars_and_the_quaternion():
    sim = FreeBody()
    layout = tangent_layout(sim, random_states(sim, 1)[0])
    np.testing.assert_array_equal(layout, [0, 1, 2, -4, -4, -4, 7, 8, 9, 10, 11, 12])
    np.testing.assert_array_equal(tangent_layout(DoubleIntegrator(), np.zeros(2)), [0, 1])


def bind(spec, sim, xs):
    return spec.bind(sim, T, tangent_layout(sim, xs[0]))


def test_tracking_measures_the_tangent_difference():
    sim, rng = FreeBody(), np.random.default_rng(1)
    xs, us, reference = random_states(sim, T + 1), rng.normal(size=(T, 6)), random_states(sim, T + 1, seed=5)
    weight = rng.random((T + 1, 12))
    term = bind(Tracking(reference, weight, scale=0.5), sim, xs)
    expected = 0.5 * np.sum(weight * sim.difference(xs, reference) ** 2)
    np.testing.assert_allclose(term.value(xs, us), expected, rtol=1e-12)
    check_expansion(sim, term, xs, us, hessian=False)


def test_tracking_hessian_is_gauss_newton():
    sim, rng = FreeBody(), np.random.default_rng(2)
    xs = random_states(sim, T + 1)
    term = bind(Tracking(xs, rng.random(12)), sim, xs)  # no residual: Gauss-Newton is the whole Hessian
    check_expansion(sim, term, xs, np.zeros((T, 6)))


def test_effort():
    sim, rng = FreeBody(), np.random.default_rng(3)
    xs, us = random_states(sim, T + 1), rng.normal(size=(T, 6))
    term = bind(Effort(rng.random((T, 6)), reference=rng.normal(size=6)), sim, xs)
    np.testing.assert_allclose(term.value(xs, us), np.sum(term.weight * (us - term.reference) ** 2), rtol=1e-12)
    check_expansion(sim, term, xs, us)


def test_residual_by_differences():
    sim, rng = FreeBody(), np.random.default_rng(4)
    xs, us = random_states(sim, T + 1), rng.normal(size=(T, 6))
    term = bind(ResidualCost(height_times_force, 3, weight=[1.0, 2.0, 3.0], knots=range(T)), sim, xs)
    r = np.stack([xs[:T, 2] * us[:, 2], xs[:T, 0] ** 2, xs[:T, 3] * xs[:T, 5]], axis=1)
    np.testing.assert_allclose(term.value(xs, us), np.sum(r**2 * [1.0, 2.0, 3.0]), rtol=1e-12)
    check_expansion(sim, term, xs, us, hessian=False)


def test_residual_with_its_jacobian():
    sim, rng = DoubleIntegrator(), np.random.default_rng(5)
    xs, us = rng.normal(size=(T + 1, 2)), rng.normal(size=(T, 1))
    exact = bind(ResidualCost(speed, 1, jacobian=speed_jacobian), sim, xs)
    check_expansion(sim, exact, xs, us)
    check_expansion(sim, bind(ResidualCost(speed, 1), sim, xs), xs, us)


@pytest.mark.parametrize(
    "spec",
    [
        Goal([0.3, -0.2]),
        Goal([0.3, -0.2], components=[1], knots=[1, 3]),
        StateBounds([-0.3, -np.inf], [0.4, 0.1]),
        ControlBounds(-0.2, 0.5),
        ResidualConstraint(speed, 1),
        ResidualConstraint(speed, 1, equality=False),
    ],
    ids=lambda s: type(s).__name__,
)
def test_constraints_with_multipliers(spec):
    sim, rng = DoubleIntegrator(), np.random.default_rng(6)
    xs, us = rng.normal(size=(T + 1, 2)), rng.normal(size=(T, 1))
    term = bind(spec, sim, xs)
    term.weight *= 3.0
    term.slope[:] = term.mask * (np.abs(rng.normal(size=term.slope.shape)) if term.one_sided else 0.7)
    check_expansion(sim, term, xs, us)


def test_goal_of_an_attitude():
    sim = FreeBody()
    xs = random_states(sim, T + 1)
    target = xs[0].copy()
    target[3:7] = Rotation.from_rotvec([0.1, 0.2, 0.3]).as_quat(scalar_first=True)
    term = bind(Goal(target, components=[3, 4, 5]), sim, xs)
    term.slope[:] = 0.5 * term.mask
    check_expansion(sim, term, xs, np.zeros((T, 6)), hessian=False)
    expected = np.abs(sim.difference(xs[T], target)[3:6]).max()
    np.testing.assert_allclose(term.violation().max(), expected, rtol=1e-12)


def test_bounds_measure_only_the_excess():
    sim = DoubleIntegrator()
    xs, us = np.zeros((T + 1, 2)), np.zeros((T, 1))
    xs[2, 0], xs[3, 1] = 1.5, -4.0
    term = bind(StateBounds([-1.0, -np.inf], [1.0, 2.0]), sim, xs)
    term.update(xs, us)
    assert term.violation().max() == 0.5
    xs[2, 0] = 0.0
    assert term.value(xs, us) == 0.0


@pytest.mark.parametrize(
    "spec, message",
    [
        (Tracking(np.zeros(3), 1.0), r"Tracking\(reference=...\): expected shape .*, got \(3,\)"),
        (Tracking(np.zeros(2), [1.0, np.nan]), r"Tracking\(weight=...\): expected finite numbers, got nan at index"),
        (Tracking(np.zeros(2), -1.0), "no negative weight"),
        (Tracking(np.zeros(2), 1.0, knots=[9]), r"expected knots in \[-5, 5\), got \[9\]"),
        (Effort([1.0, 2.0]), r"Effort\(weight=...\)"),
        (Goal(np.zeros(2), components=[2]), r"expected components in \[0, 2\), got \[2\]"),
        (StateBounds(1.0, -1.0), "expected lower <= upper"),
        (
            StateBounds(np.inf, np.inf, components=[1]),
            r"StateBounds: lower: expected a number, or -inf for no bound, got inf",
        ),
        (StateBounds([-1.0, -np.inf], [1.0, -np.inf]), r"StateBounds: upper: expected a number, or inf for no bound"),
        (ControlBounds(np.inf, np.inf), r"ControlBounds: lower: expected a number"),
    ],
)
def test_bad_terms_name_the_call(spec, message):
    with pytest.raises(ValueError, match=message):
        spec.bind(DoubleIntegrator(), T, np.arange(2))


def test_a_quaternion_has_no_bounds():
    with pytest.raises(ValueError, match=r"3 \(dof 3\) belongs to a quaternion"):
        bind(StateBounds(-1.0, 1.0), FreeBody(), random_states(FreeBody(), 1))
