"""check_same_robot: refuses motions of another robot than that of a task."""

from __future__ import annotations

from sim.simulator.simulator import Simulator
from solvers.types import Matrix

__all__ = ["check_same_robot"]


def check_same_robot(call: str, task: str, sim: Simulator, other: Simulator | None, x: Matrix) -> None:
    """Refuse a motion whose coordinates are not those of a task.

    Args:
        call: beginning of the message.
        task: name of the task.
        sim: simulator of the task.
        other: simulator of the motion, None where it is not known.
        x: (N + 1, nx) states of the motion.

    Raises:
        ValueError: the names of the degrees of freedom, or the size of the states, are others.
    """
    own, theirs = sim.mechanism.dof_names, None if other is None else other.mechanism.dof_names
    if x.shape[1] == sim.nx and theirs in (None, own):
        return
    name = "" if other is None else f" of {other.mechanism.name!r}"
    raise ValueError(
        f"{call} of {task!r}, with the coordinates of {sim.mechanism.name!r} and states of {sim.nx} numbers, got one"
        f"{name} with states of {x.shape[1]}"
    )
