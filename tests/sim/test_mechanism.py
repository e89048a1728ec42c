"""A Mechanism refuses wrong parts by name, and puts its parts in order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.gaits.equilibrium import stop_torques
from sim.mechanism.axes import contact_frame, translation_axes
from sim.mechanism.body import Body
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.joint import KINDS, Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.pack import mechanism_sizes, pack
from sim.model.model import InputKind, Law
from support.mechanisms import BALL, CASES, INF, chain_with, hip, two


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


@pytest.mark.parametrize("n", range(1, 9))
def test_any_order_of_a_tree_packs_with_parents_first(n: int, rng: np.random.Generator) -> None:
    for _ in range(8):
        _check_random_tree(n, rng)


def _check_random_tree(n: int, rng: np.random.Generator) -> None:
    kinds = rng.choice([k for k in KINDS if k != "fixed"], n).tolist()
    parents = [int(rng.integers(-1, i)) for i in range(n)]
    joints = [
        Joint(k, f"b{p}" if p >= 0 else None, f"b{i}", pitch=0.1 if k == "screw" else 0.0)
        for i, (k, p) in enumerate(zip(kinds, parents, strict=True))
    ]
    mech = Mechanism([Body(f"b{i}", shape=BALL) for i in range(n)], [joints[i] for i in rng.permutation(n)])
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
            Contact("leg", (0, 0, -0.5), 0.05, friction=0.7, height=0.1),
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


def test_limits_of_coordinates_include_the_slides_of_joints_that_turn_freely() -> None:
    joints = [
        dojo.Joint("cylindrical_free", None, "a", axis=(0, 0, 1), limits=[(-0.1, 0.2), None, None, None]),
        dojo.Joint("revolute", "a", "b", axis=(0, 1, 0), limits=(-1.0, 2.0)),
        dojo.Joint("spherical", "b", "c", cone=0.5),
    ]
    mech = dojo.Mechanism([dojo.Body(name, 1.0, (0.1, 0.1, 0.1)) for name in "abc"], joints)
    low, high = mech.coordinate_limits
    free = [np.inf] * 4
    np.testing.assert_array_equal(low, np.negative([0.1, *free, 1.0, *free]))
    np.testing.assert_array_equal(high, [0.2, *free, 2.0, *free])
    sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-4)
    x = sim.neutral()
    x[0] = 0.15
    torques = stop_torques(sim, x)
    np.testing.assert_allclose(torques[0], 1e-2 * (1.0 / 0.25 - 1.0 / 0.05))
    x[0] = 0.3
    with pytest.raises(ValueError, match="joint 'a' is beyond its stops"):
        dojo.equilibrium(sim, x)
