"""What a Mechanism refuses, by name, and the order it brings things into."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mechanisms import CASES, chain_with

from sim.build import contact_frame, mechanism_sizes, pack, translation_axes
from sim.mechanism import Mechanism
from sim.model import InputKind, Law
from sim.parts import KINDS, Body, Contact, Input, Joint
from sim.shapes import Box, Sphere

BALL = Sphere(0.1)
INF = float("inf")


def two(**changes: object) -> Mechanism:
    """A floating body with a hinged one, and what the test wants to be wrong with it."""
    parts: dict[str, object] = {
        "bodies": [Body("torso", shape=BALL), Body("leg", shape=BALL)],
        "joints": [Joint("floating", None, "torso"), Joint("revolute", "torso", "leg", name="hip")],
        "name": "robot",
    }
    return Mechanism(**{**parts, **changes})  # type: ignore[arg-type]


def hip(**changes: object) -> Joint:
    return Joint("revolute", "torso", "leg", name="hip", **changes)  # type: ignore[arg-type]


ERRORS: list[tuple[Callable[[], object], str]] = [
    (lambda: Body("", shape=BALL), r"Body\(name=\.\.\.\): expected a name"),
    (lambda: Joint("revolute", None, "x", cone=0.5), r"Joint\('x', cone=\.\.\.\): a revolute joint has no three rot"),
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
        r"body 'x' has no mass, nor has anything that",
    ),
    (lambda: Body("x", 0.0, shape=BALL), r"Body\('x', mass=\.\.\.\): expected a number > 0, got 0"),
    (lambda: Body("x", float("nan"), shape=BALL), r"Body\('x', mass=\.\.\.\): expected finite numbers, got nan"),
    (lambda: Body("x", "heavy", shape=BALL), r"Body\('x', mass=\.\.\.\): expected real numbers, got 'heavy'"),
    (lambda: Body("x", [1.0, 2.0], shape=BALL), r"Body\('x', mass=\.\.\.\): expected one number"),
    (lambda: Body("x"), r"Body\('x'\): give inertia"),
    (lambda: Body("x", shape="ball"), r"Body\('x', shape=\.\.\.\): expected Sphere, Box"),
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
    (lambda: two(joints=[Joint("floating", None, "torso")]), r"body 'leg' hangs on no joint.*Joint\('floating'"),
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


def test_tree_order_keeps_the_given_order_where_it_can() -> None:
    names = ["d", "b", "a", "c"]
    joints = [
        Joint("revolute", "b", "d"),
        Joint("revolute", "a", "b"),
        Joint("floating", None, "a"),
        Joint("fixed", "a", "c"),
    ]
    mech = Mechanism([Body(n, shape=BALL) for n in names], joints)
    assert mech.body_names == ("a", "b", "d", "c") == mech.joint_names
    model = pack(mech)
    assert model.body_parent.tolist() == [-1, 0, 1, 0]
    assert model.body_qadr.tolist() == [0, 7, 8, 9, 9] and model.body_vadr.tolist() == [0, 6, 7, 8, 8]
    assert mech.q_slice("d") == slice(8, 9) and mech.v_slice("b") == slice(6, 7)


@settings(deadline=None, derandomize=True, max_examples=50)
@given(st.data())
def test_any_order_of_a_tree_packs_with_parents_first(data: st.DataObject) -> None:
    n = data.draw(st.integers(1, 8))
    kinds = data.draw(st.lists(st.sampled_from([k for k in KINDS if k != "fixed"]), min_size=n, max_size=n))
    parents = [data.draw(st.integers(-1, i - 1)) for i in range(n)]
    joints = [
        Joint(k, f"b{p}" if p >= 0 else None, f"b{i}") for i, (k, p) in enumerate(zip(kinds, parents, strict=True))
    ]
    mech = Mechanism([Body(f"b{i}", shape=BALL) for i in range(n)], data.draw(st.permutations(joints)))
    model = pack(mech)
    for i, joint in enumerate(mech.joints):
        assert mech.bodies[i].name == joint.child
        assert model.body_parent[i] < i
        assert joint.parent == ("world" if model.body_parent[i] < 0 else mech.bodies[model.body_parent[i]].name)
        assert mech.v_slice(joint.name) == slice(model.body_vadr[i], model.body_vadr[i + 1])
    assert (mech.nq, mech.nv) == (model.body_qadr[-1], model.body_vadr[-1])


@pytest.mark.parametrize(("kind", "on_world"), CASES)
def test_every_kind_of_joint_packs(kind: str, on_world: bool) -> None:
    mech = chain_with(kind, on_world)
    i = mech.joint_names.index("a" if on_world else "b")
    model = pack(mech)
    ntrans, nrot = KINDS[kind]
    assert (model.joint_ntrans[i], model.joint_nrot[i]) == (ntrans, nrot)
    assert model.body_vadr[i + 1] - model.body_vadr[i] == ntrans + nrot
    assert model.body_qadr[i + 1] - model.body_qadr[i] == ntrans + nrot + (nrot == 3)
    first = model.body_qadr[i]
    rotations = [first + ntrans + (0 if nrot == 3 else k) for k in range(nrot)]
    expected = [first + k for k in range(ntrans)] + rotations
    assert model.dof_qadr[model.dof_body == i].tolist() == expected
    T = model.joint_trans_axes[i].reshape(3, 3)[:ntrans]
    np.testing.assert_allclose(T @ T.T, np.eye(ntrans), atol=1e-15)
    along = {1: 1.0, 2: 0.0, 3: 1.0, 0: 0.0}[ntrans]
    np.testing.assert_allclose(np.linalg.norm(T @ model.joint_axis[i]), along, atol=1e-15)
    V = np.vstack([model.joint_swing_axes[i].reshape(2, 3), model.joint_axis[i]])
    np.testing.assert_allclose(V @ V.T, np.eye(3), atol=1e-15)


def test_plane_coordinates_follow_the_world_axes() -> None:
    np.testing.assert_allclose(translation_axes(2, (0.0, 1.0, 0.0))[:2], [[1, 0, 0], [0, 0, 1]])
    np.testing.assert_allclose(translation_axes(2, (1.0, 0.0, 0.0))[:2], [[0, 1, 0], [0, 0, 1]])
    np.testing.assert_allclose(translation_axes(2, (0.0, 0.0, -1.0))[:2], [[1, 0, 0], [0, 1, 0]])


@pytest.mark.parametrize("normal", [(0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 0, -1), (0.3, -0.5, 0.8)])
def test_contact_frame_is_right_handed(normal: tuple[float, float, float]) -> None:
    n = np.array(normal) / np.linalg.norm(normal)
    F = contact_frame(n)
    np.testing.assert_allclose(F @ F.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(np.linalg.det(F), 1.0)
    np.testing.assert_allclose(F[0], n)


def test_ground_frame_is_the_world_frame() -> None:
    np.testing.assert_array_equal(contact_frame((0.0, 0.0, 1.0)), [[0, 0, 1], [1, 0, 0], [0, 1, 0]])


def test_packed_numbers() -> None:
    mech = two(
        joints=[
            Joint("floating", None, "torso", damper=0.5),
            hip(limits=(-1.0, INF), spring=3.0, damper=0.2, rest=0.1, axis=(0, 2, 0), parent_point=(0, 0, -1)),
        ],
        contacts=[
            Contact("leg", (0, 0, -0.5), 0.05, 0.7, height=0.1),
            Contact("leg", friction=0.0),
            Contact("torso", law="linear"),
        ],
        inputs=[
            Input("hip"),
            Input("torso", dof=4),
            Input(body="leg", force=(0, 0, 2), torque=(1, 0, 0), frame="body"),
        ],
        gravity=(0, 1, 2),
    )
    assert mech.contact_names == ("leg_0", "leg_1", "torso")
    assert mech.input_names == ("hip", "torso[4]", "leg")
    assert mechanism_sizes(mech)[:6] == (2, 8, 7, 3, 1, 3)
    m = pack(mech)
    assert m.limit_dof.tolist() == [6] and m.limit_sign.tolist() == [1.0] and m.limit_bound.tolist() == [-1.0]
    np.testing.assert_array_equal(m.dof_damper, [0.5] * 6 + [0.2])
    assert (m.dof_spring[6], m.dof_rest[6]) == (3.0, 0.1)
    assert m.joint_axis[1].tolist() == [0, 1, 0] and m.joint_parent_point[1].tolist() == [0, 0, -1]
    assert m.contact_body.tolist() == [1, 1, 0]
    assert m.contact_law.tolist() == [Law.NONLINEAR, Law.IMPACT, Law.LINEAR]
    assert m.contact_point[0].tolist() == [0, 0, -0.5] and m.contact_height[0] == 0.1
    assert m.input_kind.tolist() == [InputKind.JOINT, InputKind.JOINT, InputKind.BODY]
    assert m.input_index.tolist() == [6, 4, 1]
    assert m.input_wrench[2].tolist() == [0, 0, 2, 1, 0, 0] and m.gravity.tolist() == [0, 1, 2]


def test_inputs_default_to_every_joint_but_the_floating_ones() -> None:
    assert two().input_names == ("hip",)
    assert two(joints=[Joint("planar_axis", None, "torso"), hip()]).input_names == (
        "torso[0]",
        "torso[1]",
        "torso[2]",
        "hip",
    )
    assert two(inputs=[]).input_names == ()


def test_mechanisms_are_values() -> None:
    assert two() == two() and hash(two()) == hash(two())
    assert replace(two(), gravity=(0, 0, 0)) != two()
    assert replace(two(), name="other").neutral == two().neutral
