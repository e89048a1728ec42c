"""Descriptions of a scene by `describe` and in messages."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

import dojo_opt as dojo
from sim.mechanism.pack import pack
from sim.simulator.omitted_contacts import reach


def test_collisions_are_contacts_of_a_step() -> None:
    ball = dojo.Body("ball", 1.0, shape=dojo.Sphere(0.1))
    box = dojo.Body("box", 1.0, shape=dojo.Box(0.2, 0.2, 0.2))
    mech = dojo.Mechanism(
        [ball, box],
        [dojo.Joint("floating", None, "ball"), dojo.Joint("floating", None, "box")],
        collisions=[dojo.Collision("ball", "box"), dojo.Collision("box", shape_b=dojo.HalfSpace(), friction=0.0)],
    )
    text = dojo.Simulator(mech, time_step=0.01).describe()
    assert "sphere on ball, box on box: 1 point, law nonlinear, friction 0.5" in text
    assert "box on box, halfspace of the world: 8 points, law impact, friction 0" in text
    assert "1 cones, 0 pyramids, 8 without friction" in text
    assert "interior point" in text and "omitted" in text and "Newton" not in text
    assert "\ncontacts\n" not in text
    assert re.search(r"beyond a gap of 0\.\d+ m \(ball-box: 0\.\d+ m\);", text), text


def test_strings_are_always_active() -> None:
    balls = [dojo.Body(name, 1.0, shape=dojo.Sphere(0.1)) for name in "ab"]
    joints = [dojo.Joint("floating", None, name) for name in "ab"]
    mech = dojo.Mechanism(balls, joints, collisions=[dojo.Collision("a", "b", dojo.String(1.0), dojo.String(1.0))])
    assert "inactive contacts" not in dojo.Simulator(mech, time_step=0.01).describe()


def test_a_pendulum_has_no_empty_lists_and_one_of_each() -> None:
    text = dojo.Simulator(dojo.models.pendulum(), time_step=0.01).describe()
    assert "1 body, 1 degree of freedom" in text
    assert "\ncontacts\n" not in text and "\ncollisions\n" not in text


def test_a_body_that_turns_too_far_is_named() -> None:
    sim = dojo.Simulator(dojo.models.block(), time_step=0.1, divide=False)
    x = sim.neutral()
    x[2], x[-1] = 3.0, 100.0
    assert "The fastest is 'block', with 100 rad/s before the step." in sim.rollout(x, np.zeros((3, 3))).message


def test_the_gap_of_inactive_collisions_is_that_of_a_step() -> None:
    """Two balls at rest: beyond the gap of the description their collision is omitted, below it is not."""
    balls = [dojo.Body(name, 1.0, shape=dojo.Sphere(0.1)) for name in "ab"]
    joints = [dojo.Joint("floating", None, name) for name in "ab"]
    mech = dojo.Mechanism(balls, joints, collisions=[dojo.Collision("a", "b")], gravity=(0.0, 0.0, 0.0))
    sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-6)
    found = re.search(r"beyond a gap of (\S+) m", sim.describe())
    assert found is not None and float(found[1]) > 1e-3
    for share, omitted in ((1.05, ("a-b",)), (0.95, ())):
        x = sim.neutral()
        x[:3], x[7:10] = (0.2 + share * float(found[1]), 0.0, 0.0), 0.0
        assert sim.inactive_contacts(x) == omitted


def test_the_gap_of_far_contacts_is_that_of_a_step() -> None:
    """A ball at rest: beyond the gap of the description its contact is far, below it is not."""
    mech = dojo.Mechanism(
        [dojo.Body("ball", 2.0, shape=dojo.Sphere(0.1))],
        [dojo.Joint("floating", None, "ball")],
        [dojo.Contact("ball", radius=0.1, name="foot")],
        gravity=(0.0, 0.0, 0.0),
    )
    sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-3, cutoff=0.3)
    found = re.search(r"far contacts +omitted from the solver beyond a gap of (\S+) m", sim.describe())
    assert found is not None
    for share, omitted in ((1.05, ("foot",)), (0.95, ())):
        x = sim.neutral()
        x[2] = 0.1 + share * float(found[1])
        assert sim.inactive_contacts(x) == omitted
    assert "far contacts" not in sim.replace(cutoff=0.0).describe()


def test_collisions_do_not_change_the_gap_of_inactive_contacts_with_the_ground() -> None:
    mech = dojo.models.block()
    wall = dojo.Collision(mech.body_names[0], shape_a=dojo.Box(1.0, 1.0, 1.0), shape_b=dojo.Box(1.0, 1.0, 1.0))
    alone, beside = (reach(pack(m), 0.01, 1e-6, 1e-10) for m in (mech, replace(mech, collisions=[wall])))
    assert len(beside) > len(alone) == len(mech.contacts)
    np.testing.assert_array_equal(beside[: len(alone)], alone)
