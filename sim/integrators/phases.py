"""Steps of higher order of a motion with contacts, collisions and limits, while all of them are inactive.

A step may omit the impulses kappa/gap of all contacts, collisions and limits if their sum is within its tolerance:

    sum of kappa/g <= tolerance (1 + largest momentum),    g = (g0 + g1 - d)/2

g0, g1 are lower bounds of a gap where the step begins and where it ends, and d = h max |speed| of its points at both:
a path no longer than d between two places g0 and g1 from the ground is nowhere nearer to it than g. Paths are no longer
than d while accelerations hardly change within a step. A step that turns out to be near is not taken.

Columns of `inactive` here, at the first contact of a cluster: Apart of sim/model/columns.py.
"""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import NamedTuple

from sim.contact.contact_report import report_contacts
from sim.contact.inactive import cluster_gap, highest
from sim.contact.pairs.clearance import largest_speed, least_gap, measure_pairs, omitted_pairs
from sim.dynamics.external_forces import set_external
from sim.integrators.runge_kutta import advance, begin
from sim.mechanism.confined import IDLE
from sim.model.columns import Apart, Bounce, Cluster, StepReport, StepSetting
from sim.model.data import Data
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from sim.model.pace import is_due, start_pace
from solvers.compiler import Table, kernel
from solvers.dense import clear, copy, copy_vector
from solvers.rotation import quat_matrix, quat_turn
from solvers.status import Status
from solvers.types import Cube, Matrix, Vector

NEAR = -1  # in place of a Status: a contact or limit is active

_SOLVED = int(Status.SOLVED)


@kernel
def _limit(model: Model, data: Data, k: int, v: Vector) -> tuple[float, float]:
    """(gap, largest speed of the gap) of limit k, gaps as in joints/limits.py."""
    d = model.limit_dof[k]
    a = model.dof_qadr[d]
    q = data.theta1
    if not model.limit_cone[k]:
        return model.limit_sign[k] * (q[a] - model.limit_bound[k]), abs(v[d])
    axis, R = model.joint_axis[model.dof_body[d]], quat_matrix(q[a], q[a + 1], q[a + 2], q[a + 3])
    along = 0.0
    for j in range(3):
        along += axis[j] * (R[3 * j] * axis[0] + R[3 * j + 1] * axis[1] + R[3 * j + 2] * axis[2])
    scale = 1.0 / sin(model.limit_bound[k])
    speed = sqrt(v[d] * v[d] + v[d + 1] * v[d + 1] + v[d + 2] * v[d + 2])
    return scale * (along - cos(model.limit_bound[k])), scale * speed


@kernel
def left_out(model: Model, data: Data, kappa: float, v: Vector, h: float) -> float:
    """Sum of the impulses kappa/g over a step of length h to the node in `data`; of the node itself with h < 0.

    Gaps and speeds of the node are kept for the step that begins there. 1e300 where something is not apart.
    """
    total = 0.0
    for c in range(model.contact_height.shape[0]):
        if model.cluster_end[c] > 0 and model.contact_hold[c] != IDLE:
            row, speed = data.inactive[c], largest_speed(data, model.contact_body[c], model.cluster[c, Cluster.ARM])
            gap = cluster_gap(model, data, c, highest(model, c), False)
            g = least_gap(gap, speed, row[Apart.GAP], row[Apart.SPEED], h)
            row[Apart.GAP], row[Apart.SPEED] = gap, speed
            total = total + (model.cluster_end[c] - c) * kappa / g if g > 0.0 else 1e300
    for k in range(model.limit_dof.shape[0]):
        gap, speed = _limit(model, data, k, v)
        g = least_gap(gap, speed, data.bound_gap[k], data.bound_w[k], h)
        data.bound_gap[k], data.bound_w[k] = gap, speed
        total = total + kappa / g if g > 0.0 else 1e300
    return total + omitted_pairs(model, data, kappa, h)


@kernel
def _allowed(data: Data, tolerance: float) -> float:
    """tolerance (1 + largest momentum) of the node in `data`."""
    most = 0.0
    for d in range(data.momenta.shape[0]):
        most = max(most, abs(data.momenta[d]))
    return tolerance * (1.0 + most)


@kernel
def first_far(model_at: Table, data_at: Table, settings: Vector, xs: Matrix) -> int:
    """The first of the states xs (n, nx) at which all is inactive; n if there is none."""
    model = model_view(model_at)
    data = data_view(data_at)
    nq = data.theta1.shape[0]
    for t in range(xs.shape[0]):
        begin(model, data, xs[t])
        if left_out(model, data, settings[StepSetting.KAPPA], xs[t, nq:], -1.0) <= _allowed(
            data, settings[StepSetting.TOLERANCE]
        ):
            return t
    return xs.shape[0]


@kernel
def leave(data: Data) -> None:
    """Configuration 2 becomes configuration 1."""
    copy(data.pos2, data.pos1)
    copy(data.quat2, data.quat1)
    copy(data.rot2, data.rot1)


@kernel
def report_apart(model: Model, data: Data, h: float, out: Matrix) -> None:
    """Contacts that carry nothing, with their gaps and mean slips, of the step from configuration 1 to 2."""
    copy(data.pos2, data.pos3)
    copy(data.quat2, data.quat3)
    copy(data.rot2, data.rot3)
    copy(data.pos1, data.pos2)
    copy(data.quat1, data.quat2)
    for i in range(data.pos2.shape[0]):
        a, b, t = data.quat2[i], data.quat3[i], data.turn[i]
        t[0], t[1], t[2], t[3] = quat_turn(a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3])
        for k in range(3):
            data.move[i, k] = data.pos3[i, k] - data.pos2[i, k]
    data.inactive_count[0] = 0
    for c in range(model.contact_height.shape[0]):
        if model.cluster_end[c] > 0:
            data.inactive_first[data.inactive_count[0]] = c
            data.inactive_count[0] += 1
        data.contact_out[c] = 1
    for c in range(data.cone.shape[0]):
        data.bounce[c, Bounce.FLOOR] = 0.0
        for k in range(data.cone.shape[1]):
            data.cone[c, k] = 0.0
    measure_pairs(model, data, h)
    report_contacts(model, data, h, out)
    copy(data.pos3, data.pos2)
    copy(data.quat3, data.quat2)


class Flight(NamedTuple):
    """Steps while all is inactive."""

    us: Matrix  # (T, nu) in
    wrenches: Cube  # (T, nbody, 6) in, or (0, nbody, 6)
    xs: Matrix  # (T + 1, nx), of which xs[0] is given
    reports: Matrix  # (T, 5)
    contacts: Cube  # (T, ncontact, 11)


@kernel
def roll_far(model_at: Table, data_at: Table, settings: Vector, flight: Flight, first: int) -> tuple[int, int]:
    """xs[t + 1] = step(xs[t], us[t]) from t = first on while all is inactive.

    Returns how many steps were taken, and why no more: SOLVED at the end of us or after the deadline, NEAR, or the
    Status of the next.
    """
    model = model_view(model_at)
    data = data_view(data_at)
    nq = data.theta1.shape[0]
    h, kappa = settings[StepSetting.TIME_STEP], settings[StepSetting.KAPPA]
    us, xs, reports = flight.us, flight.xs, flight.reports
    start_pace(data, settings)
    if first == 0:
        clear(data.carry.external)
        begin(model, data, xs[0])
    for t in range(first, us.shape[0]):
        x = xs[t + 1]
        copy_vector(xs[t], x)
        allowed = _allowed(data, settings[StepSetting.TOLERANCE])
        if left_out(model, data, kappa, x[nq:], -1.0) > allowed:
            return t, NEAR
        leave(data)
        set_external(data, flight.wrenches, t)
        status = advance(model, data, h, us[t], x, None)
        reports[t, StepReport.STATUS] = status
        reports[t, StepReport.ITERATIONS] = model.stage_b.shape[0]
        reports[t, StepReport.WORST] = -1.0
        if status != _SOLVED:
            return t, status
        if left_out(model, data, kappa, x[nq:], h) > allowed:
            return t, NEAR
        report_apart(model, data, h, flight.contacts[t])
        if is_due(data, reports[t, StepReport.ITERATIONS]):
            return t + 1, _SOLVED
    return us.shape[0], _SOLVED
