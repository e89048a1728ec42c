"""Dry friction of joints: it holds, it brakes, it never gives energy, and its derivatives match the motion."""

from dataclasses import replace

import numpy as np
import pytest

import dojo_opt as dojo
from support.parameter_errors import error
from support.scenes import pendulum, slider

FRICTION = 3.0  # [N]


@pytest.fixture(scope="module")
def rail():
    """A mass of 2 kg that is pushed along a rail."""
    return dojo.Simulator(slider(mass=2.0, friction=FRICTION), time_step=0.01)


@pytest.fixture(scope="module")
def arm():
    """Two rods on joints with springs, dampers, limits and dry friction."""
    mech = pendulum(2, spring=4.0, damper=0.05, friction=0.7, limits=(-1.5, 1.5))
    return dojo.Simulator(mech, time_step=0.01, kappa=1e-6)


@pytest.fixture(scope="module")
def quadruped():
    """A robot held by friction of its joints alone."""
    mech = dojo.models.quadruped(damper=0.1)
    joints = [mech.joints[0], *(replace(joint, friction=15.0) for joint in mech.joints[1:])]
    return dojo.Simulator(replace(mech, joints=joints), time_step=0.01)


def test_it_holds_up_to_its_bound_and_brakes_with_it(rail):
    """Against the closed form: no motion below the bound; a sliding mass stops after v^2 m / (2 f)."""
    held = rail.rollout(np.zeros(2), np.full((1000, 1), 0.9 * FRICTION))
    creep = rail.kappa / (rail.time_step * FRICTION) * (1.0 / 0.1 - 1.0 / 1.9)  # a step, on the central path
    assert held.success and held.x[-1, 0] == pytest.approx(1000 * creep, rel=0.01) and held.x[-1, 0] < 1e-4
    pushed = rail.rollout(np.zeros(2), np.full((100, 1), FRICTION + 2.0))
    assert pushed.x[-1, 1] == pytest.approx(1.0, rel=1e-3)
    slid = rail.rollout(np.array([0.0, 1.5]), np.zeros((150, 1)))
    expected = np.maximum(1.5 - FRICTION / 2.0 * slid.time, 0.0)
    np.testing.assert_allclose(slid.x[:, 1], expected, atol=3e-4)
    assert slid.x[-1, 0] == pytest.approx(1.5**2 * 2.0 / (2.0 * FRICTION), abs=0.02)
    np.testing.assert_allclose(slid.x[-1, 1], 0.0, atol=1e-6)


def test_energy_never_grows_and_the_arm_comes_to_rest(arm):
    rough = replace(arm.mechanism, joints=[replace(j, friction=5.0) for j in arm.mechanism.joints])
    arm = arm.replace(mechanism=rough, kappa=1e-10)
    motion = arm.rollout(np.array([1.2, -0.9, 2.0, -1.0]), np.zeros((400, 2)))
    assert motion.success, motion.message
    energy = arm.energy(motion.x)
    drop = np.diff(energy[2:])
    assert drop.max() < 3e-6 * np.ptp(energy), drop.max()  # energies at nodes match the motion to second order
    late = motion.x[-100:]
    assert np.abs(late[:, 2:]).max() < 1e-4 and np.abs(late[:, :2]).max() > 0.02  # it rests away from the equilibrium


@pytest.mark.parametrize("state", [(0.4, -0.3, 0.0, 0.0), (0.4, -0.3, 0.02, -0.01), (0.9, 0.5, 3.0, -2.0)])
def test_derivatives_agree_with_differences(arm, state):
    """Of states and inputs, and by the time step; sticking, nearly sticking and sliding."""
    x, u = np.array(state), np.array([0.3, -0.2])
    linear = arm.linearize(x, u)
    e = 1e-6
    for k in range(4):
        d = e * np.eye(4)[k]
        slope = (arm.step(x + d, u).x - arm.step(x - d, u).x) / (2.0 * e)
        np.testing.assert_allclose(linear.A[:, k], slope, atol=2e-3 * max(1.0, np.abs(slope).max()))
    for k in range(2):
        d = e * np.eye(2)[k]
        slope = (arm.step(x, u + d).x - arm.step(x, u - d).x) / (2.0 * e)
        np.testing.assert_allclose(linear.B[:, k], slope, atol=2e-3 * max(0.01, np.abs(slope).max()))


@pytest.mark.parametrize("state", [(0.4, -0.3, 0.0, 0.0), (0.9, 0.5, 3.0, -2.0)])
def test_derivatives_by_parameters_agree_with_differences(arm, state):
    case = (arm, np.array(state), np.array([0.3, -0.2]))
    assert max(error(case, kind) for kind in ("time_step", "mass", "damper")) < 1e-5


def test_a_robot_with_dry_joints_lands(quadruped):
    """Contacts, limits and dry friction in one interior point: it stays up on knees that friction holds."""
    x = quadruped.neutral()
    x[2] += 0.05
    motion = quadruped.rollout(x, np.zeros((100, quadruped.nu)))
    assert motion.success, motion.message
    assert motion.x[-1, 2] > 0.8 * x[2] and np.abs(motion.x[-1, quadruped.nq :]).max() < 0.01


def test_joints_without_dry_friction_refuse_it():
    with pytest.raises(ValueError, match=">= 0"):
        dojo.Joint("revolute", None, "b", friction=-1.0)
    with pytest.raises(ValueError, match="quaternion"):
        dojo.Joint("spherical", None, "b", friction=1.0)
    with pytest.raises(ValueError, match="dry friction"):
        dojo.Simulator(slider(friction=1.0), time_step=0.01, order=4)
    robot = replace(slider(friction=0.0))
    assert not robot.joints[0].friction[0]
