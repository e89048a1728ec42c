"""Parameters of the couplings of the tree: joints that close loops, and gears; columns[:, col] -= w dR/d(parameter).

The gaps of loops and gears have rows of their own: couple_panel[:, col] += w dg.
"""

from __future__ import annotations

from sim.contact.pairs.wrench_columns import unit_vector
from sim.derivatives.parameters.body_columns import add_wrench
from sim.derivatives.parameters.directions import Effect
from sim.dynamics.loops.closure import child_point, loop_frame
from sim.dynamics.loops.gears import gear_row
from sim.model.data import Data
from sim.model.model import Model
from solvers.compiler import kernel
from solvers.rotation import cross, rotate, times


@kernel
def add_loop_geometry(model: Model, data: Data, effect: int, m: int, k: int, w: float, col: int) -> None:
    """Loop m, force f_e along t_e at the child's point A, t.(A - B) the gap:

    child point    dA = R_a e    gap t3.dA3    moment on a  dA2 x t2 f
    parent point   dB = R_b e    gap -t3.dB3
    """
    c = model.coupling_body.shape[0] - model.loop_ntrans.shape[0] + m
    a, b = model.coupling_body[c, 0], model.coupling_body[c, 1]
    e = unit_vector(k)
    i = a if effect == Effect.LOOP_CHILD else b
    d2 = rotate(data.rot2, i, e[0], e[1], e[2]) if i >= 0 else e
    d3 = rotate(data.rot3, i, e[0], e[1], e[2]) if i >= 0 else e
    sign = 1.0 if effect == Effect.LOOP_CHILD else -1.0
    loop_frame(model, data, m, b, data.pos3, data.rot3)
    first = model.coupling_row[c]
    for r in range(3 - model.loop_ntrans[m]):
        u = model.loop_axes[m, 3 * r : 3 * r + 3]
        t = times(data.loop_frame[m], u[0], u[1], u[2])
        data.couple_panel[first + r, col] += w * sign * (t[0] * d3[0] + t[1] * d3[1] + t[2] * d3[2])
    if effect == Effect.LOOP_PARENT:
        return
    loop_frame(model, data, m, b, data.pos2, data.rot2)
    for r in range(3 - model.loop_ntrans[m]):
        u = model.loop_axes[m, 3 * r : 3 * r + 3]
        t = times(data.loop_frame[m], u[0], u[1], u[2])
        x = cross(d2[0], d2[1], d2[2], t[0], t[1], t[2])
        f = w * data.carry.couple_force[first + r]
        add_wrench(model, data, a, (0.0, 0.0, 0.0), x, -f, col)
        add_wrench(model, data, b, (0.0, 0.0, 0.0), x, f, col)


@kernel
def add_loop_turn(model: Model, data: Data, m: int, k: int, w: float, col: int) -> None:
    """The frame of loop m turns by e = Q e_k:  dt = e x t of its directions; gap dt.(A - B) or dt.(axis of a)."""
    c = model.coupling_body.shape[0] - model.loop_ntrans.shape[0] + m
    a, b = model.coupling_body[c, 0], model.coupling_body[c, 1]
    n = 3 - model.loop_ntrans[m]
    O = data.origin
    s = model.loop_axis[m]
    for configuration in range(2, 4):
        pos = data.pos2 if configuration == 2 else data.pos3
        rot = data.rot2 if configuration == 2 else data.rot3
        loop_frame(model, data, m, b, pos, rot)
        Q = data.loop_frame[m]
        e = (Q[k], Q[3 + k], Q[6 + k])
        A = child_point(model, m, a, pos, rot)
        axis = rotate(rot, a, s[6], s[7], s[8])
        for r in range(n + (2 if model.loop_nrot[m] == 1 else 0)):
            row = model.coupling_row[c] + r
            u = model.loop_axes[m, 3 * r : 3 * r + 3] if r < n else s[3 * (r - n) : 3 * (r - n) + 3]
            t = times(Q, u[0], u[1], u[2])
            t = cross(e[0], e[1], e[2], t[0], t[1], t[2])
            if configuration == 3:
                g = (A[0] - Q[9], A[1] - Q[10], A[2] - Q[11]) if r < n else axis
                data.couple_panel[row, col] += w * (t[0] * g[0] + t[1] * g[1] + t[2] * g[2])
                continue
            f = w * data.carry.couple_force[row]
            x = (A[0] - O[0], A[1] - O[1], A[2] - O[2]) if r < n else axis
            x = cross(x[0], x[1], x[2], t[0], t[1], t[2])
            force = t if r < n else (0.0, 0.0, 0.0)
            add_wrench(model, data, a, force, x, -f, col)
            add_wrench(model, data, b, force, x, f, col)


@kernel
def add_gear_ratio(model: Model, data: Data, k: int, w: float, col: int) -> None:
    """gap -q_b,   impulse -f on b"""
    b = model.gear_dof[k, 1]
    row = gear_row(model, k)
    data.couple_panel[row, col] -= w * data.theta3[model.dof_qadr[b]]
    data.columns[b, col] -= w * data.carry.couple_force[row]


@kernel
def add_gear_offset(model: Model, data: Data, k: int, w: float, col: int) -> None:
    """gap -1"""
    data.couple_panel[gear_row(model, k), col] -= w
