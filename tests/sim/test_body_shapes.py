"""A body of a file has one shape for obstacles: its largest that collides; what is left out is said."""

from __future__ import annotations

import warnings
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import dojo_opt as dojo
from sim.io.urdf.drawing import largest
from support.urdf_files import collision, inertial, joint, link, write

LEFT_OUT = "a body keeps one collision shape, its largest.*left out of those"
TRUNK = '<box size="0.4 0.1 0.12"/>'
ROTOR = '<cylinder radius="0.02" length="0.02"/>'


def left_out(mech: dojo.UrdfMechanism | dojo.MjcfMechanism) -> tuple[str, ...]:
    """What the report lists."""
    assert mech.report is not None
    return next((note.names for note in mech.report.notes if "keeps one collision shape" in note.text), ())


def trunk(folder: Path) -> Path:
    """A trunk whose only primitive to look at is a rotor's, as Go1's; everything is on fixed joints."""
    seen = collision(ROTOR).replace("collision", "visual")
    rotor = link("rotor", inertial(0.1), collision(ROTOR), seen)
    at = 'xyz="0.2 0 0" rpy="0 0 0"'
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


def test_the_largest_shape_of_a_merged_body_stays_and_the_others_are_named(tmp_path: Path) -> None:
    with pytest.warns(
        dojo.UrdfWarning, match=f"{LEFT_OUT}: rotor \\(cylinder\\), head \\(sphere\\), head \\(capsule\\)"
    ):
        mech = dojo.load_urdf(trunk(tmp_path))
    shape = mech.bodies[0].shape
    assert isinstance(shape, dojo.Box) and (shape.x, shape.y, shape.z) == (0.4, 0.1, 0.12)
    assert left_out(mech) == ("rotor (cylinder)", "head (sphere)", "head (capsule)")
    assert "rotor (cylinder)" in str(mech.report)


@pytest.mark.filterwarnings("ignore:.*keeps one collision shape:sim.io.urdf.report.UrdfWarning")
def test_a_trunk_with_rotors_lands_on_a_beam(tmp_path: Path) -> None:
    mech = dojo.load_urdf(trunk(tmp_path), ground=False)
    beam = dojo.Box(0.3, 1.0, 0.2, center=(0.0, 0.0, 0.1))
    sim = dojo.Simulator(mech.with_obstacle(beam, bodies=["trunk"]), time_step=0.01)
    x = sim.neutral()
    x[2] = 0.4
    height = sim.rollout(x, np.zeros((60, 0)), throw=True).x[:, 2]
    assert height.min() > 0.2 + 0.06 - 1e-6


def test_what_is_seen_only_counts_where_nothing_collides(tmp_path: Path) -> None:
    small, big = '<sphere radius="0.1"/>', '<sphere radius="0.3"/>'
    seen = collision(big).replace("collision", "visual")
    for parts, radius in (
        ((collision(small), seen), 0.1),
        ((seen, collision(small).replace("collision", "visual")), 0.3),
    ):
        mech = dojo.load_urdf(write(tmp_path, link("ball", inertial(), *parts)), ground=False)
        assert isinstance(mech.bodies[0].shape, dojo.Sphere) and mech.bodies[0].shape.radius == radius
        assert left_out(mech) == ()


def test_one_shape_twice_is_one_shape(tmp_path: Path) -> None:
    assert left_out(dojo.load_urdf(write(tmp_path, link("ball", inertial(), collision(TRUNK), collision(TRUNK))))) == ()


def test_the_largest_has_the_largest_volume(rng: np.random.Generator) -> None:
    for _ in range(50):
        a, b, c = rng.uniform(0.05, 1.0, 3)
        volumes = {
            dojo.Sphere(a): 4.0 / 3.0 * np.pi * a**3,
            dojo.Box(a, b, c): a * b * c,
            dojo.Cylinder(b, c): np.pi * b**2 * c,
            dojo.Capsule(c, a): np.pi * c**2 * a + 4.0 / 3.0 * np.pi * c**3,
        }
        order = sorted(volumes, key=lambda shape: volumes[shape])
        for smaller, larger in pairwise(order):
            for pair in ((smaller, larger), (larger, smaller)):
                assert largest([(str(k), shape) for k, shape in enumerate(pair)]) == larger


def test_mjcf_bodies_keep_their_largest_geom_that_collides() -> None:
    pytest.importorskip("mujoco")
    text = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1"/><body name="a" pos="0 0 1"><freejoint/>
      <geom name="ball" size=".1" mass="1"/><geom name="chip" type="box" size=".02 .02 .02" mass=".1"/>
      <geom name="shell" type="box" size="1 1 1" mass=".1" contype="0" conaffinity="0"/>
      <body pos="0 0 .3"><geom name="tip" size=".01" mass=".1"/></body></body></worldbody></mujoco>"""
    with pytest.warns(dojo.MjcfWarning, match=rf"{LEFT_OUT}: chip \(box\), tip \(sphere\)"):
        mech = dojo.load_mjcf(text)
    shape = mech.bodies[0].shape
    assert isinstance(shape, dojo.Sphere) and shape.radius == 0.1
    assert left_out(mech) == ("chip (box)", "tip (sphere)")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        alone = dojo.load_mjcf('<mujoco><worldbody><body><freejoint/><geom size=".1"/></body></worldbody></mujoco>')
    assert left_out(alone) == ()
