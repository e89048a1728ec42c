"""The references of the accuracy study: against each other, MuJoCo, and closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dojo_opt as dojo
from benchmarks.engines import mujoco_scene
from dojo_opt.report.accuracy.reference import TreeReference, pendulum
from sim.mechanism.pack import pack
from support.mechanisms import chain_with, random_state
from support.pinocchio_robots import pinocchio_coordinates, pinocchio_robot


def test_a_pendulum_in_absolute_angles_agrees_with_the_tree() -> None:
    model = pack(dojo.models.npendulum(3, length=0.7, mass=0.4))
    q, v, times = np.array([1.0, -0.5, 0.3]), np.array([0.2, 1.0, -2.0]), np.linspace(0.0, 0.5, 3)
    for a, b in zip(pendulum(model, q, v, times), TreeReference(model).run(q, v, times), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-9)


@pytest.mark.parametrize("kind", ["floating", "spherical", "cylindrical_free", "planar_axis", "revolute"])
def test_accelerations_agree_with_mujoco(kind: str) -> None:
    mujoco = pytest.importorskip("mujoco")
    mech = chain_with(kind, False)
    # MuJoCo's ball spring pulls with k angle, ours with 2 k sin(angle / 2)
    joints = [replace(j, spring=0.0, rest=0.0) if j.nrot == 3 else replace(j, armature=0.2) for j in mech.joints]
    mech = dojo.Mechanism(mech.bodies, joints)
    q, v = random_state(np.random.default_rng(8), mech, speed=2.0)
    model = pack(mech)
    u = np.random.default_rng(9).normal(size=len(model.input_kind))
    twin = mujoco_scene.load(model, 0.01)
    data = mujoco_scene.state(twin, np.concatenate([q, v]))
    data.ctrl[:] = u
    mujoco.mj_forward(twin, data)
    np.testing.assert_allclose(TreeReference(model).accelerations(q, v, u), data.qacc, rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("base", ["floating", "screw"])
def test_accelerations_of_screws_agree_with_pinocchio(base: str) -> None:
    """In its coordinates: a quaternion with its scalar last, and velocities of the base in its own axes."""
    pin = pytest.importorskip("pinocchio")
    mech = replace(chain_with("screw", False), contacts=())
    joints = [replace(j, spring=0.0, damper=0.0, rest=0.0) for j in mech.joints if j.child in "abc"]
    if base == "screw":
        joints[0] = replace(joints[1], parent=None, child="a", name="a", pitch=0.6)
    mech = dojo.Mechanism([b for b in mech.bodies if b.name in "abc"], joints)
    q, v = random_state(np.random.default_rng(8), mech, speed=2.0)
    robot, _ = pinocchio_robot(mech)
    theirs = pinocchio_coordinates(mech, q)
    exact = pin.aba(robot, robot.createData(), theirs, v, np.zeros(mech.nv))
    np.testing.assert_allclose(TreeReference(pack(mech)).accelerations(q, v), exact, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("kind", ["spherical", "screw"])
def test_springs_and_dampers_agree_with_the_simulator(kind: str) -> None:
    mech = chain_with(kind, True)
    mech = dojo.Mechanism(mech.bodies, [replace(j, damper=0.05) for j in mech.joints])
    q, v = random_state(np.random.default_rng(3), mech)
    sim = dojo.Simulator(mech, time_step=0.005, order=8, tolerance=1e-13)
    x = sim.rollout(sim.state_from_velocity(q, v), np.zeros((20, sim.nu)), throw=True).x[-1]
    exact = np.concatenate([part[-1] for part in TreeReference(sim.model).run(q, v, np.array([0.0, 0.1]))])
    assert np.abs(sim.difference(x, exact)).max() < 1e-8


def test_inputs_on_bodies_are_refused() -> None:
    motion = TreeReference(pack(dojo.models.block()))
    with pytest.raises(ValueError, match="inputs on bodies"):
        motion.accelerations(np.r_[0, 0, 1, 1, 0, 0, 0.0], np.zeros(6), np.ones(6))
