"""The unknown of a step: the velocity v25 between configurations 2 and 3."""

from __future__ import annotations

from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import Guess, Outcome, StepOptions
from sim.solve.interior_point import interior_point
from sim.solve.newton import newton
from solvers.compiler import kernel
from solvers.types import Vector


@kernel
def solve_step(
    model: Model, data: Data, options: StepOptions, q: Vector, v: Vector, u: Vector, guess: Guess
) -> Outcome:
    """Solve the equations of the step that `begin_step` began; data.nu is its velocity.

    The interior point solves scenes with contacts or limits, Newton's method the others; a scene links one of them.
    """
    if model.contact_body.shape[0] + model.limit_dof.shape[0] + model.dry_dof.shape[0] > 0:
        return interior_point(model, data, options, q, v, u, guess)
    return newton(model, data, options, q, v, u, guess)
