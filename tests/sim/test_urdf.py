"""Links and joints of URDF files are read, and unsupported elements are reported."""

from __future__ import annotations

import pickle
import warnings
from pathlib import Path

import numpy as np
import pytest

import dojo_opt as dojo
from sim.mechanism.forward_kinematics import body_poses
from sim.mechanism.joint import KINDS as JOINT_KINDS
from sim.mechanism.pose import Pose, quaternion, roll_pitch_yaw, turn
from sim.mechanism.shapes import rotation_matrix
from support.urdf_files import AXIS, BALL, SKEWED, arm, inertial, joint, link, write

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
    "planarfixed": ("planar", 2, 2),
    "freerevolute": ("free_revolute", 4, 4),
    "prismatic_orbital": ("prismatic_orbital", 3, 3),
    "planarorbital": ("planar_orbital", 4, 4),
    "free_orbital": ("free_orbital", 5, 5),
}


def test_no_kind_of_joint_is_without_a_type() -> None:
    assert {"fixed", "screw"} | {kind for kind, *_ in KINDS.values()} == set(JOINT_KINDS)


def test_a_screw_is_refused(tmp_path: Path) -> None:
    """URDF has no attribute for its pitch."""
    with pytest.raises(dojo.UrdfError, match="type 'screw' is not one of: fixed, revolute"):
        dojo.load_urdf(arm(tmp_path, kind="screw", inside=(AXIS,)), floating=False)


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
    at_zero = body_poses(mech.joints, np.array(mech.neutral))["forearm"]
    np.testing.assert_allclose(at_zero.rotation, roll_pitch_yaw((0.3, -0.4, 0.5)), atol=1e-15)
    np.testing.assert_allclose(at_zero.point, (0.1, -0.2, 0.3), atol=1e-15)


def test_a_joint_moves_along_its_axis(tmp_path: Path) -> None:
    axis = np.array([1.0, 2.0, 2.0]) / 3.0
    inside = ('<axis xyz="1 2 2"/>', '<limit lower="-1" upper="1"/>')
    for kind in ("revolute", "prismatic"):
        mech = dojo.load_urdf(arm(tmp_path, kind=kind, inside=inside), floating=False)
        frame = Pose(roll_pitch_yaw((0.3, -0.4, 0.5)), np.array([0.1, -0.2, 0.3]))
        moved = Pose(turn(axis, 0.7), np.zeros(3)) if kind == "revolute" else Pose(np.eye(3), 0.7 * axis)
        expected, found = frame.then(moved), body_poses(mech.joints, np.array([0.7]))["forearm"]
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


def test_inputs_act_on_moving_or_on_chosen_joints(tmp_path: Path) -> None:
    tool = (link("hand"), joint("wrist", "forearm", "hand"))
    path = arm(tmp_path, *tool)
    assert dojo.load_urdf(path).input_names == ("elbow", "wrist")
    assert dojo.load_urdf(path, actuated=["wrist"]).input_names == ("wrist",)
    assert dojo.load_urdf(path, locked=["elbow"]).input_names == ("wrist",)
    with pytest.raises(
        ValueError, match=r"load_urdf\(actuated=\.\.\.\): joint that moves: 'knee' is not one of: .*elbow, wrist"
    ):
        dojo.load_urdf(path, actuated=["knee"])


# -- unsupported elements ----------------------------------------------------------------------------------------------


def test_mimics_become_gears_or_move_freely_with_a_warning_or_are_locked(tmp_path: Path) -> None:
    path = arm(tmp_path, link("hand"), joint("wrist", "forearm", "hand", "continuous", AXIS, '<mimic joint="elbow"/>'))
    mech = dojo.load_urdf(path, floating=False)
    assert mech.gears == (dojo.Gear("wrist", "elbow"),) and mech.input_names == ("elbow",)
    with pytest.warns(
        dojo.UrdfWarning, match="mimic joints that follow none with a coordinate.*each moves freely: wrist"
    ):
        assert dojo.load_urdf(path, floating=False, locked=["elbow"]).gears == ()
    with pytest.warns(dojo.UrdfWarning, match="mimic joints are not modelled.*each moves freely: wrist"):
        assert dojo.load_urdf(path, ground=False, mimic="free").nv == 8
    with pytest.warns(dojo.UrdfWarning, match="are held where they are: wrist"):
        assert dojo.load_urdf(path, ground=False, mimic="locked").joint_names == ("floating_base", "elbow")
    held = dojo.load_urdf(path, floating=False, locked=["wrist"], neutral={"elbow": 0.3})
    assert held.joint_names == ("elbow",)
    assert "joints that are held do not hold those that they follow: elbow" in map(str, held.report.notes)
    hand = dojo.Kinematics(dojo.Simulator(held, 0.01)).pose("hand", held.neutral)
    for name in ("elbow", "wrist"):  # one says where both are
        both = dojo.load_urdf(path, floating=False, neutral={name: 0.3})
        assert both.neutral == pytest.approx((0.3, 0.3))
        there = dojo.Kinematics(dojo.Simulator(both, 0.01)).pose("hand", both.neutral)
        np.testing.assert_allclose(there[1], hand[1], atol=1e-12)
    with pytest.raises(
        ValueError, match=r"neutral=\.\.\.\): joint 'wrist' follows 'elbow', which puts it at 0.3, got 0.1"
    ):
        dojo.load_urdf(path, neutral={"elbow": 0.3, "wrist": 0.1})
    with pytest.raises(
        ValueError, match=r"load_urdf\(mimic=\.\.\.\): 'follow' is not one of: auto, free, locked, gear"
    ):
        dojo.load_urdf(path, mimic="follow")


def test_dry_friction_and_unread_elements_are_in_the_report(tmp_path: Path) -> None:
    extra = '<transmission name="t"/><link name="ball"><contact><stiffness value="9"/></contact></link>'
    fixed = joint("weld", "forearm", "ball", "fixed", "<calibration rising='0'/>", "<actuator name='a'/>")
    inside = (AXIS, '<dynamics friction="0.2" armature="0.1"/>')
    mech = dojo.load_urdf(arm(tmp_path, extra, fixed, inside=inside))
    texts = [str(note) for note in mech.report.notes]
    assert any("dry friction" in text and text.endswith("elbow") for text in texts)
    places = ("<joint><dynamics armature>", "<transmission>", "<link><contact><stiffness>", "<joint><actuator>")
    assert f"not read: {', '.join(f'{place} (1)' for place in places)}" in texts
    rubbing = dojo.load_urdf(tmp_path / "robot.urdf", joint_friction=True)
    assert rubbing.joints[1].friction == (0.2,) and not any("dry" in str(note) for note in rubbing.report.notes)
    assert str(mech.report).startswith("robot.urdf: 3 links, 1 of them")


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


def test_materials_are_those_of_the_file_or_of_another_link(tmp_path: Path) -> None:
    def drawn(material: str) -> str:
        return f'<visual><geometry><sphere radius="0.1"/></geometry>{material}</visual>'

    parts = [
        '<material name="sky"><color rgba="0 0.5 1 1"/></material>',
        link("a", inertial(), drawn('<material name="own"><color rgba="1 0 0 1"/></material>')),
        link("b", inertial(), drawn('<material name="own"/>') + drawn('<material name="sky"/>')),
        joint("ab", "a", "b"),
    ]
    mech = dojo.load_urdf(write(tmp_path, *parts), contacts=[])
    assert [visual.color for body in mech.bodies for visual in body.visuals] == [
        (1.0, 0.0, 0.0, 1.0),
        (1.0, 0.0, 0.0, 1.0),
        (0.0, 0.5, 1.0, 1.0),
    ]
    assert not any("not read" in note.text for note in mech.report.notes)
