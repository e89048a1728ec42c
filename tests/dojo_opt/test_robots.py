"""Problems of any robot: feet, stance and weights are found; plans hold when they are replayed with shorter steps."""

from dataclasses import replace

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.gaits.feet import Feet
from dojo_opt.gaits.footfall import Footfall
from dojo_opt.gaits.legs import Legs
from dojo_opt.gaits.references import _TROT, _offsets
from sim.mechanism.contact import Contact


@pytest.fixture(scope="module")
def straight():
    """The quadruped as a file might have it: on straight legs, with contacts all over, and the feet among them."""
    mech = dojo.models.quadruped(damper=0.0)
    extra = [Contact(name, (0.0, 0.0, 0.05), name=f"{name}_point") for name in mech.body_names]
    return replace(mech, contacts=[*mech.contacts, *extra], neutral=None)


def test_a_robot_stands_on_its_feet_with_its_knees_to_the_back(straight):
    legs = Legs(straight)
    assert sorted(legs.feet) == ["FL_foot", "FR_foot", "RL_foot", "RR_foot"]
    sim = legs.simulator(0.01, 1e-6)
    feet, kin, x = Feet(sim), dojo.Kinematics(sim), sim.neutral()
    np.testing.assert_allclose(feet.gaps(x), 0.0, atol=1e-5)
    for leg, at in zip(("FR", "FL", "RR", "RL"), feet.positions(x), strict=True):
        joints = {joint.child: joint for joint in sim.mechanism.joints}
        hip, knee = (
            kin.pose(f"{leg}_{part}", x[: sim.nq])[0]
            + kin.pose(f"{leg}_{part}", x[: sim.nq])[1] @ np.asarray(joints[f"{leg}_{part}"].child_point)
            for part in ("thigh", "calf")
        )
        assert abs(hip[0] - at[0]) < 1e-3 and knee[0] < hip[0] - 0.05
    assert (
        legs.size == pytest.approx(legs.height / 0.29) and min(np.min(j.damper) for j in sim.mechanism.joints[1:]) > 0.3
    )


def test_mirrored_legs_bend_to_their_own_sides(straight):
    """As those of ANYmal, whose hind shanks bend to the front where all joints are zero; they used to go to the back."""
    start = np.array(straight.neutral)
    for leg in ("RR", "RL"):
        start[straight.q_slice(f"{leg}_calf")] = 0.3
    start[straight.q_slice("FR_calf")] = start[straight.q_slice("FL_calf")] = -0.3
    joints = [replace(joint, limits=None) for joint in straight.joints]
    found = Legs(replace(straight, joints=joints, neutral=start)).mechanism
    q = np.array(found.neutral)
    front, hind = ([float(q[found.q_slice(f"{leg}_{part}")][0]) for part in ("thigh", "calf")] for leg in ("FL", "RL"))
    assert front[0] > 0.2 and front[1] < -0.5  # a positive thigh moves its knee back
    assert hind[0] < -0.2 and hind[1] > 0.5


def test_a_foot_of_a_round_mesh_is_its_ball(straight):
    """Its hull has corners alone: a point in the middle of the lowest ones lies inside the foot, or beside it."""
    rng, radius = np.random.default_rng(0), 0.022
    shell = rng.normal(size=(60, 3))
    shell *= radius / np.linalg.norm(shell, axis=1, keepdims=True)
    block = np.array([(x, y, z) for x in (-0.02, 0.02) for y in (-0.02, 0.02) for z in (-0.006, 0.006)])

    def on(corners):
        feet = [c for c in straight.contacts if c.name.endswith("_foot")]
        spread = [
            replace(c, point=np.asarray(c.point) + at, radius=0.0, name=f"{c.body}.{k}")
            for c in feet
            for k, at in enumerate(corners)
        ]
        return feet, Legs(replace(straight, contacts=spread)).mechanism.contacts

    feet, found = on(shell)
    for foot, ball in zip(feet, found, strict=True):
        assert ball.radius == pytest.approx(radius, rel=1e-6)
        np.testing.assert_allclose(ball.point, foot.point, atol=1e-9)
    assert all(contact.radius == 0.0 for contact in on(block)[1])  # corners of no ball


def test_a_robot_on_its_back_is_refused(straight):
    q = np.array(straight.neutral)
    q[3:7] = 0.0, 1.0, 0.0, 0.0
    with pytest.raises(ValueError, match=r"problems\.stand_up\(robot\): the base .* not upright"):
        dojo.problems.stand_up(replace(straight, neutral=q))


@pytest.mark.parametrize("gravity", [(0.0, 0.0, 0.0), (0.0, 0.0, 9.81), (9.81, 0.0, 0.0)])
def test_a_robot_that_nothing_presses_onto_its_feet_is_refused(straight, gravity):
    with pytest.raises(ValueError, match=r"\(robot\): expected gravity that presses 'quadruped' onto its feet"):
        dojo.problems.trot(replace(straight, gravity=gravity))


def test_a_robot_stands_up_and_the_plan_holds_at_a_fifth_of_the_step(straight):
    problem = dojo.problems.stand_up(straight)
    plan = dojo.ilqr(problem)
    assert plan.success and plan.nit < 30, plan.message
    assert plan.x[-1, 2] - plan.x[0, 2] > 0.1
    shot = plan.replay(time_step=plan.time_step / 5)
    assert shot.success and np.abs(shot.x[-1, :3] - plan.x[-1, :3]).max() < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("task", ["trot", "jump"])
def test_a_robot_trots_and_jumps(straight, task):
    plan = dojo.ilqr(getattr(dojo.problems, task)(straight))
    assert plan.success, plan.message
    assert (1.0 - 2.0 * (plan.x[:, 4] ** 2 + plan.x[:, 5] ** 2)).min() > 0.9
    assert plan.x[-1, 0] - plan.x[0, 0] > 0.1
    shot = plan.replay(time_step=plan.time_step / 5)
    assert shot.success and np.abs(shot.x[-1, :3] - plan.x[-1, :3]).max() < 0.01


@pytest.mark.slow
def test_weak_joints_jump_as_high_as_they_can(straight):
    """Twice and four times the torque that carries the robot; a height that the user gives is not changed."""
    legs = Legs(straight)
    hold = np.abs(dojo.equilibrium(legs.simulator(0.01, 1e-6))[1]).max()

    def rise(strong, **settings):
        inputs = [replace(i, limits=(-strong * hold, strong * hold)) for i in straight.inputs]
        path = dojo.problems.jump(replace(straight, inputs=inputs), **settings).specs[0][0].reference
        return path[:, 2].max() - path[0, 2]

    assert 0.02 < rise(2.0) < 0.7 * rise(4.0)
    assert rise(2.0, height=0.2) == pytest.approx(0.2, abs=0.01)


@pytest.mark.sweep(3)
@pytest.mark.parametrize("substeps", [3, 4, 2])
def test_a_jump_lasts_whole_knots(straight, substeps):
    """Of any number of time steps; the steps of a jump alone are no multiple of three or four."""
    problem = dojo.problems.jump(straight, substeps=substeps)
    path = problem.specs[0][0].reference
    assert len(path) == problem.horizon + 1 and problem.substeps == substeps
    np.testing.assert_allclose(path[[0, -1], 2], problem.start[2], atol=1e-3)  # on its feet at both ends


def test_six_legs_trot_in_two_sets_of_three():
    places = np.array([(x, y) for x in (0.3, 0.0, -0.3) for y in (0.2, -0.2)])
    down = _offsets(_TROT, places, [str(k) for k in range(6)]).reshape(3, 2)
    np.testing.assert_array_equal(down, [[0.5, 0.0], [0.0, 0.5], [0.5, 0.0]])


def test_soles_of_a_foot_come_down_together_on_two_feet():
    places = np.array([(x, y) for y in (0.1, -0.1) for x in (0.12, -0.05)])
    np.testing.assert_array_equal(_offsets(_TROT, places, ["left", "left", "right", "right"]), [0.0, 0.0, 0.5, 0.5])


def test_the_shift_of_a_walk_is_that_of_a_pendulum():
    """y'' = w^2 (y - p): the zero moment point y - y''/w^2 is the middle of the feet on the ground."""
    walk = Footfall(np.array([0.0, 0.5]), 0.6, 0.8, 0.05, 0.2, 0.0, np.array([0.1j, -0.1j]))
    h, height = 0.8 / 512, 0.7
    t = h * np.arange(512)
    y = walk.shift(np.concatenate([t - h, t, t + h]), height).reshape(3, -1)
    support = y[1] - height / 9.81 * (y[0] - 2.0 * y[1] + y[2]) / h**2
    assert 0.02 < np.abs(y[1]).max() < 0.05 and y[1].mean() == pytest.approx(0.0, abs=1e-4)
    for begin, end, middle in ((0.12, 0.48, 0.1), (0.52, 0.58, 0.0), (0.62, 0.98, -0.1)):
        assert support[(t > 0.8 * begin) & (t < 0.8 * end)].mean() == pytest.approx(middle, abs=0.005)


@pytest.mark.slow
def test_a_humanoid_crouches_as_far_as_its_ankles_go():
    """Atlas stands up and jumps without a height that its user would have to find."""
    mech = dojo.models.atlas()
    for name, times in (("stand_up", {"duration": 0.3}), ("jump", {"before": 0.2, "after": 0.2})):
        problem = getattr(dojo.problems, name)(mech, **times)
        path = np.asarray(problem.specs[0][0].reference)
        mass = np.array([body.mass for body in mech.bodies])
        center = np.einsum("b,tbk->tk", mass / mass.sum(), problem.sim.maximal(path)[..., :2])
        feet = Feet(problem.sim)
        standing = feet.gaps(path).max(axis=1) < 0.02
        assert standing[:3].all() and path[:, 2].max() - path[0, 2] > 0.03
        np.testing.assert_allclose(center[0], feet.positions(path)[0, :, :2].mean(axis=0), atol=1e-4)


def test_an_arm_reaches_a_pose_within_its_limits():
    arm = dojo.models.panda(gripper=False)
    sim = dojo.Simulator(arm, time_step=0.05)
    kin, q = dojo.Kinematics(sim), sim.neutral()[: sim.nq]
    at, R = kin.pose("link7", q)
    problem = dojo.problems.reach(arm, "link7", at + (0.1, 0.2, -0.1), duration=1.0, time_step=0.05)
    plan = dojo.ilqr(problem)
    assert plan.success, plan.message
    np.testing.assert_allclose(kin.pose("link7", plan.x[-1, : sim.nq])[0], at + (0.1, 0.2, -0.1), atol=1e-3)
    np.testing.assert_allclose(plan.x[-1, sim.nq :], 0.0, atol=1e-3)
    assert plan.nit < 30 and R.shape == (3, 3)
    means, nodes = (
        dojo.problems.reach(one, "link7", at + (0.1, 0.2, -0.1), duration=1.0, time_step=0.05).states0[:, sim.nq :]
        for one in (sim, sim.replace(order=4))
    )
    np.testing.assert_allclose(means[1:-1], 0.5 * (nodes[:-2] + nodes[1:-1]), atol=0.02)  # of 0.6 rad/s


@pytest.mark.slow
def test_impossible_motions_are_refused(straight):
    arm = dojo.models.panda(gripper=False)
    with pytest.raises(ValueError, match="out of reach"):
        dojo.problems.reach(arm, "link7", (5.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="beyond its limits"):
        dojo.problems.reach(arm, "link7", (0.4, 0.0, 0.5), start=np.full(7, 9.0))
    with pytest.raises(ValueError, match="floating base"):
        dojo.problems.trot(arm)
    with pytest.raises(ValueError, match="expected a robot"):
        dojo.problems.trot(feet=["FL_foot"])
    with pytest.raises(ValueError, match="wing"):
        dojo.problems.stand_up(straight, feet=["wing"])
