"""Planar loops against their equations of motion in independent coordinates: positions and node velocities of order 2."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import null_space

import dojo_opt as dojo
from support.linkage import plain_fourbar

DURATION = 0.8  # [s]
PUSH, SPRING = 1.5, 4.0  # first speed along the loop's freedom [rad/s]; of the five-bar's motors [N m/rad]


@dataclass(frozen=True)
class PlanarLoop:
    """Links by their angles a about y; link k points along e_k = (cos(a_k + turn), -sin(a_k + turn)) of the x-z plane.

    com: (n, n) centres of mass are constants + com e; loop: (n,) sum of loop_k e_k is constant; mass: (n,) [kg];
    inertia: (n,) about y [kg m^2]; spring: (n,) to the ground [N m/rad] and rest: (n,) its angles.
    """

    com: np.ndarray
    loop: np.ndarray
    mass: np.ndarray
    inertia: np.ndarray
    spring: np.ndarray
    rest: np.ndarray
    turn: float

    def freedom(self, a: np.ndarray) -> np.ndarray:
        """(n, freedoms) rates of the angles that keep the loop closed."""
        return np.asarray(null_space(self.loop * self._across(a)))

    def rate(self, _: float, y: np.ndarray) -> np.ndarray:
        """d(a, a')/dt. With a'' = b + N s, G b + G' a' = 0 and G N = 0:  (N^T M N) s = N^T (f - M b)."""
        a, w = np.split(y, 2)
        along, across = self._along(a), self._across(a)
        J = self.com * across[:, None, :]  # (2, n, n): velocities of the centres of mass
        drift = -np.einsum("xki,i->xk", self.com * along[:, None, :], w**2)
        G = self.loop * across
        b = np.linalg.pinv(G) @ (self.loop * along @ w**2)
        M = np.einsum("xki,k,xkj->ij", J, self.mass, J) + np.diag(self.inertia)
        pull = np.array([0.0, -9.81])[:, None] - drift
        f = np.einsum("xki,k,xk->i", J, self.mass, pull) - self.spring * (a - self.rest)
        N = self.freedom(a)
        return np.concatenate([w, b + N @ np.linalg.solve(N.T @ M @ N, N.T @ (f - M @ b))])

    def _along(self, a: np.ndarray) -> np.ndarray:
        return np.array([np.cos(a + self.turn), -np.sin(a + self.turn)])

    def _across(self, a: np.ndarray) -> np.ndarray:
        return np.array([-np.sin(a + self.turn), -np.cos(a + self.turn)])


def fourbar() -> tuple[dojo.Mechanism, PlanarLoop, np.ndarray]:
    """Crank, coupler, rocker; the last matrix takes their angles to joint coordinates."""
    r, b, s = 0.5, 1.0, 0.8
    length = np.array([r, b, s])
    mass = 2.0 * length
    com = np.array([[r / 2, 0.0, 0.0], [r, b / 2, 0.0], [0.0, 0.0, s / 2]])
    none = np.zeros(3)
    plane = PlanarLoop(com, np.array([r, b, -s]), mass, mass * (length**2 + 0.05**2) / 12, none, none, 0.0)
    return plain_fourbar(r, b, s), plane, np.array([[1.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


def fivebar() -> tuple[dojo.Mechanism, PlanarLoop, np.ndarray]:
    """Left and right crank, left and right forearm; springs at the motors, a pin of five constraints, three redundant."""
    crank, forearm, angle = 0.3, 0.4, 0.6
    length = np.array([crank, crank, forearm, forearm])
    mass = 2.0 * length
    com = 0.5 * np.diag(length) + np.diag([crank, crank], -2)
    spring, rest = SPRING * np.array([1.0, 1.0, 0.0, 0.0]), np.array([angle, -angle, 0.0, 0.0])
    loop = np.array([crank, -crank, forearm, -forearm])
    plane = PlanarLoop(com, loop, mass, mass * (length**2 + 0.03**2) / 12, spring, rest, np.pi / 2)
    mech = dojo.models.fivebar(crank=crank, forearm=forearm, angle=angle, limits=None, spring=SPRING)
    return mech, plane, np.eye(4) - np.diag([1.0, 1.0], -2)


@pytest.mark.parametrize("linkage", [fourbar, fivebar])
def test_positions_and_node_velocities_are_of_second_order(
    linkage: Callable[[], tuple[dojo.Mechanism, PlanarLoop, np.ndarray]],
) -> None:
    """`sim.start` takes the velocity at the first node, `sim.velocity` gives those at all others."""
    mech, plane, coordinates = linkage()
    errors = []
    for h in (0.01, 0.005):
        sim = dojo.Simulator(mech, time_step=h, tolerance=1e-12)
        q = sim.neutral()[: sim.nq]
        a = np.linalg.solve(coordinates, q)
        N = plane.freedom(a)
        w = PUSH * N @ (N.T @ np.ones(len(a)))
        times = h * np.arange(round(DURATION / h) + 1)
        exact = solve_ivp(plane.rate, (0.0, times[-1]), [*a, *w], "DOP853", times, rtol=1e-11, atol=1e-12).y.T
        t = sim.rollout(sim.state_from_velocity(q, coordinates @ w), np.zeros((len(times) - 1, sim.nu)), throw=True)
        angles, rates = exact[:, : len(a)] @ coordinates.T, exact[:, len(a) :] @ coordinates.T
        assert np.ptp(angles, axis=0).min() > 0.3  # every link moves
        errors.append([np.abs(t.x[:, : sim.nq] - angles).max(), np.abs(sim.velocity(t.x) - rates).max()])
        np.testing.assert_allclose(sim.velocity(t.x[0]), coordinates @ w, atol=1e-9)
    coarse, fine = np.array(errors)
    assert (coarse < [0.01, 0.06]).all()  # [rad], [rad/s]
    np.testing.assert_allclose(coarse / fine, 4.0, rtol=0.1)


@pytest.mark.sweep(4)
@pytest.mark.parametrize("accuracy", [1e-3, 1e-4, 1e-5, 1e-6])
@pytest.mark.parametrize("linkage", [fourbar, fivebar])
def test_loops_have_the_accuracy_that_is_asked_for(
    linkage: Callable[[], tuple[dojo.Mechanism, PlanarLoop, np.ndarray]], accuracy: float
) -> None:
    mech, plane, coordinates = linkage()
    sim = dojo.Simulator(mech, accuracy=accuracy)
    q = sim.neutral()[: sim.nq]
    a = np.linalg.solve(coordinates, q)
    N = plane.freedom(a)
    w = PUSH * N @ (N.T @ np.ones(len(a)))
    exact = solve_ivp(plane.rate, (0.0, DURATION), [*a, *w], "DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    t = sim.rollout(sim.state_from_velocity(q, coordinates @ w), duration=DURATION, throw=True)
    assert np.abs(t.x[-1, : sim.nq] - coordinates @ exact[: len(a)]).max() < 3.0 * DURATION * accuracy
    assert np.abs(t.x[-1, sim.nq :] - coordinates @ exact[len(a) :]).max() < 60.0 * DURATION * accuracy
    assert max(np.abs(gap).max() for gap in sim.loop_gaps(t.x[-1]).values()) < 1e-9
