"""Scenes: mechanisms put together move as they do apart, with everything that belongs to them; obstacles."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from naive import rotation as rot

import dojo_opt as dojo
from support.scenes import ball, block, run

YAW = rot.exp(np.array([0.0, 0.0, 0.7]))


def hopper():
    return dojo.models.raiberthopper()


def test_two_robots_move_as_each_alone():
    """A hopper and, moved and turned about the vertical, a second one: the states of both, seen from their places."""
    one = hopper()
    both = one.add(one, pose=(1.0, 2.0, 0.0, *YAW), prefix="second ")
    assert both.nq == 2 * one.nq and len(both.inputs) == 2 * len(one.inputs)
    assert both.body_names[one.nbody :] == tuple(f"second {name}" for name in one.body_names)
    alone, together = (dojo.Simulator(m, time_step=0.02, tolerance=1e-10) for m in (one, both))
    u = np.array([0.2, -0.1, 3.0])
    x1 = alone.neutral()
    expected = run(alone, x1, 30, u)
    found = run(together, together.neutral(), 30, np.tile(u, 2))
    z, zs = alone.maximal(expected[-1]), together.maximal(found[-1])
    np.testing.assert_allclose(zs[: one.nbody], z, atol=1e-8)
    for k in range(one.nbody):
        np.testing.assert_allclose(zs[one.nbody + k, :3], rot.rotate(YAW, z[k, :3]) + [1.0, 2.0, 0.0], atol=1e-7)


def test_roots_that_do_not_float_are_put_in_place():
    """A pendulum hung elsewhere, upside down; loops and obstacles move with it."""
    turn = rot.exp(np.array([np.pi, 0.0, 0.0]))
    mech = dojo.models.pendulum()
    wall = dojo.Collision(mech.body_names[0], shape_a=dojo.Sphere(0.1), shape_b=dojo.Box(1, 1, 0.1, center=(0, 0, -2)))
    both = mech.add(mech.with_collisions(wall), (0.0, 3.0, 1.0, *turn), prefix="b/")
    q0 = np.array(both.neutral)
    z = dojo.Simulator(both, time_step=0.01).maximal(np.r_[q0, np.zeros(both.nv)])
    np.testing.assert_allclose(z[1, :3], rot.rotate(turn, z[0, :3]) + [0.0, 3.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(both.collisions[0].shape_b.center, (0.0, 3.0, 3.0), atol=1e-12)
    assert both.collisions[0].a == "b/" + mech.body_names[0] and both.collisions[0].b == "world"


def test_a_loop_is_carried_over():
    bar = dojo.Box(0.5, 0.05, 0.05)
    left, right, y = (-0.25, 0, 0), (0.25, 0, 0), (0, 1, 0)
    joints = [
        dojo.Joint("revolute", None, "crank", child_point=left, axis=y),
        dojo.Joint("revolute", "crank", "coupler", parent_point=right, child_point=left, axis=y),
        dojo.Joint("revolute", None, "rocker", parent_point=(0.5, 0, 0), child_point=left, axis=y),
        dojo.Joint("revolute", "coupler", "rocker", "pin", right, right, axis=y, close=True),
    ]
    bodies = [dojo.Body(name, 1.0, shape=bar) for name in ("crank", "coupler", "rocker")]
    fourbar = dojo.Mechanism(bodies, joints, neutral={"crank": 0.5, "coupler": -0.5, "rocker": 0.5})
    scene = ball().add(fourbar, (0.0, 1.0, 0.0))
    sim = dojo.Simulator(scene, time_step=0.01)
    x = sim.neutral()
    x[2] = 0.1
    t = sim.rollout(x, np.zeros((20, sim.nu)), throw=True)
    assert np.abs(sim.loop_gaps(t.x[-1])["pin"]).max() < 1e-8


def test_bodies_of_both_collide():
    """A ball rolls into a block of the other mechanism; momentum goes over."""
    scene = ball(radius=0.1, friction=0.0).add(block(0.2, friction=0.0), (1.0, 0.0, 0.1))
    touch = dojo.Collision("ball", "block", dojo.Sphere(0.1), dojo.Box(0.2, 0.2, 0.2), friction=0.0)
    sim = dojo.Simulator(scene.with_collisions(touch), time_step=0.01, kappa=1e-8, tolerance=1e-10)
    x = sim.neutral()
    x[2] = 0.1
    x[sim.nq] = 2.0
    rows = run(sim, x, 100)
    np.testing.assert_allclose(rows[-1, [sim.nq, sim.nq + 6]], 1.0, atol=5e-3)  # inelastic, equal masses


def test_an_obstacle_stops_shapes_that_touch_the_ground():
    step = dojo.Box(1.0, 1.0, 0.4, center=(1.0, 0.0, 0.0))
    mech = ball(radius=0.1, friction=0.0).with_obstacle(step, friction=0.0)
    sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-8)
    x = sim.neutral()
    x[2] = 0.1
    x[sim.nq] = 1.0
    assert run(sim, x, 100)[-1, 0] == pytest.approx(0.4, abs=3e-3)
    assert mech.collisions[0].name == "obstacle-ball"


def test_files_can_be_put_together(tmp_path):
    """A robot from a URDF file twice, each on its own terrain."""
    path = tmp_path / "pod.urdf"
    path.write_text(
        '<robot name="pod"><link name="base"><inertial><mass value="1"/>'
        '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
        '<collision><geometry><sphere radius="0.1"/></geometry></collision></link></robot>'
    )
    pod = dojo.load_urdf(str(path))
    scene = pod.add(pod.with_terrain(dojo.Terrain.slope(0.2)), (1.0, 0.0, 0.0), prefix="other ")
    assert isinstance(pod.with_terrain(dojo.Terrain.slope(0.2)), dojo.UrdfMechanism)
    sim = dojo.Simulator(scene, time_step=0.01)
    assert "other base" in sim.describe()
    assert sim.rollout(sim.neutral(), np.zeros((5, sim.nu))).success


def test_it_stands_on_other_ground():
    mech = dojo.models.quadruped().with_terrain(dojo.Terrain.slope(np.radians(10.0), (1.0, 1.0), 0.5))
    sim = dojo.Simulator(mech, time_step=0.01)
    gaps = [c.gap(sim.step(sim.neutral()).contacts.point[k]) + c.radius for k, c in enumerate(mech.contacts)]
    assert min(gaps) == pytest.approx(0.0, abs=5e-3)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: hopper().add(hopper()), "both have a body 'body'; give a prefix="),
        (lambda: hopper().add("robot"), r"Mechanism.add\(other\): expected a Mechanism"),
        (lambda: hopper().add(ball(), (1.0, 2.0)), r"expected a translation \(3,\)"),
        (lambda: hopper().add(ball(), (0, 0, 0, 1, 1, 0, 0)), "unit quaternion"),
        (lambda: hopper().add(ball(gravity=(0, 0, 0))), "has the gravity"),
        (lambda: dojo.models.pendulum().with_obstacle(dojo.Box(1, 1, 1)), "no contact with a radius"),
        (lambda: ball().with_obstacle(dojo.Box(1, 1, 1), bodies=["foot"]), "'foot' is not one of"),
    ],
)
def test_bad_scenes_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_contacts_inputs_limits_and_names_are_carried_over():
    robot = dojo.models.quadruped()
    both = hopper().add(robot, prefix="a1/")
    added = both.contacts[len(hopper().contacts) :]
    for old, new in zip(robot.contacts, added, strict=True):
        assert new == dataclasses.replace(old, name=f"a1/{old.name}", body=f"a1/{old.body}")
    for old, new in zip(robot.joints[1:], both.joints[len(hopper().joints) + 1 :], strict=True):
        assert (new.name, new.parent, new.limits) == (f"a1/{old.name}", f"a1/{old.parent}", old.limits)
    assert both.input_names[-12:] == tuple(f"a1/{name}" for name in robot.input_names)
    np.testing.assert_allclose(both.neutral[-19:], robot.neutral)


LINKS = """<robot name="two"><link name="base"><inertial><mass value="1"/>
  <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <link name="tip"/><joint name="weld" type="fixed"><parent link="base"/><child link="tip"/>
  <origin xyz="0 0 0.3"/></joint></robot>"""


def test_merged_links_are_frames_of_a_scene(tmp_path):
    (tmp_path / "two.urdf").write_text(LINKS)
    alone = dojo.load_urdf(tmp_path / "two.urdf")
    q = np.array([1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0])
    tip = dojo.Kinematics(dojo.Simulator(alone, time_step=0.01)).pose("tip", q)[0]
    both = np.concatenate([q, [0.0, 0.0, 5.0, 1.0, 0.0, 0.0, 0.0]])
    wall = dojo.Collision(alone.body_names[0], shape_a=dojo.Sphere(0.1), shape_b=dojo.HalfSpace())
    kin = dojo.Kinematics(dojo.Simulator(alone.add(ball(), prefix="b/").with_collisions(wall), time_step=0.01))
    np.testing.assert_allclose(kin.pose("tip", both)[0], tip, atol=1e-12)
    twice = alone.add(alone, prefix="r/")
    kin = dojo.Kinematics(dojo.Simulator(ball().add(twice), time_step=0.01))
    places = [
        kin.pose(name, np.concatenate([both[7:], q, q + [1.0, 0, 0, 0, 0, 0, 0]]))[0] for name in ("tip", "r/tip")
    ]
    np.testing.assert_allclose(places, [tip, tip + [1.0, 0.0, 0.0]], atol=1e-12)
