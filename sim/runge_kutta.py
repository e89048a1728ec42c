"""Steps of higher order: explicit Runge-Kutta methods for Hamilton's equations of a tree (hamilton.py).

    Y_i = y + h sum_j a_ij f(Y_j),    y+ = y + h sum_i b_i f(Y_i),       y = (q, momenta)

The momentum of a tree that floats freely is part of y, so it is exact; energy is as good as the order. The evaluation
at the end of a step, which its velocity needs, is the first one of the next: s stages cost s evaluations.

    state    x = [q; v], v at the node: p = M(q) v
"""

from __future__ import annotations

from typing import NamedTuple

from sim.dynamics import joints_below_turn
from sim.hamilton import coordinate_rates, momenta_of_velocity, momentum_rates, place, velocity_of_momenta
from sim.layout import model_view, work_view
from sim.model import Integers, Matrix, Model, Vector, Work
from solvers.jit import kernel
from solvers.record import Table
from solvers.status import Status

_SOLVED = int(Status.SOLVED)
_NOT_FINITE = int(Status.NOT_FINITE)
_SINGULAR = int(Status.SINGULAR)
_ANGULAR_STEP = int(Status.ANGULAR_STEP)


class Scheme(NamedTuple):
    """A method of s stages, and the scratch of a step."""

    a: Matrix  # (s, s), strictly lower
    b: Vector  # (s,)
    free: Integers  # (nbody,) 1 for roots that float without springs, dampers and inputs on their coordinates
    momenta: Vector  # (nv,) at the node
    stage_q: Vector  # (nq,)
    stage_p: Vector  # (nv,)
    rates_q: Matrix  # (s, nq)
    rates_p: Matrix  # (s, nv)


@kernel
def begin(model: Model, work: Work, scheme: Scheme, x: Vector) -> None:
    """Momenta and poses of the state x, about the place of its first body."""
    nq = work.theta1.shape[0]
    for k in range(3):
        work.origin[k] = x[k] if model.joint_ntrans[0] == 3 else model.joint_parent_point[0, k]
    place(model, work, x[:nq])
    momenta_of_velocity(model, work, scheme.free, x[nq:], scheme.momenta)
    for d in range(work.nu.shape[0]):
        work.nu[d] = x[nq + d]


@kernel
def _add_rates(h: float, weights: Vector, count: int, rates: Matrix, out: Vector) -> None:
    """out += h sum of weights[j] rates[j], j < count."""
    for j in range(count):
        c = h * weights[j]
        if c != 0.0:
            row = rates[j]
            for k in range(out.shape[0]):
                out[k] += c * row[k]


@kernel
def _move(work: Work, scheme: Scheme, h: float, weights: Vector, count: int, q: Vector) -> None:
    """stage = node + h sum of weights[j] times the rates of stage j, j < count."""
    for k in range(q.shape[0]):
        scheme.stage_q[k] = q[k]
    for d in range(scheme.momenta.shape[0]):
        scheme.stage_p[d] = scheme.momenta[d]
    _add_rates(h, weights, count, scheme.rates_q, scheme.stage_q)
    _add_rates(h, weights, count, scheme.rates_p, scheme.stage_p)


@kernel
def advance(model: Model, work: Work, scheme: Scheme, h: float, u: Vector, x: Vector) -> int:
    """x one step later, in place, with its evaluation in `work` before and after; returns the Status."""
    nq = work.theta1.shape[0]
    q, v = x[:nq], x[nq:]
    s = scheme.b.shape[0]
    if not joints_below_turn(model, v, h):
        return _ANGULAR_STEP
    for i in range(s):
        if i > 0:
            _move(work, scheme, h, scheme.a[i], i, q)
            place(model, work, scheme.stage_q)
            if not velocity_of_momenta(model, work, scheme.free, scheme.stage_p):
                return _SINGULAR
        momentum_rates(model, work, scheme.free, u, scheme.rates_p[i])
        coordinate_rates(model, q if i == 0 else scheme.stage_q, work.nu, scheme.rates_q[i])
    _move(work, scheme, h, scheme.b, s, q)
    place(model, work, scheme.stage_q)
    if not velocity_of_momenta(model, work, scheme.free, scheme.stage_p):
        return _SINGULAR
    total = 0.0
    for k in range(nq):
        q[k] = work.theta1[k]
        total += q[k]
    for d in range(v.shape[0]):
        v[d] = work.nu[d]
        scheme.momenta[d] = scheme.stage_p[d]
        total += v[d]
    return _SOLVED if abs(total) < 1e300 else _NOT_FINITE


@kernel
def roll(
    model_at: Table, work_at: Table, h: float, scheme: Scheme, us: Matrix, xs: Matrix, reports: Matrix
) -> int:  # fmt: skip
    """xs[t + 1] = step(xs[t], us[t]) from xs[0]; returns the number of steps that were possible.

    us: (T, nu); xs: (T + 1, nx); reports: (T, 5).
    """
    model = model_view(model_at)
    work = work_view(work_at)
    begin(model, work, scheme, xs[0])
    for t in range(us.shape[0]):
        for k in range(xs.shape[1]):
            xs[t + 1, k] = xs[t, k]
        status = advance(model, work, scheme, h, us[t], xs[t + 1])
        reports[t, 0] = status
        reports[t, 1] = scheme.b.shape[0]
        reports[t, 4] = -1.0
        if status != _SOLVED:
            return t
    return us.shape[0]
