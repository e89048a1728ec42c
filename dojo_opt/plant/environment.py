"""Environment: a problem as a Gymnasium environment, for reinforcement learning (`pip install "dojo-opt[gym]"`)."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from dojo_opt.planning.problem import Problem
from dojo_opt.plant.monte_carlo import Sampler
from dojo_opt.plant.plant import Plant
from sim.mechanism import checks

try:
    import gymnasium
except ImportError:
    gymnasium = None

Vector = NDArray[np.float64]

__all__ = ["Environment"]


class Environment(gymnasium.Env if gymnasium else object):  # type: ignore[misc]
    """One episode is one horizon of the problem, a step is one of its knots.

        observation   state x (nx,), measured
        action        (nu,) in [-1, 1] between the problem's control limits; inputs [N, N m] where it has none
        reward        minus the problem's costs at the knot, and with the last step those at the end
        terminated    the robot has fallen, or a step could not be solved: see `info["message"]`
        truncated     the horizon is over; `info["violation"]` is the largest violation of a constraint

    plant    the plant, by default the problem's own simulator from the problem's start; its time step divides a
             knot. sampler: generator -> Perturbation, drawn at every reset from the environment's seed.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": []}

    def __init__(self, problem: Problem, plant: Plant | None = None, sampler: Sampler | None = None) -> None:
        if gymnasium is None:
            raise ImportError('dojo.Environment needs gymnasium: pip install "dojo-opt[gym]"')
        if not isinstance(problem, Problem):
            raise TypeError(f"Environment(problem): expected a Problem, got {problem!r}")
        if plant is not None and not isinstance(plant, Plant):
            raise TypeError(f"Environment(plant=...): expected a Plant, as Plant(simulator), got {plant!r}")
        if sampler is not None and not callable(sampler):
            raise TypeError(f"Environment(sampler=...): expected a function of a generator, got {sampler!r}")
        self.problem = problem.with_own_terms()
        self._plant = self.plant = Plant(problem.sim, problem.start) if plant is None else plant
        self._sampler = sampler
        self._steps = round(problem.knot_time / self.plant.sim.time_step)
        if abs(self._steps * self.plant.sim.time_step - problem.knot_time) > 1e-9:
            raise ValueError(
                f"Environment(plant=...): expected a time step that divides a knot of {problem.knot_time:g} s, got "
                f"{self.plant.sim.time_step:g} s"
            )
        nx, nu = problem.sim.nx, problem.sim.nu
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (nx,), np.float64)
        lo, hi = problem.control_limits or (np.full(nu, -np.inf), np.full(nu, np.inf))
        bounded = np.isfinite(lo) & np.isfinite(hi)
        low, high = np.where(bounded, lo, -1.0), np.where(bounded, hi, 1.0)
        self._middle, self._half = 0.5 * (low + high), 0.5 * (high - low)
        edge = np.where(bounded, 1.0, np.inf)
        self.action_space = gymnasium.spaces.Box(-edge, edge, (nu,), np.float64)
        self._xs, self._us = np.tile(problem.start, (problem.horizon + 1, 1)), np.zeros((problem.horizon, nu))
        self._knot = 0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Vector, dict[str, Any]]:
        """Back to the start, under another perturbation when there is a sampler."""
        super().reset(seed=seed)
        if self._sampler is not None:
            self.plant = self._plant.perturbed(self._sampler(self.np_random))
        self.plant.reset()
        self._knot = 0
        self._xs[:] = self.plant.x
        return self.plant.measure().copy(), {}

    def step(self, action: Vector) -> tuple[Vector, float, bool, bool, dict[str, Any]]:
        """One knot with the input held: (observation, reward, terminated, truncated, info)."""
        t = self._knot
        info: dict[str, Any] = {}
        if t >= self.problem.horizon:
            raise RuntimeError("Environment.step: the episode is over; call reset()")
        chosen = checks.array("Environment.step(action)", action, (self.problem.sim.nu,))
        self._us[t] = self._middle + self._half * chosen
        for _ in range(self._steps):
            _, result = self.plant.step(self._us[t])
            if not result.success:
                info["message"] = result.message
                break
        self._knot = t + 1
        self._xs[t + 1 :] = self.plant.x
        fallen = self.plant.fallen(self.plant.x)
        if fallen:
            info["message"] = "The robot has fallen."
        over = self._knot == self.problem.horizon
        reward = -self._cost(t) - (self._cost(t + 1) if over else 0.0)
        if over:
            info["violation"] = self.problem.violation(self._xs, self._us)
        return self.plant.measure().copy(), reward, "message" in info, over, info

    def _cost(self, knot: int) -> float:
        """Cost of one knot."""
        total = 0.0
        for term in self.problem.costs:
            term.update(self._xs, self._us)
            rows = term.knots == knot
            total += float(np.sum(term.weight[rows] * term.residual[rows] ** 2))
        return total
