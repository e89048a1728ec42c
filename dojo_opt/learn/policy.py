"""LearnedPolicy: a function from states to inputs, compiled for one state and in NumPy for many."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dojo_opt.learn.network import Network, number_of, perceptron
from dojo_opt.learn.onnx_file import write_onnx
from dojo_opt.learn.task import Task
from sim.mechanism import checks
from sim.mechanism.brief import brief_repr

Floats = NDArray[np.float64]

__all__ = ["LearnedPolicy"]

_SPAN = 10.0  # standard deviations: scaled observations beyond are cut off, without a derivative


@dataclass
class LearnedPolicy:
    """a = s(network((o - mean) / deviation)), where s is tanh, or a clamp to [-1, 1] of linear policies.

        u = policy(x)                                               an input (nu,) [N, N m] for a state
        dojo.closed_loop(policy.controller, plant, 10.0, control_step=policy.task.knot_time)

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

    __repr__ = brief_repr

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

    def actions(self, observations: Floats, weights: Floats | None = None) -> Floats:
        """(n, nu) actions of rows of observations.

        Args:
            observations: (n, no).
            weights: (n, network.count) of each row, or none: those of the policy.

        Returns:
            (n, nu) actions in [-1, 1].
        """
        weights = self.weights if weights is None else weights
        return self.squashed(self.network.forward(weights, self.scaled(observations))[0])

    def action(self, observation: Floats) -> Floats:
        """(nu,) action of one observation.

        Args:
            observation: (no,).

        Returns:
            (nu,) action in [-1, 1].
        """
        sizes, work = self._buffers
        first = perceptron(sizes, self.weights, number_of(self.network.activation), self.scaled(observation), work)
        y = work[first : first + sizes[-1]]
        return np.clip(y, -1.0, 1.0) if self.linear else np.tanh(y)

    def __call__(self, x: ArrayLike) -> Floats:
        """Input (nu,) for a state (nx,) of the task: that of its simulator, followed by a command where it has one."""
        if self.task is None:
            raise ValueError("LearnedPolicy(x): a loaded policy has no task; LearnedPolicy.load(path, task)")
        state = checks.array("LearnedPolicy(x)", x, (self.task.nx,))
        return self.task.inputs(self.action(self.task.observe(state[None])[0][0]))

    def controller(self, time: float, x: Floats) -> Floats:
        """As `dojo.closed_loop` takes a controller.

        Args:
            time: not used [s].
            x: (nx,) state.

        Returns:
            (nu,) input [N, N m].
        """
        return self(x)

    def commanded(self, command: ArrayLike | Callable[[float], ArrayLike]) -> Callable[[float, Floats], Floats]:
        """A controller, as `dojo.closed_loop` takes one, that follows a command.

        Args:
            command: (task.commands,), or a function of time [s] with it.

        Returns:
            Function of (time, state (sim.nx,)) with the input (nu,) [N, N m].
        """

        def controller(time: float, x: Floats) -> Floats:
            return self(np.concatenate([x, np.asarray(command(time) if callable(command) else command)]))

        return controller

    @cached_property
    def _buffers(self) -> tuple[Any, Floats]:
        sizes = np.array(self.network.sizes, dtype=np.int64)
        return sizes, np.zeros(2 * max(self.network.sizes))

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
        shape = json.dumps({"sizes": self.network.sizes, "activation": self.network.activation})
        np.savez(path, network=shape, weights=self.weights, mean=self.mean, deviation=self.deviation)

    @classmethod
    def load(cls, path: str | Path, task: Task | None = None) -> LearnedPolicy:
        """Read a file that `save` wrote.

        Args:
            path: of the file.
            task: the task of the policy (default None).

        Returns:
            The policy.
        """
        with np.load(path, allow_pickle=False) as data:
            shape = json.loads(str(data["network"]))
            network = Network(tuple(shape["sizes"]), shape["activation"])
            return cls(network, data["weights"], data["mean"], data["deviation"], task)
