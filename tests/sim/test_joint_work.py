"""The work of joints in a step: that of their reactions, of third order in the time step."""

import numpy as np
import pytest
from naive import rotation as rot
from scenes import chain, free_body, order, pendulum, random_state

import dojo_opt as dojo
from sim.bind import bind_step
from sim.joints.work import joint_work
from sim.layout import model_view, work_view
from solvers.jit import local_kernel


@local_kernel
def of_the_last_step(model_at, work_at, h, v):
    """What the last step of this thread left."""
    return joint_work(model_view(model_at), work_view(work_at), h, v)


def work_in_step(sim, x):
    """`joint_work` of the step from x [J], and the state after it."""
    r = sim.step(x, throw=True)
    return of_the_last_step(*sim._calls.tables(bind_step), sim.time_step, np.array(x[sim.nq :])), r.x


def mean_motion(sim, x, after):
    """Mean velocities of the bodies over both intervals, v (nbody, 3) and omega (nbody, 3), and where they are."""
    h = sim.time_step
    z1 = sim.maximal(sim.integrate(x, np.r_[-h * x[sim.nq :], np.zeros(sim.nv)]))
    z2, z3 = sim.maximal(x), sim.maximal(after)
    turns = [rot.mul(b[:, 6:10], rot.conj(a[:, 6:10])) for a, b in ((z1, z2), (z2, z3))]
    omega = sum(np.sign(t[:, :1]) * t[:, 1:] for t in turns) / h
    return (z3[:, :3] - z1[:, :3]) / (2.0 * h), omega, z2[:, :3]


@pytest.mark.parametrize("kind", ["revolute", "prismatic", "spherical", "orbital"])
def test_is_that_of_the_reactions(kind, rng):
    """Force times relative velocity where it acts, and torque times relative angular velocity, joint by joint."""
    mech = chain(kind, 3)
    sim = dojo.Simulator(mech, time_step=0.1, tolerance=1e-12)
    for _ in range(5):
        x = random_state(sim, rng, speed=3.0)
        ours, after = work_in_step(sim, x)
        reactions = sim.reactions(x)
        v, omega, pos = mean_motion(sim, x, after)
        parts = []
        for k in range(1, 4):  # the first joint is free
            child = v[k] + np.cross(omega[k], reactions.point[k] - pos[k])
            parent = v[k - 1] + np.cross(omega[k - 1], reactions.point[k] - pos[k - 1])
            parts.append(reactions.force[k] @ (child - parent) + reactions.torque[k] @ (omega[k] - omega[k - 1]))
        expected = sim.time_step * np.sum(parts)
        assert abs(expected) > 1e-5
        assert abs(ours - expected) < 1e-9 * (1.0 + np.abs(parts).sum()), (ours, expected)


def test_of_springs_dampers_and_armatures_it_is_none_of_it():
    """Of third order in a step, where the whole torque of a hinge does work of first order."""
    mech, errors = pendulum(2, spring=20.0, damper=0.5, armature=0.1), []
    for h in (0.02, 0.01, 0.005):
        sim = dojo.Simulator(mech, time_step=h, tolerance=1e-12)
        errors.append(abs(work_in_step(sim, sim.start(np.array([1.0, 0.5]), np.array([2.0, -3.0])))[0]))
    assert np.all(order(errors) > 2.7), (errors, order(errors))


def test_a_body_without_joints_tumbles_without_it():
    sim = dojo.Simulator(free_body(), time_step=0.1, tolerance=1e-12)
    x = sim.neutral()
    x[sim.nq + 3 :] = (9.0, -8.0, 7.0)
    assert abs(work_in_step(sim, x)[0]) < 1e-9
