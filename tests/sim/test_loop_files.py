"""Loops in files: <loop_joint> of URDF, <connect> and <weld> of MJCF."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import dojo_opt as dojo
from sim.mechanism.joint import KINDS
from sim.mechanism.pose import roll_pitch_yaw
from support.linkage import fourbar
from support.urdf_files import SKEWED, inertial, joint, link, write

BAR = "<axis xyz='0 1 0'/>"


def bar(name: str, length: float) -> str:
    """Of 2 kg per metre, its frame at its start."""
    m, w = 2.0 * length, 0.05
    cross, along = m * (length**2 + w**2) / 12, m * (2 * w**2) / 12
    return link(name, inertial(m, f"{length / 2} 0 0", inertia=(along, cross, cross, 0.0, 0.0, 0.0)))


PARTS = (
    link("ground"),
    bar("crank", 0.5),
    bar("coupler", 1.0),
    bar("rocker", 0.8),
    joint("crank", "ground", "crank", "continuous", BAR, at='xyz="0 0 0"'),
    joint("coupler", "crank", "coupler", "continuous", BAR, at='xyz="0.5 0 0"'),
    joint("rocker", "ground", "rocker", "continuous", BAR, at='xyz="1 0 0"'),
)
PIN = (
    '<loop_joint name="pin" type="continuous"><link1 link="coupler" xyz="1 0 0"/>'
    '<link2 link="rocker" xyz="0.8 0 0"/><axis xyz="0 1 0"/>{}</loop_joint>'
)
NEUTRAL = {"crank": -1.0, "coupler": 0.6, "rocker": -1.2}


@pytest.mark.parametrize("damping", [0.0, 0.7])
def test_a_loop_joint_agrees_with_the_mechanism_by_hand(tmp_path: Path, damping: float) -> None:
    path = write(tmp_path, *PARTS, PIN.format(f'<dynamics damping="{damping}"/>'))
    mech = dojo.load_urdf(path, floating=False, neutral=NEUTRAL)
    by_hand = fourbar("pin", damper=damping)
    assert [j.kind for j in mech.loops] == [j.kind for j in by_hand.loops]
    assert mech.input_names == ("crank", "coupler", "rocker")
    a, b = (dojo.Simulator(m, time_step=0.01, tolerance=1e-11) for m in (mech, by_hand))
    ta, tb = (s.rollout(s.neutral(), np.zeros((50, s.nu)), throw=True) for s in (a, b))
    for name in ("crank", "coupler", "rocker"):
        np.testing.assert_allclose(ta.x[:, a.mechanism.q_slice(name)], tb.x[:, b.mechanism.q_slice(name)], atol=1e-9)


def test_a_loop_joint_has_its_dry_friction_where_it_is_wanted(tmp_path: Path) -> None:
    path = write(tmp_path, *PARTS, PIN.format('<dynamics friction="2"/>'))
    plain, rough = (dojo.load_urdf(path, floating=False, neutral=NEUTRAL, joint_friction=on) for on in (False, True))
    assert "dry friction of the file, which joint_friction=True adds to hinges: pin" in str(plain.report)
    assert "dry friction" not in str(rough.report)
    by_hand = fourbar("pin", friction=2.0)
    assert [(j.name, j.friction) for j in rough.joints] == [(j.name, j.friction) for j in by_hand.joints]
    assert ("pin", (2.0,)) in [(j.name, j.friction) for j in rough.joints]
    below = write(tmp_path, *PARTS, PIN.format('<dynamics friction="-2"/>'))
    with pytest.warns(dojo.UrdfWarning, match="friction is negative in the file have none: pin"):
        assert dojo.load_urdf(below, floating=False, neutral=NEUTRAL, joint_friction=True).nv == 3


def test_the_frames_of_both_links_are_read(tmp_path: Path) -> None:
    """The same pin with its axis along z of turned frames; one of them merged into its body through a fixed joint."""
    turned = PIN.replace('xyz="1 0 0"', 'xyz="0 0 0" rpy="-1.5707963267948966 0 0"').replace("coupler", "tip")
    turned = turned.replace('xyz="0.8 0 0"', 'xyz="0.8 0 0" rpy="-1.5707963267948966 0.3 0"')
    turned = turned.replace('axis xyz="0 1 0"', 'axis xyz="0 0 1"')
    tip = joint("tip", "coupler", "tip", "fixed", at='xyz="1 0 0"')
    found = []
    for parts in ((PIN.format(""),), (link("tip", inertial(0.0, inertia=(0,) * 6)), tip, turned.format(""))):
        mech = dojo.load_urdf(write(tmp_path, *PARTS, *parts), floating=False, neutral=NEUTRAL)
        sim = dojo.Simulator(mech, time_step=0.01)
        found.append(sim.rollout(sim.neutral(), np.zeros((20, sim.nu)), throw=True).x)
    np.testing.assert_allclose(found[0], found[1], atol=1e-9)


def test_a_motor_on_a_loop_joint(tmp_path: Path) -> None:
    path = write(tmp_path, *PARTS, PIN.format('<limit lower="-2" upper="2" effort="7" velocity="3"/>'))
    mech = dojo.load_urdf(path, floating=False, neutral=NEUTRAL, actuated=["pin"])
    assert mech.input_names == ("pin",) and mech.report is not None
    assert (mech.report.effort, mech.report.velocity) == (7.0, 3.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('link="rocker"', 'link="nothing"'), "line 9, <link2>: 'nothing' is not a link of the file"),
        (('link="rocker"', 'link="coupler"'), "expected two different links, got 'coupler' twice"),
        (('name="pin"', 'name="crank"'), "the name is taken by the <joint> of line 6"),
        (("continuous", "welded"), "type 'welded' is not one of"),
        (("continuous", "floating"), "a floating joint without damping constrains nothing"),
        (("<link2", "<link3"), "expected a <link2> inside"),
        (('link="rocker"', 'link="ground"'), "'ground' is part of the world; exchange link1 and link2"),
    ],
)
def test_wrong_loop_joints_are_refused(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    path = write(tmp_path, *PARTS, PIN.format("").replace("\n", "").replace(*change), "")
    with pytest.raises(ValueError, match=message.replace("(", r"\(")):
        dojo.load_urdf(path, floating=False)


ARM = (  # three bodies on ball joints, from the origin along x, y, then down
    link("base"),
    *(link(name, inertial(1.0, xyz)) for name, xyz in (("a", ".25 0 0"), ("b", "0 .25 0"), ("c", "0 0 -.25"))),
    *(
        joint(name, parent, name, "ball", "", at=f"xyz='{xyz}'")
        for name, parent, xyz in (("a", "base", "0 0 0"), ("b", "a", ".5 0 0"), ("c", "b", "0 .5 0"))
    ),
)
END = (
    '<loop_joint name="end" type="{}"><link1 link="base" xyz=".5 .5 -.5" rpy="0.3 -0.4 0.5"/>'
    '<link2 link="c" xyz="0 0 -.5"/><axis xyz=".6 0 .8"/><dynamics damping="{}"/></loop_joint>'
)
DAMPED = ("cylindrical", "floating")


def arm_by_hand(kind: str, damper: float) -> dojo.Mechanism:
    """The same arm, its end on a joint of the given kind."""
    xx, yy, zz, xy, xz, yz = SKEWED
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    x, y, z = 0.25 * np.eye(3)
    joints = [
        dojo.Joint("spherical", None, "a", child_point=-x),
        dojo.Joint("spherical", "a", "b", parent_point=x, child_point=-y),
        dojo.Joint("spherical", "b", "c", parent_point=y, child_point=z),
        dojo.Joint(
            kind, None, "c", "end", (0.5, 0.5, -0.5), -z, axis=roll_pitch_yaw((0.3, -0.4, 0.5)) @ (0.6, 0, 0.8),
            damper=damper, close=True,
        ),
    ]  # fmt: skip
    return dojo.Mechanism([dojo.Body(name, 1.0, inertia) for name in "abc"], joints, inputs=[])


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "screw"])  # no file gives its pitch
def test_every_kind_closes_a_loop(tmp_path: Path, kind: str) -> None:
    damper = 0.3 if kind in DAMPED else 0.0
    given = END.format("planarfixed" if kind == "planar" else kind, damper)
    mech = dojo.load_urdf(write(tmp_path, *ARM, given), floating=False, ground=False, actuated=[])
    by_hand = arm_by_hand(kind, damper)
    assert [joint.kind for joint in mech.loops] == [joint.kind for joint in by_hand.loops]
    found = []
    for m in (mech, by_hand):
        sim = dojo.Simulator(m, time_step=0.01, tolerance=1e-11)
        x = sim.neutral()
        x[sim.nq : sim.nq + 9] = np.random.default_rng(3).normal(size=9)
        t = sim.rollout(sim.close(x), np.zeros((30, 0)), throw=True)
        assert max(np.abs(gap).max() for gap in sim.loop_gaps(t.x[-1]).values()) < 1e-10
        found.append(sim.maximal(t.x)[:, :3])
    np.testing.assert_allclose(found[0], found[1], atol=1e-8)
    assert np.ptp(found[0][:, :, 3:6], axis=0).max() > 0.1  # they move


MJCF = """
<mujoco>
  <worldbody>
    <body name="crank" pos="0 0 1"><joint name="crank" axis="0 1 0"/>
      <geom type="box" contype="0" conaffinity="0" size="0.25 0.025 0.025" pos="0.25 0 0" mass="1"/>
      <body name="coupler" pos="0.5 0 0"><joint name="coupler" axis="0 1 0"/>
        <geom type="box" contype="0" conaffinity="0" size="0.5 0.025 0.025" pos="0.5 0 0" mass="2"/>
        <site name="end" pos="1 0 0"/>
      </body>
    </body>
    <body name="rocker" pos="1 0 1"><joint name="rocker" axis="0 1 0"/>
      <geom type="box" contype="0" conaffinity="0" size="0.4 0.025 0.025" pos="0.4 0 0" mass="1.6"/>
      <site name="top" pos="0.8 0 0"/>
    </body>
    <body name="load" pos="0.3 0 1.5"><freejoint/><geom type="box" contype="0" conaffinity="0" size="0.1 0.1 0.1" mass="0.7"/></body>
  </worldbody>
  <equality>{}</equality>
</mujoco>
"""
BY_BODY = '<connect name="pin" body1="coupler" body2="rocker" anchor="1 0 0"/>'
BY_SITE = '<connect name="pin" site1="end" site2="top"/>'
WELD = '<weld name="glue" body1="crank" body2="load" relpose="0.2 0.1 0.2 0.8 0.6 0 0"/>'


def test_connect_and_weld(tmp_path: Path) -> None:
    """A four-bar that is closed by its file, and a load on its crank: both stay, and both ways to say it are one."""
    pytest.importorskip("mujoco")
    # the anchor of body 2 is where both coincide at qpos0: not in this four-bar, so sites say it
    mech = dojo.load_mjcf(MJCF.format(BY_SITE + WELD))
    assert [(j.kind, j.name, j.parent, j.child) for j in mech.loops] == [
        ("spherical", "pin", "coupler", "rocker"),
        ("fixed", "glue", "crank", "load"),
    ]
    sim = dojo.Simulator(mech, time_step=0.005, tolerance=1e-11)
    q = np.concatenate([[-1.0, 0.6, -1.2], np.asarray(mech.neutral)[3:]])
    x = sim.close(np.concatenate([q, np.zeros(sim.nv)]))
    t = sim.rollout(x, np.zeros((100, 0)), throw=True)
    assert max(np.abs(gap).max() for gap in sim.loop_gaps(t.x[-1]).values()) < 1e-10
    z = sim.maximal(t.x[-1])[[mech.body_names.index(name) for name in ("crank", "load")]]
    from naive import rotation as rot

    inside = rot.rotate(rot.conj(z[0, 6:10]), z[1, :3] - z[0, :3]) + (0.25, 0, 0)
    np.testing.assert_allclose(inside, (0.2, 0.1, 0.2), atol=1e-9)
    turned = rot.mul(rot.conj(z[0, 6:10]), z[1, 6:10])
    np.testing.assert_allclose(turned * np.sign(turned[0]), (0.8, 0.6, 0, 0), atol=1e-9)
    assert mech.report is not None and "equality constraints are rigid here: pin, glue" in str(mech.report)


def test_the_anchor_in_the_second_body() -> None:
    """As MuJoCo computes it, from the poses at qpos0."""
    mujoco = pytest.importorskip("mujoco")
    text = MJCF.format(BY_BODY)
    mech, model = dojo.load_mjcf(text), mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    at = data.body("coupler").xpos + (1.0, 0, 0) - data.body("rocker").xpos - (0.4, 0, 0)
    np.testing.assert_allclose(mech.loops[0].child_point, at, atol=1e-12)


def test_the_loop_moves_as_in_mujoco() -> None:
    """From rest, where MuJoCo's connect is stiff: the same angles after 0.2 s."""
    mujoco = pytest.importorskip("mujoco")
    text = MJCF.format(BY_SITE).replace("<mujoco>", '<mujoco><option timestep="1e-4" solver="Newton"/>')
    text = text.replace('site2="top"', 'site2="top" solref="3e-4 1" solimp="0.9999 0.9999 0.001"')
    mech, model = dojo.load_mjcf(text), mujoco.MjModel.from_xml_string(text)
    sim = dojo.Simulator(mech, time_step=2e-4)
    q = np.concatenate([[-1.0, 0.6, -1.2], np.asarray(mech.neutral)[3:]])
    x = sim.close(np.concatenate([q, np.zeros(sim.nv)]))
    data = mujoco.MjData(model)
    data.qpos[:] = x[: sim.nq]
    for _ in range(2000):
        mujoco.mj_step(model, data)
    end = sim.rollout(x, np.zeros((1000, 0)), throw=True).x[-1]
    assert np.abs(end[:3] - x[:3]).max() > 0.05
    np.testing.assert_allclose(end[:3], data.qpos[:3], atol=1e-3)
