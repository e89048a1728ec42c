"""`tasks.humanoid_mpc`: a cadence and a velocity, and no footholds."""

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.gaits.feet import Feet
from dojo_opt.gaits.legs import Legs
from dojo_opt.tasks.walking import SteppingPose


@pytest.fixture(scope="module")
def legs():
    return Legs(dojo.models.atlas())


def test_a_bent_leg_lifts_its_foot_and_keeps_it_level(legs):
    """Below the hip: Atlas' thigh and shank are nearly equal, so that the foot hardly moves forward."""
    sim = legs.simulator(0.01, 1e-6)
    x, bends = sim.neutral(), legs.bends()
    assert bends.shape == (2, sim.nq)
    for k, row in enumerate(bends):
        bent = x.copy()
        bent[: sim.nq] += 0.4 * row
        moved = Feet(sim).positions(bent) - Feet(sim).positions(x)
        own, other = moved[4 * k : 4 * k + 4], moved[4 - 4 * k : 8 - 4 * k]
        assert not other.any()
        assert own[:, 2].min() > 0.1
        assert np.ptp(own[:, 2]) < 1e-9  # level
        assert np.abs(own[:, :2]).max() < 0.05


def test_a_march_moves_on_along_the_horizon_and_bends_its_legs_in_turn(legs):
    sim = legs.simulator(0.01, 1e-6)
    pose, bends = sim.neutral(), np.pad(legs.bends(), ((0, 0), (0, sim.nv)))
    march = SteppingPose(pose, (0.4, 0.0, 0.5), 0.1, bends, (1.0, 0.4, 0.6))
    march.anchor(0.0, pose)
    rows = march([0.0, 0.2, 0.45, 0.7])
    knees = [sim.mechanism.q_slice(f"{side}_leg_kny").start for side in "lr"]
    np.testing.assert_allclose(rows[:, knees] - pose[knees], [[0, 0], [1.2, 0], [0, 0], [0, 1.2]], atol=1e-12)
    np.testing.assert_allclose(2.0 * np.arctan2(rows[:, 6], rows[:, 3]), [0.0, 0.1, 0.225, 0.35])
    np.testing.assert_allclose(np.hypot(rows[:, sim.nq], rows[:, sim.nq + 1]), 0.4)
    np.testing.assert_allclose(rows[0, :2], pose[:2])
    assert rows[3, 0] - pose[0] == pytest.approx(0.7 * 0.4 * np.cos(0.35))
    march.anchor(10.0, pose)  # a robot that does not move holds it back
    assert np.hypot(*(march([10.0])[0, :2] - pose[:2])) == pytest.approx(0.1)


def test_a_robot_on_four_feet_is_refused():
    with pytest.raises(ValueError, match="two feet"):
        dojo.tasks.humanoid_mpc(robot=dojo.models.quadruped())
    with pytest.raises(ValueError, match="velocity"):
        dojo.tasks.humanoid_mpc((0.3, 0.0))


@pytest.mark.slow
def test_atlas_walks_and_catches_itself():
    """Pushed by 30 N s, on slippery ground: it is 1.1 m on after 3 s, and both feet have left the ground."""
    mpc = dojo.tasks.humanoid_mpc((0.4, 0.0, 0.0))
    push = dojo.Push(1.0, (0.0, 30.0, 0.0), body="utorso")
    loop = dojo.closed_loop(mpc, dojo.tasks.plant(mpc, 2e-3, pushes=[push], friction=0.6), 3.0)
    assert loop.survived, loop.message
    assert loop.x[-1, 0] - loop.x[0, 0] > 0.8
    gap = loop.contacts.gap
    assert gap[:, :4].min(axis=1).max() > 0.01 and gap[:, 4:].min(axis=1).max() > 0.01
    assert not any(np.abs(tick.cost) > 1e6 for tick in loop.log)
