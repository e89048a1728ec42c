"""Steps of higher order: explicit Runge-Kutta methods for Hamilton's equations of a tree (hamilton.py).

    Y_i = y + h sum_j a_ij f(Y_j),    y+ = y + h sum_i b_i f(Y_i),       y = (r, momenta)

r is the shift of the coordinates from the node, q (+) r; for quaternions a rotation vector, so that their length is no
variable and rotation about a fixed axis is exact (Munthe-Kaas, Appl. Numer. Math. 29, 1999).
The momentum of a tree that floats freely is part of y, so it is exact; energy is as good as the order. The evaluation
at the end of a step, which its velocity needs, is the first one of the next: s stages cost s evaluations.

    state    x = [q; v], v at the node: p = M(q) v
"""

from __future__ import annotations

from typing import NamedTuple

from sim.dynamics.external_forces import set_external
from sim.dynamics.kinematics import displace
from sim.dynamics.momentum_balance import joints_below_turn
from sim.dynamics.state import integrate_state, state_difference
from sim.integrators.feedback import BoundedLaw, Path
from sim.integrators.hamilton import (
    coordinate_rates,
    momenta_of_velocity,
    momentum_rates,
    node_energy,
    outer_power,
    place,
    velocity_of_momenta,
)
from sim.integrators.rollout import Linearized, MotionBuffers
from sim.integrators.tangents import (
    Tangents,
    first_tangents,
    keep_tangents,
    last_tangents,
    move_tangents,
    tangent_rates,
)
from sim.model.data import Data
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from sim.model.pace import is_due, start_pace
from sim.solve.energy_balance import LARGEST_GAIN
from solvers.compiler import Table, kernel
from solvers.dense import clear, copy_vector, dot
from solvers.status import Status
from solvers.types import Integers, Matrix, Vector

_SOLVED = int(Status.SOLVED)
_NOT_FINITE = int(Status.NOT_FINITE)
_SINGULAR = int(Status.SINGULAR)
_ANGULAR_STEP = int(Status.ANGULAR_STEP)
_ENERGY_STEP = int(Status.ENERGY_STEP)


class Scheme(NamedTuple):
    """A method of s stages, and the scratch of a step."""

    a: Matrix  # (s, s), strictly lower
    b: Vector  # (s,)
    free: Integers  # (nbody,) 1 for roots that float without springs, dampers and inputs on their coordinates
    momenta: Vector  # (nv,) at the node
    shift: Vector  # (nv,) of the stage
    stage_p: Vector  # (nv,)
    rates_r: Matrix  # (s, nv)
    rates_p: Matrix  # (s, nv)


@kernel
def begin(model: Model, data: Data, scheme: Scheme, x: Vector) -> None:
    """Momenta and poses of the state x, about the place of its first body; no external wrenches."""
    clear(data.external)
    nq = data.theta1.shape[0]
    for k in range(3):
        data.origin[k] = x[k] if model.joint_ntrans[0] == 3 else model.joint_parent_point[0, k]
    for k in range(nq):
        data.theta1[k] = x[k]
    place(model, data)
    momenta_of_velocity(model, data, scheme.free, x[nq:], scheme.momenta)
    for d in range(data.nu.shape[0]):
        data.nu[d] = x[nq + d]


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
def _evaluate(model: Model, data: Data, scheme: Scheme, h: float, weights: Vector, count: int, q: Vector) -> bool:
    """Velocity and momenta of the bodies at the node + h sum of weights[j] times the rates of stage j, j < count."""
    for d in range(scheme.momenta.shape[0]):
        scheme.shift[d] = 0.0
        scheme.stage_p[d] = scheme.momenta[d]
    _add_rates(h, weights, count, scheme.rates_r, scheme.shift)
    _add_rates(h, weights, count, scheme.rates_p, scheme.stage_p)
    displace(model, q, scheme.shift, 1.0, data.theta1)
    place(model, data)
    return velocity_of_momenta(model, data, scheme.free, scheme.stage_p)


@kernel
def advance(model: Model, data: Data, scheme: Scheme, h: float, u: Vector, x: Vector, tangents: Tangents | None) -> int:
    """x one step later, in place, with its evaluation in `data` before and after; returns the Status.

    tangents: of the node, moved along; without them nothing of them is compiled. No step is solved that gains energy,
    as those do that are too long for the method.
    """
    nq = data.theta1.shape[0]
    q, v = x[:nq], x[nq:]
    s = scheme.b.shape[0]
    if not joints_below_turn(model, v, h):
        return _ANGULAR_STEP
    before = node_energy(model, data)
    given = 0.0
    for d in range(v.shape[0]):
        scheme.shift[d] = 0.0
    for i in range(s):
        if i > 0 and not _evaluate(model, data, scheme, h, scheme.a[i], i, q):
            return _SINGULAR
        momentum_rates(model, data, scheme.free, u, scheme.rates_p[i])
        given += h * scheme.b[i] * outer_power(model, data, u)
        coordinate_rates(model, scheme.shift, data.nu, scheme.rates_r[i])
        if tangents is not None:
            move_tangents(model, scheme.shift, tangents, h, scheme.a[i], i)
            if not tangent_rates(model, data, scheme.free, u, scheme.shift, tangents, i):
                return _SINGULAR
    if not _evaluate(model, data, scheme, h, scheme.b, s, q):
        return _SINGULAR
    if tangents is not None:
        move_tangents(model, scheme.shift, tangents, h, scheme.b, s)
        keep_tangents(tangents)
    total = 0.0
    for k in range(nq):
        q[k] = data.theta1[k]
        total += q[k]
    for d in range(v.shape[0]):
        v[d] = data.nu[d]
        scheme.momenta[d] = scheme.stage_p[d]
        total += v[d]
    if not abs(total) < 1e300:
        return _NOT_FINITE
    if not joints_below_turn(model, scheme.shift, 1.0):
        return _ANGULAR_STEP
    after = node_energy(model, data)
    stored = abs(after[1] - before[1])
    gain = after[0] + after[1] - before[0] - before[1] - given
    return _ENERGY_STEP if gain > LARGEST_GAIN * max(before[0], stored + abs(given)) else _SOLVED


@kernel
def roll(model_at: Table, data_at: Table, settings: Vector, scheme: Scheme, motion: MotionBuffers, first: int) -> int:
    """As rollout.py, without contacts and derivatives."""
    model = model_view(model_at)
    data = data_view(data_at)
    start_pace(data, settings)
    if first == 0:
        begin(model, data, scheme, motion.xs[0])
    steps = motion.us.shape[0]
    for t in range(first, steps):
        x, report = motion.xs[t + 1], motion.reports[t]
        copy_vector(motion.xs[t], x)
        set_external(data, motion.wrenches, t)
        status = advance(model, data, scheme, settings[0], motion.us[t], x, None)
        report[0], report[1], report[4] = status, scheme.b.shape[0], -1.0
        if status != _SOLVED:
            return t
        if is_due(data, report[1]):
            return t + 1
    return steps


@kernel
def linearize(
    model_at: Table, data_at: Table, settings: Vector, scheme: Scheme, substeps: int, line: Linearized,
    tangents: Tangents, first: int,
) -> int:  # fmt: skip
    """Derivatives of the knots, of `substeps` steps each, from the step `first` of all on, carried through every stage;
    returns the step that is next.
    """
    model = model_view(model_at)
    data = data_view(data_at)
    start_pace(data, settings)
    for t in range(first // substeps, line.us.shape[0]):
        x, report = line.x_next[t], line.reports[t]
        status, before = _SOLVED, max(first - t * substeps, 0)
        if before == 0:
            copy_vector(line.xs[t], x)
            begin(model, data, scheme, x)
            set_external(data, line.wrenches, t)
            status = _SOLVED if first_tangents(model, data, scheme.free, line.us[t], tangents) else _SINGULAR
        due = False
        for s in range(before, substeps):
            if due:
                return t * substeps + s
            if status == _SOLVED:
                status = advance(model, data, scheme, settings[0], line.us[t], x, tangents)
                due = is_due(data, float(scheme.b.shape[0] * data.nu.shape[0]))
        if status == _SOLVED and not last_tangents(model, data, scheme.free, line.us[t], tangents):
            status = _SINGULAR
        report[0], report[1], report[4] = status, substeps * scheme.b.shape[0], -1.0
        nv = data.nu.shape[0]
        for d in range(nv):
            for k in range(2 * nv):
                line.A[t, d, k], line.A[t, nv + d, k] = tangents.node_q[d, k], data.columns[d, k]
            for k in range(line.us.shape[1]):
                line.B[t, d, k], line.B[t, nv + d, k] = tangents.node_q[d, 2 * nv + k], data.columns[d, 2 * nv + k]
        if due:
            return (t + 1) * substeps
    return line.us.shape[0] * substeps


@kernel
def closed_loop(
    model_at: Table,
    data_at: Table,
    settings: Vector,
    scheme: Scheme,
    law: BoundedLaw,
    substeps: int,
    path: Path,
    first: int,
) -> int:
    """As feedback.py: u_t = clamp(us_t + alpha k_t + K_t (x_t (-) xs_t)), x_t+1 = f(x_t, u_t) (+) (alpha - 1) gap."""
    model = model_view(model_at)
    data = data_view(data_at)
    policy, alpha, (low, high) = law
    ndx = policy.gaps.shape[1]
    dx = data.chain[0][:ndx]
    start_pace(data, settings)
    for t in range(first // substeps, path.us.shape[0]):
        u, b = path.us[t], path.xs[t + 1]
        state_difference(model, policy.xs[t], path.xs[t], dx)
        for j in range(u.shape[0]):
            f = policy.us[t, j] + alpha * policy.ks[t, j] + dot(policy.Ks[t, j], dx)
            u[j] = min(max(f, low[j]), high[j])
        before, due = max(first - t * substeps, 0), False
        if before == 0:
            copy_vector(path.xs[t], b)
            begin(model, data, scheme, b)
        set_external(data, policy.wrenches, t)
        for s in range(before, substeps):
            if due:
                return t * substeps + s
            path.report[0] = advance(model, data, scheme, settings[0], u, b, None)
            path.report[1] += scheme.b.shape[0]
            if path.report[0] != _SOLVED:
                return t * substeps + s
            due = is_due(data, float(scheme.b.shape[0]))
        if alpha < 1.0:
            for k in range(ndx):
                dx[k] = (alpha - 1.0) * policy.gaps[t + 1, k]
            copy_vector(b, data.step_x[0])
            integrate_state(model, data.step_x[0], dx, b)
        if due:
            return (t + 1) * substeps
    return path.us.shape[0] * substeps
