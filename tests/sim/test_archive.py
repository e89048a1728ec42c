"""Archives of simulators, trajectories and plans: loading restores the saved data, and nothing else."""

import csv
import json

import numpy as np
import pytest

import dojo_opt as dojo
from sim.mechanism.archive import packed_part, part_of
from sim.simulator.motion_file import joint_trajectory
from sim.simulator.simulator import Simulator

HILL = dojo.Terrain(np.random.default_rng(0).random((4, 4)), spacing=(0.5, 0.5))


def again(mechanism):
    """The mechanism by way of plain data."""
    arrays = {}
    return part_of(json.loads(json.dumps(packed_part(mechanism, arrays))), arrays)


@pytest.mark.parametrize("name", dojo.models.__all__)
def test_every_model_comes_back_as_it_was(name):
    given = Simulator(getattr(dojo.models, name)())
    found = Simulator(again(given.mechanism))
    assert type(found.mechanism) is type(given.mechanism)
    for field, a, b in zip(given.model._fields, given.model, found.model, strict=True):
        if field != "optional":  # addresses of kernels
            np.testing.assert_allclose(a, b, rtol=1e-14, err_msg=field)  # unit vectors are normalised again


def test_terrain_and_collisions_come_back():
    points = np.random.default_rng(1).random((8, 3))
    given = dojo.models.block().with_terrain(HILL)
    given = given.with_collisions(dojo.Collision(given.body_names[0], None, None, dojo.Polytope(points), friction=0.3))
    found = again(given)
    np.testing.assert_array_equal(found.contacts[0].terrain.heights, HILL.heights)
    assert len({id(c.terrain) for c in found.contacts}) == 1
    assert Simulator(found).parameters(("terrain",)).names == Simulator(given).parameters(("terrain",)).names
    np.testing.assert_array_equal(found.collisions[0].shape_b.vertices, given.collisions[0].shape_b.vertices)


def test_parts_that_are_made_again_have_the_same_bits():
    """An axis that was scaled to length one once more would change in its last digit, and the motion with it."""
    rng = np.random.default_rng(4)
    for axis, quaternion in zip(rng.normal(size=(200, 3)), rng.normal(size=(200, 4)), strict=True):
        turn = quaternion / np.linalg.norm(quaternion)
        first = dojo.Joint("revolute", None, "b", axis=axis, orientation=turn)
        again = dojo.Joint("revolute", None, "b", axis=first.axis, orientation=first.orientation)
        assert (first.axis, first.orientation) == (again.axis, again.orientation)


def test_a_trajectory_comes_back_and_goes_on(tmp_path):
    sim = Simulator(dojo.models.block(), time_step=0.02)
    made = sim.rollout(sim.neutral(), steps=5)
    made.save(tmp_path / "motion.npz")
    found = dojo.Trajectory.load(tmp_path / "motion.npz")
    for name in ("x", "u", "time", "iterations", "parts"):
        np.testing.assert_array_equal(getattr(found, name), getattr(made, name))
    np.testing.assert_array_equal(found.contacts.normal_force, made.contacts.normal_force)
    assert found.simulator.kappa == sim.kappa and found.status == made.status
    np.testing.assert_array_equal(found.simulator.step(found.x[-1]).x, sim.step(made.x[-1]).x)
    made.save(tmp_path / "a.motion")
    np.testing.assert_array_equal(dojo.Trajectory.load(tmp_path / "a.motion").x, made.x)


def test_a_plan_comes_back_with_the_limits_of_its_inputs(tmp_path):
    sim = Simulator(dojo.models.cartpole(), time_step=0.05)
    cost = dojo.cost.Tracking([0.0, np.pi, 0.0, 0.0], 1.0)
    plan = dojo.ilqr(dojo.Problem(sim, sim.neutral(), 20, cost=cost, control_limits=(-3.0, 2.0)), max_iterations=3)
    plan.save(tmp_path / "plan.npz")
    found = dojo.Plan.load(tmp_path / "plan.npz")
    np.testing.assert_array_equal(found.control_limits, [[-3.0], [2.0]])
    made, again = (p.replay(time_step=0.01) for p in (plan, found))
    np.testing.assert_array_equal(again.u, made.u)
    assert again.u.min() == -3.0


def test_a_trajectory_is_exported_by_names(tmp_path):
    sim = Simulator(dojo.models.panda(gripper=False), time_step=0.02)
    made = sim.rollout(sim.neutral(), steps=3)
    for suffix in ("csv", "npz", "json"):
        made.export(tmp_path / f"motion.{suffix}")
    rows = list(csv.DictReader((tmp_path / "motion.csv").read_text().splitlines()))
    assert [float(row["joint2"]) for row in rows] == made.x[:, 1].tolist()
    assert float(rows[-1]["v joint7"]) == made.x[-1, 13] and rows[-1]["u joint1"] == ""
    arrays = np.load(tmp_path / "motion.npz")
    np.testing.assert_array_equal(arrays["v"], made.x[:, 7:])
    ros = json.loads((tmp_path / "motion.json").read_text())
    assert ros["joint_names"] == [f"joint{i}" for i in range(1, 8)]
    assert ros["points"][2]["positions"] == made.x[2, :7].tolist() and ros["points"][3]["time_from_start"] == 0.06
    with pytest.raises(ValueError, match="suffix"):
        made.export(tmp_path / "motion.bag")


def test_efforts_of_exported_servos_are_their_forces():
    inputs = [
        dojo.Input("a", servo="position", stiffness=80.0, damping=2.0, force_limits=(-3.0, 3.0)),
        dojo.Input("a", name="more"),
        dojo.Input("b", servo="velocity", damping=5.0),
    ]
    joints = [
        dojo.Joint("revolute", parent, name, name=name, axis=(0, 1, 0)) for parent, name in ((None, "a"), ("a", "b"))
    ]
    mech = dojo.Mechanism([dojo.Body(name, 1.0, shape=dojo.Sphere(0.1)) for name in "ab"], joints, [], inputs)
    x = np.array([[0.1, 0.2, 0.3, 0.4], [0.1, 0.0, 0.0, 0.0]])
    points = joint_trajectory(Simulator(mech, time_step=0.01), np.array([0.0, 0.01]), x, np.array([[0.12, 0.5, 1.0]]))
    found = [point["effort"] for point in points["points"]]
    np.testing.assert_allclose(found, [[80.0 * 0.02 - 2.0 * 0.3 + 0.5, 5.0 * 0.6], [80.0 * 0.02 + 0.5, 5.0]])
    far = joint_trajectory(Simulator(mech, time_step=0.01), np.array([0.0, 0.01]), x, np.array([[9.0, 0.0, 0.0]]))
    assert far["points"][0]["effort"][0] == 3.0


def test_other_files_are_refused(tmp_path):
    np.savez(tmp_path / "other.npz", x=np.zeros(3))
    with pytest.raises(ValueError, match="no trajectory of dojo-opt"):
        dojo.Trajectory.load(tmp_path / "other.npz")
    np.savez(tmp_path / "late.npz", meta=json.dumps({"format": "dojo-opt trajectory", "version": 99}))
    with pytest.raises(ValueError, match="later version"):
        dojo.Trajectory.load(tmp_path / "late.npz")
    np.savez(tmp_path / "code.npz", meta=np.array([print], dtype=object), allow_pickle=True)
    with pytest.raises(ValueError, match="no trajectory"):
        dojo.Trajectory.load(tmp_path / "code.npz")
    with pytest.raises(ValueError, match="expected one of Body"):
        part_of({"part": "Popen", "args": "ls"}, {})
    with pytest.raises(TypeError, match="expected a part"):
        packed_part(print, {})
