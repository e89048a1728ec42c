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

from sim.dynamics.frame_placement import place_frame
from sim.dynamics.loops.constraint_rows import is_loop
from sim.model.data import Data
from sim.model.model import Model
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.rotation import Vec3, cross, join, rotate, times
from solvers.types import Matrix, Vector


@kernel
def loop_frame(model: Model, data: Data, m: int, b: int, pos: Matrix, rot: Matrix) -> None:
    """loop_frame = Q (9) and the joint point on b (3) of loop m, world axes."""
    out = data.loop_frame[m]
    place_frame(model.loop_point[m, :3], model.loop_offset[m], b, pos, rot, out[9:12], out[:9])


@kernel
def child_point(model: Model, m: int, a: int, pos: Matrix, rot: Matrix) -> Vec3:
    """x_a + R_a c_a"""
    c = model.loop_point[m]
    x, y, z = rotate(rot, a, c[3], c[4], c[5])
    return pos[a, 0] + x, pos[a, 1] + y, pos[a, 2] + z


@kernel
def relative_rotation(Q: Vector, rot: Matrix, a: int, out: Vector) -> None:
    """out (9) = E = Q^T R_a."""
    for r in range(3):
        for c in range(3):
            out[3 * r + c] = Q[r] * rot[a, c] + Q[3 + r] * rot[a, 3 + c] + Q[6 + r] * rot[a, 6 + c]


@kernel
def loop_rows(model: Model, data: Data, m: int, pos: Matrix, rot: Matrix, out: Matrix) -> None:
    """Rows of G of loop m at these poses, about O, into out; and couple_gap = g."""
    k = model.coupling_body.shape[0] - model.loop_ntrans.shape[0] + m
    a = model.coupling_body[k, 0]
    row = model.coupling_row[k]
    loop_frame(model, data, m, model.coupling_body[k, 1], pos, rot)
    Q = data.loop_frame[m]
    A = child_point(model, m, a, pos, rot)
    o = data.origin
    for e in range(3 - model.loop_ntrans[m]):
        u = model.loop_axes[m, 3 * e : 3 * e + 3]
        t = times(Q, u[0], u[1], u[2])
        w = cross(A[0] - o[0], A[1] - o[1], A[2] - o[2], t[0], t[1], t[2])
        join(out[row], t, w)
        data.couple_gap[row] = t[0] * (A[0] - Q[9]) + t[1] * (A[1] - Q[10]) + t[2] * (A[2] - Q[11])
        row += 1
    zero = (0.0, 0.0, 0.0)
    if model.loop_nrot[m] == 1:
        s = model.loop_axis[m]
        r = rotate(rot, a, s[6], s[7], s[8])
        for e in range(2):
            t = times(Q, s[3 * e], s[3 * e + 1], s[3 * e + 2])
            join(out[row], zero, cross(r[0], r[1], r[2], t[0], t[1], t[2]))
            data.couple_gap[row] = t[0] * r[0] + t[1] * r[1] + t[2] * r[2]
            row += 1
    elif model.loop_nrot[m] == 0:
        E = data.loop_turn[m]
        relative_rotation(Q, rot, a, E)
        trace = E[0] + E[4] + E[8]
        for e in range(3):  # row e of (tr E - E) Q^T / 2
            x = times(
                Q,
                0.5 * ((trace if e == 0 else 0.0) - E[3 * e]),
                0.5 * ((trace if e == 1 else 0.0) - E[3 * e + 1]),
                0.5 * ((trace if e == 2 else 0.0) - E[3 * e + 2]),
            )
            join(out[row], zero, x)
            p = (e + 1) % 3
            q = (e + 2) % 3
            data.couple_gap[row] = 0.5 * (E[3 * q + p] - E[3 * p + q])
            row += 1


@kernel
def direct_loops(model: Model, data: Data) -> None:
    """couple_B = rows of G at configuration 2, and couple_gap = g there."""
    for m in range(model.loop_ntrans.shape[0]):
        loop_rows(model, data, m, data.pos2, data.rot2, data.couple_B)


@optional(Slot.START_LOOPS)
def start_loops(model: Model, data: Data, keep: bool) -> None:
    """Force directions couple_B at configuration 2; forces at zero, or those of the step before."""
    direct_loops(model, data)
    if not keep:
        for row in range(data.carry.couple_force.shape[0]):
            data.carry.couple_force[row] = 0.0
    for row in range(data.couple_step.shape[0]):
        data.couple_step[row] = 0.0
        data.loop_open[row] = abs(data.couple_gap[row])


@optional(Slot.APPLY_LOOPS, default=0.0)
def apply_loops(model: Model, data: Data) -> float:
    """wrench -= loop forces on a, += on b; couple_gap and couple_R at configuration 3; returns the largest gap."""
    for m in range(model.loop_ntrans.shape[0]):
        loop_rows(model, data, m, data.pos3, data.rot3, data.couple_G)
    error = 0.0
    for k in range(model.coupling_body.shape[0]):
        if not is_loop(model, k):
            continue
        a = model.coupling_body[k, 0]
        b = model.coupling_body[k, 1]
        for row in range(model.coupling_row[k], model.coupling_row[k + 1]):
            error = max(error, abs(data.couple_gap[row]))
            for c in range(6):
                data.couple_R[row, c] = data.couple_G[row, c]
                data.couple_R[row, 6 + c] = -data.couple_G[row, c]
                data.wrench[a, c] -= data.carry.couple_force[row] * data.couple_B[row, c]
                if b >= 0:
                    data.wrench[b, c] += data.carry.couple_force[row] * data.couple_B[row, c]
    return error


@optional(Slot.KEEP_LOOPS)
def keep_loops(model: Model, data: Data) -> None:
    """Remember the loop forces from which the line search starts."""
    for row in range(data.carry.couple_force.shape[0]):
        data.couple_trial[row] = data.carry.couple_force[row]


@optional(Slot.MOVE_LOOPS)
def move_loops(model: Model, data: Data, alpha: float) -> None:
    """force = kept + alpha step; pairs have none of their own."""
    first = model.coupling_row[model.coupling_body.shape[0] - model.loop_ntrans.shape[0]]
    for row in range(first, data.carry.couple_force.shape[0]):
        data.carry.couple_force[row] = data.couple_trial[row] + alpha * data.couple_step[row]
