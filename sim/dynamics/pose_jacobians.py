"""Derivatives of the momentum balance of each body by its poses at configurations 1, 2 and 3, about O.

A3   d/d(pose 3): Newton matrix of the step, contacts condensed
A2   d/d(pose 2): the rest of a rotation of all three configurations, which only rotates the balance
A1   d/d(pose 1): the incoming momentum
"""

from __future__ import annotations

from sim.dynamics.angular_momentum import angular_momentum, angular_momentum_jacobian
from sim.dynamics.momentum_balance import body_jacobian
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import Kin
from solvers.compiler import kernel
from solvers.lanes import load, store
from solvers.rotation import cross, three, transposed_times
from solvers.types import Matrix, Vector


@kernel
def add_skew(A: Vector, row: int, col: int, x: float, y: float, z: float) -> None:
    """A[row:row+3, col:col+3] += [x, y, z]; A: (36,) 6 x 6 row-major."""
    k = 6 * row + col
    A[k + 1] -= z
    A[k + 2] += y
    A[k + 6] += z
    A[k + 8] -= x
    A[k + 12] -= y
    A[k + 13] += x


@kernel
def rows_to_origin(A: Vector, x: float, y: float, z: float) -> None:
    """Torque rows += [d] force rows."""
    for k in range(6):
        a, b, c = A[k], A[6 + k], A[12 + k]
        A[18 + k] += y * c - z * b
        A[24 + k] += z * a - x * c
        A[30 + k] += x * b - y * a


@kernel
def columns_to_origin(A: Vector, x: float, y: float, z: float) -> None:
    """Rotation columns -= translation columns [d]."""
    for r in range(6):
        a, b, c = A[6 * r], A[6 * r + 1], A[6 * r + 2]
        A[6 * r + 3] -= b * z - c * y
        A[6 * r + 4] -= c * x - a * z
        A[6 * r + 5] -= a * y - b * x


@kernel
def inertial_jacobians(model: Model, data: Data, h: float) -> None:
    """A1, A2, A3 of the bodies without contacts; A2 still in rows and columns at the centre of mass.

    A1 = diag(m/h I, D-),   A2 = diag(-2 m/h I, -D+ - D- - [P+ - P-]) + inputs that turn with the body
    D+ = dP+/dphi3, D- = d(-P-)/dphi1, rows of A1 about O by d2, columns by d1
    """
    J = data.inertia_world
    for i in range(model.body_parent.shape[0]):
        c, x, y, z = data.turn[i, 0], data.turn[i, 1], data.turn[i, 2], data.turn[i, 3]
        e, u, v, w = data.turn_in[i, 0], data.turn_in[i, 1], data.turn_in[i, 2], data.turn_in[i, 3]
        plus = angular_momentum_jacobian(J, i, h, c, x, y, z)
        minus = angular_momentum_jacobian(J, i, h, e, -u, -v, -w)
        px, py, pz = angular_momentum(J, i, h, c, x, y, z)
        mx, my, mz = angular_momentum(J, i, h, e, -u, -v, -w)  # -P-
        body_jacobian(model, data, h, i, data.pos3, plus, data.A3[i])
        body_jacobian(model, data, h, i, data.pos1, minus, data.A1[i])
        A2 = data.A2[i]
        for k in range(36):
            A2[k] = 0.0
        m = -2.0 * model.body_mass[i] / h
        for k in range(3):
            A2[7 * k] = m
            for j in range(3):
                A2[21 + 6 * k + j] = -plus[3 * k + j] - minus[3 * k + j]
        b = data.body_impulse[i]
        add_skew(A2, 0, 3, b[0], b[1], b[2])
        add_skew(A2, 3, 3, b[3] - px - mx, b[4] - py - my, b[5] - pz - mz)


@kernel
def add_slip_jacobian(model: Model, data: Data, h: float, c: int) -> None:
    """A2[body] -= impulse map W C2: the slip of contact c depends on pose 2 (rows and columns at the centre of mass).

    C2 = (-t/h, (-c y + s x y)/h),   y = r x t
    """
    i = model.contact_body[c]
    k = data.contact_kin[c]
    F = data.contact_frame[c]
    W = data.contact_W[c]
    A = data.A2[i]
    w, sx, sy, sz = data.turn[i, 0], data.turn[i, 1], data.turn[i, 2], data.turn[i, 3]
    ih = 1.0 / h
    y0, y1, y2 = cross(*three(k, Kin.ARM), F[3], F[4], F[5])
    a0, a1, a2 = cross(sx, sy, sz, y0, y1, y2)
    z0, z1, z2 = cross(*three(k, Kin.ARM), F[6], F[7], F[8])
    b0, b1, b2 = cross(sx, sy, sz, z0, z1, z2)
    C1 = (-F[3], -F[4], -F[5], a0 - w * y0, a1 - w * y1, a2 - w * y2)
    C2 = (-F[6], -F[7], -F[8], b0 - w * z0, b1 - w * z1, b2 - w * z2)
    for j in range(6):
        gn = ih * (W[1] * C1[j] + W[2] * C2[j])
        g1 = ih * (W[4] * C1[j] + W[5] * C2[j])
        g2 = ih * (W[7] * C1[j] + W[8] * C2[j])
        x, y, z = transposed_times(F, gn, g1, g2)
        A[j] -= x
        A[6 + j] -= y
        A[12 + j] -= z
        A[18 + j] -= k[Kin.ARM + 1] * z - k[Kin.ARM + 2] * y
        A[24 + j] -= k[Kin.ARM + 2] * x - k[Kin.ARM] * z
        A[30 + j] -= k[Kin.ARM] * y - k[Kin.ARM + 1] * x


@kernel
def pose2_to_origin(data: Data) -> None:
    """A2 from the centre of mass to O; the arm of the force moves with pose 2: torque rows -= [f] for dx2."""
    o = data.origin
    for i in range(data.A2.shape[0]):
        x, y, z = data.pos2[i, 0] - o[0], data.pos2[i, 1] - o[1], data.pos2[i, 2] - o[2]
        A = data.A2[i]
        rows_to_origin(A, x, y, z)
        f = data.wrench[i]
        add_skew(A, 3, 0, -f[0], -f[1], -f[2])
        columns_to_origin(A, x, y, z)


@kernel
def _add_matrix(A: Matrix, i: int, p: int) -> None:
    """A[p] += A[i], 36 numbers each: the last lanes begin before those in front of them end."""
    a = load(A, p, 0) + load(A, i, 0)
    b = load(A, p, 8) + load(A, i, 8)
    c = load(A, p, 16) + load(A, i, 16)
    d = load(A, p, 24) + load(A, i, 24)
    e = load(A, p, 28) + load(A, i, 28)
    store(A, p, 0, a)
    store(A, p, 8, b)
    store(A, p, 16, c)
    store(A, p, 24, d)
    store(A, p, 28, e)


@kernel
def sum_composites(model: Model, data: Data) -> None:
    """A1, A2, A3 of each body become the sums over its subtree."""
    for i in range(model.body_parent.shape[0] - 1, -1, -1):
        p = model.body_parent[i]
        if p >= 0:
            _add_matrix(data.A1, i, p)
            _add_matrix(data.A2, i, p)
            _add_matrix(data.A3, i, p)
