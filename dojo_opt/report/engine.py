"""The motion that a simulation returns, the interface of an engine, and the measurement of its processor time."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.dynamics import maximal_energy
from sim.mechanism.mechanism import Mechanism
from sim.model.state_columns import BodyState
from sim.simulator.simulator import Simulator
from solvers.types import Floats


class Run(NamedTuple):
    """The motion of the bodies at the sampled times; it ends at the last good sample if the engine stopped early.

    Velocities, energy and momentum are those at the node. Energy has the same formula for every engine,

        sum of m v.v/2 + w.J w/2 - m g.x, and of k/2 (q - rest)^2 of the springs
    """

    time: Floats  # (n,) [s]
    position: Floats  # (n, nbody, 3) centres of mass, world [m]
    quaternion: Floats  # (n, nbody, 4) body to world, scalar first
    velocity: Floats  # (n, nbody, 6) of the centre of mass, world [m/s]; angular, body axes [rad/s]
    energy: Floats  # (n,) [J]
    momentum: Floats  # (n, 6) linear [N s], angular about the origin of the world [N m s]
    seconds: float  # processor time of the stepping alone
    steps: int  # how many were taken
    message: str = ""  # why it stopped early


class PhysicsEngine(Protocol):
    """A simulator with its settings."""

    @property
    def name(self) -> str:
        """Its name in tables."""
        ...

    def simulate(
        self,
        mechanism: Mechanism,
        *,
        time_step: float,
        q: ArrayLike,
        v: ArrayLike,
        duration: float,
        samples: int,
        inputs: ArrayLike | None = None,
    ) -> Run:
        """Motion from coordinates q (nq,) with velocities v (nv,) at the node, in the layout of a state.

        samples    equal parts of the duration; the run has samples + 1 moments, the start among them
        inputs     (nu,) held throughout, or (steps, nu)

        ValueError: the duration is not a whole number of steps, there are more samples than steps, inputs of another
        shape, or a mechanism that the engine cannot represent.
        """
        ...


def nodes(time_step: float, duration: float, samples: int) -> NDArray[np.int64]:
    """Steps after which to sample, (samples + 1,), from 0 to the last: as evenly as whole steps allow."""
    steps = round(duration / time_step)
    if steps < 1 or abs(steps * time_step - duration) > 1e-9 * duration:
        raise ValueError(f"simulate: expected a duration of whole steps of {time_step:g} s, got {duration:g} s")
    if not 1 <= samples <= steps:
        raise ValueError(f"simulate: expected 1 to {steps} samples of {steps} steps, got {samples}")
    return np.round(np.linspace(0, steps, samples + 1)).astype(np.int64)


def held(mechanism: Mechanism, inputs: ArrayLike | None, steps: int) -> Floats:
    """Inputs as rows: one that is held, or one per step."""
    nu = len(mechanism.input_names)
    u = np.zeros((1, nu)) if inputs is None else np.atleast_2d(np.asarray(inputs, dtype=np.float64))
    if u.shape not in ((1, nu), (steps, nu)):
        raise ValueError(f"simulate: expected inputs ({nu},) or ({steps}, {nu}), got {u.shape}")
    return u


def clocked(run: Callable[[], Any], rounds: int = 3, idle: Callable[[], Any] | None = None) -> tuple[Any, float]:
    """(result, processor time [s]) of a call: the median of some after a first one, or that one if it took a second.

    rounds: how many at most; half a second of them is enough, and of a run shorter than 10 ms five times as many.
    idle: the same call with nothing to do, whose time is taken off: Python on the way to the engine is not its work.
    """
    start = time.process_time()
    result = run()
    first = time.process_time() - start
    if first > 1.0 or rounds < 1:
        return result, first
    count = rounds if first > 0.01 else 5 * rounds
    seconds = _median(run, count)
    if idle is not None and first < 0.1:
        seconds = max(seconds - _median(idle, count), 0.01 * seconds)
    return result, seconds


def _median(run: Callable[[], Any], count: int) -> float:
    """Median processor time of a given number of calls, within half a second [s]."""
    seconds: list[float] = []
    while len(seconds) < count and (not seconds or sum(seconds) < 0.5):
        start = time.process_time()
        run()
        seconds.append(time.process_time() - start)
    return float(np.median(seconds))


def observe(sim: Simulator, times: Floats, q: Floats, v: Floats, seconds: float, steps: int, message: str = "") -> Run:
    """The run of joint coordinates q (n, nq) and joint velocities v (n, nv) at the nodes.

    sim: of the mechanism, with any time step.
    """
    z = sim.body_states(q, v)
    return observe_bodies(sim, times, z, potential(sim, q), seconds, steps, message)


def observe_bodies(
    sim: Simulator, times: Floats, z: Floats, potential: Floats, seconds: float, steps: int, message: str = ""
) -> Run:
    """The run of maximal states z (n, nbody, 13) with velocities at the nodes, and their potential energies (n,)."""
    velocity = np.concatenate([z[..., BodyState.VELOCITY], z[..., BodyState.SPIN]], axis=2)
    energy = maximal_energy.kinetic_energy(sim.model, z) + potential
    momentum = maximal_energy.momentum(sim.model, z)
    place, turn = z[..., BodyState.POSITION], z[..., BodyState.QUATERNION]
    return Run(times, place, turn, velocity, energy, momentum, seconds, steps, message)


def potential(sim: Simulator, q: Floats) -> Floats:
    """Energy of gravity and springs at the coordinates q (n, nq) [J]."""
    x = np.concatenate([q, np.zeros((len(q), sim.nv))], axis=1)
    return np.asarray(sim.energy(x) - sim.kinetic_energy(x))
