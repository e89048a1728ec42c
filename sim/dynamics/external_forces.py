"""Gravity, inputs and external wrenches on a tree, and their derivatives; about O, in world axes."""

from __future__ import annotations

from sim.dynamics.elimination import add_children
from sim.model.data import Data
from sim.model.model import InputKind, Model
from solvers.compiler import kernel
from solvers.dense import clear, copy, dot
from solvers.rotation import cross, rotate
from solvers.types import Cube, Matrix, Vector


@kernel
def set_external(data: Data, wrenches: Cube, t: int) -> None:
    """data.carry.external = wrenches[t] (nbody, 6), of all steps or nodes; zero of (0, nbody, 6).

    External wrenches enter here and nowhere else, before a step begins or a node is evaluated.
    """
    if wrenches.shape[0] > 0:
        copy(wrenches[t], data.carry.external)
    else:
        clear(data.carry.external)


@kernel
def input_wrench(model: Model, data: Data, j: int, out: Vector) -> None:
    """out[:6] = wrench about O per unit of the WORLD or BODY input j, at the configuration in `data`."""
    i = model.input_index[j]
    w = model.input_wrench[j]
    f = (w[0], w[1], w[2])
    t = (w[3], w[4], w[5])
    if model.input_kind[j] == InputKind.BODY:
        f = rotate(data.rot2, i, f[0], f[1], f[2])
        t = rotate(data.rot2, i, t[0], t[1], t[2])
    o = data.origin
    x, y, z = data.pos2[i, 0] - o[0], data.pos2[i, 1] - o[1], data.pos2[i, 2] - o[2]
    c = cross(x, y, z, f[0], f[1], f[2])
    for k in range(3):
        out[k] = f[k]
        out[3 + k] = t[k] + c[k]


@kernel
def outer_wrenches(model: Model, data: Data, u: Vector, out: Matrix) -> None:
    """out[i] = wrench of gravity, external wrenches and WORLD and BODY inputs on the subtree of body i.   (nbody, 6)"""
    n = model.body_parent.shape[0]
    o, g = data.origin, model.gravity
    for i in range(n):
        m = model.body_mass[i] * model.body_weight[i]
        F = out[i]
        e = data.carry.external[i]
        F[0], F[1], F[2] = m * g[0] + e[0], m * g[1] + e[1], m * g[2] + e[2]
        x, y, z = data.pos2[i, 0] - o[0], data.pos2[i, 1] - o[1], data.pos2[i, 2] - o[2]
        t = cross(x, y, z, F[0], F[1], F[2])
        F[3], F[4], F[5] = t[0] + e[3], t[1] + e[4], t[2] + e[5]
    for j in range(u.shape[0]):
        if model.input_kind[j] != InputKind.JOINT:
            w = data.wrench[0]
            input_wrench(model, data, j, w)
            for k in range(6):
                out[model.input_index[j], k] += u[j] * w[k]
    add_children(model, out)


@kernel
def _add_force_slope(f: Vector, x: float, y: float, z: float, out: Vector) -> None:
    """out += [0 0; -[f]  [f][r]]: a force f that keeps its direction, at r = (x, y, z) from O."""
    s = f[0] * x + f[1] * y + f[2] * z
    r = (x, y, z)
    out[19], out[20] = out[19] + f[2], out[20] - f[1]
    out[24], out[26] = out[24] - f[2], out[26] + f[0]
    out[30], out[31] = out[30] + f[1], out[31] - f[0]
    for a in range(3):  # [f][r] = r f^T - (f.r) I
        for b in range(3):
            out[6 * (3 + a) + 3 + b] += r[a] * f[b]
        out[7 * (3 + a)] -= s


@kernel
def outer_slopes(model: Model, data: Data, u: Vector, out: Matrix) -> None:
    """out[i] = d(outer_wrenches of the subtree of body i)/d(twist of the tree), (nbody, 36): 6 x 6 by rows.

    The force of a BODY input turns with its body.
    """
    n, o, w = model.body_parent.shape[0], data.origin, data.wrench[0]
    for i in range(n):
        for k in range(36):
            out[i, k] = 0.0
        for k in range(3):
            w[k] = model.body_mass[i] * model.body_weight[i] * model.gravity[k] + data.carry.external[i, k]
        _add_force_slope(w, data.pos2[i, 0] - o[0], data.pos2[i, 1] - o[1], data.pos2[i, 2] - o[2], out[i])
    for j in range(u.shape[0]):
        if model.input_kind[j] == InputKind.JOINT:
            continue
        i = model.input_index[j]
        input_wrench(model, data, j, w)
        for k in range(6):
            w[k] *= u[j]
        N = out[i]
        if model.input_kind[j] != InputKind.BODY:
            _add_force_slope(w, data.pos2[i, 0] - o[0], data.pos2[i, 1] - o[1], data.pos2[i, 2] - o[2], N)
            continue
        for r in range(3):  # S* w = (-[f] w_S, -[n] w_S - [f] v_S)
            a, b = (r + 1) % 3, (r + 2) % 3
            N[6 * r + 3 + a] += w[b]
            N[6 * r + 3 + b] -= w[a]
            N[18 + 6 * r + 3 + a] += w[3 + b]
            N[18 + 6 * r + 3 + b] -= w[3 + a]
            N[18 + 6 * r + a] += w[b]
            N[18 + 6 * r + b] -= w[a]
    add_children(model, out)


@kernel
def input_slopes(model: Model, data: Data, out: Matrix) -> None:
    """out = df/du: the gain at the dof of a JOINT input, S_d . wrench above the body of the others."""
    w = data.wrench[0]
    for j in range(out.shape[1]):
        for d in range(out.shape[0]):
            out[d, j] = 0.0
        i = model.input_index[j]
        if model.input_kind[j] == InputKind.JOINT:
            out[i, j] = model.input_wrench[j, 0]
            continue
        input_wrench(model, data, j, w)
        while i >= 0:
            for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
                out[d, j] = w[d - model.body_vadr[i]] if model.root_free[i] == 1 else dot(data.S2[d], w)
            i = model.body_parent[i]
