"""PolicyController: a policy in closed loop, with the command and the forces of contacts that its task wants."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.learn.task import Task
from sim.mechanism import checks
from sim.simulator.contact_groups import ContactGroups
from sim.simulator.simulator import Simulator
from solvers.types import Floats

__all__ = ["PolicyController"]

_COMMAND = "LearnedPolicy.commanded(command)"
Command = ArrayLike | Callable[[float], ArrayLike]


class PolicyController:
    """u = policy([x; command; forces of contacts]) as `dojo.closed_loop` takes a controller.

    The loop tells it the contacts of every step of the plant (`feel`), from which it computes the forces of the `touch`
    groups of the task. They are zero at first.

    Args:
        policy: function of a state (task.nx,) of the task with the input (nu,) [N, N m].
        task: its task.
        command: (task.commands,), or a function of time [s] with it.

    Raises:
        ValueError: a command of the wrong shape.
    """

    def __init__(self, policy: Callable[[Floats], Floats], task: Task, command: Command = ()) -> None:
        if not callable(command):
            command = checks.array(_COMMAND, command, (task.commands,)).copy()
        self._policy, self._task, self._command = policy, task, command
        self._felt: Floats | None = None if task.touch else np.zeros(0)
        self._groups: ContactGroups | None = None

    @property
    def sim(self) -> Simulator:
        """The simulator of the task."""
        return self._task.sim

    @property
    def control_step(self) -> float:
        """Time for which an input is held, that of an action of the task [s]."""
        return self._task.knot_time

    def __repr__(self) -> str:
        return f"PolicyController({self._task.name})"

    def reset(self) -> None:
        """Forget the forces."""
        self._felt = np.zeros(6 * len(self._task.touch))

    def feel(self, sim: Simulator, x: Floats, rows: Floats) -> None:
        """Take the contacts of the last step of the plant.

        Args:
            sim: simulator of the plant.
            x: (nx,) its state after the step.
            rows: (ncontact, 11) its contacts, of `ContactRow`.
        """
        if not self._task.touch:
            return
        if self._groups is None or self._groups.sim is not sim:
            self._groups = ContactGroups(sim, self._task.touch)
        self._felt = self._groups.of_rows(x[None], rows[None]).ravel()

    def __call__(self, time: float, x: Floats) -> Floats:
        """The input.

        Args:
            time: [s], of the command.
            x: (sim.nx,) state.

        Returns:
            (nu,) input [N, N m].

        Raises:
            ValueError: a wrong shape, or forces of contacts that nobody told.
        """
        if self._felt is None:
            raise ValueError(
                "PolicyController: the task has forces of contacts (touch=...), which dojo.closed_loop tells; in a "
                "loop of your own call reset() at first, and feel(...) after every step"
            )
        given = self._command(time) if callable(self._command) else self._command
        return self._policy(np.concatenate([x, checks.array(_COMMAND, given, (self._task.commands,)), self._felt]))
