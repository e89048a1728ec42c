"""Inertias of URDF files arrive: against point masses, MuJoCo, and the same file read another way."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import dojo_opt as dojo
from sim.io.urdf.inertia import BALL_MASS, BALL_RADIUS, RigidInertia, combined, fault, repaired
from sim.mechanism.forward_kinematics import body_poses
from sim.mechanism.pose import roll_pitch_yaw
from sim.mechanism.shapes import rotation_matrix
from support.urdf_files import branched, compare_with_mujoco, inertial, joint, link, write

pytestmark = pytest.mark.filterwarnings("ignore:.*keeps one collision shape:sim.io.urdf.report.UrdfWarning")


def test_an_inertia_agrees_with_its_point_masses(tmp_path: Path, rng: np.random.Generator) -> None:
    """Masses at points of two links, one fixed to the other; written about turned frames, read back as one body."""
    masses, points = rng.uniform(0.5, 2.0, size=(2, 6)), rng.normal(size=(2, 6, 3))
    at, angles = np.array([0.4, -0.1, 0.2]), np.array([0.2, 0.9, -1.3])
    texts = []
    for m, p in zip(masses, points, strict=True):
        com, rpy = m @ p / m.sum(), rng.normal(size=3)
        d = (p - com) @ roll_pitch_yaw(rpy)
        J = sum(w * (x @ x * np.eye(3) - np.outer(x, x)) for w, x in zip(m, d, strict=True))
        numbers = (J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])
        texts.append(inertial(m.sum(), " ".join(map(repr, com.tolist())), " ".join(map(repr, rpy.tolist())), numbers))
    where = f'xyz="{" ".join(map(str, at))}" rpy="{" ".join(map(str, angles))}"'
    path = write(tmp_path, link("a", texts[0]), link("b", texts[1]), joint("weld", "a", "b", "fixed", "", at=where))
    mech = dojo.load_urdf(path, ground=False)
    m = masses.ravel()
    p = np.concatenate([points[0], points[1] @ roll_pitch_yaw(angles).T + at])
    com = m @ p / m.sum()
    J = sum(w * (x @ x * np.eye(3) - np.outer(x, x)) for w, x in zip(m, p - com, strict=True))
    assert mech.body_names == ("a",)
    np.testing.assert_allclose(mech.bodies[0].mass, m.sum(), rtol=1e-14)
    np.testing.assert_allclose(mech.bodies[0].inertia, J, rtol=1e-12)
    np.testing.assert_allclose(mech.report.links["a"].point, -com, atol=1e-14)
    np.testing.assert_allclose(mech.report.links["b"].point, at - com, atol=1e-14)
    np.testing.assert_allclose(rotation_matrix(mech.report.links["b"].orientation), roll_pitch_yaw(angles), atol=1e-14)


def test_poses_masses_and_energy_are_mujocos(tmp_path: Path, rng: np.random.Generator) -> None:
    pytest.importorskip("mujoco")
    pose, mass, energy = compare_with_mujoco(branched(tmp_path), rng)
    assert max(pose, mass) < 1e-13
    assert energy < 1e-9


def test_poses_agree_with_the_simulator(tmp_path: Path, rng: np.random.Generator) -> None:
    mech = dojo.load_urdf(branched(tmp_path), ground=False)
    q = np.concatenate(
        [rng.normal(size=3), *[v / np.linalg.norm(v) for v in rng.normal(size=(1, 4))], rng.normal(size=3)]
    )
    z = dojo.Simulator(mech, 0.01).maximal(np.concatenate([q, np.zeros(mech.nv)]))
    for name, row in zip(mech.body_names, z, strict=True):
        pose = body_poses(mech.joints, q)[name]
        np.testing.assert_allclose(pose.point, row[:3], atol=1e-13)
        np.testing.assert_allclose(pose.rotation, rotation_matrix(row[6:10]), atol=1e-13)


def test_merged_and_kept_fixed_joints_have_the_same_dynamics(tmp_path: Path, rng: np.random.Generator) -> None:
    """The mass matrices are the same; a step treats a body in two pieces differently, to second order."""
    mechs = [dojo.load_urdf(branched(tmp_path), merge_fixed=m, ground=False) for m in (True, False)]
    assert [m.nbody for m in mechs] == [4, 6]  # the marker has no mass, so it is never a body
    assert mechs[0].nv == mechs[1].nv == 9
    q = np.array(mechs[0].neutral)
    u = np.array([0.3 if n == "elbow" else -1.0 if n == "rail" else 0.5 for n in mechs[0].input_names])
    for _ in range(5):
        v = 0.1 * rng.normal(size=9)
        sims = [dojo.Simulator(m, 1e-3) for m in mechs]
        one, other = (s.kinetic_energy(s.state_from_velocity(q, v)) for s in sims)
        np.testing.assert_allclose(one, other, rtol=1e-10)
    apart = []
    for h in (0.01, 0.005):
        sims = [dojo.Simulator(m, h) for m in mechs]
        one, other = (
            s.rollout(s.state_from_velocity(q, v), np.tile(u, (round(0.6 / h), 1)), throw=True).x[-1, :10] for s in sims
        )
        assert np.abs(one - q).max() > 0.5
        apart.append(np.abs(one - other).max())
    assert apart[0] < 1e-4
    assert 3.5 < apart[0] / apart[1] < 4.5


def test_locked_joints_are_fixed_where_they_are(tmp_path: Path) -> None:
    path = branched(tmp_path)
    free = dojo.load_urdf(path, floating=False, ground=False)
    held = dojo.load_urdf(
        path, floating=False, ground=False, locked=["elbow", "rail"], neutral={"elbow": 0.4, "rail": 0.2}
    )
    assert held.joint_names == ("shoulder",)
    q = np.zeros(free.nq)
    for name, value in (("shoulder", 0.3), ("elbow", 0.4), ("rail", 0.2)):
        q[free.q_slice(name)] = value
    there, here = body_poses(free.joints, q), body_poses(held.joints, np.array([0.3]))
    for name in ("upper", "lower", "tool", "slider"):
        a, b = free.report.links[name], held.report.links[name]
        np.testing.assert_allclose(here[b.body].at(b.point), there[a.body].at(a.point), atol=1e-14)
    total = sum(b.mass * there[b.name].point for b in free.bodies) / sum(b.mass for b in free.bodies)
    np.testing.assert_allclose(here["upper"].point, total, atol=1e-14)


def test_a_link_without_mass_joins_its_neighbor(tmp_path: Path) -> None:
    empty = '<inertial><mass value="0"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'
    parts = (link("root", empty), link("trunk", inertial(3.0)), joint("weld", "root", "trunk", "fixed", ""))
    for merge in (True, False):
        mech = dojo.load_urdf(write(tmp_path, *parts), merge_fixed=merge, ground=False)
        assert (mech.body_names, mech.bodies[0].mass) == (("root",), 3.0)
        assert mech.report.links["trunk"].body == "root"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (inertial(0.0, inertia=(0,) * 6), "has no mass"),
        (inertial(0.5, inertia=(0,) * 6), "has 0.5 kg, but principal moments of inertia 0, 0, 0"),
        (inertial(0.5, inertia=(1, 1, 1, 0, 0, 2)), "not all positive"),
        (inertial(0.5, inertia=(1, 1, 2.5, 0, 0, 0)), "the largest of which exceeds the sum of the others"),
    ],
)
def test_impossible_inertias_are_refused_by_name_or_repaired(tmp_path: Path, text: str, why: str) -> None:
    path = write(tmp_path, link("base"), link("rod", text), joint("elbow", "base", "rod"))
    with pytest.raises(dojo.UrdfError, match=r"line 3, link 'rod', which moves on joint 'elbow', .*" + why):
        dojo.load_urdf(path)
    with pytest.warns(dojo.UrdfWarning, match="inertias that no rigid body has were repaired: rod has"):
        mech = dojo.load_urdf(path, ground=False, repair=True)
    rod = mech.bodies[1]
    assert rod.mass == (0.5 if 'value="0.5"' in text else BALL_MASS)
    assert dojo.Simulator(mech, 0.01).step(dojo.Simulator(mech, 0.01).neutral()).success


def test_a_root_without_mass_is_told_to_be_fixed(tmp_path: Path) -> None:
    path = write(tmp_path, link("rail", ""), link("cart"), joint("slide", "rail", "cart"))
    with pytest.raises(
        dojo.UrdfError, match=r"link 'rail', which moves as the root, has no mass\n.*floating=False fixes"
    ):
        dojo.load_urdf(path)
    assert dojo.load_urdf(path, floating=False).body_names == ("cart",)


def test_a_repair_changes_only_impossible_inertias() -> None:
    body = RigidInertia(2.0, np.array([0.1, 0.2, 0.3]), np.diag([1.0, 1.0, 2.5]))  # second moments 1.25, 1.25, -0.25
    fixed = repaired(body)
    least = 0.4 * BALL_RADIUS**2
    np.testing.assert_allclose(np.diag(fixed.inertia), (1.25 + least, 1.25 + least, 2.5), rtol=1e-12)
    ball = repaired(RigidInertia(0.0, np.zeros(3), np.eye(3)))
    np.testing.assert_allclose(ball.inertia, 0.4 * BALL_MASS * BALL_RADIUS**2 * np.eye(3), atol=1e-20)
    assert fault(body) and not fault(fixed) and not fault(ball)


def test_masses_without_extent_add_up_by_the_parallel_axes() -> None:
    pair = [RigidInertia(1.0, np.array([s, 0.0, 0.0]), np.zeros((3, 3))) for s in (-2.0, 2.0)]
    both = combined(pair)
    np.testing.assert_allclose(both.com, 0.0)
    np.testing.assert_allclose(both.inertia, np.diag([0.0, 8.0, 8.0]))
