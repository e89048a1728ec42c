"""Terms of couplings in the derivatives of a step: their wrenches F on a and -F on b depend on both bodies' poses.

    dF = K_a zeta_a + K_b zeta_b  at configuration 3,   K2_a, K2_b at configuration 2

Terms within one branch, (a, a) and (b, b), join the composites A3 and A2; those across, (a, b) and (b, a), are added to
dR_dq pair by pair of joints.
"""

from __future__ import annotations

from sim.contact.contact_law import contact_impulse
from sim.contact.moments.contact_moments import add_moment_couplings
from sim.contact.pairs.pair_contact import is_absent, pair_force
from sim.contact.pairs.pair_stiffness import add_earlier_slip
from sim.contact.pairs.wrench_columns import center_shift
from sim.derivatives.loop_stiffness import loop_stiffness
from sim.dynamics.loops.constraint_rows import is_loop
from sim.dynamics.loops.gears import gear_derivatives
from sim.model.data import Data
from sim.model.model import Model
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.dense import dot
from solvers.rotation import Vec3, cross
from solvers.types import Matrix, Vector


@optional(Slot.ADD_COUPLING_COMPOSITES)
def add_coupling_composites(model: Model, data: Data, h: float) -> None:
    """A3, A2 += the terms of one branch; fills coupling_K2. After `pose2_to_origin`, before `sum_composites`.

    `pose2_to_origin` lets every force of a body follow its centre of mass at 2; those of couplings follow K2 instead.
    """
    for r in range(data.coupling_K2.shape[0]):
        for k in range(36):
            data.coupling_K2[r, k] = 0.0
    nloop = model.loop_ntrans.shape[0]
    first = model.coupling_body.shape[0] - nloop
    for c in range(data.active_ground_count[0], data.active_count[0]):
        j = data.active[c] - model.contact_height.shape[0]
        k = model.pair_coupling[j]
        if is_absent(data, j):
            continue
        add_earlier_slip(model, data, h, j, data.coupling_K2[2 * k : 2 * k + 2])
        n, t1, t2 = contact_impulse(model, data, model.contact_height.shape[0] + j)
        _take_back(model, data, k, pair_force(data, j, n, t1, t2))
    add_moment_couplings(model, data, h)
    for m in range(nloop):
        k = first + m
        _take_back(model, data, k, loop_stiffness(model, data, m, data.coupling_K2[2 * k : 2 * k + 2]))
    for k in range(model.coupling_body.shape[0]):
        if not is_loop(model, k) and data.coupling_live[k] == 0:
            continue
        for side in range(2):
            i = model.coupling_body[k, side]
            sign = -1.0 if side == 0 else 1.0
            if i < 0:
                continue
            for e in range(36):
                data.A2[i, e] += sign * data.coupling_K2[2 * k + side, e]
                if not is_loop(model, k):
                    data.A3[i, e] += sign * data.coupling_K[2 * k + side, e]


@kernel
def _take_back(model: Model, data: Data, k: int, f: Vec3) -> None:
    """A2 of both bodies, torque rows: minus dx2 x (force of the coupling in the wrench of the body)."""
    for side in range(2):
        i = model.coupling_body[k, side]
        sign = 1.0 if side == 0 else -1.0
        if i < 0:
            continue
        for c in range(6):
            x = center_shift(data, data.pos2, i, c)
            m = cross(x[0], x[1], x[2], sign * f[0], sign * f[1], sign * f[2])
            for r in range(3):
                data.A2[i, 18 + 6 * r + c] += m[r]


@optional(Slot.ADD_COUPLING_DERIVATIVES)
def add_coupling_derivatives(model: Model, data: Data) -> None:
    """dR_dq += the terms across branches; couple_panel = the gaps of loops by the columns of dR_dq."""
    for k in range(model.coupling_body.shape[0]):
        a = model.coupling_body[k, 0]
        b = model.coupling_body[k, 1]
        if b < 0 or (not is_loop(model, k) and data.coupling_live[k] == 0):
            continue
        cross_block(model, data, a, b, -1.0, data.coupling_K2[2 * k + 1], data.S2)
        cross_block(model, data, b, a, 1.0, data.coupling_K2[2 * k], data.S2)
        if not is_loop(model, k):
            cross_block(model, data, a, b, -1.0, data.coupling_K[2 * k + 1], data.S3)
            cross_block(model, data, b, a, 1.0, data.coupling_K[2 * k], data.S3)
    X = data.couple_panel
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
                            X[row, d] += data.couple_R[row, 6 * side + c] * data.S3[d, c]
                    i = model.body_parent[i]


@kernel
def cross_block(model: Model, data: Data, rows: int, cols: int, sign: float, K: Vector, S: Matrix) -> None:
    """dR_dq[j, k] += sign S2[j].K S[k], j from body `rows` up to the root, k from body `cols`."""
    k = cols
    while k >= 0:
        for e in range(model.body_vadr[k], model.body_vadr[k + 1]):
            w = data.couple_wrench
            for r in range(6):
                t = 0.0
                for c in range(6):
                    t += K[6 * r + c] * S[e, c]
                w[r] = t
            add_column(model, data, rows, sign, e, data.dR_dq)
        k = model.body_parent[k]


@kernel
def add_column(model: Model, data: Data, i: int, sign: float, e: int, out: Matrix) -> None:
    """out[j, e] += sign S2[j].w, w in couple_wrench; j from body i up to the root."""
    while i >= 0:
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            out[d, e] += sign * dot(data.S2[d], data.couple_wrench)
        i = model.body_parent[i]
