"""A Mechanism and its parts refuse wrong arguments by name."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from sim.mechanism.body import Body
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box
from support.mechanisms import BALL, INF, hip, two

ERRORS: list[tuple[Callable[[], object], str]] = [
    (lambda: Body("", shape=BALL), r"Body\(name=\.\.\.\): expected a name"),
    (lambda: Joint("revolute", None, "x", cone=0.5), r"Joint\('x', cone=\.\.\.\): a revolute joint has no three rot"),
    (lambda: Joint("screw", None, "x"), r"Joint\('x', pitch=\.\.\.\): a screw needs its displacement per turn"),
    (
        lambda: Joint("revolute", None, "x", pitch=0.1),
        r"Joint\('x', pitch=\.\.\.\): a revolute joint has none, got 0.1",
    ),
    (lambda: Joint("screw", None, "x", pitch=INF), r"Joint\('x', pitch=\.\.\.\): expected finite numbers, got inf"),
    (
        lambda: Mechanism(
            [Body("x", 0.0), Body("y", shape=BALL)],
            [Joint("screw", None, "x", pitch=0.1), Joint("screw", "x", "y", pitch=0.1)],
        ),
        r"joints 'x' and 'y' move along one axis, and body 'x' between them has no mass",
    ),
    (lambda: Joint("spherical", None, "x", cone=0.0), r"Joint\('x', cone=\.\.\.\): expected a number > 0, got 0"),
    (lambda: Joint("spherical", None, "x", cone=3.2), r"Joint\('x', cone=\.\.\.\): expected an angle below 3.1 rad"),
    (
        lambda: Joint("spherical", None, "x", armature=1.0),
        r"Joint\('x', armature=\.\.\.\): the rotations of a quaternion",
    ),
    (lambda: Joint("revolute", None, "x", armature=-1.0), r"Joint\('x', armature=\.\.\.\): expected numbers >= 0"),
    (lambda: Joint("orbital", None, "x", limits=(0, 1)), r"Joint\('x', limits=\.\.\.\): expected 2 pairs"),
    (
        lambda: Mechanism([Body("x", 0.0)], [Joint("revolute", None, "x")]),
        r"body 'x' has no mass, and neither has any body that",
    ),
    (lambda: Body("x", 0.0, shape=BALL), r"Body\('x', mass=\.\.\.\): expected a number > 0, got 0"),
    (lambda: Body("x", float("nan"), shape=BALL), r"Body\('x', mass=\.\.\.\): expected finite numbers, got nan"),
    (lambda: Body("x", "heavy", shape=BALL), r"Body\('x', mass=\.\.\.\): expected real numbers, got 'heavy'"),
    (lambda: Body("x", [1.0, 2.0], shape=BALL), r"Body\('x', mass=\.\.\.\): expected one number"),
    (lambda: Body("x"), r"Body\('x'\): give inertia"),
    (lambda: Body("x", shape="ball"), r"Body\('x', shape=\.\.\.\): expected a shape, as Sphere"),
    (
        lambda: Body("x", shape=Box(1, 1, 1, center=(1, 0, 0))),
        r"Body\('x'\): give inertia=\.\.\.; the shape is not centred",
    ),
    (lambda: Body("x", 1.0, (1.0, 1.0)), r"Body\('x', inertia=\.\.\.\): expected shape \(3,\), got \(2,\)"),
    (lambda: Body("x", 1.0, np.eye(4)), r"Body\('x', inertia=\.\.\.\): expected shape \(3, 3\), got \(4, 4\)"),
    (lambda: Body("x", 1.0, (1.0, -1.0, 1.0)), r"Body\('x', inertia=\.\.\.\): not positive definite"),
    (lambda: Body("x", 1.0, (1.0, 1.0, 0.0)), r"Body\('x', inertia=\.\.\.\): not positive definite"),
    (lambda: Body("x", 1.0, (1.0, 1.0, 2.5)), r"Body\('x', inertia=\.\.\.\): no rigid body has principal moments"),
    (lambda: Body("x", 1.0, [[1, 0.5, 0], [0, 1, 0], [0, 0, 1]]), r"Body\('x', inertia=\.\.\.\): expected a symmetric"),
    (lambda: Body("x", 1.0, (1.0, float("inf"), 1.0)), r"Body\('x', inertia=\.\.\.\): .* got inf at index 1"),
    (lambda: Joint("hinge", None, "leg"), r"Joint\('leg', kind=\.\.\.\): 'hinge' is not one of: fixed, prismatic"),
    (lambda: hip(axis=(0, 0, 0)), r"Joint\('hip', axis=\.\.\.\): expected a direction, got the zero vector"),
    (lambda: hip(axis=(0, 1)), r"Joint\('hip', axis=\.\.\.\): expected shape \(3,\), got \(2,\)"),
    (lambda: hip(parent_point=(0, float("nan"), 0)), r"Joint\('hip', parent_point=\.\.\.\): .* got nan at index 1"),
    (lambda: hip(orientation=(1, 1, 0, 0)), r"Joint\('hip', orientation=\.\.\.\): expected a unit quaternion"),
    (lambda: hip(damper=-1.0), r"Joint\('hip', damper=\.\.\.\): expected numbers >= 0, got -1.0"),
    (lambda: hip(spring=-1.0), r"Joint\('hip', spring=\.\.\.\): expected numbers >= 0"),
    (lambda: hip(spring=(1.0, 2.0)), r"Joint\('hip', spring=\.\.\.\): expected shape \(1,\), got \(2,\)"),
    (lambda: hip(limits=(1.0, 1.0)), r"Joint\('hip', limits=\.\.\.\): expected lo < hi, got \(1, 1\)"),
    (lambda: hip(limits=(1.0, float("nan"))), r"Joint\('hip', limits=\.\.\.\): expected lo < hi"),
    (lambda: hip(limits=(INF, None)), r"Joint\('hip', limits=\.\.\.\): expected lo < hi"),
    (lambda: hip(limits=[(0, 1), (0, 1)]), r"Joint\('hip', limits=\.\.\.\): expected 1 pairs .* got 2"),
    (lambda: hip(limits=["ab"]), r"Joint\('hip', limits=\.\.\.\): expected a pair \(lo, hi\), got 'ab'"),
    (
        lambda: Joint("spherical", None, "leg", limits=[(0, 1), None, None]),
        r"Joint\('leg', limits=.*have no bounds; cone=",
    ),
    (lambda: Joint("spherical", None, "leg", rest=1.0), r"Joint\('leg', rest=\.\.\.\): expected 3 numbers"),
    (
        lambda: Joint("spherical", None, "leg", spring=(1, 1, 2)),
        r"Joint\('leg', spring=\.\.\.\): .*one spring constant",
    ),
    (lambda: Contact("foot", radius=-0.1), r"Contact\('foot', radius=\.\.\.\): expected a number >= 0"),
    (lambda: Contact("foot", friction=-0.1), r"Contact\('foot', friction=\.\.\.\): expected a number >= 0"),
    (
        lambda: Contact("foot", law="soft"),
        r"Contact\('foot', law=\.\.\.\): 'soft' is not one of: impact, linear, nonlinear",
    ),
    (lambda: Contact("foot", normal=(0, 0, 0)), r"Contact\('foot', normal=\.\.\.\): expected a direction"),
    (lambda: Input(), r"Input\(\.\.\.\): give either a joint or body"),
    (lambda: Input("hip", body="leg"), r"Input\(\.\.\.\): give either a joint or body"),
    (lambda: Input(body="leg"), r"Input\('leg'\): give a force"),
    (lambda: Input(body="leg", force=(1, 0, 0), frame="foot"), r"Input\('leg', frame=\.\.\.\): 'foot' is not one of"),
    (lambda: two(name=""), r"Mechanism\(name=\.\.\.\): expected a name"),
    (lambda: two(bodies=[]), r"Mechanism\('robot'\): expected at least one body"),
    (lambda: two(bodies=["torso"]), r"Mechanism\('robot', bodies=\.\.\.\): expected a list of Body, got 'torso'"),
    (lambda: two(bodies=[Body("torso", shape=BALL)] * 2), r"bodies: the name 'torso' is used twice"),
    (lambda: two(joints=[hip(), hip()]), r"joints: the name 'hip' is used twice"),
    (lambda: two(bodies=[Body("world", shape=BALL)]), r"a body cannot be named 'world'"),
    (lambda: two(joints=[Joint("floating", "pelvis", "torso")]), r"'pelvis' is not one of: world, torso, leg"),
    (lambda: two(joints=[Joint("floating", None, "arm")]), r"child of joint 'arm': 'arm' is not one of: torso, leg"),
    (lambda: two(joints=[Joint("floating", None, "torso")]), r"body 'leg' has no joint.*Joint\('floating'"),
    (
        lambda: two(joints=[Joint("floating", None, "torso"), hip(), Joint("fixed", None, "leg")]),
        r"body 'leg' is the child of two joints, 'hip' and 'leg'; a joint that closes a loop needs close=True",
    ),
    (lambda: two(joints=[Joint("fixed", "leg", "torso"), hip()]), r"joints in a cycle: 'torso', 'hip'"),
    (lambda: two(joints=[Joint("fixed", "torso", "torso"), hip()]), r"joints in a cycle: 'torso', 'hip'"),
    (lambda: two(joints=[Joint("fixed", None, "torso"), Joint("fixed", "torso", "leg")]), r"no joint is free to move"),
    (lambda: two(contacts=[Contact("foot")]), r"contact body: 'foot' is not one of: torso, leg"),
    (lambda: two(contacts=[Contact("leg", name="toe")] * 2), r"contacts: the name 'toe' is used twice"),
    (lambda: two(inputs=[Input("knee")]), r"joint: 'knee' is not one of: torso, hip"),
    (lambda: two(inputs=[Input("hip", dof=1)]), r"Input\('hip', dof=1\): the joint has 1 degrees of freedom"),
    (lambda: two(inputs=[Input(body="arm", force=(1, 0, 0))]), r"body: 'arm' is not one of: torso, leg"),
    (lambda: two(gravity=-9.81), r"Mechanism\('robot', gravity=\.\.\.\): expected shape \(3,\), got \(\)"),
    (lambda: two(neutral={"knee": 1.0}), r"neutral=\.\.\.\): joint: 'knee' is not one of"),
    (lambda: two(neutral={"hip": (1.0, 2.0)}), r"neutral=\.\.\.\): joint 'hip': expected shape \(1,\), got \(2,\)"),
    (lambda: two(neutral={"torso": (0, 0, 1, 1, 1, 0, 0)}), r"joint 'torso': expected a unit quaternion"),
    (lambda: two(neutral=np.zeros(3)), r"neutral=\.\.\.\): expected shape \(8,\), got \(3,\)"),
    (lambda: two().q_slice("knee"), r"q_slice\(joint\): 'knee' is not one of: torso, hip"),
]


@pytest.mark.parametrize(("make", "message"), ERRORS, ids=[m[:50] for _, m in ERRORS])
def test_errors_name_the_call_and_the_culprit(make: Callable[[], object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()
