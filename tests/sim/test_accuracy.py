"""Steps of a given accuracy: requested against achieved, times of impacts, derivatives, durations, and refusals."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import dojo_opt as dojo
from dojo_opt import models
from sim.integrators.adaptive import _allows, _go_beyond
from sim.integrators.contact_events import _jumps, landed_error
from sim.integrators.slip_stop import friction_turn
from sim.integrators.substep_lengths import lengthen, lengthen_kink, note_miss, shorten, shorten_unsolved, stalls
from sim.integrators.substeps import Clock
from sim.mechanism.mobility import largest_mobility
from sim.model.record_columns import ContactRow, StepReport
from sim.simulator.engines.adaptive_engine import AdaptiveEngine
from support.linkage import plain_fourbar
from support.scenes import ball, block

Floats = NDArray[np.float64]
G = 9.81


def engine(sim: dojo.Simulator) -> AdaptiveEngine:
    """The engine of a simulator with an accuracy."""
    assert isinstance(sim._engine, AdaptiveEngine)
    return sim._engine


def placed(sim: dojo.Simulator, height: float, speed: float) -> Floats:
    """A free body at a height that moves along x."""
    x = sim.neutral()
    x[2], x[sim.nq] = height, speed
    return x


@pytest.mark.parametrize("accuracy", [1e-2, 1e-5, 1e-8])
@pytest.mark.parametrize("links", [1, 2])
def test_pendulums_have_the_accuracy_that_is_asked_for(links: int, accuracy: float) -> None:
    mech = models.npendulum(links)
    x = np.r_[np.full(links, 0.4), np.zeros(links)]
    exact = dojo.Simulator(mech, time_step=0.002, order=8).rollout(x, steps=1000, throw=True).x[-1]
    found = dojo.Simulator(mech, accuracy=accuracy).rollout(x, duration=2.0, throw=True)
    assert np.abs(found.x[-1] - exact)[:links].max() < 2.0 * accuracy
    assert found.time[-1] == 2.0
    assert found.parts[0] < 80


def test_a_chain_goes_on_and_keeps_its_energy() -> None:
    """Five undamped links, with which steps of 10 ms end."""
    sim = dojo.Simulator(models.npendulum(5), time_step=0.05, accuracy=1e-4)
    x = sim.rollout(np.r_[np.full(5, 1.5), np.zeros(5)], steps=100, throw=True).x
    energy = sim.energy(x)
    assert np.abs(energy - energy[0]).max() < 1e-2 * np.abs(energy[0])


@pytest.mark.parametrize("accuracy", [1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
def test_bounces_happen_at_their_times(accuracy: float) -> None:
    """Dropped from 1 m with restitution 0.8: rebound speeds are v, e v, e^2 v, at times that add up."""
    mech = ball(friction=0.0)
    mech = replace(mech, contacts=tuple(replace(c, restitution=0.8) for c in mech.contacts))
    sim = dojo.Simulator(mech, accuracy=accuracy)
    found = sim.rollout(placed(sim, 1.1, 0.0), duration=2.0, throw=True).x[-1]
    time, speed = np.sqrt(2.0 / G), 0.8 * np.sqrt(2.0 * G)
    while time + 2.0 * speed / G < 2.0:
        time, speed = time + 2.0 * speed / G, 0.8 * speed
    rest = 2.0 - time
    assert abs(found[2] - (0.1 + speed * rest - 0.5 * G * rest**2)) < 2.0 * accuracy


@pytest.mark.parametrize("accuracy", [1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
@pytest.mark.parametrize("steps", [1, 20])
def test_a_block_slides_as_far_as_it_should(accuracy: float, steps: int) -> None:
    sim = dojo.Simulator(block(friction=0.3), accuracy=accuracy)
    motion = sim.rollout(placed(sim, 0.25, 2.0), steps=steps, duration=1.0, throw=True)
    assert abs(motion.x[-1][0] - 2.0**2 / (2.0 * 0.3 * G)) < 3.0 * accuracy
    assert steps > 1 or motion.parts[0] < 10  # a step ends where it stops
    impulse = motion.contacts.impulse.sum(axis=(0, 1))
    assert impulse == pytest.approx([-2.0, 0.0, G], abs=0.1 + 0.25 * G / steps)


@pytest.mark.sweep(3)
@pytest.mark.parametrize("accuracy", [1e-2, 1e-3, 1e-4, 1e-5])
@pytest.mark.parametrize("steps", [1, 10])
def test_a_thrown_ball_lands_slides_and_rolls(accuracy: float, steps: int) -> None:
    """It falls .2 m at 3 m/s, loses mu w of its speed at the impact w, slides, and rolls from 5/7 of it on."""
    mu, seconds = 0.3, 0.8
    sim = dojo.Simulator(ball(friction=mu), accuracy=accuracy)
    fall, impact = np.sqrt(0.4 / G), np.sqrt(0.4 * G)
    speed, spin = 3.0 - mu * impact, 25.0 * mu * impact
    slide = (speed - 0.1 * spin) / (3.5 * mu * G)
    end = 3.0 * fall + speed * slide - 0.5 * mu * G * slide**2 + (speed - mu * G * slide) * (seconds - fall - slide)
    turned = spin * slide + 12.5 * mu * G * slide**2 + (spin + 25.0 * mu * G * slide) * (seconds - fall - slide)
    found = sim.rollout(placed(sim, 0.3, 3.0), steps=steps, duration=seconds, throw=True).x[-1]
    assert abs(found[0] - end) < 3.0 * seconds * accuracy
    assert abs(np.angle(np.exp(1j * (2.0 * np.arctan2(found[5], found[3]) - turned)))) < 3.0 * seconds * accuracy


@pytest.mark.parametrize("accuracy", [1e-2, 1e-3])
def test_a_hopper_lands_as_exactly_or_says_so(accuracy: float) -> None:
    """Against order 2 with steps of 20 us, exact to 3e-5: got at most three times asked, or times the estimated error."""
    mech, seconds = models.hopper(), 0.4
    q, v = np.array([0.0, 1.2, 0.1, 0.5, 0.9, 0.3]), 0.5 * np.random.default_rng(1).normal(size=6)
    fine = dojo.Simulator(mech, time_step=2e-5, kappa=1e-13)
    exact = fine.rollout(fine.state_from_velocity(q, v), steps=round(seconds / 2e-5), throw=True).x[-1]
    sim = dojo.Simulator(mech, accuracy=accuracy)
    found = sim.rollout(sim.state_from_velocity(q, v), duration=seconds, throw=True)
    assert np.abs(found.x[-1] - exact)[:6].max() < 3.0 * seconds * accuracy * max(1.0, found.errors[0])
    assert found.contacts.gap[-1].min() < 1e-6
    assert ("estimated error" in found.message) == (found.errors[0] > 1.0)


def test_a_foot_that_lands_gently_is_an_impact() -> None:
    """At .2 m/s in a step of 11 ms, it turned joints nine times as far off as asked, and nothing told it."""
    mech, ends, told = models.walker(), [], []
    q, v = np.array(mech.neutral), 0.5 * np.random.default_rng(3).normal(size=9)
    q[1] = 1.264
    for accuracy in (1e-2, 1e-4):
        sim = dojo.Simulator(mech, time_step=0.1, accuracy=accuracy)
        motion = sim.rollout(sim.state_from_velocity(q, v), steps=1, throw=True)
        ends.append(motion.x[-1][: sim.nq])
        told.append(motion.errors[0])
    assert np.abs(ends[0] - ends[1]).max() / (1e-2 * 0.1) < 1.5 * max(1.0, told[0])


def test_boxes_that_rest_have_no_impacts() -> None:
    """A stack told 80,000 times an accuracy of 1e-6 while its boxes settled."""
    assert _jumps(0.01, 1e-2, 0.01 * 0.2, 1e-3) and not _jumps(0.01, 1e-2, 0.01 * 0.2, 1e-5)
    assert not _jumps(1e-3, 1e-6, 1e-3 * 1e-3, 1e-5) and _jumps(1e-3, 1e-6, 1e-3 * 0.2, 0.0)
    assert landed_error(1e-2) == 5e-4 and landed_error(1e-6) == 2.5e-7


@pytest.mark.parametrize("accuracy", [1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
def test_a_light_link_leaves_its_limit_as_exactly(accuracy: float) -> None:
    """A flap of 1e-4 kg m^2 is stopped by its limit, and turned back by 1e-4 N m: the limit does not push it.

    At 1e-6 it does, with the least kappa, and `errors` tell so.
    """
    hinge = dojo.Joint("revolute", None, "flap", axis=(0.0, 1.0, 0.0), limits=(0.0, 1.0))
    flap = dojo.Mechanism([dojo.Body("flap", 1.0, (1e-4, 1e-4, 1e-4))], [hinge], gravity=(0.0, 0.0, 0.0))
    sim = dojo.Simulator(flap, accuracy=accuracy)
    found = sim.rollout(np.array([0.0, -0.5]), np.array([[1e-4]]), duration=0.5, throw=True)
    got = abs(found.x[-1][0] - 0.5 * 0.5**2) / 0.5
    assert got < 3.0 * accuracy * max(1.0, found.errors[0])
    assert got < 3.0 * accuracy or accuracy < 1e-5
    assert found.errors[0] > 1.0 or accuracy > 1e-5


def test_an_impact_that_throws_off_what_rests_has_the_error_that_it_has() -> None:
    """A stop of the elbow throws fingers off theirs, which the rest of that impact, in a long step, would press down."""
    coarse, fine = (dojo.Simulator(models.panda(), time_step=0.02, accuracy=accuracy) for accuracy in (1e-3, 1e-5))
    x = fine.rollout(fine.neutral(), steps=14, throw=True).x[-1]
    found, exact = (sim.rollout(x, steps=4, throw=True) for sim in (coarse, fine))
    stop = abs(found.x[:, 3] - coarse.mechanism.joints[3].limits[0][0]).min()
    assert stop < 1e-5 and np.abs(found.x[-1, 7:9] - [0.0, 0.04]).min() > 1e-3
    assert np.abs(found.x - exact.x)[:, : coarse.nq].max() < 1e-3 * 4 * 0.02
    assert found.errors.max() < 10.0


def test_an_impact_that_no_short_step_ends_has_the_error_that_it_has() -> None:
    """A hopper falls; behind one of its impacts steps as short as that one have no solution. Two accuracies agree."""
    mech, seconds = models.hopper(), 0.3
    q, v = np.array([0.0, 1.26, 0.0, 0.0, 0.0, 0.0]), 0.5 * np.random.default_rng(2).normal(size=6)
    coarse, fine = (dojo.Simulator(mech, accuracy=accuracy) for accuracy in (1e-4, 1e-5))
    found, exact = (sim.rollout(sim.state_from_velocity(q, v), duration=seconds, throw=True) for sim in (coarse, fine))
    assert np.abs(found.x[-1] - exact.x[-1])[:6].max() < 1e-4 * seconds
    assert found.errors[0] < 10.0
    assert exact.errors[0] < 100.0


@pytest.mark.parametrize("name", ["hopper", "walker", "quadruped", "panda", "atlas"])
def test_mobility_is_a_bound_and_near(name: str) -> None:
    """Of the diagonal of the inverse of the mass matrix, without translations of the base."""
    mech = getattr(models, name)()
    sim = dojo.Simulator(mech)
    inverse = np.diag(np.linalg.inv(dojo.Kinematics(sim).mass_matrix(sim.neutral()[: sim.nq])))
    bound = largest_mobility(mech)
    assert inverse.max() <= bound < 100.0 * inverse.max()


def test_mobility_is_a_bound_beside_bodies_without_mass(rng: np.random.Generator) -> None:
    """A rod and a ball on a hub without mass, whose joints turn them out of its axes."""
    bodies = [dojo.Body("hub", 0.0), dojo.Body("rod", 1.0, (1e-5, 1e-2, 1e-2)), dojo.Body("ball", 0.5, (0.1, 0.1, 0.1))]
    across = (0.5**0.5, 0.0, 0.5**0.5, 0.0)  # a quarter of a turn about y
    joints = [dojo.Joint("revolute", None, "hub", axis=(0, 0, 1), limits=(-3.0, 3.0))]
    for name, orientation in (("ball", (1.0, 0.0, 0.0, 0.0)), ("rod", across)):
        joints.append(dojo.Joint("revolute", "hub", name, axis=(0, 1, 0), orientation=orientation, limits=(-3.0, 3.0)))
    for order in ((0, 1, 2), (0, 2, 1)):
        mech = dojo.Mechanism(bodies, [joints[k] for k in order])
        kin = dojo.Kinematics(dojo.Simulator(mech, kappa=1e-6))
        inverses = [np.diag(np.linalg.inv(kin.mass_matrix(q))) for q in rng.uniform(-2.0, 2.0, (20, 3))]
        assert np.max(inverses) <= largest_mobility(mech)


def test_an_input_acts_at_second_order_in_contact() -> None:
    """A ball rolls under a force along x: its acceleration is F/(1.4 m)."""
    sim = dojo.Simulator(ball(), accuracy=1e-5)
    u = np.zeros(sim.nu)
    u[0] = 1.0
    found = sim.rollout(placed(sim, 0.1, 0.0), u[None], duration=0.4, throw=True).x[-1]
    assert abs(found[0] - 0.5 * 0.4**2 / 1.4) < 3.0 * 0.4 * 1e-5


def test_a_step_that_fails_names_its_worst_contact() -> None:
    """Alike by itself, in a motion, and in the derivatives of sub-steps that were solved with more iterations."""
    hasty, patient = (dojo.Simulator(models.hopper(), accuracy=1e-3, max_iterations=most) for most in (1, 50))
    x, held = hasty.neutral(), (np.zeros(hasty.nu), engine(hasty).no_wrenches)
    for found in (hasty.step(x), hasty.rollout(x, steps=1)):
        assert found.status == dojo.Status.MAX_ITERATIONS
        assert "Contact 'heel' is worst" in found.message
    path = engine(patient).take(x, *held)
    assert path.report[StepReport.WORST] == -1
    A, _, report = engine(hasty).slopes(path, held)
    assert report[StepReport.STATUS] == dojo.Status.MAX_ITERATIONS
    assert report[StepReport.WORST] >= 0
    assert np.isnan(A).all()


def replayed(sim: dojo.Simulator, x: Floats, u: Floats, parts: tuple[Floats, NDArray[np.int64]]) -> Floats:
    """The step in parts of given lengths and orders."""
    for h, order in zip(*parts, strict=True):
        x = engine(sim).part(x, (u, engine(sim).no_wrenches), h, int(order))
    return x


@pytest.mark.parametrize(("name", "height", "steps"), [("npendulum", 0.0, 0), ("hopper", 0.3, 0), ("hopper", 0.0, 3)])
def test_derivatives_keep_the_division(name: str, height: float, steps: int) -> None:
    rng = np.random.default_rng(3)
    sim = dojo.Simulator(
        (models.npendulum(2) if name == "npendulum" else models.hopper()), kappa=1e-5, tolerance=1e-12, accuracy=1e-3
    )
    x = sim.integrate(sim.neutral(), np.r_[np.zeros(sim.nv), 0.3 * rng.normal(size=sim.nv)])
    x[1] += height
    us = np.tile(rng.normal(size=sim.nu), (steps + 1, 1))
    x = sim.rollout(x, us[:-1], throw=True).x[-1] if steps else x
    path = engine(sim).take(x, us[0], engine(sim).no_wrenches)
    parts = path.lengths, path.orders
    np.testing.assert_allclose(replayed(sim, x, us[0], parts), path.x, rtol=0.0, atol=1e-9)
    A, B = sim.linearize(x, us[0], throw=True)
    for k in range(sim.ndx):
        dx = 3e-8 * np.eye(sim.ndx)[k]
        ahead, behind = (replayed(sim, sim.integrate(x, s * dx), us[0], parts) for s in (1.0, -1.0))
        assert np.abs(sim.difference(ahead, behind) / 6e-8 - A[:, k]).max() < 1e-6 * np.abs(A).max()
    for k in range(sim.nu):
        du = 1e-4 * np.eye(sim.nu)[k]
        ahead, behind = (replayed(sim, x, us[0] + s * du, parts) for s in (1.0, -1.0))
        assert np.abs(sim.difference(ahead, behind) / 2e-4 - B[:, k]).max() < 1e-6 * np.abs(B).max()


def in_equal_parts(sim: dojo.Simulator, second: dojo.Simulator, x: Floats, u: Floats) -> Floats:
    """The node after a step in ten equal ones of order 2, those of the second simulator."""
    held = u, engine(sim).no_wrenches
    mean = engine(sim)._mean(x, held, second.time_step)[1]
    end = second.rollout(mean, np.tile(u, (10, 1)), throw=True).x[-1]
    return engine(sim)._node(end, held, second.time_step)[1]


def test_planners_see_where_an_impact_leads() -> None:
    """Derivatives that hold the sub-steps of a landing are hundreds of times too steep for a change of a millimetre."""
    rng = np.random.default_rng(3)
    sim = dojo.Simulator(models.hopper(), time_step=0.05, kappa=1e-6, tolerance=1e-12, accuracy=1e-3)
    second = sim.replace(time_step=0.005, accuracy=None, kappa=1e-7, divide=False)
    x = sim.integrate(sim.neutral(), np.r_[np.zeros(sim.nv), 0.3 * rng.normal(size=sim.nv)])
    x[1], x[sim.nq + 1] = x[1] + 0.05, x[sim.nq + 1] - 2.0
    u = np.zeros(sim.nu)
    A, B, (x_next,), (report,) = engine(sim).linearize_plan(x[None], u[None], 1, sim.kappa)
    held, _ = sim.linearize(x, u, throw=True)
    assert np.array_equal(x_next, sim.step(x, u).x)
    assert report[StepReport.ACCURACY] < 1e-5
    off = []
    for k in range(1, sim.ndx, 3):
        dx = 2e-7 * np.eye(sim.ndx)[k]
        ahead, behind = (in_equal_parts(sim, second, sim.integrate(x, s * dx), u) for s in (1.0, -1.0))
        assert (
            np.abs(sim.difference(ahead, behind) / 4e-7 - A[0][:, k]).max()
            < report[StepReport.ACCURACY] * np.abs(A).max()
        )
        moved = sim.difference(sim.step(sim.integrate(x, 5e3 * dx), u).x, x_next)
        off.append([np.abs(moved - 5e3 * slopes @ dx).max() for slopes in (A[0], held)])
    for k in range(sim.nu):
        du = 1e-4 * np.eye(sim.nu)[k]
        ahead, behind = (in_equal_parts(sim, second, x, u + s * du) for s in (1.0, -1.0))
        off_by = np.abs(sim.difference(ahead, behind) / 2e-4 - B[0][:, k]).max()
        assert off_by < report[StepReport.ACCURACY] * np.abs(B).max()
    assert np.max(off, axis=0)[0] < 0.1 < 10.0 < np.max(off, axis=0)[1]


def test_orders_agree_on_dampers() -> None:
    """A falling hopper with dampers: substeps of order 2 approach order 8, four times closer at half the length."""
    sim = dojo.Simulator(models.hopper(), accuracy=1e-3)
    x = sim.state_from_velocity(np.r_[0.0, 6.0, 0.0, 0.3, 0.4, 0.2], 0.5 * np.random.default_rng(1).normal(size=sim.nv))
    count, ends = 8, []
    for order, n in ((8, count), (2, count), (2, 2 * count)):
        parts = np.full(n, 0.08 / n), np.full(n, order)
        ends.append(replayed(sim, x, np.zeros(sim.nu), parts))
    errors = [np.abs(end - ends[0]).max() for end in ends[1:]]
    assert errors[0] < 1e-3
    assert errors[1] < 0.3 * errors[0]


def test_substeps_in_contact_are_of_fourth_order() -> None:
    """A hopper that sways on its foot: at half the length a quarter of the error of order 2, extrapolated far less."""
    sim = dojo.Simulator(models.hopper(), accuracy=1e-3)
    x = sim.neutral()
    x[sim.nq :] = 0.0, 0.0, 0.9, 0.6, -1.2, 0.6
    x = sim.rollout(x, steps=2, duration=0.03, throw=True).x[-1]
    fine, *ends = (
        replayed(sim, x, np.zeros(sim.nu), (np.full(n, 0.016 / n), np.full(n, order)))
        for n, order in ((8, 4), (1, 2), (2, 2), (1, 4))
    )
    one, two, raised = (np.abs(end - fine)[: sim.nq].max() for end in ends)
    assert 3.0 < one / two < 5.0
    assert raised < 0.2 * two


def test_impulses_are_those_of_the_momentum() -> None:
    """Those of a sliding ball, of halves raised to order 4, add up to its change of momentum."""
    sim = dojo.Simulator(ball(), accuracy=1e-4)
    motion = sim.rollout(placed(sim, 0.1, 2.0), duration=0.1, throw=True)
    path = engine(sim).take(motion.x[0], np.zeros(sim.nu), engine(sim).no_wrenches)
    assert 4 in path.orders
    gained = motion.x[-1][sim.nq : sim.nq + 3] - motion.x[0][sim.nq : sim.nq + 3]
    impulse = motion.contacts.impulse.sum(axis=(0, 1)) + [0.0, 0.0, -0.1 * G]
    np.testing.assert_allclose(impulse, gained, rtol=0.0, atol=1e-8)


def test_impacts_that_get_no_more_exact_are_kept() -> None:
    """Errors of shorter and shorter steps with an impact: slight ones once they stay, large ones a second time."""

    def tried(*errors: float) -> int:
        clock = np.zeros(len(Clock))
        clock[Clock.HIT] = 1.0
        for k, error in enumerate(errors):
            if stalls(clock, error):
                return k
            note_miss(clock, error)
        return len(errors)

    assert tried(40.0, 0.09, 0.08) == 2
    assert tried(40.0, 0.7, 0.6, 0.5, 0.4) == 5  # a part of what is allowed: shorter ones may lose it
    assert tried(40.0, 41.0, 39.0) == 2
    assert tried(40.0, 41.0, 3.0, 2.9, 2.8) == 4


def test_lengths_end_where_the_order_would_fall() -> None:
    """A step of order 4 allows 8 times the error of order 2, as long as friction turns little."""
    clock = np.zeros(len(Clock))
    clock[Clock.CEILING], clock[Clock.SHORT_RATIO] = np.inf, 1.0
    clock[Clock.ORDER], clock[Clock.ROUGH] = 4.0, 0.8
    lengthen(clock, 1e-3, 0.1, 1e-6)
    assert clock[Clock.SHORT] == pytest.approx(0.95e-3 / 0.8)
    lengthen(clock, 1e-3, 1e-3, 1e-6)  # so exact that order 2 does
    assert clock[Clock.SHORT] > 2e-3
    clock[Clock.ORDER], clock[Clock.ROUGH] = 2.0, 2.0
    shorten(clock, 1e-3, 20.0, 1e-6)
    assert clock[Clock.SHORT] == pytest.approx(0.95e-3 / 2.0)


def test_friction_that_turns_is_seen() -> None:
    """Rows of both halves: friction over the normal impulse is compared where the contact slides."""
    parts = np.zeros((3, 1, 11))
    parts[:, 0, ContactRow.NORMAL + 2], parts[:, 0, ContactRow.SLIP] = 1.0, 0.5
    parts[0, 0, :3], parts[1, 0, :3] = (0.3, 0.0, 1.0), (0.6, 0.0, 2.0)
    assert friction_turn(parts, 1e-3) == 0.0
    parts[1, 0, 1] = 0.01
    assert friction_turn(parts, 1e-3) == pytest.approx(5.0)
    parts[:, 0, ContactRow.SLIP] = 0.0
    assert friction_turn(parts, 1e-3) == 0.0


def test_lengths_that_fail_are_not_tried_again_at_once() -> None:
    clock = np.zeros(len(Clock))
    clock[Clock.CEILING], clock[Clock.SHORT_RATIO] = np.inf, 1.0
    shorten_unsolved(clock, 0.1, 1e-6)
    assert clock[Clock.SHORT] == 0.025
    lengthen(clock, 0.025, 1e-6, 1e-6)
    assert clock[Clock.SHORT] == pytest.approx(0.0625)  # not five times as long
    shorten(clock, 0.01, 1.1, 1e-6)
    assert 0.005 < clock[Clock.SHORT] < 0.01
    shorten(clock, 0.01, 1.1, 1e-6)
    assert clock[Clock.SHORT] == 0.005
    tried = []
    for _ in range(5):  # contacts oscillate: the shortest length misses the accuracy
        lengthen_kink(clock, 1e-6, 2.0, 1e-6)
        tried.append(clock[Clock.SHORT])
    np.testing.assert_allclose(tried, [5e-6, 25e-6, 125e-6, 625e-6, 5e-6])
    clock[Clock.HIT] = 1.0
    lengthen(clock, 1e-6, 0.01, 1e-6)
    assert clock[Clock.SHORT] == 1e-6  # the next impact of a cascade may follow


GEARED = dojo.Mechanism(
    [dojo.Body("wheel", 1.0, (0.1, 0.2, 0.3)), dojo.Body("pendulum", 2.0, (0.05, 0.1, 0.1))],
    [
        dojo.Joint("revolute", None, "wheel", child_point=(0.3, 0.0, 0.0), axis=(0.0, 1.0, 0.0)),
        dojo.Joint("revolute", None, "pendulum", child_point=(0.0, 0.0, 0.2), axis=(0.0, 1.0, 0.0), damper=0.05),
    ],
    gears=[dojo.Gear("pendulum", "wheel", -2.0)],
)


@pytest.mark.parametrize("accuracy", [1e-3, 1e-4, 1e-5, 1e-6])
def test_damped_gears_have_the_accuracy_that_is_asked_for(accuracy: float) -> None:
    """The impulse of a gear is half in the velocity before a node, which dampers see."""

    def rate(_: float, y: Floats) -> list[float]:
        a, w = y
        inertia = 0.2 + 1.0 * 0.3**2 + 4.0 * (0.1 + 2.0 * 0.2**2)
        torque = -0.3 * G * np.cos(a) + 2.0 * 2.0 * 0.2 * G * np.sin(-2.0 * a) - 4.0 * 0.05 * w
        return [w, torque / inertia]

    exact = solve_ivp(rate, (0.0, 0.5), [0.0, 1.0], "DOP853", rtol=1e-11, atol=1e-12).y[0, -1]
    sim = dojo.Simulator(GEARED, accuracy=accuracy)
    t = sim.rollout(sim.state_from_velocity(np.zeros(2), [1.0, -2.0]), duration=0.5, throw=True)
    np.testing.assert_allclose(t.x[-1, :2], [exact, -2.0 * exact], rtol=0.0, atol=1.5 * accuracy)
    np.testing.assert_allclose(t.x[:, 1], -2.0 * t.x[:, 0], atol=1e-9)


def test_velocities_are_closed_along_gears() -> None:
    """Of a velocity across them the part along them is left, in the metric of the masses."""
    sim = dojo.Simulator(GEARED, accuracy=1e-3)
    masses, along = np.array([0.29, 0.18]), np.array([1.0, -2.0])
    v = np.array([0.7, 0.4])
    expected = along * (along @ (masses * v)) / (along @ (masses * along))
    for x in (sim.state_from_velocity(np.zeros(2), v), sim.close(np.r_[0.0, 0.0, v])):
        np.testing.assert_allclose(x[2:], expected, rtol=1e-4)


@pytest.mark.parametrize("name", ["gear", "four-bar"])
def test_extrapolated_steps_are_of_sixth_order(name: str) -> None:
    """Without dampers; with loops and gears closed where a step ends."""
    undamped = [replace(joint, damper=0.0) for joint in GEARED.joints]
    mech = replace(GEARED, joints=undamped) if name == "gear" else plain_fourbar()
    sim = dojo.Simulator(mech, time_step=0.1, tolerance=1e-13, accuracy=1e-3)
    rng = np.random.default_rng(5)
    x = sim.close(sim.integrate(sim.neutral(), 0.3 * rng.normal(size=sim.ndx)))
    u = rng.normal(size=sim.nu)
    ends = [replayed(sim, x, u, (np.full(n, 0.1 / n), np.full(n, 6))) for n in (2, 4, 16)]
    errors = [np.abs(sim.difference(end, ends[-1])).max() for end in ends[:-1]]
    assert errors[1] < errors[0] / 40.0
    for end in ends:
        assert np.abs(sim.difference(end, sim.close(end))).max() < 1e-13


@pytest.mark.parametrize("name", ["gear", "four-bar"])
def test_derivatives_through_gears_and_loops(name: str) -> None:
    """Against differences along motions that keep them closed, with the division kept."""
    rng = np.random.default_rng(5)
    mech = GEARED if name == "gear" else models.fourbar()
    sim = dojo.Simulator(mech, time_step=0.02, tolerance=1e-12, accuracy=1e-3)
    x = sim.close(sim.integrate(sim.neutral(), 0.3 * rng.normal(size=sim.ndx)))
    u, none = rng.normal(size=sim.nu), engine(sim).no_wrenches
    path = engine(sim).take(x, u, none)
    parts = path.lengths, path.orders
    assert 6 in path.orders
    np.testing.assert_allclose(replayed(sim, x, u, parts), path.x, rtol=0.0, atol=1e-9)
    A, B = sim.linearize(x, u, throw=True)
    for _ in range(3):
        around = [
            sim.close(sim.integrate(x, 3e-6 * s * dx)) for dx in rng.normal(size=(1, sim.ndx)) for s in (1.0, -1.0)
        ]
        ahead, behind = (replayed(sim, at, u, parts) for at in around)
        found, expected = A @ sim.difference(*around), sim.difference(ahead, behind)
        assert np.abs(found - expected).max() < 1e-6 * np.abs(expected).max()
    for k in range(sim.nu):
        du = 1e-3 * np.eye(sim.nu)[k]
        ahead, behind = (replayed(sim, x, u + s * du, parts) for s in (1.0, -1.0))
        assert np.abs(sim.difference(ahead, behind) / 2e-3 - B[:, k]).max() < 1e-6 * np.abs(B).max()


@pytest.fixture(scope="module")
def swing() -> tuple[dojo.Simulator, dojo.Trajectory]:
    """A double pendulum under two inputs."""
    sim = dojo.Simulator(models.npendulum(2), time_step=0.05, accuracy=1e-6)
    return sim, sim.rollout(np.r_[0.4, 0.3, 0.0, 0.0], 0.1 * np.ones((10, sim.nu)), throw=True)


def test_sweeps_closed_loops_and_batches_follow(swing: tuple[dojo.Simulator, dojo.Trajectory]) -> None:
    sim, motion = swing
    xs, linear = sim.linearize_rollout(motion.x[0], motion.u, throw=True)
    assert np.array_equal(xs, motion.x)
    loss = np.random.default_rng(1).normal(size=(len(xs), sim.ndx))
    gradient, costate = sim.vjp(motion, loss, throw=True), loss[-1]
    for t in range(len(motion.u) - 1, -1, -1):
        assert np.allclose(gradient["input"][t], linear.B[t].T @ costate)
        costate = linear.A[t].T @ costate + loss[t]
    assert np.allclose(gradient["state"], costate)
    assert np.array_equal(sim.rollout_feedback(motion.x[0], motion.u, throw=True).x, motion.x)
    assert np.array_equal(sim.rollout_batch(motion.x[:1], motion.u[None], throw=True).x[0], motion.x)
    assert np.array_equal(pickle.loads(pickle.dumps(sim)).rollout(motion.x[0], motion.u).x, motion.x)


def test_states_at_any_time_agree_with_the_motion(swing: tuple[dojo.Simulator, dojo.Trajectory]) -> None:
    sim, motion = swing
    times = np.array([0.0, 0.013, 0.05, 0.111, 0.5])
    fine = sim.replace(time_step=0.001, accuracy=1e-9).rollout(motion.x[0], np.repeat(motion.u, 50, axis=0))
    assert np.abs(motion.at(times) - fine.x[[0, 13, 50, 111, 500]])[:, :2].max() < 1e-6
    assert np.array_equal(motion.at([0.05, 0.5]), motion.x[[1, 10]])
    with pytest.raises(ValueError, match="times from 0 to 0.5 s"):
        motion.at([0.6])
    spun = sim.neutral()
    spun[sim.nq :] = 1e200
    ended = sim.rollout(spun, steps=2)
    assert ended.solved_steps == 0 and not ended.success and ended.message
    assert np.array_equal(ended.at([0.0])[0], spun)
    with pytest.raises(ValueError, match=r"use replace\(accuracy=None\)"):
        sim.maximal_jacobian(sim.neutral())


def test_contacts_of_a_flight_are_where_the_body_is() -> None:
    """Those that carried nothing in the step, as with a fixed one."""
    mech = models.block()
    fixed, sim = dojo.Simulator(mech, time_step=0.02), dojo.Simulator(mech, time_step=0.02, accuracy=1e-3)
    x = sim.neutral()
    x[0], x[2] = 3.0, 5.0
    assert np.allclose(sim.step(x).contacts.point, fixed.step(x).contacts.point, atol=1e-2)


def test_impossible_accuracies_are_refused() -> None:
    mech = models.npendulum(2)
    for settings, match in (({"accuracy": 0.0}, "accuracy"), ({"accuracy": 1e-20}, "at least")):
        with pytest.raises(ValueError, match=match):
            dojo.Simulator(mech, **settings)
    with pytest.raises(ValueError, match="chooses the order"):
        dojo.Simulator(mech, order=4, accuracy=1e-3)
    rough = replace(mech, joints=[replace(j, friction=0.1) for j in mech.joints])
    with pytest.raises(ValueError, match="dry friction of"):
        dojo.Simulator(rough, accuracy=1e-3)
    with pytest.raises(ValueError, match="expected a simulator with an accuracy"):
        dojo.Simulator(mech).rollout(np.zeros(4), duration=1.0)
    assert dojo.Simulator(mech, accuracy=1e-3).replace(accuracy=None).order == 2
    assert repr(dojo.Simulator(mech, accuracy=1e-3)).endswith("divide=True, accuracy=0.001)")


def test_contacts_refuse_an_accuracy_that_they_do_not_have() -> None:
    for mech in (ball(), models.hopper(), models.fourbar(), GEARED):
        with pytest.raises(ValueError, match="expected at least 1e-06 with contacts, collisions, limits of joints"):
            dojo.Simulator(mech, accuracy=1e-7)
    dojo.Simulator(models.npendulum(2), accuracy=1e-7)


def test_estimated_errors_are_told() -> None:
    """In flight each step meets the allowed error; where contacts cannot meet it, the message says so."""
    pendulum = dojo.Simulator(models.npendulum(2), time_step=0.1, accuracy=1e-5)
    swing = pendulum.rollout(np.array([1.0, 0.5, 0.0, 0.0]), steps=10, throw=True)
    assert np.all(swing.errors > 0.0) and swing.errors.max() <= 1.0
    assert "estimated error" not in swing.message
    soft = dojo.Simulator(block(friction=0.3), time_step=0.05, accuracy=1e-6, kappa=1e-4)
    slide = soft.rollout(placed(soft, 0.25, 2.0), steps=10)
    worst = int(np.argmax(slide.errors))
    assert slide.success and slide.errors[worst] > 1.0
    assert slide.message.startswith(f"Solved, but the estimated error of step {worst} is ")
    assert soft.step(slide.x[worst], np.zeros(soft.nu)).error == pytest.approx(slide.errors[worst])


def test_steps_whose_lengths_all_miss_the_accuracy_take_any_error() -> None:
    """Where rounding refuses the shortest step of a hard impact, longer ones are tried, in the end with any error."""
    clock, rest, shortest = np.zeros(len(Clock)), 0.5, 1e-7
    missed = (1e-5, shortest, 1e9)  # length, shortest length, error over the one allowed
    clock[Clock.BEYOND] = shortest
    assert not _allows(clock, *missed)
    assert _go_beyond(clock, 0.1, rest, shortest, dojo.Status.SOLVED) == dojo.Status.SOLVED
    assert not _allows(clock, *missed)
    assert _go_beyond(clock, rest, rest, shortest, dojo.Status.SOLVED) == dojo.Status.SOLVED
    assert clock[Clock.BEYOND] == pytest.approx(3.0 * shortest)
    assert _allows(clock, *missed)
    assert _go_beyond(clock, rest, rest, shortest, dojo.Status.SOLVED) == dojo.Status.ACCURACY_NOT_REACHED
    assert _go_beyond(clock, rest, rest, shortest, dojo.Status.NO_PROGRESS) == dojo.Status.NO_PROGRESS
