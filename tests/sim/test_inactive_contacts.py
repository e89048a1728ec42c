"""Far contacts: the same step as when everything is near, and only far contacts are omitted.

The reference is the same simulator at a tolerance so small that no contact is far: the rule looks at the tolerance.
"""

from __future__ import annotations

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
from naive import rotation as rot
from scipy.spatial import ConvexHull

import dojo_opt as dojo
from sim.model.record_columns import Inactive
from sim.simulator.omitted_contacts import reach
from support.jacobians import check_jacobian
from support.parameter_case import Case
from support.parameter_errors import error
from support.scenes import LAWS, ball, block, chain, gaps, pendulum

TOLERANCE = 1e-8
EXACT = 1e-13


def far(sim):
    """Number of contacts that the last step of this thread omitted from the interior-point problem."""
    return int(sim._engine.inactive().sum())


def pair(mech, time_step=0.02, kappa=1e-6):
    """The simulator, and the same with everything near."""
    sim = dojo.Simulator(mech, time_step=time_step, kappa=kappa, tolerance=TOLERANCE)
    return sim, sim.replace(tolerance=EXACT)


def compare(mech, x, u, kappa=1e-6, time_step=0.02, left_out=None):
    """Step and Jacobians of both; an error of the balance moves a body by at most its mobility, here below 1e3."""
    sim, exact = pair(mech, time_step, kappa)
    result, expected = sim.step(x, u), exact.step(x, u)
    assert expected.success and far(exact) == 0
    assert result.success, result.message
    sim.step(x, u)
    if left_out is not None:
        assert far(sim) == left_out
    np.testing.assert_allclose(result.x, expected.x, rtol=0, atol=1e3 * TOLERANCE)
    np.testing.assert_allclose(result.contacts.gap, expected.contacts.gap, rtol=0, atol=1e3 * TOLERANCE)
    np.testing.assert_allclose(result.contacts.impulse, expected.contacts.impulse, rtol=0, atol=1e3 * TOLERANCE)
    for mine, theirs in zip(sim.linearize(x, u), exact.linearize(x, u), strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=0, atol=1e-5 * max(1.0, np.abs(theirs).max(initial=0.0)))
    return result


def flying(mech, height):
    """A turned, turning block or ball with its centre at this height."""
    return np.r_[0.0, 0.0, height, rot.exp(np.array([0.4, -0.3, 0.2])), 1.0, -2.0, -1.5, 3.0, 1.0, -4.0]


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("kappa", "height"), [(1e-8, 2.0), (1e-6, 8.0), (1e-4, 60.0)])
def test_a_far_block_moves_as_if_all_its_corners_were_solved_for(law, kappa, height):
    compare(block(law=law), flying(None, height), np.zeros(0), kappa, left_out=8)


@pytest.mark.parametrize("friction", [0.0, 0.8])
def test_a_far_ball_feels_its_radius_and_a_slope(friction):
    mech = ball(radius=0.3, friction=friction)
    slope = dataclasses.replace(mech.contacts[0], normal=(0.3, -0.2, 0.9), height=-20.0)
    compare(dataclasses.replace(mech, contacts=[slope]), flying(None, 1.0), 0.1 * np.ones(6), left_out=1)


def test_contacts_of_one_body_are_far_while_those_of_another_are_near():
    mech = chain("revolute", 1, gravity=(0.0, 0.0, -9.81), spring=3.0, damper=0.2)
    contacts = [dojo.Contact(f"body{i}", (0.1, -0.05, -0.2), 0.05, name=f"{i}", height=-60.0 * i) for i in range(2)]
    mech = dataclasses.replace(mech, contacts=contacts)
    x = dojo.Simulator(mech).neutral()
    x[2] = 0.3
    compare(mech, x, np.zeros(1), left_out=1)


def test_at_a_large_kappa_a_contact_is_felt_from_a_distance():
    sim = dojo.Simulator(block(), time_step=0.02, kappa=1e-2)
    x = flying(None, 3.0)
    A, _ = sim.linearize(x)
    assert far(sim) == 0
    free, _ = sim.linearize(x, kappa=1e-10)
    assert far(sim) == 8
    assert np.abs(A - free).max() > 1e-5


@pytest.mark.parametrize("height", [4.0, 12.0])
def test_contacts_that_come_near_within_the_step_are_solved_for(height):
    """Shot at the ground with 2 km/s, far and at rest before: balance and contact law hold at the solution."""
    push = dojo.Input(body="ball", force=(0.0, 0.0, 1.0))
    mech = dataclasses.replace(ball(radius=0.1, friction=0.5), inputs=[push])
    h, kappa = 0.02, 1e-6
    sim = dojo.Simulator(mech, time_step=h, kappa=kappa)
    x = np.r_[0.0, 0.0, height, 1.0, np.zeros(9)]
    assert sim.step(x).success and far(sim) == 1
    result = sim.step(x, [-1e5])
    assert result.success and far(sim) == 0
    gap, impulse = result.contacts.gap[0], result.contacts.impulse[0, 2]
    np.testing.assert_allclose(gap * impulse, kappa, rtol=1e-2)
    np.testing.assert_allclose(result.x[9], h * (-9.81 - 1e5) + impulse, atol=2e3 * TOLERANCE)


def test_a_fall_from_far_to_near():
    """Impulses that stand from step to step, contacts that become near: the same path, and gaps as they are."""
    sim, exact = pair(block(friction=0.3), kappa=1e-8)
    x = sim.state_from_velocity(flying(None, 2.0)[:7], flying(None, 2.0)[7:])
    us = np.zeros((60, 0))
    counts = [far(sim) for t in range(0, 61, 5) if sim.rollout(x, us[: t + 1]).success]
    assert counts[0] == 8 and counts[-1] == 0
    path, expected = sim.rollout(x, us), exact.rollout(x, us)
    # the motion after an impact depends on the last digit
    flight = int(np.argmax(expected.contacts.gap.min(axis=1) < 1e-2))
    assert flight > 10
    np.testing.assert_allclose(path.x[:flight], expected.x[:flight], rtol=0, atol=1e-5)
    np.testing.assert_allclose(path.contacts.gap, [gaps(sim, x) for x in path.x[1:]], rtol=0, atol=1e-9)
    assert np.linalg.norm(path.x[-1, :3] - expected.x[-1, :3]) < 1e-3


def test_far_contacts_push_by_the_law_of_the_central_path():
    """In flight momentum changes by gravity and by kappa/gap of every corner, to the tolerance of every step."""
    kappa, steps = 1e-6, 50
    sim = dojo.Simulator(block(friction=0.0, gravity=np.zeros(3)), time_step=0.02, kappa=kappa)
    x = sim.state_from_velocity(flying(None, 40.0)[:7], flying(None, 40.0)[7:])
    path = sim.rollout(x, np.zeros((steps, 0)))
    assert far(sim) == 8
    push = kappa / path.contacts.gap
    np.testing.assert_allclose(path.contacts.impulse[..., 2], push, rtol=0, atol=TOLERANCE)
    linear = np.array([sim.momentum(state)[0] for state in path.x])
    np.testing.assert_allclose(np.diff(linear[:, 2]), push.sum(axis=1), rtol=0, atol=3 * TOLERANCE)
    assert push.sum() > 100 * TOLERANCE * steps / 50, "nothing to be seen"


def test_arms_of_far_impulses_turn_with_the_body():
    """Angular momentum changes by the moment of the impulses where they act, of contacts far to one side of a body."""
    kappa, steps = 1e-6, 40
    points = [(1.0, 0.1 * y, 0.1 * z) for y in range(5) for z in range(4)]
    contacts = [dojo.Contact("block", p, friction=0.2, height=-90.0, name=str(p)) for p in points]
    mech = dataclasses.replace(block(gravity=np.zeros(3)), contacts=contacts)
    sim = dojo.Simulator(mech, time_step=0.02, kappa=kappa, tolerance=TOLERANCE)
    turning = np.r_[np.zeros(3), 1.0, np.zeros(3)], np.r_[np.zeros(4), 1.0, 0.0]
    path = sim.rollout(sim.state_from_velocity(*turning), np.zeros((steps, 0)))
    assert far(sim) == len(points)
    assert sim._engine.last().inactive[0, Inactive.TURNED] == 1.0, "evaluated again instead"
    moment = np.cross(path.contacts.point, path.contacts.impulse).sum(axis=1)
    angular = np.array([sim.momentum(state)[1] for state in path.x])
    np.testing.assert_allclose(angular[-1] - angular[0], moment.sum(axis=0), rtol=0, atol=5.0 * TOLERANCE)
    assert np.abs((moment - moment[0]).sum(axis=0)).max() > 20.0 * TOLERANCE, "arms have not turned enough to be seen"


def test_every_contact_is_in_one_cluster(rng):
    """Balls of the clusters hold their contacts; bodies and directions do not mix."""
    mech = chain("spherical", 2)
    contacts = [
        dojo.Contact(f"body{i}", rng.normal(size=3), 0.1 * k, name=f"{i} {k} {n}", normal=n, height=-9.0)
        for i in range(3)
        for n in ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
        for k in range(1, 4)
    ]
    model = dojo.Simulator(dataclasses.replace(mech, contacts=contacts)).model
    starts = np.flatnonzero(model.cluster_end)
    assert starts.tolist() == [0, 3, 6, 9, 12, 15] and model.cluster_end[starts].tolist() == [3, 6, 9, 12, 15, 18]
    for first, last in pairwise([*starts, 18]):
        ball_of = model.cluster[first]
        reach = np.linalg.norm(model.contact_point[first:last] - ball_of[:3], axis=1) + model.contact_radius[first:last]
        assert reach.max() <= ball_of[3] + 1e-12
        arms = np.linalg.norm(model.contact_point[first:last], axis=1) + model.contact_radius[first:last]
        np.testing.assert_allclose(ball_of[4], arms.max())


def test_mobility_bounds_the_velocity_per_impulse(rng):
    """On any direction at any contact, with the body alone, which every joint only makes harder to move."""
    mech = dataclasses.replace(
        chain("floating", 0), contacts=[dojo.Contact("body0", p, 0.05, name=str(k)) for k, p in enumerate(np.eye(3))]
    )
    model = dojo.Simulator(mech).model
    J = np.linalg.inv(model.body_inertia[0].reshape(3, 3))
    largest = 0.0
    for p in model.contact_point:
        for n in rng.normal(size=(200, 3)):
            n /= np.linalg.norm(n)
            r = p - 0.05 * n
            for f in rng.normal(size=(20, 3)):
                t = np.cross(r, f / np.linalg.norm(f))
                largest = max(largest, 1.0 / model.body_mass[0] + t @ J @ t)
    assert largest <= model.cluster[0, 5] <= 4.0 * largest


def test_corners_of_a_body_that_touches_are_inactive_one_by_one(rng):
    """The law and the balance of momenta hold for all; derivatives take all as active, and are exact."""
    points = rng.normal(size=(24, 3))
    points *= 0.05 / np.linalg.norm(points, axis=1)[:, None]
    contacts = [dojo.Contact("body0", p, friction=0.6, name=str(k)) for k, p in enumerate(points)]
    mech = dataclasses.replace(chain("floating", 0, gravity=(0.0, 0.0, -9.81)), contacts=contacts)
    sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-8, tolerance=1e-11)
    x = sim.neutral()
    x[2], x[7:] = 1e-4 - points[:, 2].min(), 0.1
    result = sim.step(x, throw=True)
    active = int(sim._engine.last().active_ground_count[0])
    assert 0 < active < 12 and far(sim) == 0
    np.testing.assert_allclose(result.contacts.impulse[:, 2] * result.contacts.gap, 1e-8, rtol=1e-3)
    change = sim.momentum(result.x)[0] - sim.momentum(x)[0]
    weight = -9.81 * 0.01 * sum(body.mass for body in mech.bodies)
    np.testing.assert_allclose(change, result.contacts.impulse.sum(axis=0) + [0.0, 0.0, weight], atol=1e-9)
    across = rng.normal(size=(12, 2))
    A = sim.linearize(x).A @ across
    check_jacobian(
        lambda x: sim.difference(sim.step(x, throw=True).x, result.x), A, x, lambda x, s: sim.integrate(x, across @ s)
    )


def mesh(rng, radius=0.0, friction=0.6, law="nonlinear", count=96):
    """A ball of corners."""
    points = rng.normal(size=(count, 3))
    points *= 0.05 / np.linalg.norm(points, axis=1)[:, None]
    contacts = [
        dojo.Contact("body0", p, radius, friction=friction, law=law, name=f"c{k}") for k, p in enumerate(points)
    ]
    mech = chain("floating", 0, gravity=(0.0, 0.0, -9.81))
    return dataclasses.replace(mech, contacts=contacts), points


def moving(sim, points, gap=1e-4):
    """On the ground, turning and sliding."""
    x = sim.neutral()
    x[2], x[7:] = gap + 0.01 - points[:, 2].min(), [0.3, -0.2, -1.0, 1.0, 2.0, -1.5]
    return x


@pytest.mark.parametrize("friction", [0.0, 0.6])
@pytest.mark.parametrize("kappa", [1e-9, 1e-7])
def test_corners_of_a_mesh_move_as_if_all_were_solved_for(rng, kappa, friction):
    """Corners with a radius, even of a picometre, are no corners: all are active."""
    state = rng.bit_generator.state
    mech, points = mesh(rng, friction=friction)
    rng.bit_generator.state = state
    balls, _ = mesh(rng, 1e-12, friction)
    settings = dict(time_step=0.01, kappa=kappa, tolerance=1e-12)
    sim, exact = dojo.Simulator(mech, **settings), dojo.Simulator(balls, **settings)
    x = moving(sim, points)
    for _ in range(4):
        result, expected = sim.step(x, throw=True), exact.step(x, throw=True)
        active = [int(s._engine.last().active_ground_count[0]) for s in (sim, exact)]
        assert active[0] <= active[1] and active[0] < 48
        np.testing.assert_allclose(result.x, expected.x, rtol=0, atol=1e-9)
        for name, atol in (("gap", 1e-9), ("impulse", 1e-9), ("point", 1e-9), ("slip", 1e-7), ("normals", 0.0)):
            mine, theirs = (getattr(r.contacts, name) for r in (result, expected))
            np.testing.assert_allclose(mine, theirs, rtol=0, atol=atol, err_msg=name)
        A, B = sim.linearize(x).A, exact.linearize(x).A
        np.testing.assert_allclose(A, B, rtol=0, atol=1e-6 * np.abs(B).max())
        x = result.x


def test_derivatives_of_corners_are_those_of_the_step(rng):
    """By state, friction and places, among them those of inactive corners."""
    mech, points = mesh(rng, count=40)
    sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-6, tolerance=1e-12)
    x = moving(sim, points)
    result = sim.step(x, throw=True)
    inactive = np.setdiff1d(np.arange(40), sim._engine.last().active[: sim._engine.last().active_ground_count[0]])
    assert len(inactive) > 10 and result.contacts.impulse[inactive, 2].sum() > 1e-4
    across = rng.normal(size=(12, 3))
    A = sim.linearize(x).A @ across
    check_jacobian(
        lambda x: sim.difference(sim.step(x, throw=True).x, result.x), A, x, lambda x, s: sim.integrate(x, across @ s)
    )
    for kind in ("friction", "contact_point", "contact_height"):
        assert error(Case(sim, x, np.zeros(0)), kind) < 1e-6, kind


def test_names_and_distances_of_omitted_contacts():
    mech = dataclasses.replace(
        block(), contacts=[*block().contacts, dojo.Contact("block", height=-50.0, name="wall", normal=(1.0, 0.0, 0.0))]
    )
    sim = dojo.Simulator(mech, time_step=0.02)
    x = np.r_[0.0, 0.0, 0.3, 1.0, np.zeros(9)]
    assert sim.inactive_contacts(x) == ("wall",)
    assert dojo.Simulator(pendulum()).inactive_contacts(np.zeros(2)) == ()
    text = sim.describe()
    assert "inactive contacts" in text and "omitted from the solver beyond a gap of" in text
    assert "inactive contacts" not in dojo.Simulator(pendulum()).describe()


@pytest.mark.parametrize("kappa", [1e-9, 1e-6])
def test_reach_is_where_a_contact_at_rest_becomes_far(kappa):
    sim = dojo.Simulator(ball(gravity=np.zeros(3)), time_step=0.02, kappa=kappa)
    edge = reach(sim.model, 0.02, kappa, sim.tolerance)[0]
    for share, expected in ((0.99, 0), (1.01, 1)):
        assert len(sim.inactive_contacts(np.r_[0.0, 0.0, 0.1 + share * edge, 1.0, np.zeros(9)])) == expected


def test_corners_that_keep_their_height_are_inactive_however_fast_a_hull_slides() -> None:
    """A round hull slides without friction, 3 cm a step: of its 32 corners only those that press are active."""
    rng = np.random.default_rng(2)
    corners = rng.normal(size=(16, 3))
    corners *= 0.05 / np.linalg.norm(corners, axis=1)[:, None]
    corners = np.vstack([corners, -corners])
    faces = ConvexHull(corners).equations
    down = faces[faces[:, 3].argmax(), :3]
    body = dojo.Body("foot", 1.0, np.diag([1e-3] * 3), shape=dojo.Polytope(corners))
    mech = dojo.Mechanism(
        [body],
        [dojo.Joint("floating", None, "foot")],
        contacts=[dojo.Contact("foot", corner, friction=0.0) for corner in corners],
    )
    sim = dojo.Simulator(mech, time_step=0.01)
    x = sim.neutral()
    x[3:7] = [1.0 - down[2], *np.cross(down, [0.0, 0.0, -1.0])]
    x[3:7] /= np.linalg.norm(x[3:7])
    x[2] = -faces[:, 3].max()
    x, _ = dojo.equilibrium(sim, x)
    x[sim.nq] = 3.0
    t = sim.rollout(x, steps=5, throw=True)
    np.testing.assert_allclose(t.x[-1, 0], x[0] + 0.15, atol=1e-6)
    assert sim._engine.last().active_count[0] <= 5
