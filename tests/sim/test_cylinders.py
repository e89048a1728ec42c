"""Cylinders against capsules, boxes, polytopes and cylinders: exact far inside, standing, lying, rolling, in motion."""

from __future__ import annotations

import numpy as np
import pytest

import dojo_opt as dojo
from sim.contact.collision.cylinder_contacts import separation_of_cylinder
from sim.mechanism.body import Body
from sim.mechanism.collision import Collision
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box, Capsule, Cylinder
from sim.model.shape_kinds import OUT
from support.collision_checks import chosen, contact, derivative_error, nearest, turn
from support.free_collision import check_motion
from support.jacobians import check_step
from support.solids import distance, random_case
from support.two_bodies import ALL, ROCK, SHAPES, approaching, two

OTHERS = {"capsule": SHAPES["capsule"], "box": SHAPES["box"], "rock": ROCK, "cylinder": Cylinder(0.25, 0.3)}
PAIRS = ["capsule_cylinder", "box_cylinder", "polytope_cylinder", "cylinder_cylinder"]
LYING = (0.5**0.5, 0.5**0.5, 0.0, 0.0)  # axis along -y


@pytest.mark.sweep(2)
@pytest.mark.parametrize("name", PAIRS)
def test_distance_at_any_pose(name: str, rng: np.random.Generator) -> None:
    """Apart and up to .1 m inside, half of the smallest size; also with axes and faces that are almost parallel."""
    checked = 0
    for trial in range(60):
        case = random_case(name, rng)
        R, r = turn(2.0 * rng.normal(size=3)), 0.4 * rng.normal(size=3)
        if trial % 3 == 0:
            R = turn(rng.normal(size=3) * 10.0 ** rng.uniform(-8, -1))
        expected = distance(case, R, r, rng)
        if expected < -0.1:
            continue
        # points of a rim towards a plane are rounded by 1e-4 of a radius of at most .5 m
        assert nearest(case, R, r)[0] == pytest.approx(expected, abs=1e-4), trial
        checked += 1
    assert checked > 20


@pytest.mark.parametrize("name", PAIRS)
def test_derivatives_at_any_pose(name: str, rng: np.random.Generator) -> None:
    for _ in range(12):
        case = random_case(name, rng)
        R, r = turn(2.0 * rng.normal(size=3)), rng.normal(size=3)
        assert derivative_error(case, R, 0.5 * r / np.linalg.norm(r)) < 1e-6


def test_a_face_on_an_end_is_touched_all_around() -> None:
    """Box on cylinder, cylinder on cylinder, almost level: no contact is off the level of the lowest by more than a tilt."""
    for name in ("box_cylinder", "cylinder_cylinder"):
        case = random_case(name, np.random.default_rng(0))
        for tilt in (0.0, 1e-9, 1e-5, 1e-3):
            up = (0.5 * np.ptp(case.points[0][:, 2]) if name == "box_cylinder" else case.sizes[1]) + case.sizes[5]
            pose = turn(np.array([tilt, 0.3 * tilt, 0.0])), np.array([0.02, -0.01, up])
            outs = [contact(case, *which, *pose) for which in chosen(case, *pose)]
            near = np.array([out for out in outs if out[0] < 0.05])
            assert np.abs(near[:, 0]).max() < tilt + 1e-4
            np.testing.assert_allclose(near[:, 1:3], 0.0, atol=2.0 * tilt + 1e-12)
            angles = np.sort(np.arctan2(near[:, 5], near[:, 4]))
            assert np.diff(np.append(angles, angles[0] + 2.0 * np.pi)).max() < 2.2  # no half of the end is free


def drop(shape, obstacle, pose, force=(0.0, 0.0), seconds=1.0):
    """A body of 1 kg, let go at pose (7,) over an obstacle, and pushed sideways [N]; friction 0.5."""
    body = Body("a", 1.0, shape=shape)
    on = Collision("a", shape_b=obstacle, friction=0.5)
    mech = Mechanism([body], [Joint("floating", None, "a")], collisions=[on], gravity=(*force, -9.81))
    sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-10)
    return sim.rollout(np.r_[pose, np.zeros(6)], np.zeros((round(seconds / 0.01), sim.nu)), throw=True)


@pytest.mark.parametrize(
    ("shape", "orientation", "height"),
    [
        (Cylinder(0.1, 0.3), (1.0, 0.0, 0.0, 0.0), 0.15),
        (Cylinder(0.1, 0.3), LYING, 0.1),
        (Box(0.2, 0.3, 0.2), (1.0, 0.0, 0.0, 0.0), 0.1),
        (Capsule(0.05, 0.3), LYING, 0.05),
    ],
    ids=["cylinder stands", "cylinder lies", "box", "capsule"],
)
@pytest.mark.parametrize("obstacle", ["box", "cylinder"])
def test_shapes_on_a_level_top_stay(shape, orientation, height, obstacle) -> None:
    """Pushed with .3 of its weight along its axis, below its friction; the forces of all points carry it."""
    if isinstance(shape, Box | Capsule) and obstacle == "box":
        pytest.skip("no cylinder")
    table = Box(1.0, 1.0, 0.2) if obstacle == "box" else Cylinder(0.5, 0.2)
    t = drop(shape, table, (0.05, 0.02, 0.1 + height + 0.002, *orientation), force=(0.0, 1.0))
    np.testing.assert_allclose(t.x[-1, :3], [0.05, 0.02, 0.1 + height], atol=1e-4)
    np.testing.assert_allclose(t.x[-1, 7:], 0.0, atol=1e-4)
    np.testing.assert_allclose(t.contacts.force[-1].sum(axis=0), [0.0, -1.0, 9.81], atol=1e-3)


def test_a_cylinder_at_the_border_of_a_table_stays_as_long_as_its_weight_is_above_it() -> None:
    for inside, stays in ((0.01, True), (-0.01, False)):
        t = drop(Cylinder(0.1, 0.2), Box(1.0, 1.0, 0.2), (0.5 - inside, 0.0, 0.2, 1.0, 0.0, 0.0, 0.0))
        assert (t.x[-1, 2] > 0.199) == stays


def test_a_cylinder_lies_across_two_others() -> None:
    """Crossed sides: one point on each."""
    t = drop(
        Cylinder(0.05, 0.6), Cylinder(0.1, 1.0, orientation=LYING), (0.0, 0.0, 0.151, 0.5**0.5, 0.0, 0.5**0.5, 0.0)
    )
    np.testing.assert_allclose(t.x[-1, :3], [0.0, 0.0, 0.15], atol=1e-4)


def test_a_wheel_rolls_over_a_box_without_loss() -> None:
    """On a level box: speed and radius times spin stay equal."""
    body = Body("wheel", 1.0, shape=Cylinder(0.1, 0.05))
    mech = Mechanism(
        [body], [Joint("floating", None, "wheel")], collisions=[Collision("wheel", shape_b=Box(4.0, 1.0, 0.2))]
    )
    sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-10)
    x = np.r_[-1.0, 0.0, 0.2, LYING, 1.0, 0.0, 0.0, 0.0, 0.0, -10.0]  # the axis of spin is the wheel's z, along -y
    t = sim.rollout(x, np.zeros((150, sim.nu)), throw=True)
    assert t.x[-1, 0] == pytest.approx(0.5, abs=5e-3)
    assert t.x[-1, 7] == pytest.approx(1.0, abs=2e-3)
    assert t.x[-1, 12] == pytest.approx(-10.0, abs=2e-2)


@pytest.mark.parametrize("first", [True, False], ids=["cylinder first", "cylinder second"])
@pytest.mark.parametrize("name", OTHERS)
def test_motions_keep_momentum_and_gain_no_energy(name: str, first: bool) -> None:
    shapes = (Cylinder(0.2, 0.4), OTHERS[name])
    sim = dojo.Simulator(two(*(shapes if first else shapes[::-1])), time_step=0.01, kappa=1e-8, tolerance=1e-12)
    hit = 0
    for seed in range(8):
        t = sim.rollout(approaching(sim, seed, 1.0), np.zeros((60, sim.nu)), throw=True)
        hit += check_motion(sim, t, seed)
    assert hit > 3


@pytest.mark.parametrize(
    ("a", "b", "seeds"),
    [("wheel", "wheel", (2, 12, 49, 102)), ("cylinder", "wheel", (18, 110)), ("box", "wheel", (1, 38))],
    ids=str,
)
def test_thin_wheels_at_four_centimeters_a_step(a: str, b: str, seeds: tuple[int, ...]) -> None:
    """Motions in which rims ran along each other, or passed an edge within a step."""
    sim = dojo.Simulator(two(ALL[a], ALL[b]), time_step=0.01)
    for seed in seeds:
        t = sim.rollout(approaching(sim, seed, 1.0), np.zeros((60, sim.nu)), throw=True)
        assert np.diff(sim.energy(t.x)).max() < 1e-2


def test_rims_that_run_along_each_other_are_apart(rng: np.random.Generator) -> None:
    """Axes in one plane, so that tangents at the closest points are parallel: a lower bound of the distance, above 0."""
    checked = 0
    for _ in range(120):
        case = random_case("cylinder_cylinder", rng)
        R = turn(np.array([0.0, rng.uniform(-3.0, 3.0), 0.0]))
        r = rng.uniform(0.4, 1.0) * turn(np.array([0.0, rng.uniform(-3.0, 3.0), 0.0]))[:, 0]
        expected = distance(case, R, r, rng)
        if expected < 1e-3:
            continue
        pose = np.ascontiguousarray(R).ravel(), r
        codes = np.zeros(1, dtype=np.int64)
        found = separation_of_cylinder(int(case.kind), case.sizes, case.hull, *pose, np.empty(12), codes, np.empty(OUT))
        assert 0.0 < found < expected + 1e-6
        checked += 1
    assert checked > 30


@pytest.mark.parametrize(("radius", "length", "seed"), [(0.3, 0.2, 495), (0.3, 0.02, 709)], ids=["wheel", "coin"])
def test_steps_with_impulses_that_give_energy_are_not_accepted(radius: float, length: float, seed: int) -> None:
    """A box against a wheel and a coin: the first elements with which one step is solved give 228 J and 130 J."""
    sim = dojo.Simulator(two(SHAPES["box"], Cylinder(radius, length)), time_step=0.01)
    t = sim.rollout(approaching(sim, seed, 1.0), np.zeros((60, sim.nu)))
    assert t.success or t.status in (dojo.Status.SHAPES_CROSSED, dojo.Status.MAX_ITERATIONS)
    assert np.diff(sim.energy(t.x)).max() < 1e-2  # kappa pushes from afar
    assert np.abs(t.contacts.impulse).max() > 0.1


@pytest.mark.sweep(3)
@pytest.mark.parametrize("name", ["capsule", "box", "rock"])
def test_derivatives_of_a_step(name: str) -> None:
    """In the step that hits, and in the one before."""
    sim = dojo.Simulator(two(Cylinder(0.2, 0.4), OTHERS[name]), time_step=0.01, kappa=1e-4, tolerance=1e-12)
    checked = 0
    for seed in range(5):
        t = sim.rollout(approaching(sim, seed, 1.0), np.zeros((60, sim.nu)), throw=True)
        push = np.abs(t.contacts.impulse).max(axis=(1, 2))
        if push.max() < 0.1:
            continue
        for k in (int(push.argmax()) - 1, int(push.argmax())):
            check_step(sim, t.x[k])
            checked += 1
    assert checked >= 4
