"""A URDF file that cannot be read is refused; the message has the file, the line, the element and the error."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import dojo_opt as dojo
from support.urdf_files import collision, inertial, joint, link, write

TWO = (link("base"), link("arm"))
AXIS = '<axis xyz="0 1 0"/>'

BROKEN: dict[str, tuple[tuple[str, ...], str]] = {  # parts from line 2 on, and the message
    "unclosed": ((link("base"), '<link name="arm">'), "line 4, inside the <link> of line 3: not XML: mismatched tag"),
    "no links": ((), "line 1, <robot name='robot'>: expected at least one <link>"),
    "no name": (("<link/>",), 'line 2, <link>: expected an attribute name="..."'),
    "link twice": (
        (link("base"), link("base")),
        "line 3, <link name='base'>: the name is taken by the <link> of line 2",
    ),
    "joint twice": (
        (*TWO, link("c"), joint("j", "base", "arm"), joint("j", "base", "c")),
        "line 6, <joint name='j'>: the name is taken by the <joint> of line 5",
    ),
    "unknown parent": (
        (*TWO, joint("j", "torso", "arm")),
        "line 4, <parent>: joint 'j' has a parent 'torso', which is not a link of the file",
    ),
    "unknown child": (
        (*TWO, joint("j", "base", "leg")),
        "line 4, <child>: joint 'j' has a child 'leg', which is not a link of the file",
    ),
    "no parent": (
        (*TWO, '<joint name="j" type="fixed"><child link="arm"/></joint>'),
        "line 4, .*'j'>: expected a <parent>",
    ),
    "no type": ((*TWO, '<joint name="j"/>'), "line 4, <joint name='j'>: expected an attribute type="),
    "unknown type": (
        (*TWO, joint("j", "base", "arm", "helical")),
        "line 4, .*type 'helical' is not one of: fixed, rev.*did you mean 'spherical'",
    ),
    "two parents": (
        (*TWO, link("c"), joint("i", "base", "c"), joint("j", "arm", "c"), joint("k", "base", "arm")),
        "line 6, <joint name='j'>: link 'c' is the child of joint 'i' of line 5 already; a joint that closes a loop is a <loop_joint>",
    ),
    "cycle": (
        (*TWO, joint("i", "base", "arm"), joint("j", "arm", "base")),
        "every link is the child of a joint, so the joints form a cycle: 'i', 'j'",
    ),
    "cycle beside": (
        (*TWO, link("c"), joint("i", "c", "arm"), joint("j", "arm", "c")),
        "line 5, .*joint 'i' is part of a cycle that does not hang on the root 'base'",
    ),
    "cycle beside a joint": (
        (*TWO, *map(link, "cd"), *(joint(p + c, p, c) for p, c in (("base", "arm"), ("c", "d"), ("d", "c")))),
        "line 7, .*joint 'cd' is part of a cycle that does not hang on the root 'base'",
    ),
    "two roots": (TWO, "line 3, <link name='arm'>: expected one root, but 2 links have no parent joint: base, arm"),
    "loop joint": ((*TWO, '<loop_joint name="l"/>'), "line 4, <loop_joint name='l'>: expected a <link1> inside"),
    "number": (
        (link("base", inertial().replace('value="1.0"', 'value="heavy"')),),
        "line 2, <mass>: value='heavy': expected",
    ),
    "grouped digits": (
        (link("base", inertial().replace('"1.0"', '"1_000"')),),
        "line 2, <mass>: value='1_000': expected a finite number",
    ),
    "other digits": (
        (link("base", inertial().replace('"1.0"', '"\u0661\u0662"')),),
        "line 2, <mass>: value='\u0661\u0662': expected a finite number",
    ),
    "other blanks": (
        (link("base", inertial(xyz="1\u00a02\u20033")),),
        "<origin>: xyz='1.*3': expected 3 finite numbers",
    ),
    "infinity": ((link("base", inertial(mass=float("inf"))),), "line 2, <mass>: value='inf': expected a finite number"),
    "huge": (
        (link("base", inertial(xyz="0 0 1e300")),),
        "line 2, <origin>: xyz='0 0 1e300': expected 3 finite numbers",
    ),
    "commas": ((link("base", inertial(xyz="1, 2, 3")),), "line 2, <origin>: xyz='1, 2, 3': expected 3 finite numbers"),
    "negative mass": ((link("base", inertial(-1.0)),), "line 2, <mass>: expected a mass >= 0, got -1"),
    "no mass": ((link("base", "<inertial/>"),), "line 2, <inertial>: expected a <mass> inside"),
    "no inertia": (
        (link("base", '<inertial><mass value="1"/></inertial>'),),
        "line 2, <inertial>: expected a <inertia> inside",
    ),
    "half an inertia": (
        (link("base", '<inertial><mass value="1"/><inertia ixx="1"/></inertial>'),),
        'line 2, <inertia>: expected an attribute ixy="..."',
    ),
    "zero axis": (
        (*TWO, joint("j", "base", "arm", "continuous", '<axis xyz="0 0 0"/>')),
        "line 4, <axis>: expected a direction, got the zero vector",
    ),
    "negative damping": (
        (*TWO, joint("j", "base", "arm", "continuous", AXIS, '<dynamics damping="-1"/>')),
        "line 4, <dynamics>: expected damping >= 0, got -1",
    ),
    "two axes": (
        (*TWO, joint("j", "base", "arm", "continuous", AXIS, '<axis xyz="1 0 0"/>')),
        "line 4, <axis>: a second <axis> in the <joint> of line 4",
    ),
    "negative radius": (
        (link("base", inertial(), collision('<sphere radius="-1"/>')),),
        "line 2, <sphere>: expected sizes >= 0, got -1",
    ),
    "no shape": ((link("base", inertial(), collision("")),), "line 2, <geometry>: expected one shape, got 0"),
    "negative friction": (
        (link("base", inertial(), '<contact><lateral_friction value="-1"/></contact>'),),
        "line 2, <lateral_friction>: expected a coefficient >= 0, got -1",
    ),
    "restitution beyond one": (
        (link("base", inertial(), '<contact><restitution value="1.5"/></contact>'),),
        "line 2, <restitution>: expected a coefficient of restitution between 0 and 1, got 1.5",
    ),
    "xacro element": (
        ('<xacro:include filename="a.xacro"/>',),
        "line 2, .*this is a xacro file; run xacro on it first",
    ),
    "xacro value": ((link("base", inertial(xyz="0 0 ${h}")),), "expected 3 finite numbers; this is a xacro file"),
    "world inside": (
        (link("base"), link("world"), joint("j", "base", "world")),
        "line 3, .*a link of this name must be the root",
    ),
    "nothing moves": (
        (link("world", ""), *(link(n) + joint(f"j{n}", "world", n, "fixed", "") for n in "ab")),
        "no joint is free to move",
    ),
    "no mass at all": ((link("base", ""),), "no moving link has a mass"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_errors_are_named_with_their_line(tmp_path: Path, case: str) -> None:
    parts, message = BROKEN[case]
    message = message if ".*" in message else re.escape(message)
    with pytest.raises(dojo.UrdfError, match=rf"^load_urdf: robot\.urdf\b.*{message}"):
        dojo.load_urdf(write(tmp_path, *parts))


def test_another_format_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "scene.xml"
    path.write_text('<mujoco model="scene"/>')
    with pytest.raises(
        dojo.UrdfError, match=r"scene\.xml, line 1, <mujoco>: expected a <robot> as the outermost element"
    ):
        dojo.load_urdf(path)


@pytest.mark.parametrize("text", ["", "not xml", '<robot name="r"><link name="a"></robot>', "\0\0"])
def test_files_that_are_not_xml_are_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    with pytest.raises(dojo.UrdfError, match=r"load_urdf: robot\.urdf, line 1.*: not XML: "):
        dojo.load_urdf(path)


def test_blanks_around_the_document_mean_nothing_but_count_as_lines(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    body = f'\n\n<?xml version="1.0"?>\n<robot name="r">\n{link("base")}\n</robot>\n\0'
    path.write_text(body)
    assert dojo.load_urdf(path, ground=False).nbody == 1
    path.write_text(body.replace('value="1.0"', 'value="x"'))
    with pytest.raises(dojo.UrdfError, match="line 5, <mass>"):
        dojo.load_urdf(path)


def test_an_element_repeated_word_for_word_is_read_once(tmp_path: Path) -> None:
    path = write(tmp_path, *TWO, joint("j", "base", "arm", "continuous", AXIS, AXIS))
    assert dojo.load_urdf(path, ground=False).joints[1].axis == (0.0, 1.0, 0.0)


def test_a_missing_file_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="load_urdf: No such file.*nothing.urdf"):
        dojo.load_urdf(tmp_path / "nothing.urdf")


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"rim_points": 2}, r"load_urdf\(rim_points=\.\.\.\): expected a whole number >= 3, got 2"),
        ({"locked": ["floating_base"]}, r"load_urdf\(locked=\.\.\.\): joint: 'floating_base' is not one of: j"),
        ({"locked": ["knee"]}, r"load_urdf\(locked=\.\.\.\): joint: 'knee' is not one of: j"),
        ({"friction": -1.0}, r"load_urdf\(friction=\.\.\.\): expected a number >= 0, got -1"),
        ({"position": (0, 0)}, r"load_urdf\(position=\.\.\.\): expected shape \(3,\), got \(2,\)"),
        ({"gravity": 9.81}, r"load_urdf\(gravity=\.\.\.\): expected shape \(3,\), got \(\)"),
        (
            {"neutral": {"j": "up"}},
            r"load_urdf\(neutral=\.\.\.\): joint 'j': expected one number|real numbers, got 'up'",
        ),
        ({"law": "soft"}, r"load_urdf\(law=\.\.\.\): 'soft' is not one of: impact, linear, nonlinear"),
        (
            {"actuated": ["j"], "locked": ["j"]},
            r"load_urdf\(actuated=\.\.\.\): joint that moves: 'j' is not one of: fl",
        ),
    ],
)
def test_settings_are_checked(tmp_path: Path, settings: dict[str, object], message: str) -> None:
    path = write(
        tmp_path, link("base", inertial(), collision('<sphere radius="1"/>')), link("arm"), joint("j", "base", "arm")
    )
    with pytest.raises(ValueError, match=message):
        dojo.load_urdf(path, **settings)
