"""Rows of the system of the couplings (coupling_system.py): their list, their forces and their responses."""

from __future__ import annotations

from sim.dynamics.loops.gears import gear_response, gear_responses, unit_gear_impulse
from sim.model.data import Data
from sim.model.model import Model
from solvers.compiler import kernel
from solvers.dense import dot
from solvers.lanes import Lanes, dot_lanes, load, six, spread
from solvers.types import Matrix, Vector

_ROUNDING = 1e-14  # stiffness below this share of the largest is rounding


@kernel
def is_loop(model: Model, k: int) -> bool:
    """Whether coupling k is a closed loop; they come after the pairs."""
    return k >= model.coupling_body.shape[0] - model.loop_ntrans.shape[0]


@kernel
def is_pair(model: Model, k: int) -> bool:
    """Whether coupling k is that of two bodies in contact, not a loop or a gear."""
    return k < model.coupling_body.shape[0] - model.loop_ntrans.shape[0]


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
def response_size(model: Model, data: Data, p: int, e: int) -> float:
    """|R||zeta| instead of R zeta, translations and rotations apart, of row p and column e of couple_Z: a response far
    below it is rounding.
    """
    row, k = data.couple_live[p, 0], data.couple_live[p, 1]
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
                    z += data.couple_Z[6 * i + c, e] ** 2
                t += (r * z) ** 0.5
    return t


@kernel
def enlist(model: Model, data: Data, n: int) -> int:
    """couple_live and couple_start of n couplings in their order: rows of the system, each with its coupling, or the
    number of couplings + gear; returns how many rows are those of pairs.
    """
    count = model.coupling_body.shape[0]
    row = 0
    pairs = 0
    for m in range(n):
        k = data.couple_order[m]
        data.couple_start[m] = row
        first = int(model.coupling_row[min(k, count)]) + max(k - count, 0)
        last = first + 1 if k >= count else int(model.coupling_row[k + 1])
        pair = is_pair(model, k)
        if pair:
            take_apart(data, k, first)
        for r in range(first, last):
            if not pair or data.couple_E[r] > 0.0 or data.couple_E[r] < 0.0:
                data.couple_live[row, 0] = r
                data.couple_live[row, 1] = k
                row += 1
                pairs += 1 if pair else 0
    data.couple_start[n] = row
    return pairs


@kernel
def unit_impulses(model: Model, data: Data, m: int, c: int) -> None:
    """couple_Y and -couple_Z = impulses of unit forces of the rows at place m, one per column: on joints, on bodies."""
    k = data.couple_order[m]
    if k >= model.coupling_body.shape[0]:
        unit_gear_impulse(model, k - model.coupling_body.shape[0], data.couple_Y, c)
        return
    for p in range(data.couple_start[m], data.couple_start[m + 1]):
        row, e = data.couple_live[p, 0], p - data.couple_start[m]
        for side in range(2):
            i = model.coupling_body[k, side]
            if i >= 0 and model.body_root[i] >= 0:
                sign = -1.0 if side == 0 else 1.0
                for r in range(6):
                    data.couple_Z[6 * i + r, e] = sign * data.couple_B[row, r]
        if data.bifurcation_count[0] > 0:
            for d in range(data.couple_Y.shape[0]):
                data.couple_Y[d, c + e] += data.bifurcation_direction[row, d]


@kernel
def row_responses(model: Model, data: Data, p: int, c: int) -> Lanes:
    """Row p of the system times LANES velocities, columns of couple_Y from c on, whose twists are in couple_Z."""
    row, k = data.couple_live[p, 0], data.couple_live[p, 1]
    if k >= model.coupling_body.shape[0]:
        gear_responses(model, data, k - model.coupling_body.shape[0], data.couple_Y, c, p)
        return load(data.couple_x, p, 0)
    x = spread(0.0)
    for side in range(2):
        i = model.coupling_body[k, side]
        if i >= 0:
            x = x + dot_lanes(data.couple_R, row, 6 * side, six(data.couple_Z, 6 * i, 0))
    if data.bifurcation_replaces[0] > 0:
        for d in range(data.couple_Y.shape[0]):
            x = x + data.bifurcation_direction[row, d] * load(data.couple_Y, d, c)
    return x


@kernel
def row_response(model: Model, data: Data, p: int, y: Vector) -> float:
    """Row p of the system times the velocities y (nv,), whose twists are in data.twist."""
    row, k = data.couple_live[p, 0], data.couple_live[p, 1]
    if k >= model.coupling_body.shape[0]:
        return gear_response(model, data, k - model.coupling_body.shape[0], y)
    led = dot(data.bifurcation_direction[row], y) if data.bifurcation_replaces[0] > 0 else 0.0
    return response(model, data, k, row) + led


@kernel
def column_responses(model: Model, data: Data, p: int, c: int) -> Lanes:
    """Row p of couple_panel and its response to data.columns, whose twists are in data.panel; LANES from c on."""
    row, k = data.couple_live[p, 0], data.couple_live[p, 1]
    x = load(data.couple_panel, row, c)
    if k >= model.coupling_body.shape[0]:
        gear_responses(model, data, k - model.coupling_body.shape[0], data.columns, c, p)
        return x + load(data.couple_x, p, 0)
    for side in range(2):
        i = model.coupling_body[k, side]
        if i >= 0:
            x = x + dot_lanes(data.couple_R, row, 6 * side, six(data.panel, 6 * i, c))
    return x
