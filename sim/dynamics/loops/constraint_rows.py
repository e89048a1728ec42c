"""Rows of the dense system of the couplings (coupling_system.py): their list, their forces and their responses."""

from __future__ import annotations

from sim.dynamics.loops.gears import add_gear_columns, gear_response, unit_gear_impulse
from sim.model.data import Data
from sim.model.model import Model
from solvers.compiler import kernel
from solvers.dense import dot
from solvers.types import Matrix, Vector

_ROUNDING = 1e-14  # stiffness below this share of the largest is rounding


@kernel
def is_loop(model: Model, k: int) -> bool:
    """Whether coupling k is a closed loop; they come after the pairs."""
    return k >= model.coupling_body.shape[0] - model.loop_ntrans.shape[0]


@kernel
def take_apart(data: Data, k: int, row: int) -> None:
    """Rows of couple_B, couple_R and couple_E from row on: (K_a, K_b) = B D R by elimination with full pivoting.

    coupling_K is overwritten; rows whose pivots have fallen to rounding are omitted: their forces have no effect.
    """
    first = 0.0
    for r in range(row, row + 6):
        best = 0.0
        i = 0
        j = 0
        for side in range(2):
            K = data.coupling_K[2 * k + side]
            for e in range(36):
                if abs(K[e]) > abs(best):
                    best = K[e]
                    i = e // 6
                    j = 6 * side + e % 6
        if r == row:
            first = abs(best)
        B = data.couple_B[r]
        R = data.couple_R[r]
        for c in range(6):
            B[c] = 0.0
            R[c] = 0.0
            R[6 + c] = 0.0
        data.couple_E[r] = 0.0  # no row, and none after it
        if not abs(best) > _ROUNDING * first:
            continue
        data.couple_E[r] = 1.0 / best
        for c in range(6):
            B[c] = data.coupling_K[2 * k + j // 6, 6 * c + j % 6] / best
            R[c] = data.coupling_K[2 * k, 6 * i + c] / best
            R[6 + c] = data.coupling_K[2 * k + 1, 6 * i + c] / best
        for side in range(2):
            K = data.coupling_K[2 * k + side]
            for c in range(6):
                f = best * B[c]
                for e in range(6):
                    K[6 * c + e] -= f * R[6 * side + e]


@kernel
def add_along_path(model: Model, S: Matrix, i: int, sign: float, w: Vector, out: Vector) -> None:
    """out[d] += sign S[d].w for the joints between body i and the root."""
    while i >= 0:
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            s = S[d]
            out[d] += sign * (s[0] * w[0] + s[1] * w[1] + s[2] * w[2] + s[3] * w[3] + s[4] * w[4] + s[5] * w[5])
        i = model.body_parent[i]


@kernel
def response(model: Model, data: Data, k: int, row: int) -> float:
    """R_a zeta_a + R_b zeta_b of a row of coupling k, with the twists of the last solve."""
    R = data.couple_R[row]
    t = 0.0
    for side in range(2):
        i = model.coupling_body[k, side]
        if i >= 0:
            z = data.twist[i]
            for c in range(6):
                t += R[6 * side + c] * z[c]
    return t


@kernel
def response_size(model: Model, data: Data, k: int, row: int) -> float:
    """|R||zeta| instead of R zeta, translations and rotations apart: a response far below it is rounding."""
    R = data.couple_R[row]
    t = 0.0
    for side in range(2):
        i = model.coupling_body[k, side]
        if i >= 0:
            for part in range(2):
                r = 0.0
                z = 0.0
                for c in range(3 * part, 3 * part + 3):
                    r += R[6 * side + c] ** 2
                    z += data.twist[i, c] ** 2
                t += (r * z) ** 0.5
    return t


@kernel
def enlist(model: Model, data: Data) -> int:
    """couple_live: rows of the dense system, with their coupling, or number of couplings + gear; returns how many."""
    n = 0
    count = model.coupling_body.shape[0]
    for k in range(count):
        if not is_loop(model, k):
            if data.coupling_live[k] == 0:
                continue
            take_apart(data, k, model.coupling_row[k])
        for row in range(model.coupling_row[k], model.coupling_row[k + 1]):
            if is_loop(model, k) or data.couple_E[row] > 0.0 or data.couple_E[row] < 0.0:
                data.couple_live[n, 0] = row
                data.couple_live[n, 1] = k
                n += 1
    for k in range(model.gear_dof.shape[0]):
        data.couple_live[n, 0] = model.coupling_row[count] + k
        data.couple_live[n, 1] = count + k
        n += 1
    return n


@kernel
def unit_impulse(model: Model, data: Data, p: int, out: Vector) -> None:
    """out (nv,) = the generalized impulse of a unit force in row p of the dense system."""
    row, k = data.couple_live[p, 0], data.couple_live[p, 1]
    if k >= model.coupling_body.shape[0]:
        unit_gear_impulse(model, k - model.coupling_body.shape[0], out)
        return
    for d in range(out.shape[0]):
        out[d] = 0.0
    add_along_path(model, data.S2, model.coupling_body[k, 0], 1.0, data.couple_B[row], out)
    add_along_path(model, data.S2, model.coupling_body[k, 1], -1.0, data.couple_B[row], out)
    if data.bifurcation_count[0] > 0:
        for d in range(out.shape[0]):
            out[d] += data.bifurcation_direction[row, d]


@kernel
def row_response(model: Model, data: Data, p: int, y: Vector) -> float:
    """Row p of the dense system times the velocities y (nv,), whose twists are in data.twist."""
    row, k = data.couple_live[p, 0], data.couple_live[p, 1]
    if k >= model.coupling_body.shape[0]:
        return gear_response(model, data, k - model.coupling_body.shape[0], y)
    led = dot(data.bifurcation_direction[row], y) if data.bifurcation_replaces[0] > 0 else 0.0
    return response(model, data, k, row) + led


@kernel
def add_columns(model: Model, data: Data, p: int, x: Vector) -> None:
    """x = the row of couple_panel that is row p of the dense system, plus its response to the columns."""
    row, k = data.couple_live[p, 0], data.couple_live[p, 1]
    for m in range(x.shape[0]):
        x[m] = data.couple_panel[row, m]  # p <= row
    if k >= model.coupling_body.shape[0]:
        add_gear_columns(model, data, k - model.coupling_body.shape[0], x)
        return
    for side in range(2):
        i = model.coupling_body[k, side]
        if i < 0:
            continue
        for c in range(6):
            f = data.couple_R[row, 6 * side + c]
            z = data.panel[6 * i + c]
            for m in range(x.shape[0]):
                x[m] += f * z[m]
