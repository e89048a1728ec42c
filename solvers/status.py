"""Status: why a computation ended, and one sentence for each reason."""

from __future__ import annotations

from enum import IntEnum

__all__ = ["MESSAGES", "Status"]


class Status(IntEnum):
    """Exit of a time step (below 10), of the planner (10 and above), or of both; `IntEnum`, so kernels return it."""

    SOLVED = 0
    MAX_ITERATIONS = 1
    NO_PROGRESS = 2
    NOT_FINITE = 3
    SINGULAR = 4
    ANGULAR_STEP = 5
    LOOP_STEP = 6
    COLLISION_STEP = 7
    ENERGY_STEP = 8
    JOINT_STEP = 8  # deprecated name
    CONTACT_SUNK = 9
    MAX_REGULARIZATION = 10
    LINE_SEARCH = 11
    TIME_LIMIT = 12
    SIMULATION_FAILED = 13
    INFEASIBLE = 14
    STOPPED = 15
    INTERRUPTED = 16

    def __str__(self) -> str:
        """The name, where an IntEnum prints its number."""
        return self.name


MESSAGES: dict[Status, str] = {
    Status.SOLVED: "Solved to the requested tolerance.",
    Status.MAX_ITERATIONS: "The iteration limit was reached before the tolerance.",
    Status.NO_PROGRESS: "The time step found no way to its tolerance; a smaller one may.",
    Status.NOT_FINITE: "A number that is not finite appeared.",
    Status.SINGULAR: "A matrix was singular, or not positive definite where it has to be.",
    Status.ANGULAR_STEP: "A body turns by half a turn or more in one time step; use a smaller time step.",
    Status.LOOP_STEP: "A loop passes a singular configuration faster than time steps can follow; use smaller ones.",
    Status.COLLISION_STEP: "Shapes pass through one another, or gain energy, in what was found; use smaller steps.",
    Status.ENERGY_STEP: "Every solution found gains energy, since bodies turn too far in one step; use smaller steps.",
    Status.CONTACT_SUNK: "A contact is below the ground, and its joints let no motion lift it out.",
    Status.MAX_REGULARIZATION: "No positive definite control Hessian up to the largest regularisation.",
    Status.LINE_SEARCH: "No step size of the line search improves the plan.",
    Status.TIME_LIMIT: "The time budget is used up.",
    Status.SIMULATION_FAILED: "The simulator could not step along the trajectory.",
    Status.INFEASIBLE: "The constraints are still violated after the last penalty increase.",
    Status.STOPPED: "The callback stopped the solver.",
    Status.INTERRUPTED: "Ctrl-C ended it before it was done.",
}
