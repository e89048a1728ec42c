"""Status: the reason for the end of a computation, and one sentence for each."""

from __future__ import annotations

import warnings

from solvers.codes import Code

__all__ = ["MESSAGES", "Status"]


class _Old:
    """A member under its old name, which works for one version and warns."""

    def __init__(self, new: str) -> None:
        self._new = new

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, instance: object, owner: type[Status]) -> Status:
        text = f"Status.{self._name} is now Status.{self._new}; the old name goes with version 0.2"
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return owner[self._new]


class Status(Code):
    """Exit of a time step, of the planner, or of both; kernels return it as a number."""

    # of both
    SOLVED = 0
    MAX_ITERATIONS = 1
    NO_PROGRESS = 2
    NOT_FINITE = 3
    SINGULAR = 4
    # of a time step
    TURN_TOO_LARGE = 5
    LOOP_SINGULAR = 6
    SHAPES_CROSSED = 7
    ENERGY_GAIN = 8
    CONTACT_SUNK = 9
    # of the planner
    MAX_REGULARIZATION = 10
    LINE_SEARCH = 11
    TIME_LIMIT = 12
    SIMULATION_FAILED = 13
    INFEASIBLE = 14
    STOPPED = 15
    # of any call
    INTERRUPTED = 16
    # of a time step of a given accuracy
    ACCURACY_NOT_REACHED = 17
    # of a fit
    NOT_EXPLAINED = 18
    # of the gradient of a motion
    OTHER_SOLUTION = 19

    ANGULAR_STEP = _Old("TURN_TOO_LARGE")
    LOOP_STEP = _Old("LOOP_SINGULAR")
    COLLISION_STEP = _Old("SHAPES_CROSSED")
    ENERGY_STEP = _Old("ENERGY_GAIN")
    TOLERANCE_STEP = _Old("ACCURACY_NOT_REACHED")

    def __str__(self) -> str:
        """The name, where an IntEnum prints its number."""
        return self.name


MESSAGES: dict[Status, str] = {
    Status.SOLVED: "Solved to the requested tolerance.",
    Status.MAX_ITERATIONS: "The iteration limit was reached before the tolerance.",
    Status.NO_PROGRESS: "The time step did not converge to its tolerance; try a smaller one.",
    Status.NOT_FINITE: "A number is not finite.",
    Status.SINGULAR: "A matrix is singular, or not positive definite as required.",
    Status.TURN_TOO_LARGE: "A body turns by half a turn or more in one time step; use a smaller time step.",
    Status.LOOP_SINGULAR: "A loop passes a singular configuration too fast for the time step; use a smaller one.",
    Status.SHAPES_CROSSED: "Shapes pass through one another or gain energy in every solution found; use smaller steps.",
    Status.ENERGY_GAIN: "Every solution found gains energy: bodies turn too far in one step; use smaller steps.",
    Status.CONTACT_SUNK: "A contact is below the ground, and no motion of its joints can lift it out.",
    Status.MAX_REGULARIZATION: "No positive definite control Hessian up to the largest regularisation.",
    Status.LINE_SEARCH: "No step size of the line search improves the plan.",
    Status.TIME_LIMIT: "The time limit was reached.",
    Status.SIMULATION_FAILED: "The simulator could not solve the steps of the trajectory.",
    Status.INFEASIBLE: "The constraints are still violated after the last penalty increase.",
    Status.STOPPED: "The callback stopped the solver.",
    Status.ACCURACY_NOT_REACHED: "The shortest step is too long for the requested accuracy; request a lower accuracy.",
    Status.NOT_EXPLAINED: "The predictions miss too many measurements by far more than the noise: do not trust the "
    "values; fit more parameters, give shorter windows, or end kappas=... with that of the motions.",
    Status.INTERRUPTED: "Ctrl-C interrupted the computation.",
    Status.OTHER_SOLUTION: "The step ends elsewhere than in the motion: it has several solutions, or the states "
    "are not those of this simulator.",
}
