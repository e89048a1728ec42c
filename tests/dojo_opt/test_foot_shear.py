"""Forces between standing feet, which show their friction."""

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.mpc.foot_shear import FootShear
from dojo_opt.mpc.ground_estimate import Ground
from sim.simulator.adjustable_simulator import AdjustableSimulator
from support.scenes import ball

FRICTION = ("mass:trunk", "friction:*")


@pytest.fixture(scope="module")
def mpc():
    return dojo.tasks.quadruped_mpc(adapt=dojo.Adaptation(FRICTION, shear=1.3))


def test_points_move_as_their_jacobian_says(mpc):
    sim, ground = mpc.sim, Ground(mpc.sim)
    dx = np.zeros(sim.ndx)
    dx[: sim.nv] = 0.2 * np.sin(np.arange(sim.nv))
    x = sim.integrate(mpc.start, dx)
    found = ground.point_jacobian(x)
    radius = np.array([contact.radius for contact in sim.mechanism.contacts])
    assert radius.any()
    for k in range(sim.nv):
        step = 1e-6 * (np.arange(sim.ndx) == k)
        moved = [sim.maximal(sim.integrate(x, sign * step)) for sign in (1.0, -1.0)]
        turned = [ground.points(sim.integrate(x, sign * step)) for sign in (1.0, -1.0)]
        wanted = (turned[0] - turned[1]) / 2e-6
        # a lowest point stays the lowest as its ball turns; the point of the body does not
        spin = np.array([_spin(*(z[ground._body[c]] for z in moved)) for c in range(len(radius))])
        wanted -= np.cross(spin, radius[:, None] * ground._normal)
        assert found[..., k] == pytest.approx(wanted, abs=1e-7)


def _spin(after, before):
    """Angular velocity in world axes between two poses 2e-6 apart."""
    (w, *v), (a, *b) = after[6:10], before[6:10]
    return 2.0 * (a * np.array(v) - w * np.array(b) - np.cross(v, b)) / 2e-6


def test_forces_balance_and_grow_until_the_friction_is_known(mpc):
    shear, ground, x = FootShear(mpc.sim, 1.3), Ground(mpc.sim), mpc.start
    ground.height[:] += ground.gaps(ground.points(x))
    points, J = ground.points(x), ground.point_jacobian(x)
    times = np.arange(0.0, 0.5, 0.01)
    found = [shear(now, x, ground, False) for now in times]
    assert not np.any(found[:15])
    share = 1.3 * (times[-1] - 0.15)
    forces = shear._forces(points)
    mass = sum(body.mass for body in mpc.nominal.mechanism.bodies)
    assert np.linalg.norm(forces, axis=1).max() == pytest.approx(share * mass * 9.81 / len(points), rel=1e-6)
    assert forces.sum(axis=0) == pytest.approx(0.0, abs=1e-9)
    assert np.cross(points, forces).sum(axis=0) == pytest.approx(0.0, abs=1e-9)
    assert found[-1] == pytest.approx(np.einsum("cxj,cx->j", J, forces)[-mpc.sim.nu :], abs=1e-9)
    assert not np.any(shear(0.5, x, ground, True))
    assert not np.any(shear(0.51, x, ground, False))  # for good
    shear.forget()
    shear(0.0, x, ground, False)
    assert np.any(shear(0.2, x, ground, False))


def test_forces_pause_when_a_foot_slides_far(mpc):
    shear, ground, x = FootShear(mpc.sim, 1.3), Ground(mpc.sim), mpc.start.copy()
    ground.height[:] += ground.gaps(ground.points(x))
    for now in np.arange(0.0, 0.4, 0.01):
        assert np.any(shear(now, x, ground, False)) == (now > 0.155)
    before = shear._share
    x[0] += 0.03
    assert not np.any(shear(0.4, x, ground, False))
    assert shear._share == pytest.approx(0.85 * before)
    assert not np.any(shear(0.44, x, ground, False))
    assert np.any(shear(0.46, x, ground, False))


@pytest.mark.slow
def test_a_trotting_quadruped_finds_the_friction_of_its_feet():
    known = {}
    for shear in (0.0, 1.3):
        mpc = dojo.tasks.quadruped_mpc(adapt=dojo.Adaptation(FRICTION, noise=(1e-5, 1e-4), shear=shear))
        loop = dojo.closed_loop(mpc, dojo.tasks.plant(mpc, 2e-3, payload=5.2, friction=0.79), 1.0)
        assert loop.survived, loop.message
        known[shear] = mpc.estimator.knows_friction
    assert known == {0.0: False, 1.3: True}
    assert mpc.estimator.values["friction:*"] == pytest.approx(0.79, rel=0.05)
    low, high = mpc.estimator.bounds["friction:*"]
    assert low < 0.79 < high


def test_shear_needs_a_friction_and_driven_joints():
    with pytest.raises(ValueError, match="none among the parameters"):
        dojo.tasks.quadruped_mpc(adapt=dojo.Adaptation(("mass:trunk",), shear=1.0))
    with pytest.raises(ValueError, match=r"shear=\.\.\.\): every input has to drive a joint"):
        FootShear(AdjustableSimulator.like(dojo.Simulator(ball(), time_step=0.01)), 1.0)
    with pytest.raises(ValueError, match="shear"):
        dojo.Adaptation(FRICTION, shear=-1.0)
