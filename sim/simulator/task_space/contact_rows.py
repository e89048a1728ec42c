"""Gaps and slips of contacts with the ground, by state; their forces in the step from a state, by state and input.

A state x = (q, v) is the end of the interval from q (-) h v. Gaps and slips are those of contact/ground_contact.py at
configuration 3, with the state there; forces are impulses of the step from the state over h, in the contact frame.

    d(gap, slip) = C (S3 dq2 + S3nu dv25) + C2 S2 dq2        dforce = W d(gap, slip)/h

C, C2: derivatives by the twists of configurations 3 and 2; W: the condensed law (contact/contact_law.py).
"""

from __future__ import annotations

from sim.contact.contact_law import contact_impulse
from sim.contact.ground_contact import contact_jacobian, contact_kinematics
from sim.contact.stiff_contacts import take_corners
from sim.derivatives.parameters.contact_columns import is_active
from sim.derivatives.step_gradient import gradient
from sim.dynamics.displacements import tree_displacements, turn_bodies
from sim.dynamics.joints.joint_motion import Increment
from sim.dynamics.kinematics import displace, tree_poses, velocity_columns
from sim.integrators.rollout import options_of
from sim.model.data import Data
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from sim.model.options import Guess
from sim.model.record_columns import Kin, StepSetting
from sim.simulator.task_space.knot_rows import Rows, carried
from sim.step import step
from solvers.compiler import Table, kernel
from solvers.dense import clear
from solvers.rotation import cross, left_jacobian, quat_exp, quat_matrix, three
from solvers.status import Status
from solvers.types import Integers, Matrix, Vector

_SOLVED = int(Status.SOLVED)
_SINGULAR = int(Status.SINGULAR)


@kernel
def interval_of(model: Model, data: Data, h: float, x: Vector) -> None:
    """Configurations 2 and 3 = q (-) h v and q of a state, with the columns S2, S3 and S3nu, about the world's origin.

    theta1 holds the coordinates at 2.
    """
    nq = data.theta1.shape[0]
    for k in range(3):
        data.origin[k] = 0.0
    displace(model, x[:nq], x[nq:], -h, data.theta1)
    tree_poses(model, data, data.theta1)
    tree_displacements(model, data, Increment(data.theta1, x[nq:], h), True)
    turn_bodies(data, data.rot3)
    velocity_columns(model, data.S3, x[nq:], h, data.S3nu)


@kernel
def slip_by_pose(data: Data, h: float, i: int, c: int, d: int) -> tuple[float, float]:
    """C2 S2: derivative of both slips of contact c of body i by the poses at configuration 2 under column d,

    t . (-dx2/h) + ((-c y + s x y)/h) . a,   y = r x t,   (c, s) the turn from 2 to 3
    """
    k, F = data.contact_kin[c], data.contact_frame[c]
    x = carried(
        data.S2,
        d,
        (data.pos2[i, 0] - data.origin[0], data.pos2[i, 1] - data.origin[1], data.pos2[i, 2] - data.origin[2]),
    )
    w, sx, sy, sz = data.turn[i, 0], data.turn[i, 1], data.turn[i, 2], data.turn[i, 3]
    a = (data.S2[d, 3], data.S2[d, 4], data.S2[d, 5])
    y = cross(*three(k, Kin.ARM), F[3], F[4], F[5])
    z = cross(sx, sy, sz, *y)
    first = (z[0] - w * y[0]) * a[0] + (z[1] - w * y[1]) * a[1] + (z[2] - w * y[2]) * a[2]
    first -= F[3] * x[0] + F[4] * x[1] + F[5] * x[2]
    y = cross(*three(k, Kin.ARM), F[6], F[7], F[8])
    z = cross(sx, sy, sz, *y)
    second = (z[0] - w * y[0]) * a[0] + (z[1] - w * y[1]) * a[1] + (z[2] - w * y[2]) * a[2]
    second -= F[6] * x[0] + F[7] * x[1] + F[8] * x[2]
    return first / h, second / h


@kernel
def _rate(k: Vector, row: int, s: Vector) -> float:
    """Row of C times the column s of a twist about O."""
    v, w = Kin.BY_TRANSLATION + 3 * row, Kin.BY_ROTATION + 3 * row
    return k[v] * s[0] + k[v + 1] * s[1] + k[v + 2] * s[2] + k[w] * s[3] + k[w + 1] * s[4] + k[w + 2] * s[5]


@kernel
def contact_columns(model: Model, data: Data, h: float, c: int, by_q: Matrix, by_v: Matrix) -> None:
    """d(gap, slip) of contact c by dq2 and by dv25.   by_q, by_v: (3, nv), overwritten."""
    contact_jacobian(model, data, h, c)
    clear(by_q)
    clear(by_v)
    k = data.contact_kin[c]
    i = model.contact_body[c]
    b = i
    while b >= 0:
        for d in range(model.body_vadr[b], model.body_vadr[b + 1]):
            for row in range(3):
                by_q[row, d] = _rate(k, row, data.S3[d])
                by_v[row, d] = _rate(k, row, data.S3nu[d])
            first, second = slip_by_pose(data, h, i, c, d)
            by_q[1, d] += first
            by_q[2, d] += second
        b = model.body_parent[b]


@kernel
def to_end(model: Model, h: float, v: Vector, by_q: Matrix, by_v: Matrix) -> None:
    """Derivatives by (dq2, dv) become those by (dq3, dv), q3 = q2 (+) h v:

    scalars        dq2 = dq3 - h dv
    quaternions    dq2 = R(h w) dq3 - h Jl(h w) dw
    """
    for i in range(model.body_parent.shape[0]):
        d = model.body_vadr[i]
        n = model.body_vadr[i + 1] - d
        if model.joint_nrot[i] == 3:
            n -= 3
            e = d + n
            t = (h * v[e], h * v[e + 1], h * v[e + 2])
            q = quat_exp(t[0], t[1], t[2])
            R = quat_matrix(q[0], q[1], q[2], q[3])
            J = left_jacobian(t[0], t[1], t[2])
            for row in range(by_q.shape[0]):
                a, b, c = by_q[row, e], by_q[row, e + 1], by_q[row, e + 2]
                for k in range(3):
                    by_v[row, e + k] -= h * (a * J[k] + b * J[3 + k] + c * J[6 + k])
                    by_q[row, e + k] = a * R[k] + b * R[3 + k] + c * R[6 + k]
        for e in range(d, d + n):
            for row in range(by_q.shape[0]):
                by_v[row, e] -= h * by_q[row, e]


@kernel
def contact_gaps(model_at: Table, data_at: Table, h: float, contacts: Integers, scratch: Matrix, rows: Rows) -> None:
    """Gap and both slips of each contact at all knots.   scratch: (6, nv); values: (m, 3 n)."""
    model = model_view(model_at)
    data = data_view(data_at)
    nq, nv = data.theta1.shape[0], data.nu.shape[0]
    by_q, by_v = scratch[:3], scratch[3:]
    for row in range(rows.knots.shape[0]):
        x = rows.xs[rows.knots[row]]
        interval_of(model, data, h, x)
        if rows.jacobians.shape[0] > 0:
            clear(rows.jacobians[row])
        for m in range(contacts.shape[0]):
            c = contacts[m]
            contact_kinematics(model, data, h, c)
            for k in range(3):
                rows.values[row, 3 * m + k] = data.contact_kin[c, Kin.GAP + k]
            if rows.jacobians.shape[0] > 0:
                contact_columns(model, data, h, c, by_q, by_v)
                to_end(model, h, x[nq:], by_q, by_v)
                for k in range(3):
                    for d in range(nv):
                        rows.jacobians[row, 3 * m + k, d] = by_q[k, d]
                        rows.jacobians[row, 3 * m + k, nv + d] = by_v[k, d]


@kernel
def force_jacobian(model: Model, data: Data, h: float, c: int, scratch: Matrix, J: Matrix) -> None:
    """J = d(force of contact c)/d(dq, dv, du) of the step whose gradient is in `data`: zero of an inactive contact.

    scratch: (6, nv); J: (3, 2 nv + nu), overwritten.
    """
    clear(J)
    if not is_active(data, c):
        return
    by_q, by_v = scratch[:3], scratch[3:]
    contact_columns(model, data, h, c, by_q, by_v)
    W = data.contact_W[c]
    nv = by_q.shape[1]
    for r in range(3):
        for d in range(nv):
            direct = W[3 * r] * by_q[0, d] + W[3 * r + 1] * by_q[1, d] + W[3 * r + 2] * by_q[2, d]
            J[r, d] += direct / h
            f = (W[3 * r] * by_v[0, d] + W[3 * r + 1] * by_v[1, d] + W[3 * r + 2] * by_v[2, d]) / h
            if f != 0.0:
                for k in range(J.shape[1]):
                    J[r, k] += f * data.columns[d, k]


@kernel
def contact_forces(
    model_at: Table, data_at: Table, settings: Vector, contacts: Integers, scratch: Matrix, rows: Rows
) -> None:
    """Force of each contact [N] along its normal and tangents, in the first step from each knot.

    Values of a knot whose step is not solved are NaN.   scratch: (6, nv); values: (m, 3 n).
    """
    model = model_view(model_at)
    data = data_view(data_at)
    nq, h = data.theta1.shape[0], settings[StepSetting.TIME_STEP]
    out = data.step_x[1]
    for row in range(rows.knots.shape[0]):
        t = rows.knots[row]
        x = rows.xs[t]
        options = options_of(data, settings, True)
        status = step(model, data, options, x, rows.us[t], Guess(rows.xs[t + 1, nq:], False), out, data.report)
        if status == _SOLVED and rows.jacobians.shape[0] > 0:
            if not gradient(model, data, h, options.kappa, x[:nq], x[nq:], data.step_A, data.step_B):
                status = _SINGULAR
            take_corners(model, data, h)
        for m in range(contacts.shape[0]):
            f = contact_impulse(model, data, contacts[m])
            for k in range(3):
                rows.values[row, 3 * m + k] = f[k] / h if status == _SOLVED else float("nan")
            if rows.jacobians.shape[0] > 0:
                J = rows.jacobians[row, 3 * m : 3 * m + 3]
                if status == _SOLVED:
                    force_jacobian(model, data, h, contacts[m], scratch, J)
                else:
                    clear(J)
