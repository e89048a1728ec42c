"""The slow reference on its own: its momenta derive from its Lagrangian, and it solves problems with known answers."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from naive import lagrangian as lag
from naive import rotation as rot
from naive import samples
from naive.equations import Step
from naive.maximal import jacobian, solve
from naive.scene import IMPACT, LINEAR, NONLINEAR, PlainScene, advance, poses


def simulate(scene: PlainScene, q, v, h: float, steps: int, kappa: float = 1e-6):
    """States after every step without inputs."""
    out = [(q, v)]
    for _ in range(steps):
        s = solve(scene, *out[-1], np.zeros(len(scene.inputs)), h, kappa)
        out.append((s.q, s.v))
    return out


def test_momenta_are_derivatives_of_the_discrete_energy(rng):
    h, J = 0.03, samples.free_body().bodies[0].inertia
    for _ in range(5):
        q1 = rot.exp(rng.normal(size=3))
        q2 = rot.mul(q1, rot.exp(rng.normal(size=3)))
        for function, sign, args in (
            (lag.leaving_momentum, -1.0, lambda d, a=q1, b=q2: (rot.mul(rot.exp(d), a), b)),
            (lag.arriving_momentum, 1.0, lambda d, a=q1, b=q2: (a, rot.mul(rot.exp(d), b))),
        ):
            energy = lambda d, args=args: lag.rotational_energy(J, *args(d), h)  # noqa: E731
            differences = [(energy(1e-6 * e) - energy(-1e-6 * e)) / 2e-6 for e in np.eye(3)]
            np.testing.assert_allclose(sign * function(J, q1, q2, h), differences, atol=1e-7)


def test_spring_impulse_is_derivative_of_the_discrete_potential(rng):
    scene, h = samples.spherical_chain(), 0.02
    q = np.concatenate(([0.3], rot.exp(rng.normal(size=3)), rng.normal(size=2)))
    v, w = rng.normal(size=(2, scene.nv))

    def action(dx):
        """Sum over both intervals, config 2 varied, its neighbours fixed."""
        node = advance(scene, q, dx, 1.0)
        return sum(interval(a, b) for a, b in ((q1, node), (node, q3)))

    def interval(a, b):
        joint = scene.joints[1]
        back = rot.conj(rot.exp(joint.rest))
        s = (rot.mul(back, a[1:5]) + rot.mul(back, b[1:5]))[1:] / 2.0
        slide = (a[5] + b[5]) / 2.0 - scene.joints[2].rest
        return 2.0 * h * joint.spring * (s @ s) + h / 2.0 * scene.joints[2].spring * slide**2

    q1, q3 = advance(scene, q, v, -h), advance(scene, q, w, h)
    differences = [-(action(1e-6 * e) - action(-1e-6 * e)) / 2e-6 for e in np.eye(scene.nv)]
    np.testing.assert_allclose(lag.spring_impulse(scene, q1, q, h * w, h), differences, atol=1e-7)


def test_complex_step_jacobian(rng):
    scene = samples.hopper()
    q = np.concatenate(([0.0, 0.0, 0.6], rot.exp(rng.normal(size=3)), [0.4]))
    v = rng.normal(size=7)
    step = Step(scene, q, v, np.zeros(3), 0.02)
    y = step.start(1e-2, v)
    for exact in (False, True):
        differences = [
            (step.residual(y + 1e-6 * e, 1e-2, exact) - step.residual(y - 1e-6 * e, 1e-2, exact)) / 2e-6
            for e in np.eye(len(y))
        ]
        np.testing.assert_allclose(jacobian(step, y, 1e-2, exact), np.transpose(differences), atol=1e-6)


@pytest.mark.slow
def test_free_body_against_ode_order_two():
    scene = samples.free_body()
    J, w0 = scene.bodies[0].inertia, np.array([2.0, 3.0, -2.0])

    def rates(_, y):
        return np.concatenate((0.5 * rot.mul(y[:4], np.r_[0.0, y[4:]]), np.linalg.solve(J, np.cross(J @ y[4:], y[4:]))))

    exact = solve_ivp(rates, (0.0, 1.0), np.r_[1.0, 0.0, 0.0, 0.0, w0], "DOP853", rtol=1e-12, atol=1e-12).y[:4, -1]
    errors = []
    for n in (40, 80, 160):
        q = np.r_[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
        v = lag.start(scene, q, np.r_[0.0, 0.0, 0.0, w0], 1.0 / n)
        errors.append(np.linalg.norm(rot.log(rot.mul(rot.conj(exact), simulate(scene, q, v, 1.0 / n, n)[-1][0][3:]))))
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert (abs(orders - 2.0) < 0.1).all(), (errors, orders)


@pytest.mark.slow
def test_pendulum_against_ode_order_two():
    scene, inertia = samples.pendulum(), 1.0 / 12.0 * 1.01 + 0.25

    def rates(_, y):
        return [y[1], -9.81 * 0.5 / inertia * np.sin(y[0])]

    exact = solve_ivp(rates, (0.0, 1.0), [1.0, 2.0], "DOP853", rtol=1e-12, atol=1e-12).y[0, -1]
    errors = []
    for n in (25, 50, 100):
        v = lag.start(scene, np.array([1.0]), np.array([2.0]), 1.0 / n)
        errors.append(abs(simulate(scene, np.array([1.0]), v, 1.0 / n, n)[-1][0][0] - exact))
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert (abs(orders - 2.0) < 0.1).all(), (errors, orders)


@pytest.mark.slow
def test_momentum_and_energy_of_a_floating_tree(rng):
    tree = samples.quadruped()
    scene = PlainScene(tree.bodies, [tree.joints[0]] + [j for j in tree.joints[1:]], gravity=np.zeros(3))
    soft = PlainScene(scene.bodies, scene.joints, inputs=tree.inputs, gravity=np.zeros(3))
    q = np.concatenate((rng.normal(size=3), rot.exp(rng.normal(size=3)), np.tile([0.1, 0.7, -1.4], 4)))
    v = rng.normal(size=18)
    before = lag.momentum(soft, q, v, 0.02)
    for _ in range(5):
        s = solve(soft, q, v, rng.normal(size=12), 0.02, 1e-6)
        q, v = s.q, s.v
    np.testing.assert_allclose(lag.momentum(soft, q, v, 0.02), before, atol=1e-11)


def test_joints_hold_to_machine_precision(rng):
    scene = samples.spherical_chain()
    q = np.concatenate(([0.3], rot.exp(rng.normal(size=3)), [0.2, 0.1]))
    s = solve(scene, q, rng.normal(size=6), rng.normal(size=6), 0.02, 1e-6)
    pos, quat = poses(scene, s.q)
    np.testing.assert_allclose(s.pos, pos, atol=1e-11)
    np.testing.assert_allclose(s.quat, quat, atol=1e-11)


@pytest.mark.sweep(3)
@pytest.mark.parametrize("kappa", [1e-2, 1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("law", [IMPACT, LINEAR, NONLINEAR])
def test_landing_obeys_the_contact_law(law, kappa):
    """gap gamma = kappa, and on the cone beta = -mu gamma v_t / (a + sqrt(a^2 + v_t^2)), a = gap/(2 mu)."""
    scene, h = samples.hopper(law), 0.05
    q = np.concatenate(([0.0, 0.0, 0.56], rot.exp(np.array([0.1, 0.2, 0.3])), [0.5]))
    s = solve(scene, q, np.array([1.0, 0.5, -3.0, 1.0, 2.0, 3.0, 0.5]), np.array([1.0, 2.0, 3.0]), h, kappa)
    gap, force = s.pos[1, 2] - 0.05, s.contact_impulse[0]
    np.testing.assert_allclose(gap * force[2], kappa, rtol=1e-8, atol=1e-15)
    assert 1.0 < force[2] < 4.0 and gap > 0.0
    if law == IMPACT:
        np.testing.assert_array_equal(force[:2], 0.0)
    if law == LINEAR:
        assert np.abs(force[:2]).sum() < 0.5 * force[2]
    if law == NONLINEAR:
        sine = rot.rotate(poses(scene, q)[1][1], rot.mul(rot.conj(poses(scene, q)[1][1]), s.quat[1])[1:])
        slip = (s.pos[1] - poses(scene, q)[0][1]) / h + np.cross(2.0 / h * sine, [0.0, 0.0, -0.05])
        a = gap / (2.0 * 0.5)
        expected = -0.5 * force[2] * slip[:2] / (a + np.sqrt(a * a + slip[:2] @ slip[:2]))
        np.testing.assert_allclose(force[:2], expected, rtol=1e-6)


def test_limits_hold():
    scene = samples.hopper()
    q = np.array([0.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, 0.21])
    s = solve(scene, q, np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -5.0]), np.zeros(3), 0.02, 1e-8)
    assert s.q[7] > 0.2 and s.limit_impulse[0] > 0.1
    np.testing.assert_allclose((s.q[7] - 0.2) * s.limit_impulse[0], 1e-8, rtol=1e-6)


@pytest.mark.slow
def test_energy_of_a_spring_is_kept():
    scene = samples.spherical_chain()
    joint = [
        type(j)(j.parent, j.trans_axes, j.nrot, j.axis, j.parent_point, j.child_point, j.offset, j.spring, 0.0, j.rest)
        for j in scene.joints
    ]
    scene = PlainScene(scene.bodies, joint)
    q = np.concatenate(([0.3], rot.exp(np.array([0.2, 0.1, -0.3])), [0.2, 0.1]))
    spread = []
    for h in (0.02, 0.01):
        v = lag.start(scene, q, np.ones(6), h)
        values = [lag.energy(scene, *state, h) for state in simulate(scene, q, v, h, round(0.4 / h))]
        spread.append(max(values) - min(values))
    assert 3.0 < spread[0] / spread[1] < 5.0, spread
