"""The base of a robot from a URDF file: fixed, floating, called world; and the state it stands in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import dojo_opt as dojo
from sim.mechanism.forward_kinematics import body_poses
from support.urdf_files import AXIS, BALL, arm, inertial, joint, link, write


def test_a_fixed_base_stands_where_it_is_put(tmp_path: Path) -> None:
    for merge in (True, False):
        mech = dojo.load_urdf(arm(tmp_path), floating=False, merge_fixed=merge, position=(1.0, 2.0, 3.0))
        assert mech.nv == 1
        np.testing.assert_allclose(body_poses(mech.joints, np.zeros(1))["forearm"].point, (1.1, 1.8, 3.3), atol=1e-15)
        assert mech.joint_names == (("elbow",) if merge else ("fixed_base", "elbow"))
        root = dojo.Kinematics(dojo.Simulator(mech, time_step=0.01)).pose(next(iter(mech.report.links)), np.zeros(1))
        np.testing.assert_allclose(root[0], (1.0, 2.0, 3.0), atol=1e-15)


def test_a_root_called_world_is_the_world(tmp_path: Path) -> None:
    path = write(tmp_path, link("world", ""), link("arm"), joint("pivot", "world", "arm"))
    mech = dojo.load_urdf(path)
    assert (mech.nv, mech.joints[0].parent, mech.report.links["world"].body) == (1, "world", None)
    assert "fixed there although floating=True" in str(mech.report)


def test_what_the_world_alone_holds_floats_when_asked_to(tmp_path: Path) -> None:
    """The parts of an arm, each in a file with its stand, are things to drop."""
    path = write(
        tmp_path, link("world", ""), link("arm", inertial(mass=2.0)), joint("stand", "world", "arm", "fixed", "")
    )
    with pytest.warns(
        dojo.UrdfWarning, match="fixed to the world; as floating=True, they float without this joint: stand"
    ):
        mech = dojo.load_urdf(path, ground=False)
    assert (mech.nv, mech.joints[0].kind, mech.bodies[0].mass) == (6, "floating", 2.0)
    with pytest.raises(dojo.UrdfError, match="no joint is free to move"):
        dojo.load_urdf(path, floating=False)


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
    with pytest.raises(ValueError, match=r"joint 'elbow' is fixed, or locked at zero"):
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
    np.testing.assert_allclose(body_poses(mech.joints, np.array(mech.neutral))["base"].point, (0, 0, 0.1), atol=1e-8)
