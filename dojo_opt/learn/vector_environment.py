"""VectorEnvironment: many environments of one task, stepped as one compiled batch on all cores."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_opt.learn.randomization import Drawn
from dojo_opt.learn.task import Task
from sim.mechanism import checks
from sim.mechanism.memory_limit import room_for
from solvers.status import Status
from solvers.types import Floats

try:
    import gymnasium
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ImportError:
    gymnasium = VectorEnv = None


__all__ = ["VectorEnvironment"]

_NEW = -1  # age of an environment that was never reset


class VectorEnvironment(VectorEnv if gymnasium else object):  # type: ignore[misc]
    """`num_envs` environments of a task: see Environment. Rows do not depend on one another.

    An environment whose episode is over starts anew: by default with the next step (NEXT_STEP, whose action it
    ignores), or at once with the last observation in `info["final_obs"]` (SAME_STEP), or by `reset(options=
    {"reset_mask": ...})` (DISABLED).
    """

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(
        self, task: Task, num_envs: int = 1, autoreset_mode: Any = None, max_episode_steps: int | None = None
    ) -> None:
        if gymnasium is None:
            raise ImportError('VectorEnvironment needs gymnasium: pip install "dojo-opt[gym]"')
        if not isinstance(task, Task):
            raise TypeError(f"VectorEnvironment(task): expected a Task, got {checks.shown(task)}")
        if autoreset_mode is not None and autoreset_mode not in [
            *AutoresetMode,
            *(mode.value for mode in AutoresetMode),
        ]:
            raise ValueError(
                f"VectorEnvironment(autoreset_mode=...): expected an AutoresetMode, got {checks.shown(autoreset_mode)}"
            )
        self.task, each = task, 8.0 * task.nx + 1000.0
        self.num_envs = room_for("VectorEnvironment(num_envs=...)", num_envs, each, noun="environments")
        mode = AutoresetMode.NEXT_STEP if autoreset_mode is None else AutoresetMode(autoreset_mode)
        self.metadata = {**type(self).metadata, "autoreset_mode": mode}
        limit = task.steps if max_episode_steps is None else max_episode_steps
        self._mode, self._limit = mode, checks.whole_number("VectorEnvironment(max_episode_steps=...)", limit)
        box = gymnasium.spaces.Box
        self.single_observation_space = box(-np.inf, np.inf, (task.observations,), np.float64)
        self.single_action_space = box(-1.0, 1.0, (task.sim.nu,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._model = Drawn.of(task)
        self.x, self._age = np.zeros((num_envs, task.nx)), np.full(num_envs, _NEW)
        self._over, self._all = np.zeros(num_envs, dtype=np.bool_), np.ones(num_envs, dtype=np.bool_)
        self._generators = [np.random.default_rng() for _ in range(num_envs)]
        self.render_mode = None

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """To first states. seed: environment i has seed + i; or one seed each.

        options: {"reset_mask": (num_envs,) bool} resets some of them.
        """
        mask = np.asarray(checks.mapping("VectorEnvironment.reset(options=...)", options).get("reset_mask", self._all))
        if mask.dtype != np.bool_ or mask.shape != (self.num_envs,):
            raise ValueError(
                f'VectorEnvironment.reset(options={{"reset_mask": ...}}): expected {self.num_envs} truth values, '
                f"got {checks.shown(mask)}"
            )
        seeds = self._seeds(seed)
        for i in np.flatnonzero(mask):
            if seeds[i] is not None:
                self._generators[i] = gymnasium.utils.seeding.np_random(seeds[i])[0]
        self._restart(mask)
        return self.task.observe(self.x)[0], {}

    def _seeds(self, seed: Any) -> list[int | None]:
        """One for each environment."""
        call = "VectorEnvironment.reset(seed=...)"
        if not isinstance(seed, list):
            first = None if seed is None else checks.whole_number(call, seed, least=0)
            return [None if first is None else first + i for i in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise ValueError(f"{call}: expected {self.num_envs} seeds, got {len(seed)}")
        return [None if one is None else checks.whole_number(call, one, least=0) for one in seed]

    def _restart(self, mask: NDArray[np.bool_]) -> None:
        """First states where the mask says so."""
        for i in np.flatnonzero(mask):
            self.x[i] = self.task.first(self._generators[i])
        self._age[mask], self._over[mask] = 0, False

    def step(self, actions: Floats) -> tuple[Floats, Floats, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """One action of every environment."""
        task, info = self.task, {}
        if (self._age == _NEW).any():
            raise RuntimeError("VectorEnvironment.step: an episode has not begun; call reset()")
        given = checks.array("VectorEnvironment.step(actions)", actions, (self.num_envs, task.sim.nu))
        anew = self._over.copy() if self._mode == AutoresetMode.NEXT_STEP else np.zeros(self.num_envs, dtype=np.bool_)
        if self._mode == AutoresetMode.DISABLED and self._over.any():
            raise RuntimeError("VectorEnvironment.step: an episode is over; reset it with a reset_mask")
        self._restart(anew)
        rows = np.flatnonzero(~anew)
        before, acts = self.x[rows], given[rows]
        found = self._model.step(before, task.inputs(np.clip(acts, -1.0, 1.0)))
        bad, ends = found.status != Status.SOLVED, task.ends(found.x)
        rewards, terminated = np.zeros(self.num_envs), np.zeros(self.num_envs, dtype=np.bool_)
        values = task.rewards(before, acts, found.x)[0] + task.survival * ~ends
        rewards[rows], terminated[rows] = np.where(bad, 0.0, values), ends | bad
        self.x[rows], self._age[rows] = found.x, self._age[rows] + 1
        task.redraw(self.x, self._age, self._generators)
        truncated = self._age >= self._limit
        self._over = terminated | truncated
        observations = task.observe(self.x)[0]
        if self._mode == AutoresetMode.SAME_STEP and self._over.any():
            over = self._over.copy()
            final = np.full(self.num_envs, None, dtype=object)
            for i in np.flatnonzero(over):
                final[i] = observations[i].copy()
            info = {"final_obs": final, "_final_obs": over, "final_info": {}, "_final_info": over}
            self._restart(over)
            observations[over] = task.observe(self.x[over])[0]
        return observations, rewards, terminated, truncated, info
