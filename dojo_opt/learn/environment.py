"""Environment: a task or a planning problem as a Gymnasium environment (`pip install "dojo-opt[gym]"`)."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter, sleep
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_opt.learn.randomization import Drawn
from dojo_opt.learn.task import Task
from dojo_opt.planning.knot_costs import KnotCosts
from dojo_opt.planning.problem import Problem
from dojo_opt.plant.monte_carlo import Sampler
from dojo_opt.plant.plant import Plant
from dojo_opt.viewer.live import Live, live
from sim.mechanism import checks
from sim.simulator.simulator import Simulator
from solvers.types import Vector

try:
    import gymnasium
except ImportError:
    gymnasium = None

Outcome = tuple[Vector, float, bool, bool, dict[str, Any]]

__all__ = ["Environment"]

_PICTURE = 4.8  # inches, of 100 pixels


def _limited(action: Vector, size: int) -> Vector:
    """An action within [-1, 1]; a few numbers are faster than arrays."""
    if action.shape == (size,) and all(-1.0 <= a <= 1.0 for a in action.tolist()):
        return action
    return np.clip(_numbers(action, size), -1.0, 1.0)


def _numbers(action: Any, size: int) -> Vector:
    """An action (size,) of finite numbers."""
    return checks.array("Environment.step(action)", action, (size,))


class _TaskEpisode:
    """Episodes of a task."""

    def __init__(self, task: Task) -> None:
        self.task, self.sim = task, task.sim
        self.observations, self.steps, self.knot_time = task.observations, task.steps, task.knot_time
        self.highest, self.kind = np.ones(task.sim.nu), np.float32
        self.lowest = -self.highest
        self.x, self._count = np.zeros((1, task.nx)), task.steps
        self._rngs, self._model = [np.random.default_rng()], Drawn.of(task)
        self._quick = task.sim.has_stepper

    def reset(self, rng: np.random.Generator) -> Vector:
        """To a first state."""
        self.x, self._count, self._rngs = self.task.starts([rng]), 0, [rng]
        return self.task.observe_one(self.x[0])

    def step(self, action: Vector) -> Outcome:
        """One action, held over the time steps of the task."""
        task, before = self.task, self.x
        if self._count >= task.steps:
            raise RuntimeError("Environment.step: the episode is over, or has not begun; call reset()")
        plain = type(action) is np.ndarray and action.dtype.kind == "f"  # which `_limited` looks at
        given = np.array(action if plain else _numbers(action, task.sim.nu), dtype=np.float64)
        self.x, message = self._step(before, given)
        self._count += 1
        late = self._count >= task.steps
        if message:
            return task.observe_one(self.x[0]), 0.0, True, late, {"message": message}
        observation, reward, over = task.judge(before[0], given, self.x[0])
        if task.hold is not None and self._count % task.hold == 0:
            task.redraw(self.x, np.array([self._count]), self._rngs)
            observation = task.observe_one(self.x[0])
        return observation, reward, over, late, {}

    def _step(self, x: Vector, action: Vector) -> tuple[Vector, str]:
        """The state (1, nx) after one action, and why it was not reached; checks of arguments take longer than that."""
        sim, nx = self.sim, self.sim.nx
        inputs = self.task.inputs(_limited(action, sim.nu))
        if not self._quick:
            found = self._model.step(x, inputs[None])
            return found.x, "" if found.success else found.message
        touch = self.task.touch_groups
        row = sim.stepper(self.task.substeps, touch is not None)
        if not row.advance(x[0, :nx], inputs):
            if not row.began:
                sim.step(x[0, :nx], inputs)  # which says what is wrong with the state
            return x, row.result(x[:, :nx]).message
        after = x.copy()
        after[0, :nx] = row.end
        if touch is not None:
            after[0, -6 * touch.count :] = touch.of_rows(after[:, :nx], row.last_contacts).ravel()
        return after, ""

    def state(self) -> Vector:
        """The present one, of the simulator."""
        return self.x[0, : self.sim.nx]


class _ProblemEpisode:
    """Episodes of a problem: one is one horizon, a step is one of its knots."""

    def __init__(self, problem: Problem, plant: Plant | None, sampler: Sampler | None) -> None:
        self.problem = problem.with_own_terms()
        self._plant = self.plant = Plant(problem.sim, problem.start) if plant is None else plant
        self.sim, self.knot_time, self.steps, self._sampler = problem.sim, problem.knot_time, problem.horizon, sampler
        robot, other = problem.sim.mechanism, self.plant.nominal.mechanism
        if robot.dof_names != other.dof_names or problem.sim.nu != self.plant.nominal.nu:
            raise ValueError(
                f"Environment(plant=...): expected a plant of the problem's {robot.name!r}, got one of {other.name!r}"
            )
        self._substeps = round(problem.knot_time / self.plant.nominal.time_step)
        if abs(self._substeps * self.plant.nominal.time_step - problem.knot_time) > 1e-9:
            raise ValueError(
                f"Environment(plant=...): expected a time step that divides a knot of {problem.knot_time:g} s, got "
                f"{self.plant.nominal.time_step:g} s"
            )
        self.observations, nu = problem.sim.nx, problem.sim.nu
        lo, hi = problem.control_limits or (np.full(nu, -np.inf), np.full(nu, np.inf))
        bounded = np.isfinite(lo) & np.isfinite(hi)
        low, high = np.where(bounded, lo, -1.0), np.where(bounded, hi, 1.0)
        self._middle, self._half = 0.5 * (low + high), 0.5 * (high - low)
        self.lowest, self.highest, self.kind = np.where(bounded, -1.0, lo), np.where(bounded, 1.0, hi), np.float64
        self._xs, self._us = np.tile(problem.start, (problem.horizon + 1, 1)), np.zeros((problem.horizon, nu))
        self._knot, self._cost = problem.horizon, KnotCosts(self.problem)

    def reset(self, rng: np.random.Generator) -> Vector:
        """Back to the start, under another perturbation when there is a sampler."""
        if self._sampler is not None:
            self.plant = self._plant.perturbed(self._sampler(rng).over(self._plant.perturbation))
        if np.any(self.plant.perturbation.noise):  # another one in each episode
            seed = int(rng.integers(2**31))
            self.plant = self.plant.perturbed(replace(self.plant.perturbation, seed=seed))
        self.plant.reset()
        self._knot = 0
        self._xs[:] = self.plant.x
        return self.plant.measure().copy()

    def step(self, action: Vector) -> Outcome:
        """One knot with the input held."""
        t = self._knot
        if t >= self.steps:
            raise RuntimeError("Environment.step: the episode is over, or has not begun; call reset()")
        us, plant = self._us, self.plant
        limited = np.minimum(np.maximum(_numbers(action, us.shape[1]), self.lowest), self.highest)  # faster than clip
        us[t] = self._middle + self._half * limited
        message = plant.hold(us[t], self._substeps)
        self._knot = t + 1
        self._xs[t + 1] = plant.x
        if plant.fallen(plant.x):
            message = "The robot has fallen."
        over = self._knot == self.steps
        reward = -self._cost(t, self._xs, us) - (self._cost(t + 1, self._xs, us) if over else 0.0)
        info: dict[str, Any] = {"message": message} if message else {}
        if over:
            info["violation"] = self.problem.violation(self._xs, us)
        return plant.measure().copy(), reward, bool(message), over, info

    def state(self) -> Vector:
        """The present one."""
        return self.plant.x


class Environment(gymnasium.Env if gymnasium else object):  # type: ignore[misc]
    """A Task, or a Problem with a plant, for reinforcement learning.

        task          observation, reward, end and number of steps are its own, so `max_episode_steps` of gymnasium.make
                      can only shorten an episode; actions in [-1, 1], beyond which inputs are limited, as by actuators;
                      an unsolved step ends the episode with `info["message"]`
        problem       one episode is one horizon, a step is one knot
          observation   state x (nx,), measured
          action        (nu,) in [-1, 1] between the problem's control limits, beyond which inputs are limited, too;
                        inputs [N, N m] where it has none, or one on one side only, which holds
          reward        minus the problem's costs at the knot, and with the last step those at the end
          terminated    the robot has fallen, or a step could not be solved: see `info["message"]`
          truncated     the horizon is over; `info["violation"]` is the largest violation of a constraint

    plant        of a problem, by default its own simulator from its start; its time step divides a knot. Where the
                 start is free, that is its guess: Plant(problem.sim, plan.x[0]) begins where a plan does
    sampler      generator -> Perturbation, drawn at every reset from the environment's seed, as the noise is
    render_mode  None, "rgb_array", or "human": every step is shown in the browser, at `view.url`, in real time
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array", "human"], "render_fps": 20}

    def __init__(
        self,
        source: Task | Problem,
        plant: Plant | None = None,
        sampler: Sampler | None = None,
        render_mode: str | None = None,
    ) -> None:
        if gymnasium is None:
            raise ImportError('dojo.Environment needs gymnasium: pip install "dojo-opt[gym]"')
        if not isinstance(source, Task | Problem):
            raise TypeError(f"Environment(source): expected a Task or a Problem, got {source!r}")
        if plant is not None and not isinstance(plant, Plant):
            raise TypeError(f"Environment(plant=...): expected a Plant, as Plant(simulator), got {plant!r}")
        if sampler is not None and not callable(sampler):
            raise TypeError(f"Environment(sampler=...): expected a function of a generator, got {sampler!r}")
        if isinstance(source, Task) and not (plant is None and sampler is None):
            raise ValueError("Environment(plant=..., sampler=...): a task has its own simulator and first states")
        if render_mode is not None and str(render_mode) not in ("rgb_array", "human"):
            raise ValueError(
                f'Environment(render_mode=...): expected None, "rgb_array" or "human", got {render_mode!r}'
            )
        self.render_mode, self._shown = render_mode, 0.0
        self.view: Live | None = None
        self._episode: _TaskEpisode | _ProblemEpisode = (
            _TaskEpisode(source) if isinstance(source, Task) else _ProblemEpisode(source, plant, sampler)
        )
        e = self._episode
        self.metadata = {**type(self).metadata, "render_fps": round(1.0 / e.knot_time)}
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (e.observations,), np.float64)
        self.action_space = gymnasium.spaces.Box(e.lowest.astype(e.kind), e.highest.astype(e.kind), dtype=e.kind)

    @property
    def sim(self) -> Simulator:
        """The simulator of the task, or of the problem."""
        return self._episode.sim

    @property
    def problem(self) -> Problem:
        """The problem; a ValueError where it is a task."""
        if isinstance(self._episode, _TaskEpisode):
            raise ValueError("Environment.problem: this is the environment of a task")
        return self._episode.problem

    @property
    def plant(self) -> Plant:
        """The plant of a problem, with the present perturbation; a ValueError where it is a task."""
        if isinstance(self._episode, _TaskEpisode):
            raise ValueError("Environment.plant: this is the environment of a task")
        return self._episode.plant

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Vector, dict[str, Any]]:
        """To a first state, drawn from the environment's seed."""
        super().reset(seed=seed)
        observation = self._episode.reset(self.np_random)
        self._show()
        return observation, {}

    def step(self, action: Vector) -> Outcome:
        """One action: (observation, reward, terminated, truncated, info)."""
        outcome = self._episode.step(action)
        self._show()
        return outcome

    def _show(self) -> None:
        """The present state in the browser, no earlier than the time of an action after the one before."""
        if self.render_mode != "human":
            return
        if self.view is None:
            self.view = live(self.sim, open_browser=True)
        sleep(max(self._shown + self._episode.knot_time - perf_counter(), 0.0))
        self._shown = perf_counter()
        self.view.show(self._episode.state())

    def close(self) -> None:
        """Close the page of render_mode="human"."""
        if self.view is not None:
            self.view.close()
            self.view = None

    def render(self) -> NDArray[np.uint8] | None:
        """A sketch (480, 480, 3) of the robot by Matplotlib, with render_mode="rgb_array"; "human" shows the page."""
        if self.render_mode != "rgb_array":
            return None
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        from dojo_opt.plots.thumbnail import thumbnail

        figure = thumbnail(self.sim.mechanism, self._episode.state()[: self.sim.nq], size=_PICTURE)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()
