"""One time step: begin, solve, check, write. This is the table of contents of the physics."""

from __future__ import annotations

from sim.contact.contact_report import worst_contact
from sim.dynamics.loops.closure import start_loops
from sim.dynamics.loops.loop_work import loops_gained
from sim.dynamics.momentum_balance import begin_step, ends_below_half
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import Guess, Outcome, StepOptions
from sim.model.record_columns import StepReport
from sim.model.slots import Slot
from sim.solve.energy_balance import step_gained
from sim.solve.loop_branch import solve_loops
from sim.solve.solve_step import solve_step
from solvers.compiler import inlined, optional
from solvers.status import Status
from solvers.types import Vector


@optional(Slot.STEP, default=int(Status.NOT_FINITE))
def step(
    model: Model, data: Data, options: StepOptions, x: Vector, u: Vector, guess: Guess, out: Vector, report: Vector
) -> int:
    """out = state after one step from x = (q, v) under the input u; returns the Status.

    guess: of the next velocity, x[nq:] when nothing better is known.
    report: columns of StepReport, of which the first five are written. `out` holds the last iterate if the status is
    not SOLVED; do not use it.
    """
    nq = data.theta1.shape[0]
    q = x[:nq]
    v = x[nq:]
    r = Outcome(Status.TURN_TOO_LARGE.value, 0, 1e300, 0.0)
    if begin_step(model, data, options.h, q, v, u):
        start_loops(model, data, guess.impulses)
        if model.loop_ntrans.shape[0] > 0:
            r = solve_loops(model, data, options, q, v, u, guess)
        else:
            r = solve_step(model, data, options, q, v, u, guess)
        r = _checked(model, data, options, (q, v, u), r)
    _look_ahead(data, v)
    status = _write(data, r, out)
    report[StepReport.STATUS] = status
    report[StepReport.ITERATIONS] = r.iterations
    report[StepReport.RESIDUAL] = r.residual
    report[StepReport.VIOLATION] = r.violation
    report[StepReport.WORST] = -1.0
    if status != Status.SOLVED and r.iterations > 0:
        report[StepReport.WORST] = worst_contact(model, data, options.kappa)
    data.carry.steps[0] = data.carry.steps[0] + 1 if status == Status.SOLVED else 0
    return status


@inlined
def _checked(
    model: Model, data: Data, options: StepOptions, inputs: tuple[Vector, Vector, Vector], r: Outcome
) -> Outcome:
    """The outcome of a step, refused where the forces of loops gave energy (loop_work.py), it gained some, or it ends
    so fast that no other step could begin there.

    inputs: (q, v, u). The interior point checks the gain for every solution.
    """
    if r.status == Status.SOLVED and loops_gained(model, data, options, inputs[1]):
        return Outcome(Status.LOOP_SINGULAR.value, r.iterations, r.residual, r.violation)
    smooth = model.contact_body.shape[0] + model.limit_dof.shape[0] + model.dry_dof.shape[0] == 0
    if r.status == Status.SOLVED and smooth and step_gained(model, data, options, inputs):
        return Outcome(Status.ENERGY_GAIN.value, r.iterations, r.residual, r.violation)
    if r.status == Status.SOLVED and not ends_below_half(model, data, options.h):
        return Outcome(Status.TURN_TOO_LARGE.value, r.iterations, r.residual, r.violation)
    return r


@inlined
def _look_ahead(data: Data, v: Vector) -> None:
    """Extrapolate the velocity from v and that of this step: where the next one looks first (known_start.py)."""
    for d in range(v.shape[0]):
        data.carry.next_velocity[d] = 2.0 * data.nu[d] - v[d]


@inlined
def _write(data: Data, r: Outcome, out: Vector) -> int:
    """out = (q3, v25); returns the status, NOT_FINITE where a component is not."""
    nq = data.theta3.shape[0]
    total = 0.0
    for k in range(nq):
        out[k] = data.theta3[k]
        total += out[k]
    for k in range(data.nu.shape[0]):
        out[nq + k] = data.nu[k]
        total += out[nq + k]
    return r.status if abs(total) < 1e300 else Status.NOT_FINITE.value
