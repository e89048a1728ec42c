"""Rollouts: states of many rollouts from NumPy arrays, and the pullback of their gradients, whatever the framework."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from dojo_opt.bridges.cotangents import Cotangents
from dojo_opt.identification.parameter_space import ParameterSpace
from sim.mechanism import checks
from sim.simulator.results import SimulationError
from sim.simulator.simulator import Simulator
from solvers.status import Status
from solvers.types import Floats

_KEPT = 64  # simulators of other parameters, from a rollout to its gradient


@lru_cache(1)
def _threads(process: int) -> ThreadPoolExecutor:
    """One per core; a forked process has none of those of its parent."""
    return ThreadPoolExecutor(os.cpu_count(), thread_name_prefix="dojo-opt bridge")


class Functions(NamedTuple):
    """The functions of a bridge.

    Attributes:
        step: step(x, u, theta=None) -> (nx,) next state.
        rollout: rollout(x0, us, theta=None) -> (T + 1, nx) states.
    """

    step: Callable[..., Any]
    rollout: Callable[..., Any]


class Rollouts:
    """Rollouts from x0 (..., nx) under us (..., T, nu) with the parameters theta (..., n), n = 0 for those of `sim`.

    kappa       of the derivatives [N s m]; the simulator's by default. Steps are solved at that of the simulator
    parameters  the parameters in theta
    """

    def __init__(self, call: str, sim: Simulator, kappa: float | None, parameters: ParameterSpace | None) -> None:
        if not isinstance(sim, Simulator):
            raise TypeError(f"{call}(sim): expected a Simulator, got {sim!r}")
        if parameters is not None and not isinstance(parameters, ParameterSpace):
            raise TypeError(f"{call}(parameters=...): expected a ParameterSpace, got {parameters!r}")
        if parameters is not None and (sim.order > 2 or sim.accuracy is not None):
            raise ValueError(
                f"{call}(parameters=...): expected a simulator of order 2 without an accuracy, whose steps alone "
                f"have derivatives by parameters, got {sim!r}"
            )
        self.sim, self.call, self._space = sim, call, parameters
        self._kappa = None if kappa is None else checks.number(f"{call}(kappa=...)", kappa, above=0.0)
        self._cotangents = Cotangents(sim)
        self._simulator_at = lru_cache(_KEPT)(self._made)

    def sizes(self, theta: Any) -> int:
        """How many parameters a call has that was given theta, or None for those of the simulator."""
        if theta is None:
            return 0
        if self._space is None:
            raise ValueError(
                f"{self.call}: rollout(theta): no parameters are declared; give parameters=ParameterSpace(...)"
            )
        return len(self._space.values)

    def check(self, **shapes: tuple[tuple[int, ...], tuple[int | str, ...]]) -> None:
        """Refuse shapes of arguments by name: (got, expected), a letter for any length."""
        for name, (got, wanted) in shapes.items():
            if len(got) != len(wanted) or any(w != g for g, w in zip(got, wanted, strict=True) if isinstance(w, int)):
                text = ", ".join(map(str, wanted)) + ("," if len(wanted) == 1 else "")
                raise ValueError(f"{self.call}: argument {name}: expected shape ({text}), got {got}")

    def states(self, x0: Any, us: Any, theta: Any) -> Floats:
        """xs (..., T + 1, nx). An unsolved step raises SimulationError."""
        x0s, inputs, thetas, lead = self._rows(x0, us, theta)
        out = np.empty((len(x0s), inputs.shape[1] + 1, self.sim.nx))
        if len(x0s) > 1 and thetas.shape[1] == 0:
            batch = self.sim.rollout_batch(x0s, inputs)
            out[:] = batch.x
            for row in np.flatnonzero(batch.status != Status.SOLVED)[:1]:
                self._roll(x0s[row], inputs[row], thetas[row], f"row {row}: ")
        else:
            self._each(len(x0s), lambda i: np.copyto(out[i], self._roll(x0s[i], inputs[i], thetas[i], f"row {i}: ")))
        return out.reshape(*lead, *out.shape[1:])

    def all_states(self, x0: Any, us: Any, theta: Any) -> tuple[Floats]:
        """`states` as the only result of several."""
        return (self.states(x0, us, theta),)

    def pullback(self, xs: Any, us: Any, theta: Any, by_xs: Any) -> tuple[Floats, Floats, Floats]:
        """Gradients by x0 (..., nx), us (..., T, nu) and theta (..., n) from those by xs (..., T + 1, nx)."""
        paths, inputs, thetas, lead = self._rows(xs, us, theta)
        states = paths.reshape(-1, self.sim.nx)
        losses = self._cotangents.tangent(states, np.asarray(by_xs, dtype=np.float64).reshape(states.shape))
        losses = losses.reshape(*paths.shape[:2], self.sim.ndx)
        by_dx0, by_us, by_theta = np.empty((len(paths), self.sim.ndx)), np.empty_like(inputs), np.empty_like(thetas)

        def one(i: int) -> None:
            by_dx0[i], by_us[i], by_theta[i] = self._gradient(paths[i], inputs[i], thetas[i], losses[i])

        self._each(len(paths), one)
        by_x0 = self._cotangents.ambient(paths[:, 0], by_dx0)
        return (
            by_x0.reshape(*lead, self.sim.nx),
            by_us.reshape(*lead, *inputs.shape[1:]),
            by_theta.reshape(*lead, thetas.shape[1]),
        )

    def _rows(self, x: Any, us: Any, theta: Any) -> tuple[Floats, Floats, Floats, tuple[int, ...]]:
        """The arguments with one leading axis, and those that they have."""
        inputs, thetas = np.array(us, dtype=np.float64, order="C"), np.array(theta, dtype=np.float64, order="C")
        lead = inputs.shape[:-2]
        states = np.array(x, dtype=np.float64, order="C")
        n = int(np.prod(lead))
        return (
            states.reshape(n, *states.shape[len(lead) :]),
            inputs.reshape(n, *inputs.shape[-2:]),
            thetas.reshape(n, thetas.shape[-1]),
            lead,
        )

    def _each(self, count: int, work: Callable[[int], None]) -> None:
        """The work of all rows over the cores; the first one by itself, since it may be the one that compiles."""
        if count > 0:
            work(0)
        if count > 1:
            list(_threads(os.getpid()).map(work, range(1, count)))

    def _made(self, theta: bytes) -> Simulator:
        assert self._space is not None
        return self._space.simulator(np.frombuffer(theta))

    def _simulator(self, theta: Floats) -> Simulator:
        return self._simulator_at(theta.tobytes()) if theta.size else self.sim

    def _roll(self, x0: Floats, us: Floats, theta: Floats, row: str) -> Floats:
        try:
            return self._simulator(theta).rollout(x0, us, throw=True).x
        except SimulationError as error:
            raise SimulationError(f"{self.call}: {row}{error}", error.status) from error

    def _gradient(self, xs: Floats, us: Floats, theta: Floats, loss: Floats) -> tuple[Floats, Floats, Floats]:
        """Gradients by dx_0 (ndx,), the inputs (T, nu) and theta (n,) of one rollout; loss: (T + 1, ndx) that by dx."""
        names = self._space.wrt if self._space is not None and theta.size else ()
        blocks = self._simulator(theta).vjp(
            (xs, us), loss, wrt=("state", "input", *names), kappa=self._kappa, throw=True
        )
        by_theta = self._space.chain(theta, blocks) if self._space is not None and theta.size else theta
        return blocks["state"], blocks["input"], by_theta
