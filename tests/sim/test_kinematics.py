"""Kinematics and inverse kinematics: against MuJoCo, energy, differences, and targets within and out of reach."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import dojo_opt as dojo
from sim.mechanism.shapes import rotation_matrix
from support.urdf_files import collision, inertial, joint, link, write


def robot(folder: Path, floating: bool = True) -> dojo.Mechanism:
    """Three hinges about skewed axes, and a hand on a fixed joint, merged into the last link."""
    parts = [link(name, inertial(1.0 + k, xyz="0.05 0.02 -0.1")) for k, name in enumerate(("base", "a", "b", "c"))]
    axes = ("1 0 0", "0 1 0", "0.6 0 0.8")
    limits = '<limit lower="-1.5" upper="1.5" effort="5" velocity="2"/>'
    hinges = [
        joint(f"j{k}", parent, child, "revolute", f'<axis xyz="{axis}"/>', limits)
        for k, (parent, child, axis) in enumerate(zip(("base", "a", "b"), ("a", "b", "c"), axes, strict=True))
    ]
    hand = link("hand", inertial(0.3), collision('<sphere radius="0.02"/>'))
    path = write(folder, *parts, *hinges, hand, joint("wrist", "c", "hand", "fixed", ""))
    return dojo.load_urdf(path, floating=floating, ground=False)


@pytest.fixture
def state(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    q = np.concatenate([rng.normal(size=3), [0.5, -0.5, 0.1, 0.7], rng.uniform(-1.0, 1.0, 3)])
    q[3:7] /= np.linalg.norm(q[3:7])
    return q, rng.normal(size=9), rng.normal(size=9)


def test_a_floating_robot_agrees_with_mujoco(tmp_path: Path, state: tuple[np.ndarray, ...]) -> None:
    """Mass matrix, inverse dynamics, Jacobians and the centre of mass; MuJoCo has the velocities of a free joint alike."""
    mujoco = pytest.importorskip("mujoco")
    mech = robot(tmp_path)
    q, v, dv = state
    spec = mujoco.MjSpec.from_file(str(tmp_path / "robot.urdf"))
    spec.compiler.fusestatic = False
    spec.compiler.discardvisual = False
    spec.body("base").add_freejoint()
    model = spec.compile()
    data = mujoco.MjData(model)
    kin = dojo.Kinematics(dojo.Simulator(mech, 0.01))
    data.qpos[:], data.qvel[:], data.qacc[:] = q, v, dv
    mujoco.mj_forward(model, data)
    M = np.zeros((9, 9))
    mujoco.mj_fullM(model, data, M) if _takes_data(mujoco) else mujoco.mj_fullM(model, M, data.qM)
    np.testing.assert_allclose(kin.mass_matrix(q), M, atol=1e-10)
    data.qacc[:] = dv
    mujoco.mj_inverse(model, data)
    np.testing.assert_allclose(kin.inverse_dynamics(q, v, dv), data.qfrc_inverse - data.qfrc_constraint * 0, atol=1e-9)
    hand, J = model.body("hand").id, np.zeros((6, 9))
    mujoco.mj_jacBody(model, data, J[:3], J[3:], hand)
    np.testing.assert_allclose(kin.jacobian("hand", q), J, atol=1e-10)
    np.testing.assert_allclose(kin.pose("hand", q)[0], data.xpos[hand], atol=1e-10)
    np.testing.assert_allclose(kin.pose("hand", q)[1], data.xmat[hand].reshape(3, 3), atol=1e-10)
    np.testing.assert_allclose(kin.center_of_mass(q), data.subtree_com[0], atol=1e-10)


def _takes_data(mujoco: object) -> bool:
    """Whether mj_fullM takes the data and no array of its own, as since MuJoCo 4."""
    return int(str(getattr(mujoco, "__version__", "3")).split(".")[0]) >= 4


def test_quantities_are_of_one_motion(tmp_path: Path, state: tuple[np.ndarray, ...]) -> None:
    """Kinetic energy is v^T M v / 2, momentum its Jacobian's, and Jacobians are differences of poses."""
    sim = dojo.Simulator(robot(tmp_path), 0.01)
    kin = dojo.Kinematics(sim)
    q, v, _ = state
    z = sim.body_states(q, v)
    bodies = sim.mechanism.bodies
    twice = sum(
        b.mass * zb[3:6] @ zb[3:6] + zb[10:] @ np.array(b.inertia) @ zb[10:] for b, zb in zip(bodies, z, strict=True)
    )
    assert v @ kin.mass_matrix(q) @ v == pytest.approx(twice, rel=1e-12)
    mass = sum(b.mass for b in bodies)
    np.testing.assert_allclose(kin.centroidal_momentum(q, v)[:3], mass * kin.com_jacobian(q) @ v, atol=1e-12)
    kin.add("finger", "hand", (0.1, 0.2, 0.3), (0.6, 0.8, 0.0, 0.0))
    h = 1e-6
    ahead, behind = (kin.pose("finger", kin.moved(q, s * h * v)) for s in (1.0, -1.0))
    twist = kin.velocity("finger", q, v)
    np.testing.assert_allclose((ahead[0] - behind[0]) / (2 * h), twist[:3], atol=1e-8)
    W = (ahead[1] - behind[1]) / (2 * h) @ kin.pose("finger", q)[1].T
    np.testing.assert_allclose([W[2, 1], W[0, 2], W[1, 0]], twist[3:], atol=1e-8)
    many = kin.jacobian("finger", np.stack([q, q])[None])
    assert many.shape == (1, 2, 6, 9)
    np.testing.assert_array_equal(many[0, 1], kin.jacobian("finger", q))
    with pytest.raises(ValueError, match=r"Kinematics\.add\(name\): there is a frame 'finger' already"):
        kin.add("finger", "hand")
    with pytest.raises(ValueError, match=r"Kinematics\.pose\(frame\): 'hnd' is not one of.*did you mean 'hand'"):
        kin.pose("hnd", q)


@pytest.mark.slow
def test_inverse_kinematics_meets_targets_in_reach(tmp_path: Path, rng: np.random.Generator) -> None:
    sim = dojo.Simulator(robot(tmp_path, floating=False), 0.01)
    kin = dojo.Kinematics(sim)
    for _ in range(5):
        there = rng.uniform(-1.2, 1.2, 3)
        at, R = kin.pose("hand", there)
        found = dojo.ik(kin, {"hand": at}, there + rng.uniform(-0.3, 0.3, 3))
        assert found.success and np.linalg.norm(kin.pose("hand", found.q)[0] - at) < 1e-8, found.message
    far = dojo.ik(kin, {"hand": at + (5.0, 0.0, 0.0)})
    assert not far.success and "'hand' stays" in far.message and np.abs(far.q).max() <= 1.5
    wide = dojo.ik(kin, {"hand": at + (5.0, 0.0, 0.0)}, limits=False)
    assert wide.error <= far.error + 1e-6
    # of all places within the limits it is the nearest one: no small motion is better
    for _ in range(20):
        near = np.clip(far.q + 0.02 * rng.normal(size=3), -1.5, 1.5)
        assert np.linalg.norm(kin.pose("hand", near)[0] - at - (5.0, 0.0, 0.0)) > far.error - 1e-9


@pytest.mark.slow
def test_inverse_kinematics_finds_most_postures_of_an_arm(rng: np.random.Generator) -> None:
    """Of seven joints, from random starts."""
    sim = dojo.Simulator(dojo.models.panda(gripper=False), 0.01)
    kin = dojo.Kinematics(sim)
    low, high = np.array([joint.limits[0] for joint in sim.mechanism.joints]).T
    found = [
        dojo.ik(kin, {"link7": kin.pose("link7", rng.uniform(low, high))}, rng.uniform(low, high)) for _ in range(12)
    ]
    assert sum(one.success for one in found) >= 10
    assert all(np.all((one.q >= low) & (one.q <= high)) for one in found)


def test_inverse_kinematics_closes_loops_and_keeps_gears() -> None:
    """A linkage with its foot moved, and a chain with a gear."""
    sim = dojo.Simulator(dojo.models.fivebar(), time_step=0.01)
    kin, q = dojo.Kinematics(sim), sim.neutral()[: sim.nq]
    place = kin.pose("forearm_r", q)[0] + [0.01, 0.0, 0.01]
    found = dojo.ik(sim, {"forearm_r": place})
    gaps = sim.loop_gaps(np.concatenate([found.q, np.zeros(sim.nv)]))
    assert found.success and max(np.abs(gap).max() for gap in gaps.values()) < 1e-8
    np.testing.assert_allclose(kin.pose("forearm_r", found.q)[0], place, atol=1e-8)
    far = dojo.ik(sim, {"forearm_r": place + [9.0, 0.0, 0.0]}, attempts=1)
    assert not far.success and set(far.errors) == {"forearm_r", *gaps}
    hinge = {"axis": (0, 1, 0), "parent_point": (0.5, 0, 0)}
    joints = [dojo.Joint("revolute", a, b, name=f"j{b}", **hinge) for a, b in ((None, "a"), ("a", "b"), ("b", "c"))]
    geared = dojo.Mechanism(
        [dojo.Body(n, 1.0, np.eye(3)) for n in "abc"], joints, gears=[dojo.Gear("jb", "jc", 2.0)], inputs=[]
    )
    found = dojo.ik(dojo.Simulator(geared), {"c": (1.1, 0.0, 0.3)})
    assert found.success and found.q[1] == pytest.approx(2.0 * found.q[2], abs=1e-8)


def test_inverse_kinematics_of_a_floating_robot(tmp_path: Path) -> None:
    """A pose of the hand and the place of the centre of mass, the orientation of the base held."""
    sim = dojo.Simulator(robot(tmp_path), 0.01)
    kin = dojo.Kinematics(sim)
    quat = np.array([0.8, 0.0, 0.6, 0.0])
    start = sim.neutral()[: sim.nq]
    com = kin.center_of_mass(start) + (0.1, 0.0, 0.05)
    found = dojo.ik(sim, {"hand": (None, quat), "center of mass": com}, start)
    assert found.success, found.message
    np.testing.assert_allclose(kin.pose("hand", found.q)[1], rotation_matrix(quat), atol=1e-7)
    np.testing.assert_allclose(kin.center_of_mass(found.q), com, atol=1e-7)
    held = dojo.ik(sim, {"hand": kin.pose("hand", start)[0] + (0.01, 0.01, 0.01)}, start, fixed=["floating_base"])
    np.testing.assert_array_equal(held.q[:7], start[:7])
    beyond = start + np.r_[np.zeros(7), 1.7, np.zeros(len(start) - 8)]  # the first hinge, of 1.5
    joint = sim.mechanism.joints[1].name
    held = dojo.ik(sim, {"hand": kin.pose("hand", beyond)[0] + (0.01, 0.01, 0.01)}, beyond, fixed=[joint])
    assert held.success and held.q[7] == beyond[7]
    with pytest.raises(ValueError, match=r"ik\(fixed=\.\.\.\): 'base' is not one of"):
        dojo.ik(sim, {"hand": (0, 0, 0)}, fixed=["base"])
    again = dojo.ik(sim, {"hand": kin.pose("hand", found.q)}, start)
    assert again.success, again.message
    for got, expected in zip(kin.pose("hand", again.q), kin.pose("hand", found.q), strict=True):
        np.testing.assert_allclose(got, expected, atol=1e-7)
    with pytest.raises(ValueError, match="rotation matrix"):
        dojo.ik(sim, {"hand": (None, 2.0 * np.eye(3))})


def test_frames_of_a_file_stay_where_they_are_when_a_center_of_mass_moves(tmp_path: Path) -> None:
    sim = dojo.Simulator(robot(tmp_path), 0.01)
    q = np.r_[0.1, 0.2, 0.9, 0.8, 0.0, 0.6, 0.0, 0.3, -0.4, 0.5]
    moved = sim.with_parameters({"com:c[0]": 0.1, "com:a[2]": -0.2})
    before, after = dojo.Kinematics(sim), dojo.Kinematics(moved)
    for frame in ("a", "c", "hand", "base"):
        np.testing.assert_allclose(after.pose(frame, q)[0], before.pose(frame, q)[0], atol=1e-12)
    assert np.abs(after.center_of_mass(q) - before.center_of_mass(q)).max() > 0.01


def test_arrays_have_any_leading_axes(tmp_path: Path, rng: np.random.Generator) -> None:
    """Bias forces and inverse dynamics of many states are those of each."""
    sim = dojo.Simulator(robot(tmp_path), time_step=0.01)
    kin = dojo.Kinematics(sim)
    dq, v, dv = rng.normal(size=(3, 2, 3, sim.nv))
    q = kin.moved(np.broadcast_to(sim.neutral()[: sim.nq], (2, 3, sim.nq)), dq)
    many = kin.inverse_dynamics(q, v, dv)
    for k in np.ndindex(2, 3):
        np.testing.assert_allclose(many[k], kin.inverse_dynamics(q[k], v[k], dv[k]), atol=1e-9)
        np.testing.assert_allclose(kin.bias_forces(q, v)[k], kin.bias_forces(q[k], v[k]), atol=1e-9)
    assert kin.bias_forces(q[0, 0], v).shape == (2, 3, sim.nv)
