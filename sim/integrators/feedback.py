"""FeedbackLaw: a trajectory with gains, and the knots of a rollout that follows it (rollout.py).

The data of a plan make the steps of a rollout nearby cheap: derivatives predict its velocities,
and the cone variables of its steps are nearly those of the steps beside them. An iteration of the trot goes from 5 to 2
or 3 Newton iterations per step that way.
"""

from __future__ import annotations

from typing import NamedTuple

from sim.dynamics.state_manifold import integrate_state, state_difference
from sim.model.data import Data
from sim.model.model import Model
from solvers.compiler import inlined, kernel
from solvers.dense import copy, copy_vector, dot
from solvers.types import Cube, Matrix, Vector


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
    cones: Cube  # (T, ncontact, 16) cone variables of the steps
    bounds: Cube  # (T, nlimit, 2)


class FeedbackRun(NamedTuple):
    """A motion that follows a FeedbackLaw, with inputs held over the steps of a knot:

    u_t = clamp(us_t + alpha ks_t + Ks_t (x_t (-) xs_t)),   x_t+1 = f(x_t, u_t) (+) (alpha - 1) gaps_t+1
    """

    law: FeedbackLaw
    alpha: float  # applied share of its steps and gaps
    low: Vector  # (nu,) limits of u
    high: Vector
    substeps: int  # steps of a knot
    cones: Cube  # (T, ncontact, 16) cone variables of the steps, out; or empty
    bounds: Cube  # (T, nlimit, 2)


class Path(NamedTuple):
    """A rollout under a FeedbackLaw."""

    xs: Matrix  # (T + 1, nx)
    us: Matrix  # (T, nu)
    cones: Cube  # (T, ncontact, 16) or empty
    bounds: Cube
    report: Vector  # (10,) of the last step, and the iterations of all, which are those of the report in the end; zeros


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
def begin_knot(model: Model, data: Data, motion: FeedbackRun, x: Vector, u: Vector, t: int) -> None:
    """u of knot t from the state x there, and where its step looks first: data.step_x[1], data.cone."""
    law = motion.law
    dx = data.chain[0][: law.gaps.shape[1]]
    state_difference(model, law.xs[t], x, dx)
    for j in range(u.shape[0]):
        f = law.us[t, j] + motion.alpha * law.ks[t, j] + dot(law.Ks[t, j], dx)
        u[j] = min(max(f, motion.low[j]), motion.high[j])
    _expected_velocity(law, t, dx, u, data.step_x[1, data.theta1.shape[0] :])
    if law.cones.shape[0] > 0:
        copy(law.cones[t], data.cone)
        copy(law.bounds[t], data.bound)


@inlined
def end_knot(model: Model, data: Data, motion: FeedbackRun, x: Vector, t: int) -> None:
    """Keep the cone variables where that is wanted, and close the gap of the plan in part, in the next state x."""
    if motion.cones.shape[0] > 0:
        copy(data.cone, motion.cones[t])
        copy(data.bound, motion.bounds[t])
    if motion.alpha < 1.0:
        dx = data.chain[0][: motion.law.gaps.shape[1]]
        for k in range(dx.shape[0]):
            dx[k] = (motion.alpha - 1.0) * motion.law.gaps[t + 1, k]
        copy_vector(x, data.step_x[0])
        integrate_state(model, data.step_x[0], dx, x)
