"""Status: the reason for the end of a computation, and one sentence for each."""

from __future__ import annotations

from solvers.codes import Code

__all__ = ["MESSAGES", "Status"]


class Status(Code):
    """Exit of a time step (below 10, and TOLERANCE_STEP), of the planner, or of both; kernels return it as a number."""

    SOLVED = 0
    MAX_ITERATIONS = 1
    NO_PROGRESS = 2
    NOT_FINITE = 3
    SINGULAR = 4
    ANGULAR_STEP = 5
    LOOP_STEP = 6
    COLLISION_STEP = 7
    ENERGY_STEP = 8
    CONTACT_SUNK = 9
    MAX_REGULARIZATION = 10
    LINE_SEARCH = 11
    TIME_LIMIT = 12
    SIMULATION_FAILED = 13
    INFEASIBLE = 14
    STOPPED = 15
    INTERRUPTED = 16
    TOLERANCE_STEP = 17

    def __str__(self) -> str:
        """The name, where an IntEnum prints its number."""
        return self.name


MESSAGES: dict[Status, str] = {
    Status.SOLVED: "Solved to the requested tolerance.",
    Status.MAX_ITERATIONS: "The iteration limit was reached before the tolerance.",
    Status.NO_PROGRESS: "The time step did not converge to its tolerance; try a smaller one.",
    Status.NOT_FINITE: "A number is not finite.",
    Status.SINGULAR: "A matrix is singular, or not positive definite as required.",
    Status.ANGULAR_STEP: "A body turns by half a turn or more in one time step; use a smaller time step.",
    Status.LOOP_STEP: "A loop passes a singular configuration too fast for the time step; use a smaller one.",
    Status.COLLISION_STEP: "Shapes pass through one another or gain energy in every solution found; use smaller steps.",
    Status.ENERGY_STEP: "Every solution found gains energy: bodies turn too far in one step; use smaller steps.",
    Status.CONTACT_SUNK: "A contact is below the ground, and no motion of its joints can lift it out.",
    Status.MAX_REGULARIZATION: "No positive definite control Hessian up to the largest regularisation.",
    Status.LINE_SEARCH: "No step size of the line search improves the plan.",
    Status.TIME_LIMIT: "The time limit was reached.",
    Status.SIMULATION_FAILED: "The simulator could not solve the steps of the trajectory.",
    Status.INFEASIBLE: "The constraints are still violated after the last penalty increase.",
    Status.STOPPED: "The callback stopped the solver.",
    Status.TOLERANCE_STEP: "The shortest step is too long for the requested accuracy; request a lower accuracy.",
    Status.INTERRUPTED: "Ctrl-C interrupted the computation.",
}
