"""Ellipsoids on a plane, against the equations of a body that rolls without slipping, and against statics."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import dojo_opt as dojo
from sim.mechanism.shapes import rotation_matrix

Array = np.ndarray
AXES = np.array([0.3, 0.2, 0.15])
MASS, G = 2.0, 9.81
SHAPE = dojo.Ellipsoid(*AXES)
INERTIA = MASS / 5 * (np.sum(AXES**2) - AXES**2)


def scene(h: float, joint: dojo.Joint | None = None, turn: Array | None = None, **options: float) -> dojo.Simulator:
    """The ellipsoid above a plane, which may be turned with gravity."""
    body = dojo.Body("e", MASS, shape=SHAPE)
    quat = (1.0, 0.0, 0.0, 0.0) if turn is None else turn
    ground = dojo.HalfSpace(orientation=quat)
    mech = dojo.Mechanism(
        [body],
        [joint or dojo.Joint("floating", None, "e")],
        collisions=[dojo.Collision("e", shape_b=ground, friction=options.pop("friction", 10.0), **options)],
        gravity=rotation_matrix(quat) @ (0.0, 0.0, -G),
    )
    return dojo.Simulator(mech, time_step=h, kappa=1e-9, tolerance=1e-10)


def lowest(R: Array) -> Array:
    """The point of the ellipsoid that is lowest, from its centre, world axes."""
    m = AXES * R[2]
    return -R @ (AXES * m) / np.linalg.norm(m)


def quat_product(a: Array, b: Array) -> Array:
    w, v = a[0] * b[0] - a[1:] @ b[1:], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.r_[w, v]


def rates(t: float, y: Array) -> Array:
    """y = (centre, quaternion, omega in world axes) of rolling: v = -omega x rho.

    m dv = f - m g z,   d(J omega) = rho x f,   dv = -d(omega) x rho - omega x d(rho)
    """
    q, w = y[3:7] / np.linalg.norm(y[3:7]), y[7:]
    R = rotation_matrix(q)
    rho = lowest(R)
    s = np.linalg.norm(AXES * R[2])
    dz = -np.cross(R.T @ w, R[2])  # of z in body axes
    D2 = AXES**2
    body = -(D2 * dz / s - D2 * R[2] * (R[2] * D2 @ dz) / s**3)
    drho = np.cross(w, rho) + R @ body
    J = (R * INERTIA) @ R.T
    bias = -np.cross(w, drho) + np.array([0.0, 0.0, G])  # f = m (dv + g z)
    # J dw + w x J w = rho x m (-dw x rho + bias)
    A = J + MASS * np.array([np.cross(rho, np.cross(e, rho)) for e in np.eye(3)]).T
    dw = np.linalg.solve(A, MASS * np.cross(rho, bias) - np.cross(w, J @ w))
    return np.r_[-np.cross(w, rho), 0.5 * quat_product(np.r_[0.0, w], q), dw]


def rolled(h: float, q: Array, w: Array, until: float) -> Array:
    """Centre and quaternion at the end."""
    sim = scene(h)
    R = rotation_matrix(q)
    rho = lowest(R)
    x = np.concatenate([[0.0, 0.0, -rho[2]], q, -np.cross(w, rho), R.T @ w])
    return sim.rollout(x, steps=round(until / h), throw=True).x[-1, :7]


def test_rolling_agrees_with_the_ode() -> None:
    """After a second the error is of the order of the time step."""
    q = np.array([0.9, 0.3, -0.2, 0.1])
    q /= np.linalg.norm(q)
    w = np.array([0.5, 2.0, 0.3])
    y = np.concatenate([[0.0, 0.0, -lowest(rotation_matrix(q))[2]], q, w])
    end = solve_ivp(rates, (0.0, 1.0), y, rtol=1e-11, atol=1e-12).y[:7, -1]
    found = [rolled(h, q, w, 1.0) for h in (4e-3, 2e-3, 1e-3)]
    errors = [np.abs(x - end).max() for x in found]
    assert np.linalg.norm(end[:3] - y[:3]) > 0.1
    assert errors[2] < 0.6 * errors[1] < 0.36 * errors[0] < 0.03
    assert np.abs(2.0 * found[2] - found[1] - end).max() < 1e-3  # without the error of first order


def test_a_turned_plane_is_a_turned_world() -> None:
    turn = np.array([0.8, 0.4, -0.2, 0.4])
    turn /= np.linalg.norm(turn)
    R = rotation_matrix(turn)
    level, tilted = scene(0.01, friction=0.4, restitution=0.3), scene(0.01, turn=turn, friction=0.4, restitution=0.3)
    q = np.array([0.6, 0.0, 0.8, 0.0])
    x = np.concatenate([[0.0, 0.0, 0.5], q, [1.0, 0.5, -1.0], [3.0, -1.0, 2.0]])
    z = np.concatenate([R @ x[:3], quat_product(turn, q), R @ x[7:10], x[10:]])
    a, b = level.rollout(x, steps=100, throw=True).x, tilted.rollout(z, steps=100, throw=True).x
    np.testing.assert_allclose(a[:, :3] @ R.T, b[:, :3], atol=1e-6)
    np.testing.assert_allclose(a[:, 10:], b[:, 10:], atol=1e-4)


@pytest.mark.parametrize("seed", range(4))
def test_it_comes_to_rest_on_its_shortest_axis(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sim = scene(0.02, dojo.Joint("floating", None, "e", damper=0.05), friction=0.5)
    q = rng.normal(size=4)
    x = np.concatenate([[0.0, 0.0, 0.5], q / np.linalg.norm(q), rng.normal(size=6)])
    run = sim.rollout(x, steps=3000, throw=True)
    R = rotation_matrix(run.x[-1, 3:7])
    assert abs(R[2, 2]) > 1.0 - 1e-6
    assert run.x[-1, 2] == pytest.approx(AXES[2], abs=1e-6)
    assert np.abs(run.x[-1, 7:]).max() < 1e-3
    normal = np.linalg.norm(run.contacts.impulse[-1, 0]) / 0.02
    assert normal == pytest.approx(MASS * G, rel=1e-3)


def test_on_terrain_it_is_refused_and_a_plane_is_not() -> None:
    mech = scene(0.01).mechanism
    hills = dojo.Terrain(np.zeros((4, 4)))
    with pytest.raises(
        ValueError, match="body 'e' has the shape Ellipsoid; expected a Sphere, Capsule, Box or Polytope"
    ):
        mech.with_terrain(hills, bodies=["e"])
    tied = dojo.Mechanism(mech.bodies, mech.joints, collisions=[dojo.Collision("e", shape_b=dojo.String(1.0))])
    with pytest.raises(ValueError, match="there is no collision of Ellipsoid and String"):
        dojo.Simulator(tied, time_step=0.01)
