"""A body with several shapes: all of them touch, each with its own friction; files keep every collision shape."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dojo_opt as dojo
from support.jacobians import check_step
from support.urdf_files import collision, inertial, joint, link, write

TRUNK = '<box size="0.4 0.1 0.12"/>'
ROTOR = '<cylinder radius="0.02" length="0.02"/>'
HEAD = 0.2  # [m] ahead of the trunk


def trunk(folder: Path) -> Path:
    """A trunk with a rotor and a head on fixed joints, as Go1's."""
    seen = collision(ROTOR).replace("collision", "visual")
    rotor = link("rotor", inertial(0.1), collision(ROTOR), seen)
    at = f'xyz="{HEAD} 0 0" rpy="0 0 0"'
    head = link(
        "head", inertial(0.1), collision('<sphere radius="0.03"/>'), collision('<capsule radius="0.03" length="0.04"/>')
    )
    parts = (link("trunk", inertial(5.0), collision(TRUNK)), rotor, head)
    return write(
        folder,
        *parts,
        joint("a", "trunk", "rotor", "fixed", "", at=at),
        joint("b", "trunk", "head", "fixed", "", at=at),
    )


def test_a_merged_body_keeps_every_collision_shape(tmp_path: Path) -> None:
    shapes = dojo.load_urdf(trunk(tmp_path)).bodies[0].shapes
    assert [(type(s), s.name) for s in shapes] == [
        (dojo.Box, "trunk"),
        (dojo.Cylinder, "rotor"),
        (dojo.Sphere, "head"),
        (dojo.Capsule, "head_1"),
    ]


@pytest.mark.parametrize("x", [0.0, HEAD + 0.01])
def test_the_trunk_and_the_head_land_on_a_post(tmp_path: Path, x: float) -> None:
    """A thin post below the middle meets the box, one below the head the lower end of its capsule."""
    path = trunk(tmp_path)
    if x:  # the head alone: the box does not reach beyond it
        path.write_text(path.read_text().replace("0.4 0.1 0.12", "0.2 0.1 0.12"))
    mech = dojo.load_urdf(path, ground=False)
    post = dojo.Box(0.01, 0.1, 0.2, center=(x, 0.0, 0.1))
    sim = dojo.Simulator(mech.with_obstacle(post, bodies=["trunk"]), time_step=0.01)
    start = sim.neutral()
    start[2] = 0.3
    t = sim.rollout(start, np.zeros((16, 0)), throw=True)
    pressed = t.contacts.normal_force.max(axis=0) > 1.0
    names = {n.split(".")[1].split("_")[0] for n, on in zip(sim.mechanism.contact_names, pressed, strict=True) if on}
    assert names and names <= ({"trunk"} if not x else {"head"})
    free = 0.3 - 0.5 * 9.81 * t.time[-1] ** 2
    assert t.x[-1, 2] > free + 0.01  # it was caught
    assert t.contacts.gap.min() > -1e-6


def test_visual_shapes_count_where_nothing_collides(tmp_path: Path) -> None:
    small, big = '<sphere radius="0.1"/>', '<sphere radius="0.3"/>'
    seen = collision(big).replace("collision", "visual")
    for parts, radius in (
        ((collision(small), seen), 0.1),
        ((seen, collision(small).replace("collision", "visual")), 0.3),
    ):
        shape = dojo.load_urdf(write(tmp_path, link("ball", inertial(), *parts)), ground=False).bodies[0].shape
        assert isinstance(shape, dojo.Sphere) and shape.radius == radius


def test_one_shape_twice_is_one_shape(tmp_path: Path) -> None:
    mech = dojo.load_urdf(write(tmp_path, link("ball", inertial(), collision(TRUNK), collision(TRUNK))))
    assert len(mech.bodies[0].shapes) == 1


@pytest.mark.filterwarnings("ignore:.*inertias that no rigid body has were repaired:sim.io.urdf.report.UrdfWarning")
def test_missing_masses_and_inertias_come_from_the_shapes(tmp_path: Path) -> None:
    """One link has a mass without inertia, one neither; the third has shapes, but an impossible inertia."""
    box = collision('<box size="0.2 0.4 0.6"/>', "0.1 0 0")
    none = (0.0,) * 6
    wrong = (1.0, 0.1, 0.1, 0.0, 0.0, 0.0)
    links = (
        link("a", inertial(3.0, xyz="0.1 0 0", inertia=none), box),
        link("b", box),
        link("c", inertial(1.0, inertia=wrong), box),
    )
    path = write(tmp_path, *links, joint("j", "a", "b"), joint("k", "b", "c"))
    with pytest.raises(dojo.UrdfError, match="no rigid body has the inertia of these moving links"):
        dojo.load_urdf(path)
    with pytest.warns(dojo.UrdfWarning, match="were repaired, from the collision shapes, with 1000 kg/m.3"):
        a, b, c = dojo.load_urdf(path, repair=True, ground=False).bodies
    solid = dojo.Box(0.2, 0.4, 0.6)
    np.testing.assert_allclose(a.inertia, solid.inertia(3.0), rtol=1e-12)
    assert b.mass == pytest.approx(48.0) and b.shapes[0].center == pytest.approx((0.0, 0.0, 0.0))
    np.testing.assert_allclose(b.inertia, solid.inertia(48.0), rtol=1e-12)
    assert c.mass == 1.0 and np.trace(c.inertia) > 1.2


def test_mjcf_bodies_keep_every_geom_that_collides() -> None:
    pytest.importorskip("mujoco")
    text = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1"/><body name="a" pos="0 0 1"><freejoint/>
      <geom name="ball" size=".1" mass="1"/><geom name="chip" type="box" size=".02 .02 .02" mass=".1" friction=".3"/>
      <geom name="shell" type="box" size="1 1 1" mass=".1" contype="0" conaffinity="0"/>
      <body pos="0 0 .3"><geom name="tip" size=".01" mass=".1" condim="1"/></body></body></worldbody></mujoco>"""
    shapes = dojo.load_mjcf(text).bodies[0].shapes
    assert [(s.name, s.friction) for s in shapes] == [("ball", 1.0), ("chip", 0.3), ("tip", 0.0)]


# -- bodies made by hand -----------------------------------------------------------------------------------------------


def test_inertia_of_several_shapes_agrees_with_the_solid_they_make() -> None:
    """A box cut in three, one part a polytope that is not about its own centre; and a refusal of parts that are off."""
    corners = np.array(np.meshgrid((0.0, 0.3), (0.0, 0.2), (0.0, 0.4))).reshape(3, -1).T  # of .3 x .2 x .4
    parts = [
        dojo.Box(0.3, 0.2, 0.2, center=(0.0, 0.0, -0.3)),
        dojo.Box(0.3, 0.2, 0.2, center=(0.0, 0.0, -0.1)),
        dojo.Polytope(corners, center=(-0.15, -0.1, 0.0)),
    ]
    body = dojo.Body("cut", 2.4, shape=parts)
    np.testing.assert_allclose(body.inertia, dojo.Box(0.3, 0.2, 0.8).inertia(2.4), atol=1e-15)
    with pytest.raises(
        ValueError, match=r"Body\('off'\): the centre of mass of its shapes is at \[0\.0, 0\.0, -0\.2\]"
    ):
        dojo.Body("off", 2.4, shape=parts[:2])
    with pytest.raises(ValueError, match=r"Body\('b', shape=\.\.\.\): expected a shape.*or several"):
        dojo.Body("b", shape=[dojo.Sphere(0.1), "ball"])
    with pytest.raises(ValueError, match=r"Body\('b', shape=\.\.\.\): shapes: the name 'x' is used twice"):
        dojo.Body("b", shape=[dojo.Sphere(0.1, name="x"), dojo.Sphere(0.2, name="x")])


def sled(**options: object) -> dojo.Mechanism:
    """A body of two runners with different friction, and a plank in two parts that lies there."""
    runners = [
        dojo.Box(0.4, 0.04, 0.1, center=(0.0, 0.1, 0.0), friction=0.1, name="left"),
        dojo.Capsule(0.05, 0.3, center=(0.0, -0.1, 0.0), orientation=(np.sqrt(0.5), 0, np.sqrt(0.5), 0), friction=0.4),
    ]
    bodies = [dojo.Body("sled", 2.0, (0.02, 0.03, 0.04), runners)]
    floor = dojo.Collision("sled", shape_b=dojo.HalfSpace(friction=0.2), name="floor", **options)
    return dojo.Mechanism(
        bodies, [dojo.Joint("floating", None, "sled")], collisions=[floor], neutral={"sled": (0, 0, 0.0501, 1, 0, 0, 0)}
    )


def test_each_shape_rubs_with_its_own_friction() -> None:
    """Sliding, the force is the larger coefficient of shape and floor times the normal force, point by point."""
    mech = sled()
    assert [(c.name, c.friction) for c in mech.collisions] == [("floor.left", 0.2), ("floor.1", 0.4)]
    assert [c.friction for c in sled(friction=0.7).collisions] == [0.7, 0.7]
    sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-9)
    v = np.zeros(6)
    v[0] = 2.0
    t = sim.rollout(sim.state_from_velocity(mech.neutral, v), np.zeros((20, 0)), throw=True)
    normal, along = t.contacts.normal_force[10], t.contacts.friction_force[10]
    carried = normal > 0.05
    coefficient = np.array([0.2 if "left" in name else 0.4 for name in mech.contact_names])
    assert carried.sum() >= 3
    np.testing.assert_allclose(along[carried], (coefficient * normal)[carried], rtol=1e-3)
    np.testing.assert_allclose(normal.sum(), 2.0 * 9.81, rtol=1e-3)


def test_terrain_and_parameters_know_every_shape() -> None:
    mech = sled()
    stone = replace(mech.bodies[0].shapes[0], restitution=0.3)
    body = replace(mech.bodies[0], shape=[stone, mech.bodies[0].shapes[1]])
    alone = dojo.Mechanism([body], mech.joints).with_terrain(dojo.Terrain.slope(0.2), bodies=["sled"])
    settings = {(c.name.split("_")[0], c.friction, c.restitution) for c in alone.contacts}
    assert settings == {("sled.left", 0.1, 0.3), ("sled.1", 0.4, 0.0)} and len(alone.contacts) == 10
    sim = dojo.Simulator(mech, time_step=0.01)
    names = sim.parameters(["friction", "size_a"]).names
    assert {"friction:floor.left", "friction:floor.1", "size_a:floor.left[x]", "size_a:floor.1[radius]"} <= set(names)


def test_derivatives_with_several_shapes_are_differences(rng: np.random.Generator) -> None:
    """The sled lands on a block of two shapes: four pairs of shapes between the same two bodies."""
    mech = sled()
    block = [dojo.Box(0.2, 0.4, 0.1, center=(0.1, 0, 0)), dojo.Sphere(0.05, center=(-0.2, 0.1, 0.0), friction=0.9)]
    mech = dojo.Mechanism(
        [*mech.bodies, dojo.Body("block", 1.0, (0.02, 0.01, 0.02), block)],
        [*mech.joints, dojo.Joint("floating", None, "block")],
        collisions=[dojo.Collision("sled", "block")],
    )
    assert [c.name for c in mech.collisions] == [f"sled-block.{a}-{b}" for a in ("left", 1) for b in (0, 1)]
    sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-3, tolerance=3e-14)
    x = sim.neutral()
    x[2] = 0.105
    x = sim.integrate(x, 0.01 * rng.normal(size=sim.ndx))
    check_step(sim, x)
