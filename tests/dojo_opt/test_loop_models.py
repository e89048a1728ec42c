"""Mechanisms with closed loops over many steps, and the period of a four-bar."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import dojo_opt as dojo
from support.benchmark import loaded
from support.linkage import COUPLER, CRANK, ROCKER, fourbar


@pytest.fixture(scope="module")
def bench() -> Iterator[Any]:
    yield from loaded("loops")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fourbar", "fivebar", "minitaur_leg", "stewart", "delta"])
def test_loops_stay_closed_and_energy_bounded(bench: Any, name: str) -> None:
    """10,000 of the 100,000 steps of `python benchmarks/loops.py`."""
    steps, gap, energy, *_ = bench.motion(name, 10_000)
    assert steps == 10_000 and gap < 1e-10
    assert energy < 0.05


def test_the_cost_of_a_loop_is_measured(bench: Any) -> None:
    steps, gap, _, cost, tree, _ = bench.motion("fivebar", 200)
    assert steps == 200 and gap < 1e-10 and cost > 0.0 and tree > 0.0


def places(a: float) -> tuple[np.ndarray, np.ndarray]:
    """The moving ends of crank and coupler (2, 2), and angles of crank, coupler, rocker; the crank at a, z is down."""
    b = CRANK * np.array([np.cos(a), np.sin(a)])
    d = np.array([1.0, 0.0]) - b
    r = np.linalg.norm(d)
    along = (COUPLER**2 - ROCKER**2 + r**2) / (2 * r)
    up = -np.sqrt(COUPLER**2 - along**2)
    c = b + along * d / r + up * np.array([-d[1], d[0]]) / r
    return np.array([b, c]), np.array([a, np.arctan2(*(c - b)[::-1]), np.arctan2(c[1], c[0] - 1.0)])


def swing(a: float) -> tuple[float, float]:
    """M(a) of the kinetic energy M a'^2/2, and the potential energy."""
    (b, c), _ = places(a)
    across = np.array([[0.0, -1.0], [1.0, 0.0]])
    vb, coupler, rocker = across @ b, across @ (c - b), across @ (c - (1.0, 0.0))
    wb, wc = np.linalg.solve(np.array([coupler, -rocker]).T, -vb)
    mass, length = 2.0 * np.array([CRANK, COUPLER, ROCKER]), np.array([CRANK, COUPLER, ROCKER])
    speed = np.array([vb / 2, vb + wb * coupler / 2, wc * rocker / 2])
    turn = mass * (length**2 + 0.05**2) / 12 * np.array([1.0, wb, wc]) ** 2
    height = -np.array([b[1] / 2, (b[1] + c[1]) / 2, c[1] / 2])
    return float(mass @ (speed**2).sum(axis=1) + turn.sum()), float(9.81 * mass @ height)


def period(a0: float) -> float:
    """Of the oscillation that starts at rest at a0, by an accurate solver of its single coordinate."""

    def rate(_: float, y: np.ndarray) -> list[float]:
        (M1, V1), (M0, V0), (M, _V) = swing(y[0] + 1e-5), swing(y[0] - 1e-5), swing(y[0])
        return [y[1], -(0.5 * (M1 - M0) / 2e-5 * y[1] ** 2 + (V1 - V0) / 2e-5) / M]

    def back(_: float, y: np.ndarray) -> float:
        return float(y[1])

    found = solve_ivp(rate, (0.0, 8.0), [a0, 0.0], events=back, rtol=1e-7, atol=1e-8)
    return float(2.0 * next(t for t in found.t_events[0] if t > 1e-3))


def test_period_of_a_four_bar() -> None:
    """Second order in the time step."""
    mech = fourbar("pin")
    guess = np.asarray(mech.neutral)
    low = min(np.linspace(0.3, 2.5, 400), key=lambda a: swing(a)[1])
    a0 = float(low) - 0.4
    _, angles = places(a0)
    q = np.array([a0, angles[1] - a0, angles[2]])
    assert len(q) == len(guess)
    exact = period(a0)
    errors = []
    for h in (0.01, 0.005):
        sim = dojo.Simulator(mech, time_step=h, tolerance=1e-11)
        t = sim.rollout(sim.state_from_velocity(q, np.zeros(3)), np.zeros((int(2.2 * exact / h), 0)), throw=True)
        v = t.x[1:, 3]  # of the crank, in the middle of every interval
        k = [k for k in range(2, len(v) - 1) if v[k] * v[k + 1] <= 0.0][1]  # from rest through one side and back
        errors.append(abs((k + 0.5 + v[k] / (v[k] - v[k + 1])) * h - exact))
    assert errors[0] < 5e-3 * exact and errors[1] < 0.35 * errors[0]


@pytest.mark.parametrize(
    ("model", "field", "length"),
    [("delta", "forearm", 0.1), ("fivebar", "forearm", 0.05), ("minitaur_leg", "lower", 0.05)],
)
def test_lengths_that_cannot_meet_are_refused(model: str, field: str, length: float) -> None:
    with pytest.raises(ValueError, match=rf"{model}\({field}=...\): expected more than .* got {length}"):
        getattr(dojo.models, model)(**{field: length})
