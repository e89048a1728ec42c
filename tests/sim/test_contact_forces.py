"""Forces of the ground for an acceleration: the laws of Newton and Euler, the cones, and the least of all such forces."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

import dojo_opt as dojo
from sim.simulator.contact_forces import _projected, _slope, balanced, least_forces
from support.pinocchio_robots import pinocchio_coordinates, pinocchio_robot


@pytest.fixture(scope="module")
def robot():
    return dojo.Simulator(dojo.models.quadruped(), time_step=0.01)


@pytest.fixture
def rng():
    return np.random.default_rng(3)


def motion(sim, rng, size):
    """Coordinates on the ground, velocities, and an acceleration."""
    q = sim.neutral()[: sim.nq]
    return q, 0.3 * rng.standard_normal(sim.nv), size * rng.standard_normal(sim.nv)


def inside_cones(x, friction):
    return friction**2 * x[::3] ** 2 - x[1::3] ** 2 - x[2::3] ** 2


@pytest.mark.parametrize("joints", [False, True])
def test_forces_obey_newton_and_euler(robot, rng, joints):
    """Momentum changes by the forces of the ground and gravity alone, however strong the joints are."""
    kin = dojo.Kinematics(robot)
    q, v, dv = motion(robot, rng, 0.5)
    found = kin.contact_forces(q, v, dv)
    if joints:  # given the joint forces, the same ground forces follow from all equations
        found = kin.contact_forces(q, v, dv, found.joint_forces)
    assert found.success and found.residual < 1e-8
    h = 1e-5
    ends = [kin.centroidal_momentum(kin.moved(q, s * h * v + 0.5 * h**2 * dv), v + s * h * dv) for s in (1.0, -1.0)]
    rate = (ends[0] - ends[1]) / (2.0 * h)
    mass = sum(body.mass for body in robot.mechanism.bodies)
    f = found.forces
    np.testing.assert_allclose(f.sum(axis=0) - (0.0, 0.0, 9.81 * mass), rate[:3], atol=1e-4)
    kinds = robot.mechanism.contacts
    at = [kin.pose(c.body, q)[0] + kin.pose(c.body, q)[1] @ np.asarray(c.point) for c in kinds]
    arm = np.array(at) - [[0.0, 0.0, c.radius] for c in kinds] - kin.center_of_mass(q)
    np.testing.assert_allclose(np.cross(arm, f).sum(axis=0), rate[3:], atol=1e-4)
    assert np.all(np.hypot(f[:, 0], f[:, 1]) <= np.array([c.friction for c in kinds]) * f[:, 2] + 1e-9)


def test_joint_forces_and_contact_forces_accelerate_a_robot_as_asked(robot, rng):
    """The simulator in the air, with the forces on its links and joints, has the acceleration."""
    kin = dojo.Kinematics(robot)
    q, v, dv = motion(robot, rng, 0.5)
    v *= 0.0
    found = kin.contact_forces(q, v, dv)
    mech = robot.mechanism
    bare = [replace(joint, damper=0.0, spring=0.0, limits=None) for joint in mech.joints]
    sim = dojo.Simulator(replace(mech, joints=bare, contacts=[], collisions=()), time_step=1e-5)
    wrenches = {}
    for contact, force in zip(mech.contacts, found.forces, strict=True):
        at, R = kin.pose(contact.body, q)
        arm = R @ np.asarray(contact.point) - (0.0, 0.0, contact.radius)
        wrenches[contact.body] = np.concatenate([force, np.cross(arm, force)])
    u = [found.joint_forces[mech.v_slice(i.joint).start + i.dof] for i in mech.inputs]
    end = sim.step(np.concatenate([q, v]), u, wrenches=wrenches).x
    np.testing.assert_allclose((end[sim.nq :] - v) / 1e-5, dv, atol=0.02 * np.abs(dv).max())


def test_inverse_dynamics_on_contacts_agree_with_pinocchio(robot, rng):
    """Its recursive algorithm of Newton and Euler, with our contact forces on its links, has our joint forces."""
    pin = pytest.importorskip("pinocchio")
    mech, kin = robot.mechanism, dojo.Kinematics(robot)
    model, ids = pinocchio_robot(mech)
    data = model.createData()
    for _ in range(5):
        q, v, dv = motion(robot, rng, 0.5)
        q = kin.moved(q, np.r_[np.zeros(6), 0.1 * rng.standard_normal(12)])
        found = kin.contact_forces(q, v, dv, contacts=[c.name for c in mech.contacts])
        assert found.success
        theirs = pinocchio_coordinates(mech, q)
        pin.forwardKinematics(model, data, theirs)
        wrenches = [pin.Force.Zero() for _ in range(model.njoints)]
        for contact, force in zip(mech.contacts, found.forces, strict=True):
            place = data.oMi[ids[contact.body]]
            own = mech.joints[mech.body_names.index(contact.body)]
            center = place.act(np.asarray(contact.point) - np.asarray(own.child_point))
            lowest = center - (0.0, 0.0, contact.radius)
            wrenches[ids[contact.body]] += place.actInv(pin.Force(force, np.cross(lowest, force)))
        tau = pin.rnea(model, data, theirs, v, dv, wrenches)
        armature = np.concatenate([np.asarray(joint.armature) for joint in mech.joints])
        np.testing.assert_allclose(found.joint_forces, tau + armature * dv, atol=1e-9 * np.abs(found.forces).max())


def test_loads_that_forces_can_balance_are_balanced(rng):
    """Also those of forces on the edges of the cones, where no other forces balance them."""
    for trial in range(60):
        A, mu = rng.standard_normal((rng.integers(1, 7), rng.integers(1, 9), 3)), rng.uniform(0.0, 1.0)
        friction = np.full(A.shape[1], mu)
        inside = _projected(rng.standard_normal(friction.size * 3), friction)
        if trial % 2:
            side = np.maximum(np.hypot(inside[:, 1], inside[:, 2]), 1e-300)
            inside[:, 1:] *= (mu * inside[:, 0] / side)[:, None]
        load = np.einsum("nka,ka->n", A, inside)
        assert balanced(least_forces(A, load, friction)[1], load)


def test_forces_that_miss_the_load_miss_it_least(rng):
    """A^T (A f - r) is in the dual cone and orthogonal to f, the conditions of the nearest point of a convex cone."""
    for _ in range(10):
        A, mu = rng.standard_normal((6, 2, 3)), rng.uniform(0.2, 0.8, 2)
        load = rng.standard_normal(6)
        f, residual = least_forces(A, load, mu)
        assert not balanced(residual, load)
        slope = np.einsum("nka,n->ka", A, np.einsum("nka,ka->n", A, f) - load)
        assert abs(np.sum(slope * f)) < 1e-12
        assert np.all(slope[:, 0] > mu * np.hypot(slope[:, 1], slope[:, 2]) - 1e-4)


def test_forces_are_the_least(rng):
    """Beside SciPy's SLSQP, which may stop at the tip of a cone, and other forces that balance the load.

    f is the point of a convex set nearest to zero if f . (g - f) >= 0 for every g in the set.
    """
    for _ in range(5):
        A, mu = rng.standard_normal((4, 5, 3)), rng.uniform(0.2, 0.8, 5)
        inside = _projected(rng.standard_normal(15), mu)
        load = np.einsum("nka,ka->n", A, inside)
        f, residual = least_forces(A, load, mu)
        assert residual < 1e-8
        bounds = [{"type": "ineq", "fun": inside_cones, "args": (mu,)}, {"type": "ineq", "fun": lambda x: x[::3]}]
        balance = {"type": "eq", "fun": lambda x, A=A, load=load: A.reshape(4, 15) @ x - load}
        other = minimize(
            lambda x: x @ x, inside.ravel(), jac=lambda x: 2 * x, constraints=[*bounds, balance], tol=1e-12
        )
        assert np.abs(f - _projected(f.ravel(), mu)).max() < 1e-12
        for g in (other.x, inside.ravel(), 0.5 * (other.x + inside.ravel())):
            assert f.ravel() @ (g - f.ravel()) > -1e-6
        assert np.sum(f**2) < 0.999 * np.sum(inside**2)


def test_slopes_of_the_projection(rng):
    mu = np.full(40, 0.6)
    at, move = rng.standard_normal((40, 3)), rng.standard_normal((40, 3))
    h = 1e-6
    central = (_projected((at + h * move).ravel(), mu) - _projected((at - h * move).ravel(), mu)) / (2 * h)
    np.testing.assert_allclose(np.einsum("kab,kb->ka", _slope(at, mu), move), central, atol=1e-7)


def test_what_no_force_can_do_is_told(robot, rng):
    """Nothing pulls a robot down, and feet in the air carry nothing."""
    kin = dojo.Kinematics(robot)
    q, v, dv = motion(robot, rng, 0.0)
    dv[2] = -20.0
    high = q.copy()
    high[2] += 0.1
    found = kin.contact_forces(np.stack([q, high, q]), v * 0.0, np.stack([dv, 0.0 * dv, 0.0 * dv]))
    np.testing.assert_array_equal(found.success, [False, False, True])
    assert found.residual[0] > 10.0 and np.all(found.forces[1] == 0.0)
    with pytest.raises(ValueError, match="hand"):
        kin.contact_forces(q, v, dv, contacts=["hand"])
