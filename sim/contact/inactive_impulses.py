"""Impulses of inactive contacts (inactive.py): the law of the central path, evaluated again when motion has changed it.

Most of the change is in the moment: arms turn with the body. That is known exactly: of a cluster whose law still
holds only the arms are turned, at a cost that does not depend on the number of its contacts.
"""

from __future__ import annotations

from math import sqrt

from sim.contact.contact_law import contact_impulse, start_contact
from sim.contact.corners import evaluate_corners, gather_corners
from sim.contact.inactive_bounds import ANGLE, NEARER, bound_changes, keep_motion
from sim.contact.inactive_terrain import evaluate_on_terrain
from sim.contact.moments.inactive_moments import evaluate_moments
from sim.dynamics.displacements import third_quaternion
from sim.model.data import Data
from sim.model.model import Law, Model
from sim.model.record_columns import Cluster, Cone, Inactive, Kin
from solvers.compiler import inlined, kernel
from solvers.rotation import Vec3, cross, put_three, rotate, three, transposed_times
from solvers.types import Vector

_DRIFT = 1.0  # bound of the relative change of a law of corners, up to which it stays in the matrix


@kernel
def changes(model: Model, data: Data, h: float, c: int) -> tuple[float, float]:
    """Bounds of the change of an inactive cluster's wrench since its law was evaluated: by that law, by turned arms."""
    i = model.contact_body[c]
    row = data.inactive[c]
    if row[Inactive.LEAST_GAP] == 0.0:
        return 1e300, 0.0
    dx = 0.0
    dv = 0.0
    dw = 0.0
    w = 0.0
    q = third_quaternion(data, i)
    dq = abs(q[0] - row[Inactive.QUATERNION])
    for k in range(3):
        omega = 2.0 / h * data.turn[i, 1 + k]
        dx += abs(data.pos3[i, k] - row[Inactive.POSITION + k])
        dq += abs(q[1 + k] - row[Inactive.QUATERNION + 1 + k])
        dv += abs(data.move[i, k] / h - row[Inactive.VELOCITY + k])
        dw += abs(omega - row[Inactive.ANGULAR + k])
        w += abs(omega)
    arm = model.cluster[c, Cluster.ARM]
    turn = ANGLE * dq
    if dx + arm * turn > NEARER * row[Inactive.LEAST_GAP]:
        return 1e300, 0.0
    law = row[Inactive.BY_GAP] * (dx + arm * turn) + row[Inactive.BY_SLIP] * (dv + arm * (dw + w * turn))
    law += row[Inactive.BY_RATE] * dw
    return law, row[Inactive.BY_TURN] * turn


@kernel
def update_inactive(model: Model, data: Data, h: float) -> None:
    """Impulses of the inactive clusters at configuration 3, to a share of the tolerance: turned or evaluated again."""
    fraction = data.inactive_tolerance[0]
    for m in range(data.inactive_count[0]):
        c = data.inactive_first[m]
        law, arms = changes(model, data, h, c)
        if model.contact_terrain[c] > 0:
            if not law + arms <= fraction:
                evaluate_on_terrain(model, data, h, c)
        elif not law <= fraction:
            if model.cluster[c, Cluster.CORNERS] > 0.0:
                _evaluate_corners(model, data, h, c, law)
            else:
                _evaluate(model, data, h, c)
        elif data.inactive[c, Inactive.TURNED] > 0.0 or law + arms > fraction:
            data.inactive[c, Inactive.TURNED] = 1.0
            turn_arms(model, data, c)


@inlined
def _cone_impulse(mu: float, kappa: float, gap: float, x: float, y: float) -> tuple[float, float, float]:
    """`start_contact` of a cone written out, slip (x, y): one division, and mu = 0 needs no case of its own."""
    psi = gap + sqrt(gap * gap + 4.0 * mu * mu * (x * x + y * y))  # 2 mu psi of cone.py
    q = kappa / (gap * psi)
    return psi * q, -2.0 * mu * mu * q * x, -2.0 * mu * mu * q * y


@kernel
def turn_arms(model: Model, data: Data, c: int) -> None:
    """Inactive.MOMENT, that of the impulses of the last evaluation, at configuration 3:

    (R sum gamma p) x n + (R sum beta p) x t - sum rho beta n x t
    """
    i = model.contact_body[c]
    row = data.inactive[c]
    f = model.contact_frame[c]
    R = data.rot3
    nx, ny, nz = cross(*rotate(R, i, *three(row, Inactive.ARMS)), f[0], f[1], f[2])
    ax, ay, az = cross(*rotate(R, i, *three(row, Inactive.ARMS + 3)), f[3], f[4], f[5])
    bx, by, bz = cross(*rotate(R, i, *three(row, Inactive.ARMS + 6)), f[6], f[7], f[8])
    # n x t1 = t2, n x t2 = -t1
    row[Inactive.MOMENT] = nx + ax + bx - row[Inactive.RADIUS_ARMS] * f[6] + row[Inactive.RADIUS_ARMS + 1] * f[3]
    row[Inactive.MOMENT + 1] = ny + ay + by - row[Inactive.RADIUS_ARMS] * f[7] + row[Inactive.RADIUS_ARMS + 1] * f[4]
    row[Inactive.MOMENT + 2] = nz + az + bz - row[Inactive.RADIUS_ARMS] * f[8] + row[Inactive.RADIUS_ARMS + 1] * f[5]


@kernel
def _slip_coefficients(row: Vector, R: Vector, f: Vector, k: int) -> tuple[float, float, Vec3]:
    """t.v, (t x omega).n and R^T (t x omega), t at k in the frame f of a contact."""
    x, y, z = cross(f[k], f[k + 1], f[k + 2], *three(row, Inactive.ANGULAR))
    v = f[k] * row[Inactive.VELOCITY] + f[k + 1] * row[Inactive.VELOCITY + 1] + f[k + 2] * row[Inactive.VELOCITY + 2]
    return v, f[0] * x + f[1] * y + f[2] * z, transposed_times(R, x, y, z)


@kernel
def _bound_turn(row: Vector) -> None:
    """Inactive.BY_TURN, by which the moments of Inactive.ARMS turn with the body."""
    turning = 0.0
    for k in range(9):
        turning += abs(row[Inactive.ARMS + k])
    row[Inactive.BY_TURN] = turning / (1.0 - NEARER)


@kernel
def _keep_arms(row: Vector, n: Vec3, x: Vec3, y: Vec3) -> None:
    """Inactive.ARMS = sums of p times the impulses along n, t1 and t2."""
    put_three(n, Inactive.ARMS, row)
    put_three(x, Inactive.ARMS + 3, row)
    put_three(y, Inactive.ARMS + 6, row)
    _bound_turn(row)


@kernel
def _evaluate(model: Model, data: Data, h: float, c: int) -> None:
    """The row of `inactive` and the cone variables of a cluster at configuration 3: affine in p and the radius rho,

    gap    n.x3 - height + (R^T n).p - rho              slip    t.v + (R^T (t x omega)).p - rho (t x omega).n
    """
    i = model.contact_body[c]
    row = data.inactive[c]
    keep_motion(data, h, i, row)
    f, R = model.contact_frame[c], data.rot3[i]
    va, ra, (a0, a1, a2) = _slip_coefficients(row, R, f, 3)
    vb, rb, (b0, b1, b2) = _slip_coefficients(row, R, f, 6)
    n0, n1, n2 = transposed_times(R, f[0], f[1], f[2])
    D = f[0] * row[Inactive.POSITION] + f[1] * row[Inactive.POSITION + 1] + f[2] * row[Inactive.POSITION + 2]
    N, X, Y, rX, rY = 0.0, 0.0, 0.0, 0.0, 0.0
    N0, N1, N2, X0, X1, X2, Y0, Y1, Y2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    kappa = data.carry.inactive_kappa[0]
    least = 1e300
    for k in range(c, model.cluster_end[c]):
        if data.contact_out[k] == 0:
            continue
        p = model.contact_point[k]
        rho = model.contact_radius[k]
        gap = max(D - model.contact_height[k] + n0 * p[0] + n1 * p[1] + n2 * p[2] - rho, row[Inactive.ACTIVATION])
        least = min(least, gap)
        x = va + a0 * p[0] + a1 * p[1] + a2 * p[2] - rho * ra
        y = vb + b0 * p[0] + b1 * p[1] + b2 * p[2] - rho * rb
        if model.contact_law[k] == Law.LINEAR:
            kin = data.contact_kin[k]
            kin[Kin.GAP], kin[Kin.SLIP1], kin[Kin.SLIP2] = gap, x, y
            start_contact(model, data, k, kappa, row[Inactive.ACTIVATION])
            fn, fx, fy = contact_impulse(model, data, k)
        else:
            mu = model.contact_friction[k] if model.contact_law[k] == Law.NONLINEAR else 0.0
            fn, fx, fy = _cone_impulse(mu, kappa, gap, x, y)
            z = data.cone[k]
            z[Cone.SLACK], z[Cone.IMPULSE], z[Cone.FRICTION1], z[Cone.FRICTION2] = gap, fn, fx, fy
        N, X, Y = N + fn, X + fx, Y + fy
        rX, rY = rX + rho * fx, rY + rho * fy
        N0, N1, N2 = N0 + fn * p[0], N1 + fn * p[1], N2 + fn * p[2]
        X0, X1, X2 = X0 + fx * p[0], X1 + fx * p[1], X2 + fx * p[2]
        Y0, Y1, Y2 = Y0 + fy * p[0], Y1 + fy * p[1], Y2 + fy * p[2]
    row[Inactive.LEAST_GAP] = least
    bound_changes(model, data, c, (1.0 - NEARER) * least)
    evaluate_moments(model, data, h, c, (1.0 - NEARER) * least)
    _keep_arms(row, (N0, N1, N2), (X0, X1, X2), (Y0, Y1, Y2))
    for k in range(3):
        row[Inactive.FORCE + k] = N * f[k] + X * f[3 + k] + Y * f[6 + k]
    row[Inactive.RADIUS_ARMS], row[Inactive.RADIUS_ARMS + 1], row[Inactive.TURNED] = rX, rY, 0.0
    turn_arms(model, data, c)


@kernel
def _evaluate_corners(model: Model, data: Data, h: float, c: int, law: float) -> None:
    """`_evaluate` of a cluster of corners, of which all are inactive if it is so as a whole.

    law: of `changes`. The matrix keeps the law of a near motion: iterates hardly move from there, and the bound is that
    of all corners at the least gap, many times the change of their stiffness.
    """
    row = data.inactive[c]
    if law < 1e300:
        row[Inactive.DRIFT] += (
            law * (1.0 + model.cluster[c, Cluster.FRICTION]) / (row[Inactive.BY_GAP] * row[Inactive.LEAST_GAP])
        )
    if not (law < 1e300 and row[Inactive.DRIFT] < _DRIFT):
        row[Inactive.SHARE] = -1.0
    keep_motion(data, h, model.contact_body[c], row)
    if row[Inactive.CORNERS] == 0.0:
        gather_corners(model, data, c, -1e300, 0.0)
    evaluate_corners(model, data, h, c)
    bound_changes(model, data, c, (1.0 - NEARER) * row[Inactive.LEAST_GAP])
    _bound_turn(row)
    row[Inactive.RADIUS_ARMS] = row[Inactive.RADIUS_ARMS + 1] = row[Inactive.TURNED] = 0.0
    turn_arms(model, data, c)


@kernel
def add_inactive_wrenches(model: Model, data: Data) -> None:
    """wrench -= impulses of the inactive clusters, about O."""
    for m in range(data.inactive_count[0]):
        c = data.inactive_first[m]
        i = model.contact_body[c]
        row = data.inactive[c]
        x, y, z = three(row, Inactive.FORCE)
        o = data.origin
        tx, ty, tz = cross(data.pos2[i, 0] - o[0], data.pos2[i, 1] - o[1], data.pos2[i, 2] - o[2], x, y, z)
        A = data.wrench[i]
        A[0] -= x
        A[1] -= y
        A[2] -= z
        A[3] -= tx + row[Inactive.MOMENT] + row[Inactive.TURNING]
        A[4] -= ty + row[Inactive.MOMENT + 1] + row[Inactive.TURNING + 1]
        A[5] -= tz + row[Inactive.MOMENT + 2] + row[Inactive.TURNING + 2]
