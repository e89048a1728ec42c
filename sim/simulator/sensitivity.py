"""Entries from Python to the derivatives by parameters, which are compiled on first use."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from sim.derivatives.parameters.directions import At, Effect, ParameterTerm
from sim.derivatives.parameters.height_columns import height_jacobian
from sim.derivatives.parameters.parameter_jacobian import parameter_jacobian
from sim.derivatives.parameters.parameters import ParameterPlan
from sim.derivatives.parameters.terrain_parameters import height_gradients
from sim.integrators.adjoint import Sweep, sweep
from sim.integrators.rollout import MotionBuffers, ParameterColumns, roll
from sim.mechanism.mechanism import Mechanism
from sim.model.interruptible_loops import pieces
from sim.model.record_columns import StepReport
from sim.simulator.engines.division import DIVISIBLE
from sim.simulator.engines.engine import REPORT, DividedStep, Engine, Rolled, contact_rows, refuse
from sim.simulator.link_kernels import link_heights, link_parameters
from solvers.status import Status
from solvers.types import Floats, Vector

_TWISTS = 12  # rows of scratch for twists at three configurations
_PIECE = 64  # steps whose (A, B) are kept at once
_NEAR, _LOOSE = 1e-4, 1e2  # how near to the state of a motion its step has to end again: so far, or times the tolerance


def parameter_columns(
    engine: Engine, mech: Mechanism, step: tuple[Vector, Vector], A: Floats, plan: ParameterPlan
) -> Floats:
    """d(next state)/d(parameters), (ndx, n), right after `linearize_one` of the step (x, u) with the result A."""
    x, u = step
    out = np.zeros((engine.ndx, plan.size))
    nq = engine.sizes.nq
    at = At(engine.settings.time_step, x[:nq], x[nq:], u, np.zeros((_TWISTS, 6)), np.zeros(engine.sizes.nbody))
    model, data = engine.tables(link_parameters)
    if len(plan.weights):
        parameter_jacobian(model, data, at, A, plan.terms, plan.weights, out)
    if len(plan.heights):
        places = np.zeros((engine.ndx, 3 * (engine.sizes.ncontact - engine.sizes.npair)))
        coefficients = np.zeros((engine.ndx, engine.sizes.nheight))
        height_jacobian(model, data, at, places, coefficients)
        _add_heights(mech, plan, coefficients, out)
    return out


def adjoint_products(engine: Engine, line: Sweep, kappa: float | None, near: float) -> int:
    """The sweep by state and input where steps are not one kernel, from (A, B) of a piece of the trajectory at a time:

    l_T = dL/dx_T,    l_t = A_t^T l_t+1 + dL/dx_t,    dL/du_t = B_t^T l_t+1;  the step that was not solved, or -1.
    """
    costate = line.loss[-1]
    for last in range(len(line.us), 0, -_PIECE):
        first = max(last - _PIECE, 0)
        A, B, x_next, reports = engine.linearize(
            line.xs[first : last + 1], line.us[first:last], 1, kappa, None, line.wrenches[first:last]
        )
        for t in range(last - 1, first - 1, -1):
            line.report[0] = reports[t - first]
            solved = reports[t - first, StepReport.STATUS] == Status.SOLVED
            if solved and not _is_near(x_next[t - first], line.xs[t + 1], near):
                line.report[0, StepReport.STATUS] = Status.OTHER_SOLUTION
            if line.report[0, StepReport.STATUS] != Status.SOLVED:
                return t
            line.inputs[t] = B[t - first].T @ costate
            costate = A[t - first].T @ costate + line.loss[t]
    line.costate[0] = costate
    return -1


class Request(NamedTuple):
    """Requested parameters of a simulator."""

    mechanism: Mechanism
    plan: ParameterPlan
    # d(x over another interval)/d(parameters), (ndx, n), of (x, its interval, the other one)
    change: Callable[[Vector, float, float], Floats]

    def of_parts(self, parts: int) -> Request:
        """Request for the parts of a step, which last 1/parts of a time step."""
        weights = self.plan.weights.copy()
        weights[self.plan.terms[:, ParameterTerm.EFFECT] == Effect.TIME_STEP] /= parts
        return self._replace(plan=self.plan._replace(weights=weights))


class StepSlopes(NamedTuple):
    """Derivatives of one step."""

    A: Floats  # (ndx, ndx)
    B: Floats  # (ndx, nu)
    x_next: Vector  # (nx,)
    report: Vector  # (9,)
    J: Floats  # (ndx, n) by parameters; zeros where the step was not solved


def step_slopes(
    engine: Engine, request: Request, step: tuple[Vector, Vector, Floats], kappa: float | None
) -> StepSlopes:
    """Derivatives of the step (state, input, external wrenches (1 or 0, nbody, 6)), divided where necessary."""
    x, u, external = step
    A, B, x_next, reports = Engine.linearize(engine, x[None], u[None], 1, kappa, None, external)
    if reports[0, StepReport.STATUS] != Status.SOLVED:
        return divided_slopes(engine, request, step, reports[0], kappa)
    J = parameter_columns(engine, request.mechanism, (x, u), A[0], request.plan)
    return StepSlopes(A[0], B[0], x_next[0], reports[0], J)


def divided_slopes(
    engine: Engine,
    request: Request,
    step: tuple[Vector, Vector, Floats],
    report: Vector,
    kappa: float | None,
) -> StepSlopes:
    """Derivatives of a step that could not be solved as a whole, for the reason in `report` (9,).

    Where division does not solve it either, the report stays and the derivatives are zero.
    """
    x, u, external = step
    divided = None
    if int(report[StepReport.STATUS]) in DIVISIBLE:
        divided = engine.divide(x, u, external, kappa, derivatives=True)
    if divided is not None:
        return _products(engine, request, step, divided, kappa)
    A, B = np.zeros((engine.ndx, engine.ndx)), np.zeros((engine.ndx, engine.nu))
    return StepSlopes(A, B, x, report, np.zeros((engine.ndx, request.plan.size)))


def _products(
    engine: Engine, request: Request, step: tuple[Vector, Vector, Floats], divided: DividedStep, kappa: float | None
) -> StepSlopes:
    """Of a divided step: the products of those of its parts and of the conversions at both ends."""
    x, u, external = step
    parts, h = divided.parts, divided.engine.settings.time_step
    first, last = divided.rolled.xs[0], divided.rolled.xs[-1]
    path = first, np.repeat(u[None], parts, axis=0), np.repeat(external, parts, axis=0)
    level = None if kappa is None else kappa / parts
    rolled, Js = roll_parameters(divided.engine, request.of_parts(parts), path, level)
    ahead, back = engine.conversions(x, divided)
    A, B, J = ahead, np.zeros((engine.ndx, engine.nu)), request.change(x, engine.states.interval(x), h)
    for dx, du, dp in zip(rolled.A, rolled.B, Js, strict=True):
        A, B, J = dx @ A, dx @ B + du, dx @ J + dp
    J = back @ J + request.change(last, h, engine.states.interval(divided.x))
    return StepSlopes(back @ A, back @ B, divided.x, divided.report(), J)


def roll_parameters(
    engine: Engine, request: Request, path: tuple[Vector, Floats, Floats], kappa: float | None
) -> tuple[Rolled, Floats]:
    """A rollout with its derivatives, and d(next state)/d(parameters) (T, ndx, n).

    path: state, inputs, external wrenches (T or 0, nbody, 6).
    """
    x, us, wrenches = path
    n = len(us)
    xs, reports = np.zeros((n + 1, engine.nx)), np.zeros((n, REPORT))
    A, B = np.zeros((n, engine.ndx, engine.ndx)), np.zeros((n, engine.ndx, engine.nu))
    J = np.zeros((n, engine.ndx, request.plan.size))
    xs[0], knot = x, 0
    in_one_loop = not len(request.plan.heights)  # their columns are made in Python
    while knot < n:
        if in_one_loop:
            motion = MotionBuffers(
                xs[knot:], us[knot:], wrenches[knot:], reports[knot:], engine.no_outputs[0], A[knot:], B[knot:]
            )
            knot += _whole_steps(engine, request.plan, motion, J[knot:], kappa)
            if knot == n:
                break
        step = xs[knot], us[knot], wrenches[knot : knot + 1]
        if in_one_loop:
            found = divided_slopes(engine, request, step, reports[knot], kappa)
        else:
            found = step_slopes(engine, request, step, kappa)
        A[knot], B[knot], xs[knot + 1], reports[knot], J[knot] = found
        if reports[knot, StepReport.STATUS] == Status.SOLVED and not np.isfinite(J[knot]).all():
            reports[knot, StepReport.STATUS] = Status.NOT_FINITE
        if reports[knot, StepReport.STATUS] != Status.SOLVED:
            break
        knot += 1
    contacts = contact_rows(engine.sizes, 0)
    return Rolled(knot, xs, reports, contacts, A, B), J


def _whole_steps(engine: Engine, plan: ParameterPlan, motion: MotionBuffers, J: Floats, kappa: float | None) -> int:
    """The number of steps, from the first one on, that are solved as a whole, with their derivatives."""
    steps, done = len(motion.us), 0
    model, data = engine.tables(link_parameters)
    scratch = np.zeros((_TWISTS, 6)), np.zeros(engine.sizes.nbody)
    columns = ParameterColumns(plan.terms, plan.weights, J, *scratch) if len(plan.weights) else None
    settings = engine.settings.array(kappa)
    for _ in pieces(settings, steps):
        done = int(roll(model, data, settings, motion, done, columns, None))
        if done == steps or motion.reports[done, StepReport.STATUS] != Status.SOLVED:
            break
    return refuse(motion.reports, done, motion.A[:done], motion.B[:done], J[:done])


def _add_heights(mech: Mechanism, plan: ParameterPlan, coefficients: Floats, out: Floats) -> None:
    """out (n, nparameter) += derivatives by heights of terrains, from those by coefficients."""
    heights, columns = plan.heights.T
    found = height_gradients(mech, coefficients)[:, heights] * plan.height_weights
    np.add.at(out.T, columns, found.T)


def adjoint_sweep(
    engine: Engine,
    request: Request,
    path: tuple[Floats, Floats, Floats | None],
    loss: Floats,
    kappa: float | None,
) -> tuple[int, Sweep]:
    """(the step that was not solved or -1, gradients) of a loss with the gradient `loss` by the states of the path.

    path: states, inputs, external wrenches.
    """
    xs, us, wrenches = path
    sizes, plan = engine.sizes, request.plan
    line = Sweep(
        xs=xs,
        us=us,
        wrenches=engine.external(wrenches),
        loss=loss,
        A=np.empty((1, engine.ndx, engine.ndx)),
        B=np.empty((1, engine.ndx, engine.nu)),
        x_next=np.empty((1, engine.nx)),
        report=np.zeros((1, REPORT)),
        costate=np.zeros((2, engine.ndx)),
        inputs=np.zeros((len(us), engine.nu)),
        parameters=np.zeros(plan.size),
        w=np.zeros(sizes.nv),
        y=np.zeros(sizes.nv + sizes.nrow),
        twists=np.zeros((_TWISTS, 6)),
        below=np.zeros(sizes.nbody),
        places=np.zeros((1, 3 * (sizes.ncontact - sizes.npair))),
        heights=np.zeros((1, sizes.nheight if len(plan.heights) else 0)),
    )
    known = kappa is None or kappa == engine.settings.kappa  # otherwise the steps end elsewhere
    near = max(_NEAR, _LOOSE * engine.settings.tolerance) if known else np.inf
    if not engine.in_one_kernel:
        return adjoint_products(engine, line, kappa, near), line
    needs = (link_parameters, link_heights) if len(plan.heights) else (link_parameters,)
    model, data = engine.tables(*needs[: 2 if plan.size else 0])
    settings, left = engine.settings.array(kappa), len(us)
    line.costate[0] = loss[-1]
    while left:
        for _ in pieces(settings, left):
            left = int(sweep(model, data, settings, line, plan.terms, plan.weights, left, near))
            if left == 0 or line.report[0, StepReport.STATUS] != Status.SOLVED:
                break
        if left == 0 or not _sweep_again(engine, request, line, kappa, left - 1, near):
            break
        left -= 1
    if len(plan.heights):
        _add_heights(request.mechanism, plan, line.heights, line.parameters[None])
    return left - 1, line


def _sweep_again(engine: Engine, request: Request, line: Sweep, kappa: float | None, t: int, near: float) -> bool:
    """The sweep over step t, which was not solved, or had another solution; False where it stays so."""
    step = line.xs[t], line.us[t], line.wrenches[t : t + 1]
    for slopes in _all_slopes(engine, request, step, line.report[0], kappa):
        if slopes.report[StepReport.STATUS] != Status.SOLVED:
            line.report[0] = slopes.report
            continue
        if not _is_near(slopes.x_next, line.xs[t + 1], near):
            line.report[0, StepReport.STATUS] = Status.OTHER_SOLUTION
            continue
        line.report[0] = 0.0
        costate = line.costate[0].copy()
        line.inputs[t] = slopes.B.T @ costate
        line.parameters[:] += slopes.J.T @ costate
        line.costate[0] = slopes.A.T @ costate + line.loss[t]
        return True
    return False


def _all_slopes(
    engine: Engine, request: Request, step: tuple[Vector, Vector, Floats], report: Vector, kappa: float | None
) -> Iterator[StepSlopes]:
    """Derivatives of all solutions of a step that are found, after one that ended as in `report` (9,).

    Where that was not solved, the step is divided; where it was another solution than that of the motion, the step
    begins as it does alone. If these are others, too, it is divided in all ways.
    """
    if report[StepReport.STATUS] == Status.OTHER_SOLUTION:
        yield step_slopes(engine, request, step, kappa)
    else:
        found = divided_slopes(engine, request, step, report.copy(), kappa)
        yield found
        if found.report[StepReport.STATUS] != Status.SOLVED:
            return
    for divided in engine.divisions(*step, kappa):
        yield _products(engine, request, step, divided, kappa)


def _is_near(x: Vector, goal: Vector, near: float) -> bool:
    """As in adjoint.py."""
    return bool(np.abs(x - goal).max() <= near * max(1.0, np.abs(goal).max()))
