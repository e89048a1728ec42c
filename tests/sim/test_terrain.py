"""Terrain: its heights, its contact with a ball, the derivatives of a step on it, and motions with known solutions."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import dojo_opt as dojo
from sim.mechanism.stance import gaps
from support.hills import GRID, WAVES, H, derivatives_of, waves
from support.scenes import ball, block, chain, order, run

# -- heights -----------------------------------------------------------------------------------------------------------


def test_a_function_is_met_and_its_normal_agrees_with_the_spline(rng):
    x, y = rng.uniform(-1.9, 1.9, (2, 200))
    np.testing.assert_allclose(WAVES.height(x, y), waves(x, y), atol=2e-6)
    e = 1e-5
    fx = (WAVES.height(x + e, y) - WAVES.height(x - e, y)) / (2 * e)
    fy = (WAVES.height(x, y + e) - WAVES.height(x, y - e)) / (2 * e)
    n = WAVES.normal(x, y)
    np.testing.assert_allclose(-n[:, :2] / n[:, 2:], np.stack([fx, fy], axis=1), atol=1e-8)
    np.testing.assert_allclose(np.linalg.norm(n, axis=1), 1.0, atol=1e-14)


def test_splines_give_back_cubics_and_go_on_level():
    def cubic(X, Y):
        return 0.2 * X**3 - X * Y + 0.1 * Y**2

    T = dojo.Terrain.from_function(cubic, np.linspace(-1, 1, 9), np.linspace(-1, 1, 7))
    x, y = np.array([-0.9, 0.13, 0.77]), np.array([0.4, -0.71, 0.99])
    np.testing.assert_allclose(T.height(x, y), cubic(x, y), atol=1e-12)
    far = T.height(np.array([5.0, 50.0]), np.array([0.2, 0.2]))
    assert far[0] == far[1]
    ramp = dojo.Terrain(0.1 * np.arange(5.0)[:, None])  # goes on by a grid line; with level edges it does not rise
    np.testing.assert_allclose(
        ramp.height([-9.0, -2.0, 0.0, 4.0, 6.0, 9.0], 0.0), [-0.1, -0.1, 0.0, 0.4, 0.5, 0.5], atol=1e-12
    )
    level = dojo.Terrain(np.r_[np.zeros(12), 0.1, np.full(12, 0.2)][:, None])
    np.testing.assert_allclose(level.height([-9.0, 0.0, 24.0, 40.0], 0.0), [0.0, 0.0, 0.2, 0.2], atol=2e-6)


@pytest.mark.parametrize("name", ["walker", "block2d", "raiberthopper"])
def test_bases_that_can_rise_stand_on_other_ground(name):
    mech = getattr(dojo.models, name)()
    for terrain, rise in ((dojo.Terrain([[0.5]]), 0.5), (dojo.Terrain.slope(0.2, (0.0, 1.0), height=-0.3), None)):
        moved = mech.with_terrain(terrain)
        assert gaps(moved, np.array(moved.neutral)).min() == pytest.approx(1e-9, abs=1e-12)
        change = np.subtract(moved.neutral, mech.neutral)
        up = 2 if mech.joints[0].kind == "floating" else 1
        assert np.flatnonzero(change).tolist() == [up] and (rise is None or change[up] == pytest.approx(rise, abs=1e-8))


def test_bases_on_slides_rise_where_nothing_limits_them():
    """A plane's joints one by one, with bodies without mass in between; the upper slide is turned."""
    turned = (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)  # its x axis points down
    for limits in (None, (-1.0, 1.0)):
        joints = [
            dojo.Joint("prismatic", None, "cart", axis=(0, 1, 0)),
            dojo.Joint("prismatic", "cart", "ball", axis=(1, 0, 0), orientation=turned, limits=limits),
        ]
        bodies = [dojo.Body("cart", 0.0), dojo.Body("ball", 1.0, shape=dojo.Sphere(0.1))]
        moved = dojo.Mechanism(bodies, joints).with_terrain(dojo.Terrain([[0.5]]), bodies=["ball"])
        np.testing.assert_allclose(moved.neutral, [0.0, -0.6 if limits is None else 0.0], atol=1e-8)


def test_a_wall_does_not_raise_a_base():
    """One contact stays on a wall, whose normal has a vertical part of rounding."""
    contacts = [dojo.Contact("ball", radius=0.1, name="foot", normal=n, height=0.2) for n in ((0, 0, 1), (1, 0, 2e-16))]
    scene = ball(law="impact")
    mech = dataclasses.replace(scene, contacts=[contacts[0], dataclasses.replace(contacts[1], name="hand")])
    moved = mech.with_terrain(dojo.Terrain.slope(0.0), contacts=["foot"])
    np.testing.assert_allclose(np.array(moved.neutral)[:3], (0.0, 0.0, 0.1), atol=1e-8)


@pytest.mark.parametrize("radius", [0.02, 0.3])
def test_a_ball_in_a_bowl_is_a_point_in_a_smaller_bowl(radius):
    R = 2.0
    bowl = dojo.Terrain.from_function(lambda X, Y: R - np.sqrt(R**2 - X**2 - Y**2), GRID[8:-8], GRID[8:-8])
    x, y = np.linspace(-0.6, 0.6, 13), 0.2
    expected = R - np.sqrt((R - radius) ** 2 - x**2 - y**2)
    np.testing.assert_allclose(bowl.surface(radius).height(x, y), expected, atol=3e-6)


def test_steps_stand_where_they_are_said_to():
    T = dojo.Terrain.steps([0.1, -0.05], depth=0.4, start=1.0, edge=0.05, direction=(0.0, 1.0))
    y = np.array([0.0, 0.97, 1.0, 1.03, 1.37, 1.4, 1.43, 9.0])
    expected = [0.0, 0.0, 0.05, 0.1, 0.1, 0.075, 0.05, 0.05]
    np.testing.assert_allclose(T.height(np.full(8, 3.0), y), expected, atol=1e-6)
    ball_over = T.surface(0.03)
    assert abs(float(ball_over.height(0.0, 0.5)) - 0.03) < 1e-8
    assert float(ball_over.height(0.0, 0.985)) > 0.1  # the edge is felt before the ball is over it


def test_a_slope_is_a_half_space():
    T = dojo.Terrain.slope(0.2, (0.0, 2.0), height=0.3)
    contact = dojo.Contact("b", radius=0.1, terrain=T)
    assert contact.terrain is None
    assert T.height(5.0, 1.0) == pytest.approx(0.3 + np.tan(0.2))
    np.testing.assert_allclose(contact.normal, [0.0, -np.sin(0.2), np.cos(0.2)])
    assert contact.gap((5.0, 1.0, 0.3 + np.tan(0.2))) == pytest.approx(-0.1)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: dojo.Terrain([[0.0, np.nan]]), r"Terrain\(heights=...\): expected finite"),
        (lambda: dojo.Terrain(np.zeros((0, 3))), "expected one height at least"),
        (lambda: dojo.Terrain(spacing=(0.0, 1.0)), r"Terrain\(spacing=...\): expected numbers > 0"),
        (lambda: dojo.Terrain.slope(1.6), "less than a right angle"),
        (lambda: dojo.Terrain.steps([0.1], depth=0.1, edge=0.2), "at most the depth"),
        (lambda: dojo.Terrain.from_function(waves, [0.0, 1.0, 3.0], [0.0]), "equally spaced"),
        (lambda: dojo.Contact("b", terrain=0.3), r"terrain=...\): expected a Terrain"),
        (lambda: dojo.Contact("b", terrain=WAVES, normal=(1, 0, 0)), "no normal of its own"),
        (lambda: dojo.Contact("b", restitution=1.5), "from 0 to 1"),
        (lambda: ball().with_terrain("hill"), r"Mechanism.with_terrain\(terrain\)"),
        (lambda: ball().with_terrain(WAVES, contacts=["foot"]), "'foot' is not one of: ball"),
    ],
)
def test_bad_terrain_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


# -- a step ------------------------------------------------------------------------------------------------------------


def test_an_inclined_plane_on_a_grid_is_the_half_space(rng):
    """The same motion of a ball that slides and rolls, and of a block that tumbles."""
    slope = dojo.Terrain.slope(0.3, (1.0, 0.5))
    grid = dojo.Terrain.from_function(slope.height, 2.0 * GRID, 2.0 * GRID)
    for mech in (ball(friction=0.2), block(0.3)):
        sims = [dojo.Simulator(mech.with_terrain(t), time_step=H, kappa=1e-8, tolerance=1e-10) for t in (slope, grid)]
        x = sims[0].neutral()
        x[2] += 0.02
        x[sims[0].nq :] = 0.3 * rng.normal(size=6)
        first, second = (run(sim, x, 40) for sim in sims)
        np.testing.assert_allclose(first, second, atol=1e-6)


@pytest.mark.sweep(13)
@pytest.mark.parametrize("kappa", [1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize("law", ["impact", "linear", "nonlinear"])
@pytest.mark.parametrize("height", [-0.01, 0.0, 0.3])
def test_derivatives_on_waves(law, height, kappa, rng):
    """Pressed, touching and flying; a ball with a radius not small against the waves, and points of a block."""
    for mech in (ball(radius=0.25, law=law), block(0.4, law=law)):
        sim = dojo.Simulator(mech.with_terrain(WAVES), time_step=H, kappa=kappa)
        x = sim.neutral()
        x[:2] = rng.uniform(-0.8, 0.8, 2)
        x[sim.nq :] = rng.normal(size=6)
        x[3:7] = sim.integrate(x, np.r_[np.zeros(3), rng.normal(size=3), np.zeros(6)])[3:7]
        contacts = sim.mechanism.contacts
        free = dojo.Simulator(dataclasses.replace(sim.mechanism, contacts=[]), time_step=H).step(x, np.zeros(sim.nu))
        x[2] += height - min(float(c.gap(place(sim, free.x, c))) for c in contacts)
        derivatives_of(sim.mechanism, x, kappa)


def place(sim, x, contact):
    """Centre of the ball of a contact."""
    z = sim.maximal(x)[sim.mechanism.body_names.index(contact.body)]
    w, r, p = z[6], z[7:10], np.asarray(contact.point)
    return z[:3] + p + 2.0 * np.cross(r, np.cross(r, p) + w * p)


def test_derivatives_of_a_chain_on_waves(rng):
    """Contacts of several bodies, far from the first of them, with a height of their own."""
    mech = chain("revolute", 2, gravity=(0.0, 0.0, -9.81), damper=0.1)
    contacts = [dojo.Contact(f"body{k}", (0.1, 0.05, -0.1), 0.08, height=-0.02 * k) for k in range(3)]
    mech = dataclasses.replace(mech, contacts=contacts).with_terrain(WAVES)
    x = dojo.Simulator(mech, time_step=H).neutral()
    x[0] = 0.4
    x[-8:] = 0.5 * rng.normal(size=8)
    result = derivatives_of(mech, x, 1e-3)
    assert np.abs(result.contacts.impulse).max() > 1e-3


def test_far_contacts_are_left_out_and_change_nothing():
    """High above the ground, and in a long fall onto it; against the same without the list of far contacts."""
    mech = ball(radius=0.1).with_terrain(WAVES)
    sim = dojo.Simulator(mech, time_step=H, kappa=1e-8, tolerance=1e-8)
    x = sim.neutral()
    x[2] += 1.0
    assert sim.inactive_contacts(x) == ("ball",)
    assert sim.inactive_contacts(sim.neutral()) == ()
    x[sim.nq : sim.nq + 3] = 1.0, 0.4, 0.0
    exact = dojo.Simulator(mech, time_step=H, kappa=1e-8, tolerance=1e-13)
    assert exact.inactive_contacts(x) == ()
    np.testing.assert_allclose(run(sim, x, 60), run(exact, x, 60), atol=1e-6)


# -- motions -----------------------------------------------------------------------------------------------------------


@pytest.mark.sweep(2)
@pytest.mark.parametrize("friction", [0.0, 0.1, 1.0])
def test_a_ball_on_an_incline(friction):
    """a = g (sin - mu cos) while it slides, 5/7 g sin once it rolls; every direction of the slope."""
    angle, steps = 0.4, 40
    limit = 2.0 / 7.0 * np.tan(angle)
    a = 9.81 * (5 / 7 * np.sin(angle) if friction > limit else np.sin(angle) - friction * np.cos(angle))
    for heading in np.linspace(0.0, 2.0 * np.pi, 5)[:-1] + 0.2:
        down = np.array([-np.cos(heading), -np.sin(heading)])
        slope = dojo.Terrain.slope(angle, -down)
        mech = ball(friction=friction).with_terrain(dojo.Terrain.from_function(slope.height, 2 * GRID, 2 * GRID))
        sim = dojo.Simulator(mech, time_step=H, kappa=1e-9, tolerance=1e-10)
        x = run(sim, sim.neutral(), steps)[-1]
        expected = a * H * steps * np.array([*(np.cos(angle) * down), -np.sin(angle)])
        np.testing.assert_allclose(x[sim.nq : sim.nq + 3], expected, atol=0.02 * a * H * steps)


def test_without_friction_energy_stays_in_a_bowl():
    """A block on its points slides through a bowl; its loss of energy is of first order in the time step."""
    bowl = dojo.Terrain.from_function(lambda X, Y: 0.2 * (X**2 + Y**2), GRID, GRID)
    mech = block(0.2, friction=0.0).with_terrain(bowl)
    drift = []
    for h in (0.004, 0.002, 0.001):
        sim = dojo.Simulator(mech, time_step=h, kappa=1e-9, tolerance=1e-10)
        x = sim.neutral()
        x[0] = 0.8
        x = sim.integrate(x, np.r_[np.zeros(4), -np.arctan(0.32), np.zeros(7)])
        x[2] -= min(float(c.gap(p) / c.normal_at(p)[2]) for c in mech.contacts for p in [place(sim, x, c)])
        rows = run(sim, x, round(1.0 / h))[round(0.3 / h) :]  # it has come to lie on its points
        drift.append(np.ptp(sim.energy(rows)))
    assert drift[-1] < 0.02
    assert order(drift).min() > 0.7, drift


@pytest.mark.parametrize("friction", [0.5, 1.0, 2.0])
def test_boxes_land_on_curved_ground(friction, rng):
    """Four corners hold a box in four directions, one of them hardly: landings with a negative determinant."""
    ground = dojo.Terrain.from_function(lambda X, Y: 0.3 * X + 0.1 * Y**2, GRID, GRID)
    box = dojo.Mechanism([dojo.Body("box", 1.0, shape=dojo.Box(0.3, 0.2, 0.1))], [dojo.Joint("floating", None, "box")])
    sim = dojo.Simulator(box.with_terrain(ground, bodies=["box"], friction=friction), time_step=H, kappa=1e-9)
    x = sim.neutral()
    for height in (0.0, *rng.uniform(0.1, 0.4, 10)):
        t = sim.rollout(x + np.r_[0.0, 0.0, height, np.zeros(10)], np.zeros((60, sim.nu)), throw=True)
        assert t.contacts.gap.min() > -1e-8
        assert (t.contacts.normal_force.max(axis=0) > 1.0).sum() >= 4
        x[7], x[11] = rng.uniform(-1.0, 1.0), rng.uniform(-3.0, 3.0)


@pytest.mark.parametrize(
    "terrain",
    [
        dojo.Terrain.slope(np.radians(10.0), (1.0, 0.5)),
        dojo.Terrain.from_function(dojo.Terrain.slope(np.radians(10.0), (1.0, 0.5)).height, GRID, GRID),
        dojo.Terrain.steps([0.06], start=0.0),
        dojo.Terrain.steps([0.05, -0.05], start=-0.02, depth=0.15, direction=(0.3, 1.0)),
    ],
    ids=["slope", "inclined grid", "step", "curb"],
)
def test_a_quadruped_stands(terrain):
    """Springs in its joints hold it; it neither creeps nor sinks in."""
    mech = dojo.models.quadruped(spring=200.0, damper=20.0, stance=(0.9, -1.425)).with_terrain(terrain)
    sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-9)
    t = sim.rollout(sim.neutral(), np.zeros((300, sim.nu)), throw=True)
    assert t.contacts.gap.min() > -1e-8
    z = sim.maximal(t.x)[:, mech.body_names.index("trunk"), :3]
    assert np.linalg.norm(z[-1] - z[200]) < 1e-4
    assert (t.contacts.normal_force[-1] > 1.0).sum() >= 3
    assert z[-1, 2] - terrain.height(*z[-1, :2]) > 0.2
