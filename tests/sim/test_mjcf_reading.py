"""load_mjcf: conversion of rows of joints, omitted elements, and refusals."""

from __future__ import annotations

from contextlib import nullcontext

import numpy as np
import pytest

from sim.io.mjcf import MjcfMechanism, MjcfWarning, load_mjcf, omitted
from sim.simulator.simulator import Simulator

pytest.importorskip("mujoco")


def test_slides_and_a_hinge_become_one_joint() -> None:
    joints = {
        "planar_axis": '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/><joint axis="0 -1 0"/>',
        "cylindrical": '<joint type="slide" axis="0 1 0"/><joint axis="0 1 0"/>',
        "fixed_orientation": "".join(f'<joint type="slide" axis="{a}"/>' for a in ("1 0 0", "0 1 0", "0 0 1")),
        "planar": '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>',
        "floating": "<freejoint/>",
    }
    for kind, text in joints.items():
        body = f'<body pos="0 0 1">{text}<geom size="0.1"/></body>'
        mech = load_mjcf(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
        assert [j.kind for j in mech.joints] == [kind]
    turned = (
        '<body quat="0.7 0.1 0.1 0.7"><joint type="slide" axis="1 1 0"/><joint axis="0 0 1"/><geom size="0.1"/></body>'
    )
    mech = load_mjcf(f"<mujoco><worldbody>{turned}</worldbody></mujoco>")
    assert [j.kind for j in mech.joints] == ["prismatic", "revolute"]


@pytest.mark.parametrize("axis", ["1 0 0", "1 2 3"])
def test_hinges_about_one_axis_are_refused(axis: str) -> None:
    text = (
        '<mujoco><worldbody><body><joint name="a" axis="{0}"/><joint name="b" axis="{0}" {1}/>'
        '<geom size="0.1" pos="0 0 0.2"/></body></worldbody></mujoco>'
    )
    with pytest.raises(ValueError, match=r"joints 'a' and 'b' move along one axis"):
        load_mjcf(text.format(axis, ""))
    for held in ('pos="0 0 0.1"' if axis == "1 0 0" else 'pos="0.1 0 0"', 'damping="1"'):
        sim = Simulator(load_mjcf(text.format(axis, held)), time_step=0.01)
        assert sim.step(sim.neutral() + 0.1, np.zeros(0)).status.name == "SOLVED"


def test_omitted_elements_are_reported() -> None:
    text = """
    <mujoco><option density="1000"/><worldbody>
      <body name="a"><freejoint/><geom name="g" size="0.1"/></body>
      <body name="b" pos="0 0 1"><joint name="j" frictionloss="1"/><geom name="h" size="0.1" pos="1 0 0"/></body>
      <body name="c" pos="0 0 2"><joint name="k"/><geom size="0.1" pos="1 0 0"/></body>
    </worldbody><equality><joint name="w" joint1="j" joint2="k" polycoef="0 1 2 0 0"/></equality></mujoco>"""
    with pytest.warns(MjcfWarning):
        report = load_mjcf(text).report
    assert report is not None
    for words in ("that hold one joint, or are not linear, are omitted: w", "hinges and slides: j", "drag of a fluid",
                  "bodies do not collide"):  # fmt: skip
        assert words in str(report), words
    with pytest.warns(MjcfWarning):
        rubbing = load_mjcf(text, joint_friction=True)
    assert [float(np.max(joint.friction)) for joint in rubbing.joints] == [0.0, 1.0, 0.0]
    assert "dry" not in str(rubbing.report)


ARM = """<mujoco><compiler angle="radian"/><option><flag {}/></option><worldbody><geom name="floor" type="plane" size="1 1 1"/>
  <body pos="0 0 1"><joint name="j" axis="0 1 0" range="-1 1" limited="true" damping="3" stiffness="2" {}/>
    <geom size=".1" pos="0 0 .3"/></body></worldbody>
  <actuator><motor name="m" joint="j" ctrlrange="-100 100" group="2"/>{}</actuator></mujoco>"""


def test_flags_of_the_file_are_heeded() -> None:
    def load(*flags: str) -> MjcfMechanism:
        return load_mjcf(ARM.format(" ".join(f'{flag}="disable"' for flag in flags), "", ""))

    for flag, field, before in (("limit", "limits", (-1.0, 1.0)), ("damper", "damper", 3.0), ("spring", "spring", 2.0)):
        assert getattr(load().joints[0], field) == (before,)
        mech = load(flag)
        assert getattr(mech.joints[0], field)[0] in (0.0, (-np.inf, np.inf)), flag
        assert f"that disable these: {flag}" in str(mech.report)
    assert load("constraint").joints[0].limits == load("limit").joints[0].limits
    assert load("gravity").gravity == (0.0, 0.0, 0.0) != load().gravity
    assert not load("contact").contacts and len(load().contacts) == 1
    assert load_mjcf(ARM.format('gravity="disable"', "", ""), gravity=(0, 0, -1)).gravity == (0.0, 0.0, -1.0)
    off = load("actuation")
    assert not off.inputs and "switches off are omitted: m" in str(off.report)
    grouped = ARM.replace("<option>", '<option actuatorgroupdisable="2">').format("", "", "")
    assert not load_mjcf(grouped).inputs


def test_ranges_of_actuator_forces_are_read() -> None:
    ranged = 'actuatorfrcrange="-5 3"'
    assert load_mjcf(ARM.format("", ranged, "")).input_limits == ([-5.0], [3.0])
    servo = '<position name="s" joint="j" kp="50" forcerange="-4 20"/>'
    with pytest.warns(MjcfWarning, match="bounds each of their actuators alone, and none at a site: j"):
        mech = load_mjcf(ARM.format("", ranged, servo))
    assert [part.force_limits[1] for part in mech.inputs or ()] == [np.inf, 3.0]
    with pytest.warns(MjcfWarning, match="inputs without bounds, where those of the file leave one value: m \\(3\\)"):
        load_mjcf(ARM.replace("-100 100", "4 100").format("", ranged, ""))


def test_free_joints_have_the_armature_of_their_translations() -> None:
    text = '<mujoco><worldbody><body><joint name="j" type="free" {}/><geom size=".1"/></body></worldbody></mujoco>'
    with pytest.warns(MjcfWarning, match="armature of the rotations of free joints is omitted: j"):
        assert load_mjcf(text.format('armature="2"')).joints[0].armature == (2.0, 2.0, 2.0, 0.0, 0.0, 0.0)
    with pytest.warns(MjcfWarning, match="springs of free joints are omitted: j"):
        load_mjcf(text.format('stiffness="50"'))


WALL = """<mujoco><worldbody>{}<geom type="plane" size="2 2 .1" {}/>
  <body pos="0 0 1"><freejoint/><geom name="ball" type="sphere" size=".1"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize("floor", ["", '<geom type="plane" size="2 2 .1"/>'])
@pytest.mark.parametrize(
    "turned", ['zaxis="1 0 0"', 'quat="1 0 1 0"', 'pos="0 0 1" zaxis="1 0 .2"', 'pos="0 0 1" zaxis="0 0 -1"']
)
def test_a_wall_does_not_raise_a_base(floor: str, turned: str) -> None:
    """Neither by its depth over the rounding of its normal, nor down to the floor."""
    with pytest.warns(MjcfWarning, match=r"inside of the ground in the neutral state: ball(@geom_1)? \(0\.1 m\)"):
        mech = load_mjcf(WALL.format(floor, turned))
    np.testing.assert_allclose(np.asarray(mech.neutral)[:3], (0.0, 0.0, 1.0))


HELD = """
<mujoco>
  <worldbody>
    <body name="a"><joint name="j" axis="0 1 0"/><geom size="0.1" pos="1 0 0"/></body>
    <body name="b" pos="0 0 2"><joint name="k" axis="0 1 0"/><geom size="0.1" pos="1 0 0"/></body>
  </worldbody>
  <tendon><fixed name="t"><joint joint="j" coef="1"/></fixed></tendon>
  <equality>{}</equality>
</mujoco>
"""
EQUALITIES = {
    '<connect name="e" body1="a" body2="b" anchor="1 0 0"/>': "equality constraints are rigid here: e",
    '<weld name="e" body1="a" body2="b"/>': "equality constraints are rigid here: e",
    '<joint name="e" joint1="j" joint2="k" polycoef="0 2 0 0 0"/>': "equality constraints are rigid here: e",
    '<joint name="e" joint1="j"/>': "that hold one joint, or are not linear, are omitted: e",
    '<joint name="e" joint1="j" joint2="k" polycoef="0 1 2 0 0"/>': "or are not linear, are omitted: e",
    '<tendon name="e" tendon1="t"/>': "other than connect, weld and joint are omitted: e (tendon)",
    '<tendon name="e" tendon1="t" active="false"/>': "that the file switches off are omitted: e",
}


@pytest.mark.parametrize("given", EQUALITIES)
def test_every_equality_is_read_or_named(given: str) -> None:
    words = EQUALITIES[given]
    warns = "omitted" in words and "switches" not in words
    with pytest.warns(MjcfWarning, match="equality") if warns else nullcontext():
        mech = load_mjcf(HELD.format(given))
    assert mech.report is not None and words in str(mech.report)
    assert len(mech.loops) + len(mech.gears) == ("rigid" in words)


@pytest.mark.parametrize(
    ("source", "error", "words"),
    [
        ("nowhere.xml", FileNotFoundError, "load_mjcf: no file 'nowhere.xml'"),
        ("<mujoco><worldbody><body/></worldbody>", ValueError, "load_mjcf: the text: "),
        ("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>", ValueError, "no joint is free to move"),
    ],
)
def test_errors(source: str, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        load_mjcf(source)


BARE = """<mujoco><compiler angle="radian"/><option{option}/><worldbody><geom name="floor" type="plane" size="5 5 1"{floor}/>
  <body name="a" pos="0 0 1"{body}><joint name="j" axis="0 1 0" limited="true" range="-1 1"{joint}/>
    <geom name="g" size=".1" pos=".3 0 0"{geom}/></body></worldbody>
  <contact>{pairs}</contact><actuator>{actuators}</actuator></mujoco>"""
OMITTED = {
    "springs do not yield here .springyield.: j": {"joint": ' stiffness="5" springyield=".2"'},
    "nonlinear stiffness is omitted: j": {"joint": ' stiffness="5 1"'},
    "nonlinear damping is omitted: j": {"joint": ' damping="5 1"'},
    "nonlinear damping is omitted: m": {"actuators": '<motor name="m" joint="j" damping="1 2"/>'},
    "compensation by actuators is unbounded here .*: j": {
        "body": ' gravcomp="1"',
        "joint": ' actuatorgravcomp="true" actuatorfrcrange="-1 1"',
    },
    "and limits that MuJoCo's solref lets bounce do not bounce here: j": {"joint": ' solreflimit=".02 .1"'},
    "limits that give way visibly in MuJoCo are rigid here: j": {"joint": ' solreflimit=".1 1"'},
    "limits that give way visibly in MuJoCo are rigid here: floor": {"floor": ' solref="-100 -20"'},
    "solref lets bounce do not bounce here: g": {"geom": ' solref="-1000 -1"'},
    "torsional and rolling friction is omitted .*: g": {"geom": ' condim="4"'},
    "torsional and rolling friction is omitted .*: floor": {"floor": ' condim="6" friction="1 0 .1"'},
    "torsional and rolling friction is omitted .*: p": {"pairs": '<pair name="p" geom1="g" geom2="floor" condim="6"/>'},
    "that of the first direction in all directions: p": {
        "pairs": '<pair name="p" geom1="g" geom2="floor" friction="1 .2 0 0 0"/>'
    },
    "adhesion of contacts is omitted: g": {"geom": ' adhesion="3"'},
    "adhesion of contacts is omitted: p": {"pairs": '<pair name="p" geom1="g" geom2="floor" adhesion="2"/>'},
    "velocities of surfaces are omitted: floor": {"floor": ' surfacevel="1 0 0 0 0 0"'},
    "delays of actuators are omitted: m": {"actuators": '<motor name="m" joint="j" delay=".1" nsample="60"/>'},
    "with several controls or forces are omitted: m": {
        "actuators": '<pid name="m" joint="j" kp="2"/><motor joint="j" gear="3" ctrlrange="-1 2" ctrllimited="true"/>'
    },
}


@pytest.mark.parametrize("words", OMITTED)
def test_every_attribute_that_moves_the_robot_is_read_or_named(words: str) -> None:
    parts = dict.fromkeys(("option", "floor", "body", "joint", "geom", "pairs", "actuators"), "")
    with pytest.warns(MjcfWarning, match=words):
        mech = load_mjcf(BARE.format(**parts | OMITTED[words]))
    if "several" in words:
        assert mech.report is not None
        assert [part.tolist() for part in (mech.report.gear, mech.report.low, mech.report.high)] == [[3], [-3], [6]]


def test_equalities_that_give_way_are_named() -> None:
    weld = '<weld name="e" body1="a" body2="b" {}/>'
    for given, words in (
        ('solref=".1 1"', "that give way"),
        ('solimp=".2 .3"', "that give way"),
        ('torquescale="0"', "torque"),
    ):
        with pytest.warns(MjcfWarning, match=f"{words}.*: e"):
            load_mjcf(HELD.format(weld.format(given)))


def test_an_actuator_of_a_ball_leaves_its_armature_out() -> None:
    text = '<mujoco><worldbody><body><joint name="b" type="ball"/><geom size=".1"/></body></worldbody><actuator>{}'
    text = text.format('<motor name="m" joint="b" gear="1" armature="1"/></actuator></mujoco>')
    with pytest.warns(MjcfWarning, match="omitted: m") as caught:
        load_mjcf(text)
    assert sum("armature and damping of actuators" in str(w.message) for w in caught) == 1


def test_flexes_are_named_and_negative_margins_let_geoms_sink_in() -> None:
    cloth = '<flexcomp type="grid" count="2 2 1" spacing=".1 .1 .1" dim="2" pos="0 0 2" name="cloth" mass="1"/>'
    body = '<body pos="0 0 1"><freejoint/><geom type="box" size=".1 .1 .1" margin="-.02"/></body>'
    text = f'<mujoco><worldbody><geom type="plane" size="2 2 1"/>{body}{cloth}</worldbody></mujoco>'
    with pytest.warns(MjcfWarning, match="flexes are omitted"):
        mech = load_mjcf(text)
    assert [(c.radius, c.height) for c in mech.contacts[:8]] == [(0.0, -0.02)] * 8


def test_fields_of_a_later_mujoco_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(omitted._ONE_OF_EACH)
    assert omitted._unknown(model) == []
    monkeypatch.setitem(omitted._KNOWN, "jnt", omitted._KNOWN["jnt"].replace("springyield ", ""))
    monkeypatch.setattr(omitted, "_OPTIONS", omitted._OPTIONS.replace("wind ", ""))
    assert omitted._unknown(model) == []
    model.jnt_springyield[1], model.opt.wind[2], model.opt.enableflags = 0.1, 2.0, 1 << 8
    assert omitted._unknown(model) == ["option.wind", "option.enableflags", "jnt_springyield"]
