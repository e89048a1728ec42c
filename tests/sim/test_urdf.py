"""Links, joints and inertias of URDF files arrive: against point masses, MuJoCo, and the same file read another way."""

from __future__ import annotations

import pickle
import warnings
from pathlib import Path

import numpy as np
import pytest
from urdf_files import SKEWED, compare_with_mujoco, inertial, joint, link, write

import dojo_opt as dojo
from sim.shapes import rotation_matrix
from sim.urdf.inertia import BALL_MASS, BALL_RADIUS, RigidInertia, combined, fault, repaired
from sim.urdf.pose import Pose, quaternion, roll_pitch_yaw, turn
from sim.urdf.stance import poses

BALL = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
AXIS = '<axis xyz="0 1 0"/>'

KINDS = {  # type in the file: (kind, nq, nv)
    "revolute": ("revolute", 1, 1),
    "continuous": ("revolute", 1, 1),
    "prismatic": ("prismatic", 1, 1),
    "planar": ("planar_axis", 3, 3),
    "floating": ("floating", 7, 6),
    "spherical": ("spherical", 4, 3),
    "ball": ("spherical", 4, 3),
    "planaraxis": ("planar_axis", 3, 3),
    "planarfree": ("planar_free", 6, 5),
    "cylindrical": ("cylindrical", 2, 2),
    "cylindricalfree": ("cylindrical_free", 5, 4),
    "fixedorientation": ("fixed_orientation", 3, 3),
    "orbital": ("orbital", 2, 2),
}


def arm(folder: Path, *extra: str, kind: str = "revolute", inside: tuple[str, ...] = ()) -> Path:
    """A base, and a forearm on a joint called elbow."""
    return write(
        folder,
        link("base", inertial(2.0), BALL),
        link("forearm"),
        joint("elbow", "base", "forearm", kind, *inside),
        *extra,
    )


# -- poses -------------------------------------------------------------------------------------------------------------


def test_rotations_have_the_meaning_of_the_format() -> None:
    about_z, about_y, about_x = (turn(e, a) for e, a in zip(np.eye(3)[::-1], (0.3, -0.4, 0.5), strict=True))
    np.testing.assert_allclose(roll_pitch_yaw((0.5, -0.4, 0.3)), about_z @ about_y @ about_x, atol=1e-15)
    np.testing.assert_allclose(turn((0, 0, 1), 0.5 * np.pi) @ (1, 0, 0), (0, 1, 0), atol=1e-15)


def test_quaternions_of_all_rotations_with_every_component_largest(rng: np.random.Generator) -> None:
    halves = [np.eye(4)[k] for k in range(4)] + [v / np.linalg.norm(v) for v in rng.normal(size=(50, 4))]
    for q in halves:
        found = np.array(quaternion(rotation_matrix(q)))
        np.testing.assert_allclose(found * np.sign(found @ q), q, atol=1e-15)


# -- joints ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("given", KINDS)
def test_every_kind_of_joint(tmp_path: Path, given: str) -> None:
    path = arm(tmp_path, kind=given, inside=(AXIS, '<limit lower="-1" upper="1"/>') if given == "revolute" else (AXIS,))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", dojo.UrdfWarning)
        mech = dojo.load_urdf(path, floating=False, ground=False)
    kind, nq, nv = KINDS[given]
    elbow = mech.joints[0]
    assert (elbow.kind, elbow.nq, elbow.nv, elbow.parent, mech.name) == (kind, nq, nv, "world", "robot")
    at_zero = poses(mech, np.array(mech.neutral))["forearm"]
    np.testing.assert_allclose(at_zero.rotation, roll_pitch_yaw((0.3, -0.4, 0.5)), atol=1e-15)
    np.testing.assert_allclose(at_zero.point, (0.1, -0.2, 0.3), atol=1e-15)


def test_a_joint_moves_along_its_axis(tmp_path: Path) -> None:
    axis = np.array([1.0, 2.0, 2.0]) / 3.0
    inside = ('<axis xyz="1 2 2"/>', '<limit lower="-1" upper="1"/>')
    for kind in ("revolute", "prismatic"):
        mech = dojo.load_urdf(arm(tmp_path, kind=kind, inside=inside), floating=False)
        frame = Pose(roll_pitch_yaw((0.3, -0.4, 0.5)), np.array([0.1, -0.2, 0.3]))
        moved = Pose(turn(axis, 0.7), np.zeros(3)) if kind == "revolute" else Pose(np.eye(3), 0.7 * axis)
        expected, found = frame.then(moved), poses(mech, np.array([0.7]))["forearm"]
        np.testing.assert_allclose(found.rotation, expected.rotation, atol=1e-15)
        np.testing.assert_allclose(found.point, expected.point, atol=1e-15)


def test_the_axis_is_x_when_left_out(tmp_path: Path) -> None:
    mech = dojo.load_urdf(arm(tmp_path, kind="continuous", inside=("<!-- no axis -->",)))
    assert mech.joints[1].axis == (1.0, 0.0, 0.0)


def test_limits_damping_and_bounds_arrive(tmp_path: Path) -> None:
    inside = ('<limit lower="-0.5" upper="2" effort="30" velocity="4"/>', '<dynamics damping="0.7"/>')
    mech = dojo.load_urdf(arm(tmp_path, inside=inside))
    elbow = mech.joints[1]
    assert (elbow.limits, elbow.damper) == (((-0.5, 2.0),), (0.7,))
    assert (mech.report.effort.tolist(), mech.report.velocity.tolist()) == ([30.0], [4.0])


@pytest.mark.parametrize(
    "limit", ['<limit effort="1" velocity="1"/>', "", '<limit lower="0" upper="0"/>', '<limit lower="1" upper="-1"/>']
)
def test_no_range_is_no_limit_and_is_said(tmp_path: Path, limit: str) -> None:
    mech = dojo.load_urdf(arm(tmp_path, inside=(AXIS, limit)))
    assert mech.joints[1].limits == ((-np.inf, np.inf),)
    assert "joints without limits" in str(mech.report)
    assert "elbow" in str(mech.report)


def test_a_continuous_joint_has_no_limits(tmp_path: Path) -> None:
    mech = dojo.load_urdf(arm(tmp_path, kind="continuous", inside=(AXIS, '<limit lower="-1" upper="1" effort="2"/>')))
    assert mech.joints[1].limits == ((-np.inf, np.inf),)


def test_inputs_act_on_what_moves_or_on_what_is_chosen(tmp_path: Path) -> None:
    tool = (link("hand"), joint("wrist", "forearm", "hand"))
    path = arm(tmp_path, *tool)
    assert dojo.load_urdf(path).input_names == ("elbow", "wrist")
    assert dojo.load_urdf(path, actuated=["wrist"]).input_names == ("wrist",)
    assert dojo.load_urdf(path, locked=["elbow"]).input_names == ("wrist",)
    with pytest.raises(
        ValueError, match=r"load_urdf\(actuated=\.\.\.\): joint that moves: 'knee' is not one of: .*elbow, wrist"
    ):
        dojo.load_urdf(path, actuated=["knee"])


# -- inertias ----------------------------------------------------------------------------------------------------------


def test_an_inertia_is_that_of_its_point_masses(tmp_path: Path, rng: np.random.Generator) -> None:
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


def branched(folder: Path) -> Path:
    """A tree with offset and turned inertias, three kinds of joints, and fixed links in the middle and at the ends."""
    turned = inertial(1.3, "0.05 -0.1 0.02", "0.7 -0.2 1.1")
    limits = '<limit lower="-1.5" upper="1.5"/>'
    return write(
        folder,
        link("base", turned),
        *(link(name, turned, BALL) for name in ("upper", "bracket", "lower", "slider", "tool")),
        link("marker", ""),
        joint("shoulder", "base", "upper", "revolute", '<axis xyz="1 1 0"/>', limits, '<dynamics damping="0.1"/>'),
        joint("plate", "upper", "bracket", "fixed", ""),
        joint("elbow", "bracket", "lower", "continuous", '<axis xyz="0 -1 2"/>'),
        joint("rail", "bracket", "slider", "prismatic", '<axis xyz="0 0 1"/>', limits),
        joint("flange", "lower", "tool", "fixed", ""),
        joint("spot", "tool", "marker", "fixed", ""),
    )


def test_poses_masses_and_energy_are_mujocos(tmp_path: Path, rng: np.random.Generator) -> None:
    pytest.importorskip("mujoco")
    pose, mass, energy = compare_with_mujoco(branched(tmp_path), rng)
    assert max(pose, mass) < 1e-13
    assert energy < 1e-9


def test_poses_are_those_of_the_simulator(tmp_path: Path, rng: np.random.Generator) -> None:
    mech = dojo.load_urdf(branched(tmp_path), ground=False)
    q = np.concatenate(
        [rng.normal(size=3), *[v / np.linalg.norm(v) for v in rng.normal(size=(1, 4))], rng.normal(size=3)]
    )
    z = dojo.Simulator(mech, 0.01).maximal(np.concatenate([q, np.zeros(mech.nv)]))
    for name, row in zip(mech.body_names, z, strict=True):
        pose = poses(mech, q)[name]
        np.testing.assert_allclose(pose.point, row[:3], atol=1e-13)
        np.testing.assert_allclose(pose.rotation, rotation_matrix(row[6:10]), atol=1e-13)


def test_merged_and_kept_fixed_joints_have_the_same_dynamics(tmp_path: Path, rng: np.random.Generator) -> None:
    """The same mass matrix; and motions that differ by what the step does to a body in two pieces, of second order."""
    mechs = [dojo.load_urdf(branched(tmp_path), merge_fixed=m, ground=False) for m in (True, False)]
    assert [m.nbody for m in mechs] == [4, 6]  # the marker has no mass, so it is never a body
    assert mechs[0].nv == mechs[1].nv == 9
    q = np.array(mechs[0].neutral)
    u = np.array([0.3 if n == "elbow" else -1.0 if n == "rail" else 0.5 for n in mechs[0].input_names])
    for _ in range(5):
        v = 0.1 * rng.normal(size=9)
        sims = [dojo.Simulator(m, 1e-3) for m in mechs]
        one, other = (s.kinetic_energy(s.start(q, v)) for s in sims)
        np.testing.assert_allclose(one, other, rtol=1e-10)
    apart = []
    for h in (0.01, 0.005):
        sims = [dojo.Simulator(m, h) for m in mechs]
        one, other = (s.rollout(s.start(q, v), np.tile(u, (round(0.6 / h), 1)), throw=True).x[-1, :10] for s in sims)
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
    there, here = poses(free, q), poses(held, np.array([0.3]))
    for name in ("upper", "lower", "tool", "slider"):
        a, b = free.report.links[name], held.report.links[name]
        np.testing.assert_allclose(here[b.body].at(b.point), there[a.body].at(a.point), atol=1e-14)
    total = sum(b.mass * there[b.name].point for b in free.bodies) / sum(b.mass for b in free.bodies)
    np.testing.assert_allclose(here["upper"].point, total, atol=1e-14)


def test_a_link_without_mass_joins_its_neighbour(tmp_path: Path) -> None:
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


def test_a_repair_changes_only_what_is_impossible() -> None:
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


# -- the base ----------------------------------------------------------------------------------------------------------


def test_a_fixed_base_stands_where_it_is_put(tmp_path: Path) -> None:
    for merge in (True, False):
        mech = dojo.load_urdf(arm(tmp_path), floating=False, merge_fixed=merge, position=(1.0, 2.0, 3.0))
        assert mech.nv == 1
        np.testing.assert_allclose(poses(mech, np.zeros(1))["forearm"].point, (1.1, 1.8, 3.3), atol=1e-15)
        assert mech.joint_names == (("elbow",) if merge else ("fixed_base", "elbow"))


def test_a_root_called_world_is_the_world(tmp_path: Path) -> None:
    path = write(tmp_path, link("world", ""), link("arm"), joint("pivot", "world", "arm"))
    mech = dojo.load_urdf(path)
    assert (mech.nv, mech.joints[0].parent, mech.report.links["world"].body) == (1, "world", None)
    assert "fixed there although floating=True" in str(mech.report)


def test_the_base_joint_makes_way_for_a_joint_of_its_name(tmp_path: Path) -> None:
    path = write(tmp_path, link("base"), link("arm"), joint("floating_base", "base", "arm"))
    assert dojo.load_urdf(path, ground=False).joint_names == ("base_floating_base", "floating_base")
    assert dojo.load_urdf(path, ground=False, locked=["floating_base"]).joint_names == ("floating_base",)


def test_the_neutral_state_is_within_limits_and_can_be_chosen(tmp_path: Path) -> None:
    path = arm(tmp_path, inside=(AXIS, '<limit lower="-2" upper="-1"/>'))
    assert dojo.load_urdf(path, floating=False).neutral == (-1.5,)
    assert dojo.load_urdf(path, floating=False, neutral={"elbow": -1.2}).neutral == (-1.2,)
    mech = dojo.load_urdf(path, neutral={"floating_base": (0, 0, 5, 1, 0, 0, 0)})
    assert mech.neutral[2] == 5.0
    with pytest.raises(
        ValueError, match=r"load_urdf\(neutral=\.\.\.\): joint: 'knee' is not one of: elbow, floating_base"
    ):
        dojo.load_urdf(path, neutral={"knee": 1.0})
    with pytest.raises(ValueError, match=r"load_urdf\(neutral=\.\.\.\): joint: 'floating_base' is not one of: elbow"):
        dojo.load_urdf(path, floating=False, neutral={"floating_base": (0, 0, 5, 1, 0, 0, 0)})
    ball = arm(tmp_path, kind="spherical", inside=("",))
    assert dojo.load_urdf(ball, neutral={"elbow": (0, 1, 0, 0)}).neutral[-4:] == (0.0, 1.0, 0.0, 0.0)
    with pytest.raises(ValueError, match=r"joint 'elbow' does not move, or is held where all coordinates are zero"):
        dojo.load_urdf(ball, neutral={"elbow": (0, 1, 0, 0)}, locked=["elbow"])


def test_a_base_that_floats_in_the_file_is_put_on_the_ground_too(tmp_path: Path) -> None:
    at = 'xyz="0 0 7" rpy="1 0.3 0"'
    path = write(
        tmp_path,
        link("world", ""),
        link("base", inertial(), BALL),
        joint("free", "world", "base", "floating", "", at=at),
    )
    mech = dojo.load_urdf(path)
    assert mech.joint_names == ("free",)
    np.testing.assert_allclose(poses(mech, np.array(mech.neutral))["base"].point, (0, 0, 0.1), atol=1e-8)


# -- what is not represented -------------------------------------------------------------------------------------------


def test_mimics_move_freely_with_a_warning_or_are_locked(tmp_path: Path) -> None:
    path = arm(tmp_path, link("hand"), joint("wrist", "forearm", "hand", "continuous", AXIS, '<mimic joint="elbow"/>'))
    with pytest.warns(dojo.UrdfWarning, match="mimic joints are not modelled.*each moves freely: wrist"):
        assert dojo.load_urdf(path, ground=False).nv == 8
    with pytest.warns(dojo.UrdfWarning, match="are held where they are: wrist"):
        assert dojo.load_urdf(path, ground=False, mimic="locked").joint_names == ("floating_base", "elbow")
    assert dojo.load_urdf(path, ground=False, locked=["wrist"]).joint_names == ("floating_base", "elbow")
    with pytest.raises(ValueError, match=r"load_urdf\(mimic=\.\.\.\): 'follow' is not one of: free, locked, gear"):
        dojo.load_urdf(path, mimic="follow")


def test_dry_friction_and_unread_elements_are_in_the_report(tmp_path: Path) -> None:
    extra = '<transmission name="t"/>'
    mech = dojo.load_urdf(arm(tmp_path, extra, inside=(AXIS, '<dynamics friction="0.2"/>')))
    texts = [str(note) for note in mech.report.notes]
    assert any("dry friction" in text and text.endswith("elbow") for text in texts)
    assert "not read: <transmission> (1)" in texts
    assert str(mech.report).startswith("robot.urdf: 2 links, 0 of them")


def test_the_report_stays_with_the_mechanism(tmp_path: Path) -> None:
    path = arm(tmp_path, link("foot", BALL), joint("ankle", "forearm", "foot", "fixed", ""))
    sim = dojo.Simulator(dojo.load_urdf(path), 0.01)
    again = pickle.loads(pickle.dumps(sim)).replace(friction=0.1).mechanism
    assert again.report.links == sim.mechanism.report.links
    assert again.contacts[0].friction == 0.1
    assert "floating_base" in sim.describe()
    hash(sim.mechanism)


def test_bodies_are_drawn_with_their_largest_shape(tmp_path: Path) -> None:
    shapes = "".join(
        f'<visual><origin xyz="0 0 1"/><geometry>{s}</geometry></visual>'
        for s in ('<sphere radius="0.1"/>', '<box size="1 2 3"/>', '<mesh filename="package://a/b.stl"/>')
    )
    mech = dojo.load_urdf(write(tmp_path, link("base", inertial(xyz="0 0 0.5"), shapes)), ground=False)
    assert mech.bodies[0].shape == dojo.Box(1, 2, 3, center=(0, 0, 0.5))
    assert SKEWED[0] == mech.bodies[0].inertia[0][0]
