"""Parameters of the geometry of joints: the place and orientation of a joint.

Such a change moves the subtree of the joint like one more degree of freedom: by twists T1, T2, T3 at the three
configurations, about O. So its column is that of `residual_derivatives` with T in the place of S:

    above the joint    S2_d.F,                       F = A3 T3 + A2 T2 + A1 T1 of its body
    the joint          S2_d.F + (B x S2_d).r         B: how its own columns move
    below              S2_d.(A3 T3 + A2 T2 + A1 T1) + (T2 x S2_d).r       of the body of d

The coordinates of the joint stay constant.
"""

from __future__ import annotations

from typing import NamedTuple

from sim.contact.pairs.wrench_columns import unit_vector
from sim.derivatives.parameters.body_columns import add_wrench
from sim.derivatives.parameters.directions import At, Effect
from sim.derivatives.restitution_gradient import gap_wrench
from sim.dynamics.joints.coordinates import joint_frame
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import Bounce, DirectionRow
from solvers.compiler import kernel
from solvers.rotation import Vec3, cross, quat_matrix, rotate, times
from solvers.types import Matrix, Vector

_PRODUCT = 9  # row of At.twists with F


class Configuration(NamedTuple):
    """Coordinates, and poses of the bodies."""

    q: Vector  # (nq,)
    pos: Matrix  # (nbody, 3)
    quat: Matrix  # (nbody, 4)
    rot: Matrix  # (nbody, 9)


@kernel
def _add_rotation(out: Vector, p: Vec3, a: Vec3) -> None:
    """out += (p x a, a), a rotation about the axis a through p."""
    v = cross(p[0], p[1], p[2], a[0], a[1], a[2])
    for k in range(3):
        out[k] += v[k]
        out[3 + k] += a[k]


@kernel
def _axis_twist(model: Model, i: int, a: Vec3, b: Vec3, o: Vec3, t: Vec3, out: Matrix) -> None:
    """The directions of motion of joint i turn by a, its body on them by -b, so that only its motion changes.

    o: joint point on the child; t: from that on the parent to it.
    """
    if 0 < model.joint_ntrans[i] < 3 or model.joint_lead[i] != 0.0:
        x = cross(a[0], a[1], a[2], t[0], t[1], t[2])
        for k in range(3):
            out[0, k] = x[k]
            out[2, k] = x[k]
            out[1, 3 + k] = a[k]
    if 0 < model.joint_nrot[i] < 3:
        _add_rotation(out[0], o, (a[0] - b[0], a[1] - b[1], a[2] - b[2]))
        _add_rotation(out[2], o, a)


@kernel
def _point_twist(model: Model, effect: int, i: int, k: int, at: Configuration, out: Matrix) -> None:
    """A joint point moves along axis k: that on the child, and its body the other way; or that on the parent."""
    p = model.body_parent[i]
    e = unit_vector(k)
    if effect == Effect.CHILD_POINT:
        b = rotate(at.rot, i, e[0], e[1], e[2])
        for j in range(3):
            out[0, j] = -b[j]
        return
    if p >= 0:
        e = rotate(at.rot, p, e[0], e[1], e[2])
    for r in range(3):
        for j in range(3):
            out[r, j] = e[j]


@kernel
def _lead_twist(model: Model, i: int, at: Configuration, out: Matrix) -> None:
    """The body of joint i moves along the axis, by the angle about it; to its column `_add_lead` adds the axis."""
    t = model.joint_axis[i]
    a = rotate(at.rot, i, t[0], t[1], t[2])
    y = at.q[model.body_qadr[i + 1] - 1]
    for j in range(3):
        out[0, j] = y * a[j]


@kernel
def _turn_twist(model: Model, O: Vector, effect: int, i: int, k: int, at: Configuration, out: Matrix) -> None:
    """The joint frame, or the directions of motion in it, turn about axis k of that frame; O: the common point."""
    e = unit_vector(k)
    b = rotate(at.rot, i, e[0], e[1], e[2])
    x, f = joint_frame(model, i, at.pos, at.quat, at.rot)
    Q = quat_matrix(f[0], f[1], f[2], f[3])
    a = times(Q, e[0], e[1], e[2])
    c = model.joint_child_point[i]
    c0, c1, c2 = rotate(at.rot, i, c[0], c[1], c[2])
    y = (at.pos[i, 0] + c0, at.pos[i, 1] + c1, at.pos[i, 2] + c2)
    if effect == Effect.ORIENTATION:
        for r in range(3):
            _add_rotation(out[r], (x[0] - O[0], x[1] - O[1], x[2] - O[2]), a)
    else:
        t = (y[0] - x[0], y[1] - x[1], y[2] - x[2])
        _axis_twist(model, i, a, b, (y[0] - O[0], y[1] - O[1], y[2] - O[2]), t, out)


@kernel
def _joint_twist(model: Model, data: Data, effect: int, i: int, k: int, at: Configuration, out: Matrix) -> None:
    """out[0] = T at one configuration, out[1], out[2] = B of the translation and the rotation columns of joint i."""
    for r in range(3):
        for j in range(6):
            out[r, j] = 0.0
    if effect == Effect.PARENT_POINT or effect == Effect.CHILD_POINT:
        _point_twist(model, effect, i, k, at, out)
    elif effect == Effect.LEAD:
        _lead_twist(model, i, at, out)
    else:
        _turn_twist(model, data.origin, effect, i, k, at, out)


@kernel
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]


@kernel
def _mark_below(model: Model, i: int, below: Vector) -> None:
    """below = 1 for body i and those that hang on it."""
    for b in range(below.shape[0]):
        p = model.body_parent[b]
        below[b] = 1.0 if b == i or (p >= 0 and below[p] > 0.0) else 0.0


@kernel
def _add_lead(model: Model, data: Data, at: At, i: int, w: float, col: int) -> None:
    """a . f of the column (a, 0) that a lead adds to that of the rotation; f: residual force on the subtree of i."""
    d = model.body_vadr[i + 1] - 1
    s = data.S2[d]
    for b in range(i, at.below.shape[0]):
        f = data.wrench[b]
        data.columns[d, col] -= w * at.below[b] * (s[3] * f[0] + s[4] * f[1] + s[5] * f[2])


@kernel
def add_geometry(model: Model, data: Data, at: At, effect: int, i: int, k: int, w: float, col: int) -> None:
    """The column of a change of the geometry of joint i."""
    T = at.twists
    _joint_twist(model, data, effect, i, k, Configuration(data.theta1, data.pos1, data.quat1, data.rot1), T[0:3])
    _joint_twist(model, data, effect, i, k, Configuration(at.q, data.pos2, data.quat2, data.rot2), T[3:6])
    _joint_twist(model, data, effect, i, k, Configuration(data.theta3, data.pos3, data.quat3, data.rot3), T[6:9])
    T1, T2, T3, F = T[0], T[3], T[6], T[_PRODUCT]
    for r in range(6):
        A1, A2, A3 = data.A1[i, 6 * r : 6 * r + 6], data.A2[i, 6 * r : 6 * r + 6], data.A3[i, 6 * r : 6 * r + 6]
        F[r] = _dot(A1, T1) + _dot(A2, T2) + _dot(A3, T3)
    X = data.columns
    first_rotation = model.body_vadr[i] + model.joint_ntrans[i]
    for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
        B = T[4] if d < first_rotation else T[5]
        X[d, col] -= w * (_dot(data.S2[d], F) + _dot(B, data.F[d, DirectionRow.TURNED : DirectionRow.TURNED + 6]))
    p = model.body_parent[i]
    while p >= 0:
        for d in range(model.body_vadr[p], model.body_vadr[p + 1]):
            X[d, col] -= w * _dot(data.S2[d], F)
        p = model.body_parent[p]
    _mark_below(model, i, at.below)
    if effect == Effect.LEAD:
        _add_lead(model, data, at, i, w, col)
    for b in range(i + 1, at.below.shape[0]):
        if at.below[b] > 0.0:
            for d in range(model.body_vadr[b], model.body_vadr[b + 1]):
                G = data.G[d]
                X[d, col] -= w * (_dot(G[0:6], T1) + _dot(G[6:12], T2) + _dot(G[12:18], T3))
    add_coupled_geometry(model, data, at, w, col)


@kernel
def add_coupled_geometry(model: Model, data: Data, at: At, w: float, col: int) -> None:
    """The effect of a change of geometry on couplings across branches: wrench F on a and -F on b, gaps of loops."""
    T2, T3, F = at.twists[3], at.twists[6], at.twists[_PRODUCT]
    loops = model.coupling_body.shape[0] - model.loop_ntrans.shape[0]
    for k in range(model.coupling_body.shape[0]):
        for side in range(2):
            i = model.coupling_body[k, side]
            other = model.coupling_body[k, 1 - side]
            far = k < loops and data.coupling_live[k] == 0  # its rows are those of an earlier step
            if i < 0 or at.below[i] == 0.0 or far:
                continue
            K2 = data.coupling_K2[2 * k + side]
            for r in range(6):
                F[r] = _dot(K2[6 * r : 6 * r + 6], T2)
            for row in range(model.coupling_row[k], model.coupling_row[k + 1]):
                t = _dot(data.couple_R[row, 6 * side : 6 * side + 6], T3)
                if k >= loops:
                    data.couple_panel[row, col] += w * t
                    continue
                if data.couple_E[row] == 0.0:  # no row
                    continue
                for r in range(6):
                    F[r] += data.couple_B[row, r] * t / data.couple_E[row]
            add_wrench(model, data, other, (F[0], F[1], F[2]), (F[3], F[4], F[5]), w if side == 0 else -w, col)
    for j in range(model.pair_kind.shape[0]):
        if data.bounce[model.contact_height.shape[0] + j, Bounce.RESTITUTION] > 0.0:
            _add_coupled_impact(model, data, at, j, w, col)


@kernel
def _add_coupled_impact(model: Model, data: Data, at: At, j: int, w: float, col: int) -> None:
    """As `add_bounce_derivatives`: a floor that the motion of one body raises pushes the other."""
    c = model.contact_height.shape[0] + j
    b = data.bounce[c]
    rise = b[Bounce.RESTITUTION] * _dot(b[Bounce.ROW1 : Bounce.ROW2], at.twists[0]) + (
        1.0 - b[Bounce.RESTITUTION]
    ) * _dot(b[Bounce.ROW2 : Bounce.GAP1], at.twists[3])
    f, t = gap_wrench(model, data, c)
    for side in range(2):
        i = model.coupling_body[model.pair_coupling[j], side]
        if i >= 0 and at.below[i] > 0.0:
            add_wrench(model, data, model.coupling_body[model.pair_coupling[j], 1 - side], f, t, -w * rise, col)
