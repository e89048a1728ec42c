"""Steps of higher order of a motion with contacts, collisions and limits, while all of them are inactive.

A step may omit the impulses kappa/gap of all contacts, collisions and limits if their sum is within its tolerance:

    sum of kappa/g <= tolerance (1 + largest momentum),    g = (g0 + g1 - d)/2

g0, g1 are lower bounds of a gap where the step begins and where it ends, and d = h max |speed| of its points at both:
a path no longer than d between two places g0 and g1 from the ground is nowhere nearer to it than g. Paths are no longer
than d while accelerations hardly change within a step. A step that turns out to be near is not taken.

Columns of `inactive` here, at the first contact of a cluster: Apart of sim/model/record_columns.py.
"""

from __future__ import annotations

from math import cos, sin, sqrt

from sim.contact.contact_report import report_contacts
from sim.contact.inactive import cluster_gap, highest
from sim.contact.pairs.clearance import largest_speed, least_gap, measure_pairs, omitted_pairs
from sim.dynamics.external_forces import set_external
from sim.integrators.rollout import MotionBuffers
from sim.integrators.runge_kutta import advance
from sim.mechanism.immovable_contacts import IDLE
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import Apart, Bounce, Cluster, StepReport, StepSetting
from solvers.compiler import kernel
from solvers.dense import copy, copy_vector
from solvers.rotation import quat_matrix, quat_turn
from solvers.status import Status
from solvers.types import Matrix, Vector

NEAR = -1  # in place of a Status: a contact or limit is active, or near at the end of the step

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
def omitted_impulses(model: Model, data: Data, kappa: float, v: Vector, h: float) -> float:
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


@kernel
def fly(
    model: Model, data: Data, settings: Vector, motion: MotionBuffers, x: Vector, x_next: Vector, t: int
) -> int:  # fmt: skip
    """x_next = the node a step of higher order after the node x, which is in `data`; the Status, or NEAR.

    Inputs, external wrenches, report and contacts are those of step t of the motion.
    """
    nq, h, kappa = data.theta1.shape[0], settings[StepSetting.TIME_STEP], settings[StepSetting.KAPPA]
    report = motion.reports[t]
    copy_vector(x, x_next)
    allowed = _allowed(data, settings[StepSetting.TOLERANCE])
    if omitted_impulses(model, data, kappa, x_next[nq:], -1.0) > allowed:
        return NEAR
    leave(data)
    set_external(data, motion.wrenches, t)
    status = advance(model, data, h, motion.us[t], x_next, None)
    report[StepReport.STATUS], report[StepReport.WORST] = status, -1.0
    report[StepReport.ITERATIONS] = model.stage_b.shape[0]
    if status != _SOLVED:
        return status
    if omitted_impulses(model, data, kappa, x_next[nq:], h) > allowed:
        return NEAR
    report_apart(model, data, h, motion.contacts[t])
    return _SOLVED
