"""FeedbackLaw: a trajectory with gains, and the rollout that follows it.

The data of a plan make the steps of a rollout nearby cheap: derivatives predict its velocities,
and the cone variables of its steps are nearly those of the steps beside them. An iteration of the trot goes from 5 to 2
or 3 Newton iterations per step that way.
"""

from __future__ import annotations

from typing import NamedTuple

from sim.dynamics.external_forces import set_external
from sim.dynamics.state import integrate_state, state_difference
from sim.integrators.rollout import options_of
from sim.model.data import Data
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from sim.model.options import Guess
from sim.model.pace import is_due
from sim.step import step
from solvers.compiler import Table, inlined, kernel
from solvers.dense import copy, copy_vector, dot
from solvers.status import Status
from solvers.types import Cube, Matrix, Vector

_SOLVED = int(Status.SOLVED)


class FeedbackLaw(NamedTuple):
    """The target of a rollout: a trajectory, its gains, and warm starts of its steps; the last four may be empty."""

    xs: Matrix  # (T + 1, nx)
    us: Matrix  # (T, nu)
    wrenches: Cube  # (T, nbody, 6) external ones, held over a knot, or (0, nbody, 6)
    ks: Matrix  # (T, nu)
    Ks: Cube  # (T, nu, ndx)
    gaps: Matrix  # (T + 1, ndx)  f(xs_t, us_t) (-) xs_t+1
    A: Cube  # (T, ndx, ndx) derivatives of the steps: where the next velocity is looked for
    B: Cube  # (T, ndx, nu)
    cones: Cube  # (T, ncontact, 12) cone variables of the steps
    bounds: Cube  # (T, nlimit, 2)


# with the share of its steps that is taken, and limits of u
BoundedLaw = tuple[FeedbackLaw, float, tuple[Vector, Vector]]


class Path(NamedTuple):
    """Buffers of a rollout."""

    xs: Matrix  # (T + 1, nx)
    us: Matrix  # (T, nu)
    cones: Cube  # (T, ncontact, 12) or empty
    bounds: Cube
    report: Vector  # (7,) of the last step, and the iterations of all, which are those of the report in the end; zeros


@kernel
def _expected_velocity(policy: FeedbackLaw, t: int, dx: Vector, u: Vector, out: Vector) -> None:
    """out = velocity at knot t + 1 by the linear model of the policy, dx away from its state at knot t under u."""
    n = out.shape[0]
    last = policy.xs.shape[1] - n
    for i in range(n):
        out[i] = policy.xs[t + 1, last + i]
    if policy.A.shape[0] == 0:
        return
    for i in range(n):
        out[i] += policy.gaps[t + 1, n + i] + dot(policy.A[t, n + i], dx)
        row = policy.B[t, n + i]
        for j in range(u.shape[0]):
            out[i] += row[j] * (u[j] - policy.us[t, j])


@inlined
def _begin_knot(
    model: Model,
    data: Data,
    policy: FeedbackLaw,
    alpha: float,
    limits: tuple[Vector, Vector],
    path: Path,
    t: int,
) -> bool:
    """The input of knot t, and where its step looks first; returns whether the impulses of a step nearby are known."""
    u, (low, high) = path.us[t], limits
    dx = data.chain[0][: policy.gaps.shape[1]]
    state_difference(model, policy.xs[t], path.xs[t], dx)
    for j in range(u.shape[0]):
        f = policy.us[t, j] + alpha * policy.ks[t, j] + dot(policy.Ks[t, j], dx)
        u[j] = min(max(f, low[j]), high[j])
    _expected_velocity(policy, t, dx, u, data.step_x[1, data.theta1.shape[0] :])
    if policy.cones.shape[0] > 0:
        copy(policy.cones[t], data.cone)
        copy(policy.bounds[t], data.bound)
    return t > 0 or policy.cones.shape[0] > 0


@inlined
def _end_knot(model: Model, data: Data, policy: FeedbackLaw, alpha: float, path: Path, t: int) -> None:
    """Keep the cone variables where they are asked for, and close the gap of the plan in part."""
    b = path.xs[t + 1]
    if path.cones.shape[0] > 0:
        copy(data.cone, path.cones[t])
        copy(data.bound, path.bounds[t])
    if alpha < 1.0:
        dx = data.chain[0][: policy.gaps.shape[1]]
        for k in range(dx.shape[0]):
            dx[k] = (alpha - 1.0) * policy.gaps[t + 1, k]
        copy_vector(b, data.step_x[0])
        integrate_state(model, data.step_x[0], dx, b)


@kernel
def closed_loop(
    model_at: Table,
    data_at: Table,
    settings: Vector,
    law: BoundedLaw,
    substeps: int,
    path: Path,
    first: int,
) -> int:
    """Rollout from path.xs[0] under the policy of a backward pass, from the step `first` on, that many of all knots
    before it; returns the number of solved steps.

    u_t = clamp(us_t + alpha k_t + K_t (x_t (-) xs_t)),   x_t+1 = f(x_t, u_t) (+) (alpha - 1) gap_t+1
    """
    model = model_view(model_at)
    data = data_view(data_at)
    options = options_of(data, settings, first == 0)
    policy, alpha, limits = law
    nq = data.theta1.shape[0]
    velocity = data.step_x[1, nq:]
    knots = path.us.shape[0]
    for t in range(first // substeps, knots):
        u, b = path.us[t], path.xs[t + 1]
        before = max(first - t * substeps, 0)
        known = _begin_knot(model, data, policy, alpha, limits, path, t)
        set_external(data, policy.wrenches, t)
        if before == 0:
            copy_vector(path.xs[t], b)
        due = False
        for s in range(before, substeps):
            copy_vector(b, data.step_x[0])
            guess = Guess(velocity if substeps == 1 else data.step_x[0, nq:], s > 0 or known)
            if step(model, data, options, data.step_x[0], u, guess, b, path.report) != _SOLVED:
                return t * substeps + s
            path.report[6] += path.report[1]
            due = is_due(data, path.report[1])
            if due and s + 1 < substeps:
                return t * substeps + s + 1
        _end_knot(model, data, policy, alpha, path, t)
        if due:
            return (t + 1) * substeps
    path.report[1] = path.report[6]
    return knots * substeps
