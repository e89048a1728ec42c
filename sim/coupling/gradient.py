"""What couplings add to the derivatives of a step: their wrenches F on a and -F on b depend on both bodies' poses.

    dF = K_a zeta_a + K_b zeta_b  at configuration 3,   K2_a, K2_b at configuration 2

Terms within one branch, (a, a) and (b, b), join the composites A3 and A2; those across, (a, b) and (b, a), are added to
dR_dq pair by pair of joints.
"""

from __future__ import annotations

from sim import late
from sim.contacts.friction import contact_impulse
from sim.coupling.gears import gear_derivatives
from sim.coupling.loop_stiffness import loop_stiffness
from sim.coupling.rows import is_loop
from sim.model import Matrix, Model, Vector
from sim.pairs.contact import is_absent, pair_force
from sim.pairs.stiffness import add_earlier_slip, centre_shift
from sim.rotation import Vec3, cross
from sim.work import Work
from solvers.compiler import kernel
from solvers.dense import dot


@late.add_coupling_composites.defined()
def add_coupling_composites(model: Model, work: Work, h: float) -> None:
    """A3, A2 += the terms of one branch; fills coupling_K2. After `pose2_to_origin`, before `sum_composites`.

    `pose2_to_origin` lets every force of a body follow its centre of mass at 2; those of couplings follow K2 instead.
    """
    for r in range(work.coupling_K2.shape[0]):
        for k in range(36):
            work.coupling_K2[r, k] = 0.0
    nloop = model.loop_ntrans.shape[0]
    first = model.coupling_body.shape[0] - nloop
    for j in range(model.pair_kind.shape[0]):
        k = model.pair_coupling[j]
        if is_absent(work, j):
            continue
        add_earlier_slip(model, work, h, j, work.coupling_K2[2 * k : 2 * k + 2])
        n, t1, t2 = contact_impulse(model, work, model.contact_height.shape[0] + j)
        _take_back(model, work, k, pair_force(work, j, n, t1, t2))
    for m in range(nloop):
        k = first + m
        _take_back(model, work, k, loop_stiffness(model, work, m, work.coupling_K2[2 * k : 2 * k + 2]))
    for k in range(model.coupling_body.shape[0]):
        for side in range(2):
            i = model.coupling_body[k, side]
            sign = -1.0 if side == 0 else 1.0
            if i < 0:
                continue
            for e in range(36):
                work.A2[i, e] += sign * work.coupling_K2[2 * k + side, e]
                if not is_loop(model, k):
                    work.A3[i, e] += sign * work.coupling_K[2 * k + side, e]


@kernel
def _take_back(model: Model, work: Work, k: int, f: Vec3) -> None:
    """A2 of both bodies, torque rows: minus dx2 x (force of the coupling in the wrench of the body)."""
    for side in range(2):
        i = model.coupling_body[k, side]
        sign = 1.0 if side == 0 else -1.0
        if i < 0:
            continue
        for c in range(6):
            x = centre_shift(work, work.pos2, i, c)
            m = cross(x[0], x[1], x[2], sign * f[0], sign * f[1], sign * f[2])
            for r in range(3):
                work.A2[i, 18 + 6 * r + c] += m[r]


@late.add_coupling_derivatives.defined()
def add_coupling_derivatives(model: Model, work: Work) -> None:
    """dR_dq += the terms across branches; couple_panel = the gaps of loops by the columns of dR_dq."""
    for k in range(model.coupling_body.shape[0]):
        a = model.coupling_body[k, 0]
        b = model.coupling_body[k, 1]
        if b < 0:
            continue
        cross_block(model, work, a, b, -1.0, work.coupling_K2[2 * k + 1], work.S2)
        cross_block(model, work, b, a, 1.0, work.coupling_K2[2 * k], work.S2)
        if not is_loop(model, k):
            cross_block(model, work, a, b, -1.0, work.coupling_K[2 * k + 1], work.S3)
            cross_block(model, work, b, a, 1.0, work.coupling_K[2 * k], work.S3)
    X = work.couple_panel
    gear_derivatives(model, X)
    for k in range(model.coupling_body.shape[0]):
        for row in range(model.coupling_row[k], model.coupling_row[k + 1]):
            for m in range(X.shape[1]):
                X[row, m] = 0.0
            if not is_loop(model, k):
                continue
            for side in range(2):
                i = model.coupling_body[k, side]
                while i >= 0:
                    for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
                        for c in range(6):
                            X[row, d] += work.couple_R[row, 6 * side + c] * work.S3[d, c]
                    i = model.body_parent[i]


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
            add_column(model, work, rows, sign, e, work.dR_dq)
        k = model.body_parent[k]


@kernel
def add_column(model: Model, work: Work, i: int, sign: float, e: int, out: Matrix) -> None:
    """out[j, e] += sign S2[j].w, w in couple_wrench; j from body i up to the root."""
    while i >= 0:
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            out[d, e] += sign * dot(work.S2[d], work.couple_wrench)
        i = model.body_parent[i]
