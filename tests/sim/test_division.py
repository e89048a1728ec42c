"""Division of steps: a step that cannot be solved as a whole is solved in parts, and all results follow."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import dojo_opt as dojo
from dojo_opt import models
from sim.model.record_columns import StepReport
from sim.simulator.engines.dividing_engine import LARGEST_DIVISION, DividingEngine
from sim.simulator.engines.engine import Engine
from support.scenes import KINDS, chain, random_state

Floats = NDArray[np.float64]


def links(count: int, length: float = 2.0, mass: float = 2.0) -> dojo.Mechanism:
    """An undamped chain of rods, hanging from the world."""
    size, m = length / count, mass / count
    inertia = m / 12.0 * size * size
    bodies = [dojo.Body(f"rod{k}", m, (inertia, inertia, 1e-2 * inertia)) for k in range(count)]
    joints = [
        dojo.Joint(
            "revolute",
            f"rod{k - 1}" if k else None,
            f"rod{k}",
            parent_point=(0.0, 0.0, -0.5 * size if k else 0.0),
            child_point=(0.0, 0.0, 0.5 * size),
            axis=(0.0, -1.0, 0.0),
        )
        for k in range(count)
    ]
    return dojo.Mechanism(bodies, joints)


def engine(sim: dojo.Simulator) -> DividingEngine:
    """The engine of a simulator that divides steps."""
    assert isinstance(sim._engine, DividingEngine)
    return sim._engine


def forced(sim: dojo.Simulator, x: Floats, u: Floats, parts: int) -> Floats:
    """The state after a step in this number of parts."""
    found = engine(sim).in_parts(parts, x, (u, engine(sim).no_wrenches))
    assert found is not None and found.share == 1.0
    return np.asarray(found.x)


def moving(name: str, time_step: float, steps: int = 0) -> tuple[dojo.Simulator, Floats, Floats]:
    """A simulator, a random state or a state reached from it, and a random input."""
    rng = np.random.default_rng(3)
    sim = dojo.Simulator(getattr(models, name)(), time_step=time_step, kappa=1e-4, tolerance=1e-12)
    x = sim.integrate(sim.neutral(), np.r_[0.05 * rng.normal(size=sim.nv), 0.5 * rng.normal(size=sim.nv)])
    if steps:
        x = sim.rollout(x, steps=steps, throw=True).x[-1]
    return sim, x, rng.normal(size=sim.nu)


@pytest.fixture(scope="module")
def whip() -> tuple[dojo.Simulator, Floats]:
    """Three links, a step before they turn against each other too far for a step of 10 ms."""
    rng = np.random.default_rng(4)
    sim = dojo.Simulator(links(3), time_step=0.01, tolerance=1e-12)
    x = np.r_[rng.uniform(-3.0, 3.0, 3), 20.0 * rng.normal(size=3)]
    motion = sim.replace(divide=False).rollout(x, steps=100)
    assert not motion.success
    return sim, motion.x[-2]


def test_a_refused_step_is_divided(whip: tuple[dojo.Simulator, Floats]) -> None:
    sim, x = whip
    assert sim.replace(divide=False).rollout(x, steps=20).solved_steps == 1
    motion = sim.rollout(x, steps=20, throw=True)
    assert motion.parts[0] == 1 < motion.parts[1]
    assert sim.step(motion.x[1]).parts == motion.parts[1]
    assert np.array_equal(motion.x, sim.rollout(x, steps=20).x)  # a division is deterministic


def test_a_motion_without_division_agrees_with_a_simulator_that_refuses() -> None:
    sim, x, _ = moving("quadruped", 0.01)
    motion = sim.rollout(x, steps=40, throw=True)
    assert motion.parts.max() == 1
    assert np.array_equal(motion.x, sim.replace(divide=False).rollout(x, steps=40).x)


@pytest.mark.parametrize("parts", [2, 16])
def test_parts_of_a_fall_are_the_fall(parts: int) -> None:
    """Without rotation, steps of any length have the same nodes: momentum is handed on at both ends."""
    sim = dojo.Simulator(models.sphere(), time_step=0.05, tolerance=1e-13)
    x = sim.neutral()
    x[2], x[sim.nq : sim.nq + 3] = 20.0, (1.0, -2.0, 3.0)
    u = np.zeros(sim.nu)
    assert np.allclose(forced(sim, x, u, parts), sim.step(x, u, throw=True).x, rtol=0.0, atol=1e-10)


def test_momentum_is_handed_on_exactly() -> None:
    rng = np.random.default_rng(0)
    mech = dojo.Mechanism(
        [dojo.Body("a", 1.0, (0.1, 0.2, 0.3)), dojo.Body("b", 0.5, (0.02, 0.03, 0.04))],
        [dojo.Joint("floating", None, "a"), dojo.Joint("spherical", "a", "b", parent_point=(0.3, 0, 0))],
        gravity=(0.0, 0.0, 0.0),
    )
    sim = dojo.Simulator(mech, time_step=0.1, tolerance=1e-13)
    x = sim.integrate(sim.neutral(), np.r_[np.zeros(sim.nv), 4.0 * rng.normal(size=sim.nv)])
    before = np.concatenate(sim.momentum(x))
    for parts in (2, 4, 32):
        after = np.concatenate(sim.momentum(forced(sim, x, np.zeros(sim.nu), parts)))
        assert np.abs(after - before).max() < 1e-11 * np.abs(before).max()


@pytest.mark.parametrize(("name", "steps"), [("quadruped", 0), ("quadruped", 60), ("hopper", 60), ("fourbar", 3)])
def test_derivatives_of_a_divided_step(name: str, steps: int) -> None:
    """Products of the derivatives of parts and conversions, against central differences that keep the division."""
    sim, x, u = moving(name, 0.01, steps)
    if name == "fourbar":
        x = sim.state_from_velocity(sim.neutral()[: sim.nq], np.ones(sim.nv))
    found = engine(sim).in_parts(4, x, (u, engine(sim).no_wrenches), derivatives=True)
    assert found is not None
    A, B = engine(sim).slopes(x, found)
    eps = 2e-7
    for k in range(sim.ndx):
        dx = eps * np.eye(sim.ndx)[k]
        ahead, behind = (forced(sim, sim.integrate(x, s * dx), u, 4) for s in (1.0, -1.0))
        assert np.abs(sim.difference(ahead, behind) / (2 * eps) - A[:, k]).max() < 1e-6 * np.abs(A).max()
    for k in range(sim.nu):
        du = 1e-3 * np.eye(sim.nu)[k]
        ahead, behind = (forced(sim, x, u + s * du, 4) for s in (1.0, -1.0))
        assert np.abs(sim.difference(ahead, behind) / 2e-3 - B[:, k]).max() < 1e-5 * np.abs(B).max()


@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_of_the_conversions(kind: str) -> None:
    """Of the state with the same momentum over another interval, with springs and dampers, by central differences.

    The energy of both states is the same: half the impulse of a damper, of either interval, is part of the momentum.
    """
    rng = np.random.default_rng(8)
    sim = dojo.Simulator(chain(kind, 2, spring=3.0, damper=2.0), time_step=0.03, tolerance=1e-12)
    x, change = random_state(sim, rng, speed=2.0), engine(sim).intervals
    part = change.to_part(x, 0.01)
    assert part is not None and np.abs(part - x).max() > 1e-4
    short = engine(sim).part(3)
    assert short.states.energies(part[None])[0] == pytest.approx(engine(sim).states.energies(x[None])[0], rel=1e-10)
    slopes, eps = change.slopes(x, 0.01, part), 1e-5
    for k in range(sim.ndx):
        ends = [change.to_part(sim.integrate(x, s * eps * np.eye(sim.ndx)[k]), 0.01) for s in (1.0, -1.0)]
        assert ends[0] is not None and ends[1] is not None
        assert np.abs(sim.difference(*ends) / (2 * eps) - slopes[:, k]).max() < 1e-6 * np.abs(slopes).max()


@pytest.fixture(scope="module")
def divided(whip: tuple[dojo.Simulator, Floats]) -> tuple[dojo.Simulator, dojo.Trajectory]:
    """A motion in which one step is divided, and its end is exact."""
    sim, x = whip
    motion = sim.rollout(x, 1e-3 * np.ones((3, sim.nu)), throw=True)
    assert motion.parts.max() > 1
    return sim, motion


NAMES = ("mass", "inertia", "com", "parent_point", "time_step")


@pytest.mark.slow
def test_derivatives_by_parameters(divided: tuple[dojo.Simulator, dojo.Trajectory]) -> None:
    sim, motion = divided
    t = int(motion.parts.argmax())
    x, u = motion.x[t], motion.u[t]
    table = sim.linearize(x, u, wrt=NAMES)
    for name in NAMES:
        values = sim.parameters([name]).values
        for j, value in enumerate(values):
            eps = 1e-5 * max(abs(value), 1e-1)
            ends = []
            for sign in (1.0, -1.0):
                changed = values.copy()
                changed[j] += sign * eps
                ends.append(sim.with_parameters({name: changed}).step(x, u, throw=True))
            assert ends[0].parts == ends[1].parts == motion.parts[t]
            difference = sim.difference(ends[0].x, ends[1].x) / (2.0 * eps)
            assert np.abs(table[name][:, j] - difference).max() < 1e-6 * max(1.0, np.abs(table[name]).max()), name


def test_sweep_and_products_agree(divided: tuple[dojo.Simulator, dojo.Trajectory]) -> None:
    sim, motion = divided
    xs, linear = sim.linearize_rollout(motion.x[0], motion.u, wrt=["mass"], throw=True)
    assert np.allclose(xs, motion.x, rtol=0.0, atol=1e-9)
    loss = np.random.default_rng(1).normal(size=(len(xs), sim.ndx))
    gradient = sim.vjp(motion, loss, wrt=("state", "input", "mass"), throw=True)
    costate, mass = loss[-1], np.zeros(sim.nbody)
    for t in range(len(motion.u) - 1, -1, -1):
        mass = mass + linear.parameters["mass"][t].T @ costate
        assert np.allclose(gradient["input"][t], linear.B[t].T @ costate, rtol=1e-7)
        costate = linear.A[t].T @ costate + loss[t]
    assert np.allclose(gradient["state"], costate, rtol=1e-7)
    assert np.allclose(gradient["mass"], mass, rtol=1e-7)
    knots = sim.linearize_trajectory(motion.x, motion.u, throw=True)
    assert np.allclose(knots.A, linear.A, rtol=1e-6, atol=1e-6 * np.abs(linear.A).max())


def test_a_gradient_is_that_of_the_division_of_the_motion(divided: tuple[dojo.Simulator, dojo.Trajectory]) -> None:
    """A step that was divided, as rollouts do where their warm start fails, and can be solved as a whole."""
    sim, motion = divided
    t = int(np.flatnonzero(motion.parts == 1)[0])
    x, u, eps = motion.x[t], motion.u[t], 1e-7
    path, loss = np.stack([x, forced(sim, x, u, 4)]), np.random.default_rng(2).normal(size=(2, sim.ndx))
    assert np.abs(path[1] - motion.x[t + 1]).max() > 1e-3
    found = sim.vjp((path, u[None]), loss, throw=True)
    for k, dx in enumerate(eps * np.eye(sim.ndx)):
        ahead, behind = (forced(sim, sim.integrate(x, s * dx), u, 4) for s in (1.0, -1.0))
        expected = loss[0, k] + loss[1] @ sim.difference(ahead, behind) / (2.0 * eps)
        assert found["state"][k] == pytest.approx(expected, rel=1e-5, abs=1e-5 * np.abs(loss).max())
    path[1, -1] += 1e-2
    assert sim.vjp((path, u[None]), loss).status == dojo.Status.OTHER_SOLUTION


def test_batches_and_closed_loops_divide(divided: tuple[dojo.Simulator, dojo.Trajectory]) -> None:
    sim, motion = divided
    x0, us = motion.x[0], motion.u
    batch = sim.rollout_batch(np.tile(x0, (3, 1)), np.tile(us, (3, 1, 1)), throw=True)
    assert np.allclose(batch.x, motion.x, rtol=0.0, atol=1e-9)
    shot = sim.rollout_feedback(x0, us, throw=True)
    assert np.allclose(shot.x, motion.x, rtol=0.0, atol=1e-9)
    held = sim.rollout_feedback(x0, us[:1], substeps=3, throw=True)
    assert np.allclose(held.x[-1], sim.rollout(x0, np.tile(us[:1], (3, 1))).x[-1], rtol=0.0, atol=1e-9)


def test_reactions_of_a_divided_step_are_means(divided: tuple[dojo.Simulator, dojo.Trajectory]) -> None:
    """The force of the world on the first link and gravity change the momentum of all links, over the parts."""
    sim, motion = divided
    t = int(motion.parts.argmax())
    force = sim.reactions(motion.x[t], motion.u[t], throw=True).force[0]
    parts = engine(sim).divide(motion.x[t], motion.u[t], engine(sim).no_wrenches)
    assert parts is not None and parts.parts == motion.parts[t]
    momentum = parts.engine.states.momenta(parts.rolled.xs)[:, :3]
    weight = 2.0 * np.asarray(sim.mechanism.gravity)
    assert np.allclose(momentum[-1] - momentum[0], sim.time_step * (force + weight), rtol=0.0, atol=1e-9)


def test_contact_impulses_add_up() -> None:
    """A ball that rests on the ground is carried by its weight times the time, in parts as well."""
    sim = dojo.Simulator(models.sphere(), time_step=0.02)
    x = sim.rollout(sim.neutral(), steps=200, throw=True).x[-1]
    e = engine(sim)
    first = e.in_parts(8, x, (np.zeros(sim.nu), e.no_wrenches))
    assert first is not None
    second = e.in_parts(8, first.x, (np.zeros(sim.nu), e.no_wrenches))
    assert second is not None
    mass = sum(b.mass for b in sim.mechanism.bodies)
    assert second.contacts()[0, 2] == pytest.approx(mass * 9.81 * sim.time_step, rel=1e-6)


@pytest.mark.parametrize("rate", [500.0, 3000.0])
def test_bodies_spin_as_fast_as_they_like(rate: float) -> None:
    mech = dojo.Mechanism(
        [dojo.Body("b", 1.0, (0.1, 0.2, 0.3))], [dojo.Joint("floating", None, "b")], gravity=(0, 0, 0)
    )
    sim = dojo.Simulator(mech, time_step=0.01, tolerance=1e-13)
    x = sim.state_from_velocity(sim.neutral()[:7], np.array([0.0, 0.0, 0.0, 0.1, 0.2, rate]))
    motion = sim.rollout(x, steps=50, throw=True)
    momentum = np.asarray([np.concatenate(sim.momentum(row)) for row in motion.x])
    assert np.abs(momentum - momentum[0]).max() < 1e-10 * np.abs(momentum[0]).max()
    assert np.abs(sim.energy(motion.x) / sim.energy(x) - 1.0).max() < 1e-4
    assert sim.velocity(motion.x[-1])[5] == pytest.approx(rate, rel=1e-6)


def test_links_that_spin_fast_have_more_parts_than_others() -> None:
    """Joints that turn by 800 rad per step, within a fraction of a radian in each of the parts."""
    sim = dojo.Simulator(links(2), time_step=0.01)
    x = sim.state_from_velocity(np.array([0.3, 0.2]), np.array([80000.0, -40000.0]))
    motion = sim.rollout(x, steps=2, throw=True)
    assert motion.parts.min() > LARGEST_DIVISION
    assert np.abs(sim.energy(motion.x) / sim.energy(x) - 1.0).max() < 1e-3
    assert not sim.linearize(x, np.zeros(sim.nu)).success  # derivatives have no more parts than before


def test_a_whip_in_flight_keeps_the_momentum_of_everything() -> None:
    """Where no state has the momentum of every link, the nearest one has that of all; energy is lost, as in an impact."""
    rods = links(3)
    root = dojo.Joint("floating", None, "rod0")
    mech = dojo.Mechanism(rods.bodies, [root, *rods.joints[1:]], gravity=(0.0, 0.0, 0.0))
    sim, rng = dojo.Simulator(mech, time_step=0.05, tolerance=1e-13), np.random.default_rng(55)
    v = rng.normal(size=8) * np.array([1.0, 1.0, 1.0, 5.0, 15.0, 5.0, 20.0, 20.0])
    q = np.r_[sim.neutral()[:7], rng.uniform(-2.0, 2.0, 2)]
    x = sim.state_from_velocity(q, v)
    e = engine(sim)
    assert not any(e.in_parts(2**k, x, (np.zeros(sim.nu), e.no_wrenches)) for k in range(1, 11))
    ended = sim.step(x, throw=True)
    assert 0.1 < ended.momentum_fraction < 1.0
    before, after = (np.concatenate(sim.momentum(state)) for state in (x, ended.x))
    assert np.abs(after - before).max() < 1e-12 * np.abs(before).max()
    assert sim.energy(ended.x) < (1.0 + 1e-3) * sim.energy(x)


@pytest.mark.parametrize("order", [4])
def test_higher_orders_divide_their_steps_of_order_two(order: int) -> None:
    """A hard landing in one step that order 2 refuses as a whole."""
    sim = dojo.Simulator(models.quadruped(), time_step=0.02, order=order)
    rng = np.random.default_rng(5)
    x = sim.integrate(sim.neutral(), np.r_[np.zeros(sim.nv), 3.0 * rng.normal(size=sim.nv)])
    motion = sim.rollout(x, steps=40)
    assert motion.success, motion.message


@pytest.mark.parametrize("order", [2, 4])
def test_every_order_tells_how_its_steps_are_divided(order: int) -> None:
    """A block that spins on the ground too fast for whole steps."""
    sim = dojo.Simulator(models.block(), time_step=0.02, order=order)
    x = sim.neutral()
    x[-3:] = (0.0, 0.0, 200.0)
    motion = sim.rollout(x, steps=3)
    assert motion.success and motion.parts.min() > 1, (motion.message, motion.parts)
    linear = sim.linearize_rollout(x, np.zeros((3, sim.nu)))[1]
    assert linear.success and np.all(np.asarray(linear.accuracy) > 0.0)


def test_steps_that_division_cannot_solve_keep_their_reason() -> None:
    sim = dojo.Simulator(models.quadruped(), time_step=0.01, max_iterations=1)
    result = sim.step(sim.neutral())
    assert result.status == dojo.Status.MAX_ITERATIONS
    assert result.parts == 1
    with pytest.raises(TypeError, match="divide"):
        dojo.Simulator(models.quadruped(), divide=3)  # type: ignore[arg-type]


def test_a_step_that_loses_momentum_has_no_derivatives_of_another_division(
    whip: tuple[dojo.Simulator, Floats], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the fewest parts end without a state of their momentum, more parts may have one: that is another step."""
    sim, x = whip
    before = sim.rollout(x, steps=20)
    knot = int(np.flatnonzero(before.parts > 1)[0])
    x = before.x[knot]
    parts, plant = before.parts[knot], dojo.Plant(sim, x)
    real = engine(sim).intervals.from_part
    fewest = sim.time_step / parts
    for patched in (engine(sim).intervals, engine(plant.simulator).intervals):
        monkeypatch.setattr(patched, "from_part", lambda y, part: real(y, part) if part < 0.9 * fewest else None)
        monkeypatch.setattr(patched, "slowed", lambda y, part: (real(y, part), 0.5))
    ended = sim.step(x)
    assert (ended.parts, ended.momentum_fraction) == (parts, 0.5)
    lost = "momentum of bodies relative to one another was lost"
    assert ended.success and "step 0 conserved 0.5 of it" in ended.message
    u = np.zeros((1, sim.nu))
    for solved in (
        sim.rollout(x, steps=1),
        sim.rollout(x, lambda t, x: u[0], steps=1),
        sim.rollout_batch(x[None], u[None]),
        sim.rollout_feedback(x, u),
        sim.step_batch(x[None], u),
        sim.step_batch(np.stack([x, x]), np.zeros((2, sim.nu))),
        dojo.closed_loop(lambda t, x: u[0], plant, sim.time_step),
    ):
        assert lost in solved.message and "conserved 0.5 of it" in solved.message, solved
    assert not sim.linearize(x, np.zeros(sim.nu)).success
    assert not sim.linearize_rollout(x, np.zeros((1, sim.nu)))[1].success


def test_ctrl_c_inside_a_division_keeps_the_steps_before(
    whip: tuple[dojo.Simulator, Floats], monkeypatch: pytest.MonkeyPatch
) -> None:
    sim, x = whip

    def stop(*_: object, **__: object) -> None:
        raise dojo.Interrupted(None)

    monkeypatch.setattr(engine(sim), "in_parts", stop)
    with pytest.raises(dojo.Interrupted) as stopped:
        sim.rollout(x, steps=20)
    assert stopped.value.result.solved_steps == 1
    assert stopped.value.result.status == dojo.Status.INTERRUPTED


@pytest.mark.parametrize("speed", [1.0, 100.0, 3000.0])
def test_momenta_behind_dampers_have_their_slopes_however_fast_joints_turn(speed: float) -> None:
    sim = dojo.Simulator(chain("spherical", 3, damper=2000.0), time_step=0.01)
    intervals, nv, part = engine(sim).intervals, sim.nv, 1e-4
    rng = np.random.default_rng(0)
    x = random_state(sim, rng, 1.0)
    x[-nv:] *= speed / np.abs(x[-nv:]).max()
    by_q, by_v = intervals.momentum_slopes(part, x)
    for _ in range(3):
        d = np.r_[rng.normal(size=nv), speed * rng.normal(size=nv)]
        ends = [intervals.momentum(part, sim.integrate(x, s * 1e-6 * d)) for s in (1.0, -1.0)]
        slope = (ends[0] - ends[1]) / 2e-6
        assert np.abs(by_q @ d[:nv] + by_v @ d[nv:] - slope).max() < 1e-6 * np.abs(slope).max()


def test_overlaps_that_no_pose_opens_are_left_and_named() -> None:
    bodies = [dojo.Body(name, 1.0, (0.01, 0.01, 0.01), shape=dojo.Sphere(0.1)) for name in ("base", "post", "arm")]
    joints = [
        dojo.Joint("floating", None, "base"),
        dojo.Joint("fixed", "base", "post", parent_point=(0.0, 0.0, 0.5)),
        dojo.Joint("revolute", "post", "arm", parent_point=(0.1, 0.0, -0.5), child_point=(0.03, 0, 0), axis=(0, 0, 1)),
    ]
    mech = dojo.Mechanism(bodies, joints, gravity=(0, 0, 0), collisions=[dojo.Collision("base", "arm", name="hit")])
    sim = dojo.Simulator(mech, time_step=0.01)
    x = sim.integrate(
        sim.neutral(), 0.5 * np.eye(sim.ndx)[6] + np.eye(sim.ndx)[-1]
    )  # centres .07 to .13 m apart, always
    assert not sim.replace(divide=False).step(x).success
    motion = sim.rollout(x, np.zeros((3, sim.nu)))
    assert motion.success and motion.parts.min() > 1
    gaps = motion.contacts.gap[:, 0]
    assert np.all(np.diff(gaps) > -1e-6) and gaps.max() < -0.06
    assert "overlap" in motion.message and "'hit'" in motion.message
    assert np.ptp(np.hstack(sim.momentum(motion.x)), axis=0).max() < 1e-9
    assert not sim.linearize(x, np.zeros(sim.nu)).success


def test_a_step_whose_warm_start_fails_is_solved_as_it_is_alone(
    whip: tuple[dojo.Simulator, Floats], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without the impulses of the step before, and without a division."""
    sim, x = whip
    start, t = sim.rollout(x, steps=3, throw=True).x[-1], 1
    motion = sim.rollout(start, steps=3, throw=True)
    took, counts = Engine.take_steps, list[int]()

    def failing(self: Engine, model: Any, line: Any, *rest: Any) -> int:
        """As usual, but that the first call ends before the step t."""
        counts.append(len(line.us))
        done = took(self, model, line, *rest)
        if len(counts) == 1:
            done, line.reports[t, StepReport.STATUS] = t, dojo.Status.NO_PROGRESS
        return done

    monkeypatch.setattr(Engine, "take_steps", failing)
    again = sim.rollout(start, steps=3, throw=True)
    assert counts == [3, 1, 1] and again.parts.max() == motion.parts.max() == 1
    assert np.abs(again.x - motion.x).max() < 1e-9
