"""What couples branches of the tree: pairs of bodies in contact, and closed loops, as a small dense system.

A coupling of the bodies a and b adds B f to the wrench on a and takes it from that on b, about O:

    pairs in contact    (K_a, K_b) = B D R        f/D - R_a zeta_a - R_b zeta_b = 0
    closed loop         B = G2^T                      - G3 zeta_a + G3 zeta_b = g

K are the derivatives of the wrench by the twists of the bodies, of rank six at most; taking them apart keeps the
stiffness D of contacts, up to 1e16, out of the sums. With the tree eliminated, twists are zeta = zeta_0 + Z f, where
zeta_0 answers the right-hand side and Z the unit forces:

    (E - R_a Z_a - R_b Z_b) f = g + R_a zeta_0a + R_b zeta_0b        E = 1/D or 0,  R = (G3, -G3) for a loop

so trees stay linear, and pay nothing. Rows of couple_B, couple_R, ... follow coupling_row, those of gears (gears.py)
come last; couple_live names those that the dense system has: not those of far pairs, nor those without stiffness.
Constraints that say nothing new (a planar loop in space) are found by the pivots, and their forces set to zero; their
rows are rounding, and kept so by a scale that does not look at directions.
"""

from __future__ import annotations

from sim.elimination import solve
from sim.gears import add_gear_columns, gear_response, gear_row, unit_gear_impulse
from sim.model import Late, Matrix, Model, Vector, Work
from solvers.full_lu import full_lu_factor, full_lu_solve
from solvers.jit import kernel
from solvers.late import late

_ROUNDING = 1e-14  # stiffness below this share of the largest is rounding
_DEPENDENT = 1e-10  # a pivot below this belongs to a loop constraint that depends on others


@kernel
def is_loop(model: Model, k: int) -> bool:
    """Whether coupling k is a closed loop; they come after the pairs."""
    return k >= model.coupling_body.shape[0] - model.loop_ntrans.shape[0]


@kernel
def take_apart(work: Work, k: int, row: int) -> None:
    """Rows of couple_B, couple_R and couple_E from row on: (K_a, K_b) = B D R by elimination with full pivoting.

    coupling_K is used up; what is left when the pivots have fallen to rounding is dropped: forces without effect.
    """
    first = 0.0
    for r in range(row, row + 6):
        best = 0.0
        i = 0
        j = 0
        for side in range(2):
            K = work.coupling_K[2 * k + side]
            for e in range(36):
                if abs(K[e]) > abs(best):
                    best = K[e]
                    i = e // 6
                    j = 6 * side + e % 6
        if r == row:
            first = abs(best)
        B = work.couple_B[r]
        R = work.couple_R[r]
        for c in range(6):
            B[c] = 0.0
            R[c] = 0.0
            R[6 + c] = 0.0
        work.couple_E[r] = 0.0  # no row, and none after it
        if not abs(best) > _ROUNDING * first:
            continue
        work.couple_E[r] = 1.0 / best
        for c in range(6):
            B[c] = work.coupling_K[2 * k + j // 6, 6 * c + j % 6] / best
            R[c] = work.coupling_K[2 * k, 6 * i + c] / best
            R[6 + c] = work.coupling_K[2 * k + 1, 6 * i + c] / best
        for side in range(2):
            K = work.coupling_K[2 * k + side]
            for c in range(6):
                f = best * B[c]
                for e in range(6):
                    K[6 * c + e] -= f * R[6 * side + e]


@kernel
def add_along_path(model: Model, work: Work, i: int, sign: float, w: Vector, out: Vector) -> None:
    """out[d] += sign S2[d].w for the joints between body i and the root."""
    while i >= 0:
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            s = work.S2[d]
            out[d] += sign * (s[0] * w[0] + s[1] * w[1] + s[2] * w[2] + s[3] * w[3] + s[4] * w[4] + s[5] * w[5])
        i = model.body_parent[i]


@kernel
def response(model: Model, work: Work, k: int, row: int) -> float:
    """R_a zeta_a + R_b zeta_b of a row of coupling k, with the twists of the last solve."""
    R = work.couple_R[row]
    t = 0.0
    for side in range(2):
        i = model.coupling_body[k, side]
        if i >= 0:
            z = work.twist[i]
            for c in range(6):
                t += R[6 * side + c] * z[c]
    return t


@kernel
def response_size(model: Model, work: Work, k: int, row: int) -> float:
    """|R||zeta| instead of R zeta, translations and rotations apart: a response far below it is rounding."""
    R = work.couple_R[row]
    t = 0.0
    for side in range(2):
        i = model.coupling_body[k, side]
        if i >= 0:
            for part in range(2):
                r = 0.0
                z = 0.0
                for c in range(3 * part, 3 * part + 3):
                    r += R[6 * side + c] ** 2
                    z += work.twist[i, c] ** 2
                t += (r * z) ** 0.5
    return t


@kernel
def enlist(model: Model, work: Work) -> int:
    """couple_live: rows of the dense system, with their coupling, or number of couplings + gear; returns how many."""
    n = 0
    count = model.coupling_body.shape[0]
    for k in range(count):
        if not is_loop(model, k):
            if work.coupling_live[k] == 0:
                continue
            take_apart(work, k, model.coupling_row[k])
        for row in range(model.coupling_row[k], model.coupling_row[k + 1]):
            if is_loop(model, k) or work.couple_E[row] > 0.0 or work.couple_E[row] < 0.0:
                work.couple_live[n, 0] = row
                work.couple_live[n, 1] = k
                n += 1
    for k in range(model.gear_dof.shape[0]):
        work.couple_live[n, 0] = gear_row(model, k)
        work.couple_live[n, 1] = count + k
        n += 1
    return n


@kernel
def unit_impulse(model: Model, work: Work, p: int, out: Vector) -> None:
    """out (nv,) = the generalized impulse of a unit force in row p of the dense system."""
    row, k = work.couple_live[p, 0], work.couple_live[p, 1]
    if k >= model.coupling_body.shape[0]:
        unit_gear_impulse(model, k - model.coupling_body.shape[0], out)
        return
    for d in range(out.shape[0]):
        out[d] = 0.0
    add_along_path(model, work, model.coupling_body[k, 0], 1.0, work.couple_B[row], out)
    add_along_path(model, work, model.coupling_body[k, 1], -1.0, work.couple_B[row], out)


@kernel
def row_response(model: Model, work: Work, p: int, y: Vector) -> float:
    """Row p of the dense system times the velocities y (nv,), whose twists are in work.twist."""
    row, k = work.couple_live[p, 0], work.couple_live[p, 1]
    if k >= model.coupling_body.shape[0]:
        return gear_response(model, work, k - model.coupling_body.shape[0], y)
    return response(model, work, k, row)


@kernel
def scale_row(T: Matrix, p: int, size: float) -> float:
    """Divide row p by its largest entry, or by `size` when that is larger; returns one over it."""
    largest = size
    for q in range(T.shape[1]):
        largest = max(largest, abs(T[p, q]))
    scale = 1.0 / largest if largest > 0.0 else 1.0
    for q in range(T.shape[1]):
        T[p, q] *= scale
    return scale


@late(Late.FACTOR_COUPLING, True)
def factor_coupling(model: Model, work: Work) -> bool:
    """The dense system of the couplings, factored; after `factor`. False if it is singular beyond redundant loops."""
    n = enlist(model, work)
    T = work.couple_T[:n, :n]
    pairs = 0
    for p in range(n):
        work.couple_scale[p] = 0.0
    for q in range(n):
        col, k = work.couple_live[q, 0], work.couple_live[q, 1]
        unit_impulse(model, work, q, work.rhs)
        y = work.couple_Y[col]
        solve(model, work, work.rhs, y)
        for p in range(n):
            T[p, q] = -row_response(model, work, p, y)
            m = work.couple_live[p, 1]
            if is_loop(model, m) and m < model.coupling_body.shape[0]:
                work.couple_scale[p] = max(work.couple_scale[p], response_size(model, work, m, work.couple_live[p, 0]))
        if not is_loop(model, k):
            T[q, q] += work.couple_E[col]
            pairs += 1
    for p in range(n):
        work.couple_scale[p] = scale_row(T, p, work.couple_scale[p])
    least = _DEPENDENT if model.loop_ntrans.shape[0] + model.gear_dof.shape[0] > 0 else 1e-300
    rank = full_lu_factor(T, work.couple_pivots, least)
    work.couple_rank[0] = rank
    work.couple_rank[1] = n
    return rank >= pairs


@late(Late.SOLVE_COUPLING)
def solve_coupling(model: Model, work: Work, share: float, out: Vector) -> None:
    """After out = H0^-1 b of the tree: the answer with couplings, its twists, and couple_step, the forces f.

    share: part of the loop gaps to close.
    """
    n = int(work.couple_rank[1])
    x = work.couple_x[:n]
    for p in range(n):
        gap = share * work.couple_gap[work.couple_live[p, 0]]
        x[p, 0] = work.couple_scale[p] * (gap + row_response(model, work, p, out))
    full_lu_solve(work.couple_T[:n, :n], work.couple_pivots, int(work.couple_rank[0]), x)
    for row in range(work.couple_step.shape[0]):
        work.couple_step[row] = 0.0
    for p in range(n):
        f = x[p, 0]
        row = work.couple_live[p, 0]
        work.couple_step[row] = f
        Y = work.couple_Y[row]
        for d in range(out.shape[0]):
            out[d] += f * Y[d]
    body_twists(model, work, out)


@kernel
def body_twists(model: Model, work: Work, y: Vector) -> None:
    """twist[i] = twist[parent] + S3nu y."""
    for i in range(model.body_parent.shape[0]):
        p = model.body_parent[i]
        V = work.twist[i]
        for k in range(6):
            V[k] = work.twist[p, k] if p >= 0 else 0.0
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            for k in range(6):
                V[k] += work.S3nu[d, k] * y[d]


@kernel
def add_columns(model: Model, work: Work, p: int, x: Vector) -> None:
    """x = the row of couple_panel that is row p of the dense system, plus its response to the columns."""
    row, k = work.couple_live[p, 0], work.couple_live[p, 1]
    for m in range(x.shape[0]):
        x[m] = work.couple_panel[row, m]  # p <= row
    if k >= model.coupling_body.shape[0]:
        add_gear_columns(model, work, k - model.coupling_body.shape[0], x)
        return
    for side in range(2):
        i = model.coupling_body[k, side]
        if i < 0:
            continue
        for c in range(6):
            f = work.couple_R[row, 6 * side + c]
            z = work.panel[6 * i + c]
            for m in range(x.shape[0]):
                x[m] += f * z[m]


@late(Late.SOLVE_COUPLING_PANEL)
def solve_coupling_panel(model: Model, work: Work) -> None:
    """`solve_coupling` for all columns, after `solve_panel`; couple_panel holds g of each column."""
    n = int(work.couple_rank[1])
    X = work.couple_panel[:n]
    for p in range(n):
        add_columns(model, work, p, X[p])
        for m in range(X.shape[1]):
            X[p, m] *= work.couple_scale[p]
    full_lu_solve(work.couple_T[:n, :n], work.couple_pivots, int(work.couple_rank[0]), X)
    for p in range(n):
        Y = work.couple_Y[work.couple_live[p, 0]]
        for d in range(work.columns.shape[0]):
            f = Y[d]
            for m in range(X.shape[1]):
                work.columns[d, m] += f * X[p, m]


@kernel
def cross_block(model: Model, work: Work, rows: int, cols: int, sign: float, K: Vector, S: Matrix) -> None:
    """dR_dq[j, k] += sign S2[j].K S[k], j from body `rows` up to the root, k from body `cols`."""
    k = cols
    while k >= 0:
        for e in range(model.body_vadr[k], model.body_vadr[k + 1]):
            w = work.couple_wrench
            for r in range(6):
                t = 0.0
                for c in range(6):
                    t += K[6 * r + c] * S[e, c]
                w[r] = t
            j = rows
            while j >= 0:
                for d in range(model.body_vadr[j], model.body_vadr[j + 1]):
                    s = work.S2[d]
                    t = s[0] * w[0] + s[1] * w[1] + s[2] * w[2] + s[3] * w[3] + s[4] * w[4] + s[5] * w[5]
                    work.dR_dq[d, e] += sign * t
                j = model.body_parent[j]
        k = model.body_parent[k]
