"""Collision shapes of URDF files as contacts: where they are, which are chosen, and that a robot stands on them."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pytest
from naive import rotation as rot

import dojo_opt as dojo
from sim.mechanism.stance import gaps
from support.jacobians import check_step
from support.urdf_files import collision, inertial, joint, link, write

SPHERE, BOX = '<sphere radius="0.1"/>', '<box size="0.2 0.4 0.6"/>'
CYLINDER, CAPSULE = '<cylinder radius="0.3" length="0.2"/>', '<capsule radius="0.05" length="0.4"/>'
MESH = '<mesh filename="package://robot/foot.stl" scale="1 1 1"/>'
pytestmark = pytest.mark.filterwarnings("ignore:.*collision meshes not found:sim.io.urdf.report.UrdfWarning")


def one(folder: Path, *parts: str, **settings: object) -> dojo.UrdfMechanism:
    """A body with its centre of mass at (0.1, 0, 0) of its link."""
    return dojo.load_urdf(write(folder, link("body", inertial(xyz="0.1 0 0"), *parts)), **settings)


def balls(mech: dojo.Mechanism) -> list[tuple[float, ...]]:
    """(x, y, z, radius) of the contacts, sorted."""
    return sorted((*(round(x, 9) for x in c.point), c.radius) for c in mech.contacts)


def test_a_sphere_is_one_ball(tmp_path: Path) -> None:
    mech = one(tmp_path, collision(SPHERE, "0.1 0.2 0.3"))
    assert balls(mech) == [(0.0, 0.2, 0.3, 0.1)]
    assert mech.contact_names == ("body",)


def test_a_box_is_its_corners_turned_and_moved(tmp_path: Path) -> None:
    mech = one(tmp_path, collision(BOX, "0.1 0 1", f"0 0 {np.pi / 2}"))
    expected = [(x, y, 1.0 + z, 0.0) for x, y, z in product((-0.2, 0.2), (-0.1, 0.1), (-0.3, 0.3))]
    np.testing.assert_allclose(balls(mech), sorted(expected), atol=1e-9)


def test_a_capsule_is_two_balls(tmp_path: Path) -> None:
    mech = one(tmp_path, collision(CAPSULE, "0.1 0 0"))
    assert balls(mech) == [(0.0, 0.0, -0.2, 0.05), (0.0, 0.0, 0.2, 0.05)]


@pytest.mark.parametrize("rim", [3, 4, 8])
def test_a_cylinder_is_points_on_both_rims(tmp_path: Path, rim: int) -> None:
    points = np.array([c.point for c in one(tmp_path, collision(CYLINDER, "0.1 0 0"), rim_points=rim).contacts])
    assert len(points) == 2 * rim
    np.testing.assert_allclose(np.linalg.norm(points[:, :2], axis=1), 0.3)
    np.testing.assert_allclose(np.sort(points[:, 2]), np.repeat([-0.1, 0.1], rim))
    assert len({tuple(p) for p in points.round(6)}) == 2 * rim


def wheeled(folder: Path, axis: str, at: str = "0 0 0") -> dojo.UrdfMechanism:
    wheel = link("wheel", inertial(), collision(CYLINDER, at, f"{np.pi / 2} 0 0"))
    return dojo.load_urdf(
        write(
            folder, link("car", inertial()), wheel, joint("axle", "car", "wheel", "continuous", axis, at='xyz="0 1 0"')
        )
    )


def test_a_cylinder_that_turns_about_its_axis_is_a_wheel(tmp_path: Path) -> None:
    """Two balls of its radius: level, it is as high above the ground at every angle as a round wheel."""
    mech = wheeled(tmp_path, '<axis xyz="0 1 0"/>')
    np.testing.assert_allclose(balls(mech), [(0.0, -0.1, 0.0, 0.3), (0.0, 0.1, 0.0, 0.3)], atol=1e-9)
    q = np.array(mech.neutral)
    for angle in (0.0, 0.4, 2.0):
        q[-1] = angle
        np.testing.assert_allclose(gaps(mech, q), 0.0, atol=2e-9)
    assert len(wheeled(tmp_path, '<axis xyz="1 0 0"/>').contacts) == 8  # not its axis
    assert len(wheeled(tmp_path, '<axis xyz="0 1 0"/>', "0.1 0 0").contacts) == 8  # eccentric


def test_shapes_of_merged_links_are_carried_over(tmp_path: Path) -> None:
    at = 'xyz="0.1 0 -1" rpy="0 1.5707963267948966 0"'
    parts = (link("body", inertial()), link("foot", inertial(0.5), collision(SPHERE, "0 0 0.2")))
    path = write(tmp_path, *parts, joint("ankle", "body", "foot", "fixed", "", at=at))
    merged, kept = dojo.load_urdf(path), dojo.load_urdf(path, merge_fixed=False)
    assert (merged.contacts[0].body, kept.contacts[0].body) == ("body", "foot")
    com = np.array([0.1, 0.0, -1.0]) / 3.0  # 0.5 of 1.5 kg at the foot
    np.testing.assert_allclose(merged.contacts[0].point, np.array([0.3, 0.0, -1.0]) - com, atol=1e-12)
    np.testing.assert_allclose(kept.contacts[0].point, (0.0, 0.0, 0.2))
    assert merged.contact_names == kept.contact_names == ("foot",)


# -- choices -----------------------------------------------------------------------------------------------------------


def biped(folder: Path) -> Path:
    """A trunk with a box; feet with a sphere and with a mesh."""
    feet = (link("left", inertial(), collision(SPHERE)), link("right", inertial(), collision(MESH)))
    down = {"left": 'xyz="0 0.2 -0.5"', "right": 'xyz="0 -0.2 -0.5"'}
    ankles = (joint(f"{foot}_ankle", "trunk", foot, at=at) for foot, at in down.items())
    return write(folder, link("trunk", inertial(), collision(BOX)), *feet, *ankles)


def test_all_links_touch_the_ground_or_those_that_are_chosen(tmp_path: Path) -> None:
    path = biped(tmp_path)
    every = dojo.load_urdf(path)
    assert len(every.contacts) == 9
    assert any(str(n) == "no contact from collision shapes of kind 'mesh': right" for n in every.report.notes)
    assert dojo.load_urdf(path, contacts=["left"]).contact_names == ("left",)
    assert dojo.load_urdf(path, ground=False).contacts == ()


@pytest.mark.parametrize("seed", range(5))
def test_all_other_links_keep_their_shapes_beside_contacts_by_hand(tmp_path: Path, seed: int) -> None:
    """Random links with and without shapes: balls by hand on some of them, and no link sinks that did not before."""
    rng = np.random.default_rng(seed)
    names = [f"l{k}" for k in range(6)]
    parts = [link(name, inertial(), collision(SPHERE) if rng.random() < 0.7 else "") for name in names]
    parts += [joint(f"j{k}", names[k - 1], names[k], "revolute") for k in range(1, 6)]
    path = write(tmp_path, *parts)
    chosen = rng.choice(names, size=2, replace=False)
    every, both = (
        dojo.load_urdf(path),
        dojo.load_urdf(path, contacts=["*", *(dojo.Contact(n, radius=0.02) for n in chosen)]),
    )
    assert {c.body for c in both.contacts} == {c.body for c in every.contacts} | set(chosen)
    assert all((c.radius == 0.02) == (c.body in chosen) for c in both.contacts)
    with pytest.raises(dojo.UrdfError, match="'l9' is not a link"):
        dojo.load_urdf(path, contacts=["*", "l9"])


def test_a_contact_can_be_placed_by_hand_in_the_frame_of_its_link(tmp_path: Path) -> None:
    foot = dojo.Contact("right", point=(0.0, 0.0, 0.1), radius=0.02, friction=0.3)
    mech = dojo.load_urdf(biped(tmp_path), contacts=["left", foot])
    assert [(c.name, c.body, c.radius, c.friction) for c in mech.contacts] == [
        ("left", "left", 0.1, 0.8),
        ("right", "right", 0.02, 0.3),
    ]
    with pytest.raises(
        dojo.UrdfError,
        match=r"link name='right'.*contacts=\.\.\.: the link has no sphere, box, cylinder, capsule or mesh",
    ):
        dojo.load_urdf(biped(tmp_path), contacts=["right"])
    with pytest.raises(dojo.UrdfError, match=r"load_urdf\(contacts=\.\.\.\): 'hand' is not a link of the file: trunk"):
        dojo.load_urdf(biped(tmp_path), contacts=["hand"])


def test_friction_is_the_callers_or_the_files_or_the_usual_one(tmp_path: Path) -> None:
    rubber = '<contact><lateral_friction value="1.5"/></contact>'
    slick, sticky = one(tmp_path, collision(SPHERE)), one(tmp_path, rubber, collision(SPHERE))
    assert (slick.contacts[0].friction, sticky.contacts[0].friction) == (0.8, 1.5)
    assert one(tmp_path, rubber, collision(SPHERE), friction=0.2).contacts[0].friction == 0.2
    assert one(tmp_path, collision(SPHERE), law="linear").contacts[0].law == "linear"


def test_friction_and_law_are_those_of_self_collisions_too(tmp_path: Path) -> None:
    names = ("a", "b", "c")
    slick = '<contact><lateral_friction value="0.2"/></contact>'
    parts = [link(name, inertial(), collision(SPHERE), slick if name == "a" else "") for name in names]
    chain = [joint(f"j{name}", *ends, at='xyz="0 0 1"') for name, ends in (("b", "ab"), ("c", "bc"))]
    path = write(tmp_path, *parts, *chain)
    pairs = [
        dojo.load_urdf(path, collisions="self", **given).collisions[0]  # type: ignore[arg-type]
        for given in ({}, {"friction": 0.1, "law": "linear", "restitution": 0.3})
    ]
    assert [(c.friction, c.law, c.restitution) for c in pairs] == [(0.2, "nonlinear", 0.0), (0.1, "linear", 0.3)]


def test_spinning_and_rolling_friction_is_that_of_the_file_where_the_caller_asks_for_it(tmp_path: Path) -> None:
    rubber = '<contact><rolling_friction value="0.003"/><spinning_friction value="0.01"/></contact>'
    with pytest.warns(
        dojo.UrdfWarning, match="torsional and rolling friction is omitted .*turning_friction=True.*: body"
    ):
        sliding = one(tmp_path, rubber, collision(SPHERE))
    turning = one(tmp_path, rubber, collision(SPHERE), turning_friction=True)
    for mech, lengths in ((sliding, (0.0, 0.0)), (turning, (0.01, 0.003))):
        contact, shape = mech.contacts[0], mech.bodies[0].shapes[0]
        assert (contact.torsional_friction, contact.rolling_friction) == lengths
        assert (shape.torsional_friction or 0.0, shape.rolling_friction or 0.0) == lengths
    assert "omitted" not in str(turning.report)
    with pytest.raises(dojo.UrdfError, match="<rolling_friction>: expected a coefficient >= 0, got -1"):
        one(tmp_path, '<contact><rolling_friction value="-1"/></contact>', collision(SPHERE))


def test_friction_against_spinning_and_rolling_is_that_of_bullet(tmp_path: Path) -> None:
    """A ball that spins, or rolls, on its plane, whose friction is 1."""
    bullet = pytest.importorskip("pybullet")
    surface = '<contact><spinning_friction value="0.01"/><rolling_friction value="0.003"/></contact>'
    solid = inertial(inertia=(0.004, 0.004, 0.004, 0.0, 0.0, 0.0))
    path = write(tmp_path, link("body", solid, collision(SPHERE), surface))
    sim = dojo.Simulator(dojo.load_urdf(path, turning_friction=True), time_step=0.001, kappa=1e-10)
    x = sim.neutral()
    bullet.connect(bullet.DIRECT)
    try:
        bullet.setGravity(0.0, 0.0, -9.81)
        bullet.setTimeStep(0.001)
        plane = bullet.createMultiBody(0.0, bullet.createCollisionShape(bullet.GEOM_PLANE))
        bullet.changeDynamics(plane, -1, lateralFriction=1.0)
        ball = bullet.loadURDF(str(path), x[:3])
        bullet.changeDynamics(ball, -1, linearDamping=0.0, angularDamping=0.0)
        bullet.resetBaseVelocity(ball, [1.0, 0.0, 0.0], [0.0, 1.0 / x[2], 5.0])
        speeds = []
        for _ in range(60):
            bullet.stepSimulation()
            speeds.append([bullet.getBaseVelocity(ball)[0][0], bullet.getBaseVelocity(ball)[1][2]])
    finally:
        bullet.disconnect()
    x[7:] = 1.0, 0.0, 0.0, 0.0, 1.0 / x[2], 5.0
    states = sim.rollout(x, np.zeros((60, 0)), throw=True).x[1:]
    spins = [float(rot.matrix(q)[2] @ w) for q, w in zip(states[:, 3:7], states[:, 10:], strict=True)]
    for k, mine in enumerate((states[:, 7], np.array(spins))):
        loss = mine[19] - mine[59], speeds[19][k] - speeds[59][k]
        assert loss[0] == pytest.approx(loss[1], rel=0.02) and loss[0] > 1e-3


def test_restitution_is_that_of_the_file_where_the_caller_asks_for_it(tmp_path: Path) -> None:
    """Not by default: physics engines multiply it with that of their ground, which is zero."""
    rubber = '<contact><lateral_friction value="0.7"/><restitution value="0.5"/></contact>'
    ball, plain = (rubber, collision(SPHERE)), (collision(SPHERE),)
    still, bouncing = one(tmp_path, *ball), one(tmp_path, *ball, restitution=None)
    assert [m.contacts[0].restitution for m in (still, bouncing)] == [0.0, 0.5]
    assert [m.bodies[0].shapes[0].restitution for m in (still, bouncing)] == [None, 0.5]
    assert "without the restitution of the file, which restitution=None uses: body" in str(still.report)
    assert "restitution" not in str(bouncing.report)
    assert one(tmp_path, *plain, restitution=None).contacts[0].restitution == 0.0
    assert one(tmp_path, *ball, restitution=0.2).contacts[0].restitution == 0.2
    wall = dojo.Collision("body", shape_b=dojo.HalfSpace(center=(1.0, 0.0, 0.0), orientation=(0.8, 0.0, -0.6, 0.0)))
    walled = dojo.Mechanism(bouncing.bodies, bouncing.joints, collisions=[wall])
    assert (walled.collisions[0].friction, walled.collisions[0].restitution) == (0.7, 0.5)
    sim = dojo.Simulator(bouncing, time_step=0.01)
    x = sim.neutral()
    x[2] += 0.5
    fall = sim.rollout(x, np.zeros((70, sim.nu)), throw=True).x[:, sim.nq + 2]
    assert fall.max() == pytest.approx(-0.5 * fall.min(), rel=0.05)  # up after the impact as fast as half of the fall


def test_a_contact_that_is_placed_by_hand_keeps_all_of_its_properties(tmp_path: Path) -> None:
    spot = dojo.Contact("body", (0.1, 0.0, 0.0), 0.02, restitution=0.4, height=0.1, friction=0.3)
    (found,) = one(tmp_path, collision(SPHERE), contacts=[spot]).contacts
    assert (found.restitution, found.height, found.friction, found.radius) == (0.4, 0.1, 0.3, 0.02)


def test_contact_names_never_collide(tmp_path: Path) -> None:
    parts = (link("foot", inertial(), collision(CAPSULE)), link("foot_0", inertial(), collision(SPHERE)))
    mech = dojo.load_urdf(write(tmp_path, *parts, joint("toe", "foot", "foot_0")))
    assert mech.contact_names == ("foot_0", "foot_1", "foot_0_1")


def test_shapes_that_cannot_touch_the_ground_are_reported(tmp_path: Path) -> None:
    with pytest.warns(dojo.UrdfWarning, match="nothing of the robot makes contact with the ground"):
        one(tmp_path, collision(MESH))
    path = biped(tmp_path)
    with pytest.warns(
        dojo.UrdfWarning, match=r"contacts that are below the ground in the neutral state.*left \(0\.6 m\)"
    ):
        mech = dojo.load_urdf(path, floating=False)
    assert "no contacts on links that are fixed to the world: trunk" in str(mech.report)
    assert dojo.load_urdf(path, floating=False, position=(0, 0, 1)).contact_names == ("left",)


# -- standing ----------------------------------------------------------------------------------------------------------


def test_the_lowest_contact_touches_the_ground(tmp_path: Path) -> None:
    for settings in ({}, {"neutral": {"left_ankle": 0.5}}, {"contacts": ["left"]}):
        mech = dojo.load_urdf(biped(tmp_path), **settings)
        lowest = gaps(mech, np.array(mech.neutral)).min()
        assert 0.0 < lowest < 1e-8


def test_a_box_stands_and_carries_its_weight(tmp_path: Path) -> None:
    mech = one(tmp_path, collision(BOX, "0.1 0 0"))
    sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-8)
    t = sim.rollout(sim.neutral(), np.zeros((100, 0)), throw=True)
    np.testing.assert_allclose(t.x[-1, :3], (0.0, 0.0, 0.3), atol=1e-4)  # of the frame of the link
    np.testing.assert_allclose(t.contacts.normal_force[-1].sum(), 9.81, rtol=1e-3)
    assert t.contacts.gap.min() > -1e-8


def trolley(folder: Path) -> dojo.UrdfMechanism:
    """A plank on four wheels of radius 0.3 m, 2 kg each."""
    wheel = collision(CYLINDER, rpy=f"{np.pi / 2} 0 0")
    disc = inertial(2.0, inertia=(0.06, 0.09, 0.06, 0, 0, 0))
    parts = [link("plank", inertial(4.0))]
    for k, (x, y) in enumerate(product((-1, 1), (-0.5, 0.5))):
        parts += [link(f"wheel{k}", disc, wheel)]
        parts += [joint(f"axle{k}", "plank", f"wheel{k}", "continuous", '<axis xyz="0 1 0"/>', at=f'xyz="{x} {y} 0"')]
    return dojo.load_urdf(write(folder, *parts))


def test_wheels_roll_without_loss(tmp_path: Path) -> None:
    """At 1.2 m/s for 2 s: the same distance as on round wheels, at the same height, without slip."""
    mech = trolley(tmp_path)
    assert len(mech.contacts) == 8
    sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-8)
    v = np.zeros(sim.nv)
    v[0], v[6:] = 1.2, 1.2 / 0.3
    t = sim.rollout(sim.state_from_velocity(sim.neutral()[: sim.nq], v), np.zeros((200, 4)), throw=True)
    np.testing.assert_allclose(t.x[-1, 0], 2.4, rtol=2e-3)
    np.testing.assert_allclose(t.x[:, 2], 0.3, atol=1e-5)
    np.testing.assert_allclose(t.x[-1, 7 : sim.nq], 8.0, rtol=2e-3)
    assert t.contacts.slip[10:].max() < 1e-4


def test_derivatives_of_a_loaded_robot_are_differences(tmp_path: Path, rng: np.random.Generator) -> None:
    sim = dojo.Simulator(dojo.load_urdf(biped(tmp_path)), time_step=0.02, kappa=1e-3, tolerance=3e-14)
    x = sim.integrate(sim.neutral(), 0.05 * rng.normal(size=sim.ndx))
    u = rng.normal(size=sim.nu)
    check_step(sim, x, u)


def test_messages_about_many_links_are_short(tmp_path: Path) -> None:
    names = [f"l{k}" for k in range(60)]
    joints = [joint(f"j{k}", names[0], name) for k, name in enumerate(names[1:])]
    path = write(tmp_path, *(link(name, inertial()) for name in names), *joints)
    with pytest.warns(dojo.UrdfWarning, match=r"Contact\('l6', radius=0\.02\), \.\.\. for all 59 of them\]") as told:
        dojo.load_urdf(path)
    assert len(str(told[0].message)) < 600
    with pytest.raises(ValueError, match=r"not a link of the file: l0, .*, l19, \.\.\. \(60 in all\)"):
        dojo.load_urdf(path, contacts=["foot"])
