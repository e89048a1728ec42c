"""Closed loops: closed to rounding, momentum and energy kept, derivatives right, redundant constraints harmless."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import dojo_opt as dojo
from sim.mechanism.body import Body
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from support.linkage import plain_fourbar as fourbar
from support.linkage import worst_gap


def ring(kind: str = "spherical") -> Mechanism:
    """Four bodies in a floating ring of spherical joints, closed by a joint of the given kind."""
    bodies = [Body(f"b{k}", 1.0 + 0.3 * k, (0.02, 0.03, 0.04)) for k in range(4)]
    joints = [Joint("floating", None, "b0")]
    corners = [(0.5, 0.0, 0.0), (0.0, 0.5, 0.0), (-0.5, 0.0, 0.0), (0.0, -0.5, 0.0)]
    centers = 0.5 * (np.array(corners) + np.roll(corners, -1, axis=0))
    for k in range(1, 4):
        at = np.array(corners[k])
        joints.append(Joint("spherical", f"b{k - 1}", f"b{k}", "", at - centers[k - 1], at - centers[k]))
    at = np.array(corners[0])
    joints.append(Joint(kind, "b3", "b0", "last", at - centers[3], at - centers[0], axis=(0.6, 0.0, 0.8), close=True))
    return Mechanism(bodies, joints, gravity=(0, 0, 0), name="ring")


def moving(sim: dojo.Simulator, speed: float = 1.0) -> np.ndarray:
    x = sim.neutral()
    x[sim.nq :] = speed * np.random.default_rng(1).normal(size=sim.nv)
    return sim.close(x)


def test_a_four_bar_stays_closed_and_keeps_its_energy() -> None:
    sim = dojo.Simulator(fourbar(), time_step=0.01, tolerance=1e-11)
    t = sim.rollout(sim.neutral(), np.zeros((20_000, sim.nu)))
    assert t.success, t.message
    assert max(worst_gap(sim, x) for x in t.x[::500]) < 1e-10
    energy = sim.energy(t.x[1:])
    first, last = energy[:2000], energy[-2000:]
    assert np.ptp(energy) < 0.1 and abs(first.mean() - last.mean()) < 0.1 * np.ptp(energy)


@pytest.mark.parametrize("kind", ["revolute", "spherical", "cylindrical"])
def test_redundant_constraints_change_nothing(kind: str) -> None:
    """A planar loop needs two constraints; five, three or four of them leave the same motion."""
    reference = dojo.Simulator(fourbar(), time_step=0.01, tolerance=1e-11)
    sim = dojo.Simulator(fourbar(kind=kind), time_step=0.01, tolerance=1e-11)
    a, b = (s.rollout(s.neutral(), np.zeros((200, 3))) for s in (reference, sim))
    assert a.success and b.success
    np.testing.assert_allclose(a.x, b.x, atol=1e-8)


def test_a_parallelogram_swings_like_its_single_coordinate() -> None:
    """(m_crank/3 2 + m_coupler) r^2 theta'' = -(m_crank + m_coupler) g r sin(theta); order 2 in the time step."""
    r, length, T = 0.5, 1.0, 3.0
    heavy, light = 2.0 * length, 2.0 * r
    square = light * (r**2 + 0.05**2) / 12 + light * r**2 / 4  # one crank about its pin

    def swing(_: float, y: np.ndarray) -> list[float]:
        return [y[1], -(light + heavy) * 9.81 * r * np.sin(y[0]) / (2 * square + heavy * r**2)]

    exact = solve_ivp(swing, (0, T), [0.6, 0.0], method="DOP853", rtol=1e-12, atol=1e-12).y[0, -1]
    errors = []
    for h in (0.01, 0.005):
        sim = dojo.Simulator(fourbar(r, length, r, length), time_step=h, tolerance=1e-11)
        q = np.array([np.pi / 2 - 0.6, -(np.pi / 2 - 0.6), np.pi / 2 - 0.6])  # axis y: positive angles point down
        t = sim.rollout(sim.state_from_velocity(q, np.zeros(3)), np.zeros((round(T / h), 3)))
        assert t.success, t.message
        errors.append(abs((np.pi / 2 - t.x[-1, 0]) - exact))
    assert errors[0] < 2e-3 and errors[1] < 0.3 * errors[0]


@pytest.mark.parametrize("kind", ["spherical", "revolute", "fixed", "prismatic", "planar_axis"])
def test_a_floating_ring_keeps_its_momentum(kind: str) -> None:
    sim = dojo.Simulator(ring(kind), time_step=0.01, tolerance=1e-12)
    x = moving(sim)
    t = sim.rollout(x, np.zeros((100, sim.nu)))
    assert t.success, t.message
    p, L = sim.momentum(t.x)
    assert np.ptp(p, axis=0).max() < 1e-10 and np.ptp(L, axis=0).max() < 1e-10
    assert worst_gap(sim, t.x[-1]) < 1e-10


@pytest.mark.parametrize("mechanism", [fourbar(), ring("spherical"), ring("revolute"), ring("fixed")])
def test_derivatives_of_closed_loops(mechanism: Mechanism) -> None:
    sim = dojo.Simulator(mechanism, time_step=0.02, tolerance=1e-12)
    x = sim.rollout(moving(sim), np.zeros((3, sim.nu))).x[-1]
    u = np.random.default_rng(2).normal(size=sim.nu)
    A, B = sim.linearize(x, u)
    e = 1e-5
    step = [e * d for d in np.eye(sim.ndx)]
    FA = [sim.difference(sim.step(sim.integrate(x, d), u).x, sim.step(sim.integrate(x, -d), u).x) for d in step]
    FB = [sim.difference(sim.step(x, u + d).x, sim.step(x, u - d).x) for d in e * np.eye(sim.nu)]
    np.testing.assert_allclose(A, np.array(FA).T / (2 * e), atol=1e-6 * np.abs(A).max())
    np.testing.assert_allclose(B, np.array(FB).T / (2 * e), atol=1e-6 * np.abs(A).max())


def test_loops_that_cannot_close_are_refused_by_name() -> None:
    with pytest.raises(ValueError, match="loop joint 'pin' cannot be closed near this state, it is off by"):
        dojo.Simulator(fourbar(crank=0.1, coupler=0.1, rocker=0.1), time_step=0.01).neutral()


def test_closing_joints_are_checked() -> None:
    bodies = [Body("a", 1.0, (1, 1, 1)), Body("b", 1.0, (1, 1, 1))]
    tree = [Joint("revolute", None, "a"), Joint("revolute", "a", "b")]
    with pytest.raises(ValueError, match="constrains nothing"):
        Mechanism(bodies, [*tree, Joint("floating", None, "b", "c", close=True)])
    with pytest.raises(ValueError, match="a joint that closes a loop needs close=True"):
        Mechanism(bodies, [*tree, Joint("revolute", None, "b", "c")])
    with pytest.raises(ValueError, match="'nobody' is not one of"):
        Mechanism(bodies, [*tree, Joint("revolute", "nobody", "b", "c", close=True)])
