"""Closed loops: joints that close the tree, as constraints between their bodies with explicit forces.

    g(z_a, z_b) = 0 at configuration 3        wrench on a += G2^T f, on b -= G2^T f        G = dg/d(twist of a about O)

As for the joints of the tree, forces act along the constraint directions of configuration 2: the discrete null-space
form of the variational integrator, so momentum stays exact and no energy is lost. g is at the level of positions, and
does not drift. A rigid motion of both bodies leaves g alone, so its derivative by the twist of b is -G.

A loop joint sits on b (the parent) with the frame Q = R_b offset, and holds the point of a (the child):

    translations   t.(x_a + R_a c_a - x_b - R_b c_b), t = Q e, for every axis e that is not free
    rotations      (Q e1).(R_a axis), (Q e2).(R_a axis) around a free axis; vee(E - E^T)/2, E = Q^T R_a, where none is
"""

from __future__ import annotations

from sim.coupling_rows import is_loop
from sim.model import Late, Matrix, Model, Vector, Work
from sim.pair_stiffness import add_wrench_column, point_shift, unit_vector
from sim.rotation import Vec3, cross, rotate
from solvers.jit import kernel
from solvers.late import late


@kernel
def loop_frame(model: Model, work: Work, m: int, b: int, pos: Matrix, rot: Matrix) -> None:
    """loop_frame = Q (9) and the joint point on b (3) of loop m, world axes."""
    out = work.loop_frame[m]
    c = model.loop_point[m]
    Q = model.loop_offset[m]
    if b < 0:
        for k in range(9):
            out[k] = Q[k]
        for k in range(3):
            out[9 + k] = c[k]
        return
    for k in range(3):
        x, y, z = rotate(rot, b, Q[k], Q[3 + k], Q[6 + k])
        out[k] = x
        out[3 + k] = y
        out[6 + k] = z
    x, y, z = rotate(rot, b, c[0], c[1], c[2])
    out[9] = pos[b, 0] + x
    out[10] = pos[b, 1] + y
    out[11] = pos[b, 2] + z


@kernel
def child_point(model: Model, m: int, a: int, pos: Matrix, rot: Matrix) -> Vec3:
    """x_a + R_a c_a"""
    c = model.loop_point[m]
    x, y, z = rotate(rot, a, c[3], c[4], c[5])
    return pos[a, 0] + x, pos[a, 1] + y, pos[a, 2] + z


@kernel
def turned(Q: Vector, x: float, y: float, z: float) -> Vec3:
    """Q (x, y, z)"""
    return (
        Q[0] * x + Q[1] * y + Q[2] * z,
        Q[3] * x + Q[4] * y + Q[5] * z,
        Q[6] * x + Q[7] * y + Q[8] * z,
    )


@kernel
def relative_rotation(Q: Vector, rot: Matrix, a: int, out: Vector) -> None:
    """out (9) = E = Q^T R_a."""
    for r in range(3):
        for c in range(3):
            out[3 * r + c] = Q[r] * rot[a, c] + Q[3 + r] * rot[a, 3 + c] + Q[6 + r] * rot[a, 6 + c]


@kernel
def _set_row(row: Vector, v: Vec3, w: Vec3) -> None:
    for k in range(3):
        row[k] = v[k]
        row[3 + k] = w[k]


@kernel
def loop_rows(model: Model, work: Work, m: int, pos: Matrix, rot: Matrix, out: Matrix) -> None:
    """Rows of G of loop m at these poses, about O, into out; and couple_gap = g."""
    k = model.coupling_body.shape[0] - model.loop_ntrans.shape[0] + m
    a = model.coupling_body[k, 0]
    row = model.coupling_row[k]
    loop_frame(model, work, m, model.coupling_body[k, 1], pos, rot)
    Q = work.loop_frame[m]
    A = child_point(model, m, a, pos, rot)
    o = work.origin
    for e in range(3 - model.loop_ntrans[m]):
        u = model.loop_axes[m, 3 * e : 3 * e + 3]
        t = turned(Q, u[0], u[1], u[2])
        w = cross(A[0] - o[0], A[1] - o[1], A[2] - o[2], t[0], t[1], t[2])
        _set_row(out[row], t, w)
        work.couple_gap[row] = t[0] * (A[0] - Q[9]) + t[1] * (A[1] - Q[10]) + t[2] * (A[2] - Q[11])
        row += 1
    zero = (0.0, 0.0, 0.0)
    if model.loop_nrot[m] == 1:
        s = model.loop_axis[m]
        r = rotate(rot, a, s[6], s[7], s[8])
        for e in range(2):
            t = turned(Q, s[3 * e], s[3 * e + 1], s[3 * e + 2])
            _set_row(out[row], zero, cross(r[0], r[1], r[2], t[0], t[1], t[2]))
            work.couple_gap[row] = t[0] * r[0] + t[1] * r[1] + t[2] * r[2]
            row += 1
    elif model.loop_nrot[m] == 0:
        E = work.loop_turn[m]
        relative_rotation(Q, rot, a, E)
        trace = E[0] + E[4] + E[8]
        for e in range(3):  # row e of (tr E - E) Q^T / 2
            x = turned(
                Q,
                0.5 * ((trace if e == 0 else 0.0) - E[3 * e]),
                0.5 * ((trace if e == 1 else 0.0) - E[3 * e + 1]),
                0.5 * ((trace if e == 2 else 0.0) - E[3 * e + 2]),
            )
            _set_row(out[row], zero, x)
            p = (e + 1) % 3
            q = (e + 2) % 3
            work.couple_gap[row] = 0.5 * (E[3 * q + p] - E[3 * p + q])
            row += 1


@late(Late.START_LOOPS)
def start_loops(model: Model, work: Work, keep: bool) -> None:
    """Force directions couple_B at configuration 2; forces at zero, or those of the step before."""
    for m in range(model.loop_ntrans.shape[0]):
        loop_rows(model, work, m, work.pos2, work.rot2, work.couple_B)
    if not keep:
        for row in range(work.couple_force.shape[0]):
            work.couple_force[row] = 0.0
    for row in range(work.couple_step.shape[0]):
        work.couple_step[row] = 0.0


@late(Late.APPLY_LOOPS, 0.0)
def apply_loops(model: Model, work: Work) -> float:
    """wrench -= loop forces on a, += on b; couple_gap and couple_R at configuration 3; returns the largest gap."""
    for m in range(model.loop_ntrans.shape[0]):
        loop_rows(model, work, m, work.pos3, work.rot3, work.couple_G)
    error = 0.0
    for k in range(model.coupling_body.shape[0]):
        if not is_loop(model, k):
            continue
        a = model.coupling_body[k, 0]
        b = model.coupling_body[k, 1]
        for row in range(model.coupling_row[k], model.coupling_row[k + 1]):
            error = max(error, abs(work.couple_gap[row]))
            for c in range(6):
                work.couple_R[row, c] = work.couple_G[row, c]
                work.couple_R[row, 6 + c] = -work.couple_G[row, c]
                work.wrench[a, c] -= work.couple_force[row] * work.couple_B[row, c]
                if b >= 0:
                    work.wrench[b, c] += work.couple_force[row] * work.couple_B[row, c]
    return error


@late(Late.KEEP_LOOPS)
def keep_loops(model: Model, work: Work) -> None:
    """Remember the loop forces from which the line search starts."""
    for row in range(work.couple_force.shape[0]):
        work.couple_trial[row] = work.couple_force[row]


@late(Late.MOVE_LOOPS)
def move_loops(model: Model, work: Work, alpha: float) -> None:
    """force = kept + alpha step; pairs have none of their own."""
    first = model.coupling_row[model.coupling_body.shape[0] - model.loop_ntrans.shape[0]]
    for row in range(first, work.couple_force.shape[0]):
        work.couple_force[row] = work.couple_trial[row] + alpha * work.couple_step[row]


@kernel
def loop_stiffness(model: Model, work: Work, m: int, K2: Matrix) -> Vec3:
    """K2 (2, 36) += d(G2^T f) by the twists of a and b at configuration 2; returns the force on a."""
    k = model.coupling_body.shape[0] - model.loop_ntrans.shape[0] + m
    a = model.coupling_body[k, 0]
    b = model.coupling_body[k, 1]
    row = model.coupling_row[k]
    loop_frame(model, work, m, b, work.pos2, work.rot2)
    A = child_point(model, m, a, work.pos2, work.rot2)
    o = work.origin
    P = (A[0] - o[0], A[1] - o[1], A[2] - o[2])
    fx, fy, fz = 0.0, 0.0, 0.0
    for _ in range(3 - model.loop_ntrans[m]):
        g = work.couple_force[row]
        fx += g * work.couple_B[row, 0]
        fy += g * work.couple_B[row, 1]
        fz += g * work.couple_B[row, 2]
        row += 1
    f = (fx, fy, fz)
    zero = (0.0, 0.0, 0.0)
    for c in range(6):
        e = unit_vector(c - 3)
        add_wrench_column(K2[0], c, f, zero, P, point_shift(c, P[0], P[1], P[2]))
        add_wrench_column(K2[1], c, f, cross(e[0], e[1], e[2], fx, fy, fz), P, zero)
        if c < 3:
            continue
        for side in range(2):
            d = _torque_rate(model, work, m, a, row, e, side)
            for r in range(3):
                K2[side, 18 + 6 * r + c] += d[r]
    return f


@kernel
def _torque_rate(model: Model, work: Work, m: int, a: int, row: int, e: Vec3, side: int) -> Vec3:
    """Change of the constraint torque of loop m when a (side 0) or b (side 1) turns by e at configuration 2."""
    Q = work.loop_frame[m]
    if model.loop_nrot[m] == 1:
        s = model.loop_axis[m]
        r = rotate(work.rot2, a, s[6], s[7], s[8])
        x, y, z = 0.0, 0.0, 0.0
        for i in range(2):
            g = work.couple_force[row + i]
            t = turned(Q, g * s[3 * i], g * s[3 * i + 1], g * s[3 * i + 2])
            x += t[0]
            y += t[1]
            z += t[2]
        if side == 0:
            d = cross(e[0], e[1], e[2], r[0], r[1], r[2])
            return cross(d[0], d[1], d[2], x, y, z)
        d = cross(e[0], e[1], e[2], x, y, z)
        return cross(r[0], r[1], r[2], d[0], d[1], d[2])
    if model.loop_nrot[m] != 0:
        return 0.0, 0.0, 0.0
    E = work.loop_turn[m]
    relative_rotation(Q, work.rot2, a, E)
    f = (work.couple_force[row], work.couple_force[row + 1], work.couple_force[row + 2])
    sign = 1.0 if side == 0 else -1.0
    p = (  # Q^T e
        sign * (Q[0] * e[0] + Q[3] * e[1] + Q[6] * e[2]),
        sign * (Q[1] * e[0] + Q[4] * e[1] + Q[7] * e[2]),
        sign * (Q[2] * e[0] + Q[5] * e[1] + Q[8] * e[2]),
    )
    # M = Q (tr E - E^T) f / 2 turns with b, and E changes by [p] E
    dtrace = -(p[0] * (E[7] - E[5]) + p[1] * (E[2] - E[6]) + p[2] * (E[3] - E[1]))
    c = cross(p[0], p[1], p[2], f[0], f[1], f[2])
    x, y, z = turned(
        Q,
        0.5 * (dtrace * f[0] + E[0] * c[0] + E[3] * c[1] + E[6] * c[2]),
        0.5 * (dtrace * f[1] + E[1] * c[0] + E[4] * c[1] + E[7] * c[2]),
        0.5 * (dtrace * f[2] + E[2] * c[0] + E[5] * c[1] + E[8] * c[2]),
    )
    if side == 1:
        trace = E[0] + E[4] + E[8]
        M = turned(
            Q,
            0.5 * (trace * f[0] - E[0] * f[0] - E[3] * f[1] - E[6] * f[2]),
            0.5 * (trace * f[1] - E[1] * f[0] - E[4] * f[1] - E[7] * f[2]),
            0.5 * (trace * f[2] - E[2] * f[0] - E[5] * f[1] - E[8] * f[2]),
        )
        d = cross(e[0], e[1], e[2], M[0], M[1], M[2])
        return x + d[0], y + d[1], z + d[2]
    return x, y, z
