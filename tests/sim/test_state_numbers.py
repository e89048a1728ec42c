"""States that no body can have, and numbers too large: every call about states refuses them, or its result is finite."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import dojo_opt as dojo
from sim.simulator.results import SimulationError
from support.linkage import plain_fourbar


@cache
def simulator(name: str) -> dojo.Simulator:
    if name == "linkage":
        return dojo.Simulator(plain_fourbar(), time_step=0.01)
    if name == "order 4":
        return dojo.Simulator(replace(dojo.models.raiberthopper(), contacts=[]), time_step=0.01, order=4)
    return dojo.Simulator(dojo.models.raiberthopper(), time_step=0.02)


def minimal(sim: dojo.Simulator, x: np.ndarray) -> Any:
    z = sim.maximal(sim.neutral())
    z.ravel()[: sim.nx] *= np.abs(x).max()
    return sim.minimal(z, joint_tolerance=np.inf)


CALLS: dict[str, Callable[[dojo.Simulator, np.ndarray], Any]] = {
    "close": lambda s, x: s.close(x),
    "loop_gaps": lambda s, x: np.concatenate([*s.loop_gaps(x).values(), [0.0]]),
    "state_from_velocity": lambda s, x: s.state_from_velocity(x[: s.nq], x[s.nq :]),
    "velocity": lambda s, x: s.velocity(x),
    "body_states": lambda s, x: s.body_states(x[: s.nq], x[s.nq :]),
    "integrate": lambda s, x: s.integrate(x, x[-1] * np.ones(s.ndx)),
    "integrate from neutral": lambda s, x: s.integrate(s.neutral(), np.abs(x).max() * np.ones(s.ndx)),
    "difference": lambda s, x: s.difference(x, s.neutral()),
    "difference of opposites": lambda s, x: s.difference(np.where(np.arange(s.nx) < s.nq, x, -x), x),
    "difference to": lambda s, x: s.difference(s.neutral(), x),
    "maximal": lambda s, x: s.maximal(x),
    "minimal": minimal,
    "maximal_jacobian": lambda s, x: s.maximal_jacobian(x),
    "energy": lambda s, x: s.energy(x),
    "kinetic_energy": lambda s, x: s.kinetic_energy(x),
    "momentum": lambda s, x: np.concatenate(s.momentum(x)),
}


@pytest.mark.sweep(4)
@pytest.mark.parametrize("name", ["hopper", "linkage", "order 4"])
@pytest.mark.parametrize("call", CALLS)
def test_a_result_is_finite_or_refused(name: str, call: str, rng: np.random.Generator) -> None:
    sim = simulator(name)
    if sim.order != 2 and call == "maximal_jacobian":
        pytest.skip("of order 2")
    refused = False
    for size in (1e100, 1e155, 1e200, 1e300, 1.7e308):
        for where in ("q", "v", "both", "one"):
            x = sim.neutral()
            rows = {"q": slice(0, sim.nq), "v": slice(sim.nq, sim.nx), "both": slice(0, sim.nx)}
            at = rows.get(where, [int(rng.integers(sim.nx))])
            x[at] = size * rng.choice([-1.0, 1.0], size=len(x[at]))
            if name != "linkage" and where in ("q", "both"):
                x[3:7] = sim.neutral()[3:7]
            try:
                assert np.isfinite(CALLS[call](sim, x)).all()
            except SimulationError:
                refused = True
            except ValueError as error:
                assert str(error).startswith(("Simulator.", "Mechanism(")), error
                refused = True
    assert refused or call not in ("energy", "kinetic_energy", "momentum", "difference of opposites"), (
        "nothing was refused"
    )


def test_the_joint_with_the_largest_numbers_is_named() -> None:
    sim = simulator("hopper")
    x = sim.neutral()
    x[sim.nq + sim.mechanism.v_slice("leg").start] = 1e200
    message = r"Simulator.energy\(x\): the result is not finite, .* the largest entry is 1e\+200, of joint 'leg'"
    with pytest.raises(ValueError, match=message):
        sim.energy(x)
    with pytest.raises(ValueError, match=r"Simulator.energy\(x\) in row 1: .*'leg'"):
        sim.energy(np.stack([sim.neutral(), x]))
    dx = np.zeros(sim.ndx)
    dx[sim.nv + 1], x[sim.nq + 1] = 1.7e308, 1e308
    with pytest.raises(ValueError, match=r"Simulator.integrate: .* 1.7e\+308, of joint 'body'"):
        sim.integrate(x, dx)


@pytest.mark.parametrize("name", ["hopper", "order 4"])
@pytest.mark.parametrize("call", [c for c in CALLS if c not in ("minimal", "integrate from neutral")])
def test_a_quaternion_of_length_zero_is_refused(name: str, call: str) -> None:
    sim = simulator(name)
    if sim.order != 2 and call == "maximal_jacobian":
        pytest.skip("of order 2")
    x = sim.neutral()
    x[3:7] = 0.0
    with pytest.raises(
        ValueError, match=f"Simulator.{call.split()[0]}.* joint '.*expected a unit quaternion, got length 0"
    ):
        CALLS[call](sim, x)


@pytest.mark.parametrize("call", ["minimal", "minimal_jacobian"])
def test_a_maximal_state_with_a_quaternion_of_length_zero_is_refused(call: str) -> None:
    sim = simulator("hopper")
    z = sim.maximal(sim.neutral())
    z[1, 6:10] = 0.0
    body = sim.mechanism.body_names[1]
    with pytest.raises(ValueError, match=rf"Simulator.{call}\(z\): body '{body}': expected a unit quaternion"):
        getattr(sim, call)(z)


def test_an_overflowing_sum_of_numbers_does_not_warn() -> None:
    sim = simulator("hopper")
    with pytest.raises(ValueError, match="expected finite numbers, got inf at index 0"):
        sim.integrate(sim.neutral(), np.concatenate([[np.inf, -np.inf], np.zeros(sim.ndx - 2)]))
    far = np.zeros(sim.ndx)
    far[:2] = 1.7e308
    assert np.isfinite(sim.integrate(sim.neutral(), far)).all()
