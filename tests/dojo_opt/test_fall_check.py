"""FallCheck against its definition, by the maximal state of the base; and commands that are held."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.plant.fall import FallCheck
from sim.mechanism.shapes import rotation_matrix

QUARTER = (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)


def posture(sim, x, first, normal, height, up):
    """Cosine of the tilt, and height along z above the plane with normal `up`."""
    now, then = sim.maximal(x)[0], sim.maximal(first)[0]
    turned = rotation_matrix(now[6:10]) @ rotation_matrix(then[6:10]).T @ normal
    return normal @ turned, (up @ now[:3] - height) / up[2]


@pytest.mark.parametrize("build", [dojo.models.quadruped, dojo.models.hopper])
def test_it_agrees_with_the_pose_of_the_base(build):
    """For bases held off their centre, by a turned joint, on sloping ground."""
    mech = build()
    base = mech.joints[0]
    turned = base.orientation if base.kind == "planar_axis" else QUARTER
    base = replace(base, child_point=(0.1, 0.02, -0.3), parent_point=(0.2, 0.0, 0.1), orientation=turned)
    up = np.array([0.1, -0.2, 0.9]) / np.linalg.norm([0.1, -0.2, 0.9])
    contacts = [replace(c, normal=up, height=-0.4) for c in mech.contacts]
    sim = dojo.Simulator(replace(mech, joints=[base, *mech.joints[1:]], contacts=contacts), time_step=0.01)
    first = sim.neutral()
    first[2 if base.kind == "floating" else 1] += 1.0
    check, rng, fallen = FallCheck(sim.mechanism, first, up), np.random.default_rng(0), 0
    _, initially = posture(sim, first, first, up, -0.4, up)
    assert check.height(first) == pytest.approx(initially, abs=1e-12)
    for _ in range(200):
        x = sim.integrate(first, rng.normal(0.0, 0.7, sim.ndx))
        tilt, height = posture(sim, x, first, up, -0.4, up)
        assert check.height(x) == pytest.approx(height, abs=1e-12)
        assert check(x) == (tilt < 0.5 or height < 0.5 * initially)
        fallen += check(x)
    assert 20 < fallen < 190


@pytest.mark.parametrize("rise", [0.0, -1.0, 1.0])
def test_the_ground_is_a_half_space_of_a_collision_as_of_a_contact(rise):
    """A ball rests on it, and falls beside it; one without ground that begins below the origin has no height to lose."""
    ball, free = dojo.Body("ball", 1.0, shape=dojo.Sphere(0.1)), dojo.Joint("floating", None, "ball")
    place, up = [0.0, 0.0, rise + 0.1, 1.0, 0.0, 0.0, 0.0], np.array([0.0, 0.0, 1.0])
    plane = dojo.Collision("ball", shape_b=dojo.HalfSpace(center=(0.0, 0.0, rise)))
    given = ({"contacts": [dojo.Contact("ball", radius=0.1, height=rise)]}, {"collisions": [plane]})
    checks = [
        FallCheck(dojo.Mechanism([ball], [free], neutral={"ball": place}, **ground), np.array(place + 6 * [0.0]), up)
        for ground in (*given, {})
    ]
    for height in (0.06, 0.04):
        x = np.array([0.0, 0.0, rise + height, 1.0, *9 * [0.0]])
        assert [check(x) for check in checks[:2]] == 2 * [height < 0.05]
        assert checks[0].height(x) == pytest.approx(checks[1].height(x), abs=1e-12)
    assert not checks[2](np.array([*place, *6 * [0.0]]))


def test_a_held_command_takes_the_steps_of_a_plant():
    sim = dojo.Simulator(dojo.models.hopper(), time_step=5e-3)
    u = np.linspace(-1.0, 1.0, sim.nu)
    for fields in ({}, {"delay": 0.01}, {"control_limits": (-0.5, 0.5)}, {"pushes": [dojo.Push(0.01, (1.0, 0, 0))]}):
        one, other = dojo.Plant(sim, **fields), dojo.Plant(sim, **fields)
        assert one.hold(u, 7) == ""
        for _ in range(7):
            other.step(u)
        np.testing.assert_allclose(one.x, other.x, atol=1e-8)
        assert one.time == other.time
    with pytest.raises(ValueError, match=r"Plant\.step\(command\): expected finite numbers"):
        one.hold(np.full(sim.nu, np.nan), 1)
