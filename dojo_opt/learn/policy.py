"""LearnedPolicy: a function from states to inputs, compiled for one state and in NumPy for many."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.learn.network import Network, number_of, perceptron
from dojo_opt.learn.onnx_file import write_onnx
from dojo_opt.learn.policy_controller import Command, PolicyController
from dojo_opt.learn.task import Task
from dojo_opt.planning.same_robot import check_same_names
from sim.mechanism import checks
from sim.mechanism.short_repr import short_repr
from sim.simulator.npz_file import check_head, check_shapes, read_npz, reading, write_npz
from solvers.types import Floats, Integers

__all__ = ["LearnedPolicy", "policy_head", "policy_of"]

_SPAN = 10.0  # standard deviations: scaled observations beyond are cut off, without a derivative


@dataclass
class LearnedPolicy:
    """a = s(network((o - mean) / deviation)), where s is tanh, or a clamp to [-1, 1] of linear policies.

        u = policy(x)                                               an input (nu,) [N, N m] for a state
        dojo.closed_loop(policy.controller, plant, 10.0)            held for an action of the task

    Attributes:
        network: shape of the network.
        weights: (network.count,) its weights.
        mean: (no,) of observations.
        deviation: (no,) of observations, above 0.
        task: the Task; not saved.
    """

    network: Network
    weights: Floats
    mean: Floats
    deviation: Floats
    task: Task | None = field(default=None, repr=False)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        sizes = self.network.sizes
        for name, length in (("weights", self.network.count), ("mean", sizes[0]), ("deviation", sizes[0])):
            if np.shape(getattr(self, name)) != (length,):
                raise ValueError(
                    f"LearnedPolicy({name}=...): expected shape ({length},) for a network of {sizes}, got "
                    f"{np.shape(getattr(self, name))}"
                )
        if self.task is not None and (sizes[0], sizes[-1]) != (self.task.observations, self.task.sim.nu):
            raise ValueError(
                f"LearnedPolicy(task=...): expected a task with {sizes[0]} observations and {sizes[-1]} inputs, got "
                f"{self.task.observations} and {self.task.sim.nu}"
            )

    def scaled(self, observations: Floats) -> Floats:
        """Scaled and limited to ten standard deviations.

        Args:
            observations: (..., no).

        Returns:
            (..., no) numbers from -10 to 10.
        """
        return np.clip((observations - self.mean) / self.deviation, -_SPAN, _SPAN)

    @property
    def linear(self) -> bool:
        """Whether the network has no hidden layer."""
        return len(self.network.sizes) == 2

    def squashed(self, outputs: Floats) -> Floats:
        """Actions from outputs of the network.

        Args:
            outputs: (..., nu).

        Returns:
            (..., nu) in [-1, 1].
        """
        return np.clip(outputs, -1.0, 1.0) if self.linear else np.tanh(outputs)

    def actions(self, observations: Floats, weights: Floats | None = None, noise: Floats | float = 0.0) -> Floats:
        """(n, nu) actions of rows of observations.

        Args:
            observations: (n, no).
            weights: (n, network.count) of each row, or none: those of the policy.
            noise: of the observations, in their standard deviations, a number or (n, no) (default 0).

        Returns:
            (n, nu) actions in [-1, 1].
        """
        weights = self.weights if weights is None else weights
        return self.squashed(self.network.forward(weights, self.scaled(observations) + noise)[0])

    def action(self, observation: Floats) -> Floats:
        """(nu,) action of one observation.

        Args:
            observation: (no,).

        Returns:
            (nu,) action in [-1, 1].
        """
        sizes = self._sizes
        work = np.zeros(2 * int(sizes.max()))  # of this call: a policy may act in several threads
        first = perceptron(sizes, self.weights, number_of(self.network.activation), self.scaled(observation), work)
        y = work[first : first + sizes[-1]]
        return np.clip(y, -1.0, 1.0) if self.linear else np.tanh(y)

    def __call__(self, x: ArrayLike) -> Floats:
        """Input (nu,) for a state (nx,) of the task: that of its simulator, followed by a command where it has one."""
        task = self._known_task("LearnedPolicy(x)")
        state = checks.array("LearnedPolicy(x)", x, (task.nx,))
        return task.inputs(self.action(task.observe_one(state)))

    @property
    def controller(self) -> PolicyController:
        """As `dojo.closed_loop` takes one: a function of (time, state (sim.nx,)) that returns the input (nu,) [N, N m].

        The loop tells it the forces of contacts that tasks with `touch` want. Tasks with a command need `commanded`.
        """
        return self.commanded(())

    def commanded(self, command: Command) -> PolicyController:
        """A controller, as `dojo.closed_loop` takes one, that follows a command.

        Args:
            command: (task.commands,), or a function of time [s] with it.

        Returns:
            Function of (time, state (sim.nx,)) with the input (nu,) [N, N m].

        Raises:
            ValueError: a command of the wrong shape, or a policy without a task.
        """
        task = self._known_task("LearnedPolicy.commanded(command)")
        return PolicyController(self, task, command)

    def _known_task(self, call: str) -> Task:
        if self.task is None:
            raise ValueError(f"{call}: a loaded policy has no task; LearnedPolicy.load(path, task)")
        return self.task

    @cached_property
    def _sizes(self) -> Integers:
        return np.array(self.network.sizes, dtype=np.int64)

    def export_onnx(self, path: str | Path) -> None:
        """Write the policy as an ONNX model: "observation" (n, no) to "action" (n, nu) in [-1, 1], both float32.

        Args:
            path: of the file.

        Raises:
            ImportError: without onnx (`pip install "dojo-opt[onnx]"`).
        """
        write_onnx(self.network, self.weights, (self.mean, self.deviation), path)

    def save(self, path: str | Path) -> None:
        """Write the policy to an .npz file, which NumPy reads without this package.

        Args:
            path: of the file.
        """
        shape = policy_head(self)
        arrays = {"weights": self.weights, "mean": self.mean, "deviation": self.deviation}
        write_npz("LearnedPolicy.save(path)", path, shape, arrays, "network")

    @classmethod
    def load(cls, path: str | Path, task: Task | None = None) -> LearnedPolicy:
        """Read a file that `save` wrote.

        Args:
            path: of the file.
            task: the task of the policy (default None).

        Returns:
            The policy.

        Raises:
            OSError: the file cannot be read.
            ValueError: it is another file, damaged, or its policy does not fit the task.
        """
        call = "LearnedPolicy.load"
        with reading(call, path, "policy"):
            shape, arrays = read_npz(call, path, "network")
            alone = policy_of(shape, arrays, None)
        _check_robot("LearnedPolicy.load(task=...)", shape, task)
        return replace(alone, task=task)


def policy_head(policy: LearnedPolicy) -> dict[str, Any]:
    """The head of the file of a policy.

    Args:
        policy: the policy.

    Returns:
        What `policy_of` reads beside the arrays, with the names of the robot's degrees of freedom if its task is known.
    """
    head = {"sizes": policy.network.sizes, "activation": policy.network.activation}
    return head if policy.task is None else head | {"dofs": policy.task.sim.mechanism.dof_names}


def _check_robot(call: str, shape: Mapping[str, Any], task: Task | None) -> None:
    """Refuse a task of another robot than that of a file which names it."""
    if task is not None and "dofs" in shape:
        check_same_names(call, shape["dofs"], task.sim.mechanism.dof_names)


def policy_of(shape: Mapping[str, Any], arrays: Mapping[str, Any], task: Task | None) -> LearnedPolicy:
    """The policy of a file.

    Args:
        shape: {"sizes": of the layers, "activation": name, "dofs": of the robot, if it is known}.
        arrays: "weights", "mean" and "deviation".
        task: the task of the policy, if it is known.

    Returns:
        The policy.

    Raises:
        ValueError: an entry is missing, or does not fit the others or the robot of the task.
    """
    check_head(shape, {"sizes": list, "activation": str} | ({"dofs": list} if "dofs" in shape else {}))
    _check_robot("task", shape, task)
    network = Network(tuple(shape["sizes"]), shape["activation"])
    lengths = {"weights": network.count, "mean": network.sizes[0], "deviation": network.sizes[0]}
    check_shapes(arrays, {name: (length,) for name, length in lengths.items()})
    weights, mean, deviation = (checks.array(name, arrays[name], (length,)) for name, length in lengths.items())
    if not np.all(deviation > 0.0):
        raise ValueError("array deviation: expected numbers > 0")
    return LearnedPolicy(network, weights, mean, deviation, task)
