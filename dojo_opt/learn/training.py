"""Training: an algorithm of learning between two epochs, with its counts and the best policy so far."""

from __future__ import annotations

from concurrent.futures import Executor
from typing import Any

import numpy as np

from dojo_opt.learn.evaluation import Evaluation, evaluate
from dojo_opt.learn.policy import LearnedPolicy
from dojo_opt.learn.task import Task
from dojo_opt.learn.training_result import Learned
from sim.mechanism.memory_limit import check_room
from solvers.types import Floats


class Training:
    """The state of all algorithms; a subclass sets `policy` and `chosen`, and has `train`, which makes one epoch.

    Args:
        task: the task to learn.
        options: settings of the algorithm.
        seed: of all random numbers.
    """

    algorithm = ""
    advice = (  # where no policy is better than the one before the first epoch
        "Actions at their limits have no gradient: try a smaller range (low, high), another reward, a smaller rate, or "
        "another seed."
    )
    executor: Executor | None = None
    policy: LearnedPolicy  # moves in place
    chosen: LearnedPolicy  # the best so far

    NUMBERS: tuple[str, ...] = ("epoch", "steps", "unsolved", "infinite", "best", "score", "chosen_at")

    def __init__(self, task: Task, options: Any, seed: int) -> None:
        self.task, self.options, self.seed = task, options, seed
        self._check_memory()
        self.rng = np.random.default_rng((seed, 1))
        self.epoch, self.steps, self.unsolved, self.infinite, self.best = 0, 0, 0, 0, -np.inf
        self.score, self.chosen_at = -np.inf, 0  # epochs before the policy that was chosen

    def _check_memory(self) -> None:
        """Refuse rollouts of an epoch, with their derivatives, that do not fit the memory."""
        o, task, sim = self.options, self.task, self.task.sim
        kind = next((name for name in ("environments", "directions") if hasattr(o, name)), None)
        if kind is None:
            return
        numbers = 2 * task.nx + task.observations + 3 * sim.nu
        numbers += sim.ndx * (sim.ndx + sim.nu + task.observations) if kind == "environments" else 0
        steps = task.steps if o.horizon is None else o.horizon
        check_room(f"{self.algorithm}({kind}=..., horizon=...)", getattr(o, kind) * steps, 8.0 * numbers)

    def train(self) -> dict[str, Any]:
        """One epoch: its record, without an evaluation."""
        raise NotImplementedError

    def record(self, value: float | None, gradient: float, share: float) -> dict[str, Any]:
        """The record of an epoch: its return, the length of its gradient, and the share of it that was clipped."""
        return {
            "epoch": self.epoch, "steps": self.steps, "return": value, "evaluated": None, "gradient": gradient,
            "clipped": share, "unsolved": self.unsolved, "infinite": self.infinite,
        }  # fmt: skip

    def snapshot(self) -> LearnedPolicy:
        """A copy of the policy as it is now."""
        p = self.policy
        return LearnedPolicy(p.network, p.weights.copy(), p.mean.copy(), p.deviation.copy(), self.task)

    def assess(self) -> float:
        """Mean return of the present policy, which is kept if it is the best."""
        policy = self.snapshot()
        found = evaluate(policy, self.options.episodes, self.seed)
        self.count(found)
        value = float(found.returns.mean())
        score = self.rating(policy, value)
        if score > self.score:
            self.score, self.best, self.chosen, self.chosen_at = score, value, policy, self.epoch
        return value

    def rating(self, policy: LearnedPolicy, value: float) -> float:
        """The number that the best policy has most of: by default its mean return."""
        return value

    def count(self, found: Evaluation) -> None:
        """Count an evaluation; by default, the steps of training alone count."""

    def arrays(self) -> dict[str, Floats]:
        """By name, the arrays that training writes in place."""
        return {"weights": self.policy.weights}

    def state(self) -> dict[str, Any]:
        """The numbers, arrays and random state that `resume` needs."""
        numbers = {name: getattr(self, name) for name in self.NUMBERS}
        arrays = {name: array.copy() for name, array in self.arrays().items()}
        sim = self.task.sim
        task = {"dofs": list(sim.mechanism.dof_names), "mean_over": sim.mean_over, "control_step": self.task.knot_time}
        return {**numbers, **arrays, "rng": self.rng.bit_generator.state, "task": task}

    def resume(self, learned: Learned) -> None:
        """Go on where a run ended."""
        known = {"score": learned.state["best"], **learned.state}  # older files have no score
        for name in self.NUMBERS:
            setattr(self, name, known[name])
        for name, array in self.arrays().items():
            array[...] = learned.state[name]
        self.rng.bit_generator.state = learned.state["rng"]
        p = learned.policy
        self.chosen = LearnedPolicy(p.network, p.weights, p.mean, p.deviation, self.task)
