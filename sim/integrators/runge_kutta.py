"""Steps of higher order: explicit Runge-Kutta methods for Hamilton's equations of a tree (hamilton.py).

    Y_i = y + h sum_j a_ij f(Y_j),    y+ = y + h sum_i b_i f(Y_i),       y = (r, momenta)

r is the shift of the coordinates from the node, q (+) r; for quaternions a rotation vector, so that their length is no
variable and rotation about a fixed axis is exact (Munthe-Kaas, Appl. Numer. Math. 29, 1999).
The momentum of a tree that floats freely is part of y, so it is exact; energy is as good as the order. The evaluation
at the end of a step, which its velocity needs, is the first one of the next: s stages cost s evaluations.

    state    x = [q; v], v at the node: p = M(q) v

`step_by_stages` and `gradient_by_stages` fill the slots of `step` and `gradient` (sim/step.py): every loop over time
runs them as it runs those of order 2. The coefficients are in the Model, everything that changes is in the Data.
"""

from __future__ import annotations

from sim.dynamics.kinematics import displace
from sim.dynamics.momentum_balance import joints_below_turn
from sim.integrators.hamilton import (
    coordinate_rates,
    momenta_of_velocity,
    momentum_rates,
    node_energy,
    outer_power,
    place,
    velocity_of_momenta,
)
from sim.integrators.runge_kutta_gradient import (
    Tangents,
    first_tangents,
    keep_tangents,
    last_tangents,
    move_tangents,
    tangent_rates,
    tangents_of,
)
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import Guess, StepOptions
from sim.model.record_columns import StepReport
from sim.model.slots import Slot
from sim.solve.energy_balance import LARGEST_GAIN
from solvers.compiler import kernel, optional
from solvers.dense import copy_vector
from solvers.status import Status
from solvers.types import Matrix, Vector

_SOLVED = int(Status.SOLVED)
_NOT_FINITE = int(Status.NOT_FINITE)
_SINGULAR = int(Status.SINGULAR)
_TURN_TOO_LARGE = int(Status.TURN_TOO_LARGE)
_ENERGY_GAIN = int(Status.ENERGY_GAIN)
_ROUNDED = 1e-12  # [m, rad]


@kernel
def begin(model: Model, data: Data, x: Vector) -> None:
    """Momenta and poses of the state x, about the place of its first body."""
    for k in range(3):
        data.origin[k] = x[k] if model.joint_ntrans[0] == 3 else model.joint_parent_point[0, k]
    _stand(model, data, x)


@kernel
def _stand(model: Model, data: Data, x: Vector) -> None:
    """Momenta and poses of the state x, about the point O of the motion."""
    nq = data.theta1.shape[0]
    for k in range(nq):
        data.theta1[k] = x[k]
    place(model, data)
    momenta_of_velocity(model, data, x[nq:], data.momenta)
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
def _evaluate(model: Model, data: Data, h: float, weights: Vector, count: int, q: Vector) -> bool:
    """Velocity and momenta of the bodies at the node + h sum of weights[j] times the rates of stage j, j < count."""
    for d in range(data.momenta.shape[0]):
        data.stage_shift[d] = 0.0
        data.stage_momenta[d] = data.momenta[d]
    _add_rates(h, weights, count, data.stage_dr, data.stage_shift)
    _add_rates(h, weights, count, data.stage_dp, data.stage_momenta)
    displace(model, q, data.stage_shift, 1.0, data.theta1)
    place(model, data)
    return velocity_of_momenta(model, data, data.stage_momenta)


@kernel
def _moves(data: Data) -> bool:
    """Whether a step changes a coordinate by more than rounding does, as of a robot in balance, whose energies are
    noise.
    """
    for d in range(data.stage_shift.shape[0]):
        if not abs(data.stage_shift[d]) < _ROUNDED:
            return True
    return False


@kernel
def advance(model: Model, data: Data, h: float, u: Vector, x: Vector, tangents: Tangents | None) -> int:
    """x one step later, in place, with its evaluation in `data` before and after; returns the Status.

    tangents: of the node, moved along; without them nothing of them is compiled. No step is solved that gains energy,
    as those do that are too long for the method.
    """
    nq = data.theta1.shape[0]
    q, v = x[:nq], x[nq:]
    s = model.stage_b.shape[0]
    if not joints_below_turn(model, v, h):
        return _TURN_TOO_LARGE
    before = node_energy(model, data)
    given = 0.0
    for d in range(v.shape[0]):
        data.stage_shift[d] = 0.0
    for i in range(s):
        if i > 0 and not _evaluate(model, data, h, model.stage_a[i], i, q):
            return _SINGULAR
        momentum_rates(model, data, u, data.stage_dp[i])
        given += h * model.stage_b[i] * outer_power(model, data, u)
        coordinate_rates(model, data.stage_shift, data.nu, data.stage_dr[i])
        if tangents is not None:
            move_tangents(model, data.stage_shift, tangents, h, model.stage_a[i], i)
            if not tangent_rates(model, data, u, data.stage_shift, tangents, i):
                return _SINGULAR
    if not _evaluate(model, data, h, model.stage_b, s, q):
        return _SINGULAR
    if tangents is not None:
        move_tangents(model, data.stage_shift, tangents, h, model.stage_b, s)
        keep_tangents(tangents)
    total = 0.0
    for k in range(nq):
        q[k] = data.theta1[k]
        total += q[k]
    for d in range(v.shape[0]):
        v[d] = data.nu[d]
        data.momenta[d] = data.stage_momenta[d]
        total += v[d]
    if not abs(total) < 1e300:
        return _NOT_FINITE
    if not joints_below_turn(model, data.stage_shift, 1.0):
        return _TURN_TOO_LARGE
    after = node_energy(model, data)
    stored = abs(after[1] - before[1])
    gain = after[0] + after[1] - before[0] - before[1] - given
    gained = gain > LARGEST_GAIN * max(before[0], stored + abs(given)) and _moves(data)
    return _ENERGY_GAIN if gained else _SOLVED


@kernel
def _stands_at(data: Data, x: Vector) -> bool:
    """Whether x is where the last step of this motion ended, with its evaluation still in `data`."""
    if data.carry.steps[0] == 0:
        return False
    nq = data.theta1.shape[0]
    for k in range(nq):
        if x[k] != data.theta1[k]:
            return False
    for d in range(data.nu.shape[0]):
        if x[nq + d] != data.nu[d]:
            return False
    return True


@optional(Slot.STEP, default=int(Status.NOT_FINITE))
def step_by_stages(
    model: Model, data: Data, options: StepOptions, x: Vector, u: Vector, guess: Guess, out: Vector, report: Vector
) -> int:
    """As `step` of sim/step.py: out = state after one step from x = (q, v) under the input u; returns the Status.

    guess: not used.
    """
    if not _stands_at(data, x):
        begin(model, data, x)
    copy_vector(x, data.held_x[0])
    copy_vector(u, data.held_u)
    copy_vector(data.momenta, data.held_momenta)
    copy_vector(x, out)
    status = advance(model, data, options.h, u, out, None)
    report[StepReport.STATUS] = status
    report[StepReport.ITERATIONS] = model.stage_b.shape[0]
    report[StepReport.RESIDUAL] = report[StepReport.VIOLATION] = 0.0
    report[StepReport.WORST] = -1.0
    data.carry.steps[0] = data.carry.steps[0] + 1 if status == _SOLVED else 0
    return status


@optional(Slot.GRADIENT, default=False)
def gradient_by_stages(
    model: Model, data: Data, h: float, kappa: float, q: Vector, v: Vector, A: Matrix, B: Matrix
) -> bool:
    """As `gradient` of sim/derivatives/step_gradient.py: of the last step, which is taken again with its tangents.

    kappa, q, v: not used; the Data holds where the step began.
    """
    x, u = data.held_x[1], data.held_u
    copy_vector(data.held_x[0], x)
    _stand(model, data, x)
    copy_vector(data.held_momenta, data.momenta)
    tangents = tangents_of(data)
    if not first_tangents(model, data, u, tangents):
        return False
    if advance(model, data, h, u, x, tangents) != _SOLVED:
        return False
    if not last_tangents(model, data, u, tangents):
        return False
    nv = data.nu.shape[0]
    for d in range(nv):
        for k in range(2 * nv):
            A[d, k], A[nv + d, k] = tangents.node_q[d, k], data.columns[d, k]
        for k in range(u.shape[0]):
            B[d, k], B[nv + d, k] = tangents.node_q[d, 2 * nv + k], data.columns[d, 2 * nv + k]
    return True
