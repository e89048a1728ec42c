"""Derivatives of a step with impacts (restitution.py): the floor of an impact moves with configurations 1 and 2.

    d(impulse)/d(floor) = -d(impulse)/d(gap),      dfloor = e dphi1 + (1 - e) dphi2

of the branch that was taken. Scenes without restitution do not compile these kernels.
"""

from __future__ import annotations

from sim import late
from sim.coupling.gradient import add_column
from sim.model import Matrix, Model, Vector
from sim.pairs.contact import pair_arm, pair_force
from sim.rotation import Vec3, cross, join, transposed_times
from sim.work import Work
from solvers.dense import dot
from solvers.jit import kernel


@kernel
def gap_wrench(model: Model, work: Work, c: int) -> tuple[Vec3, Vec3]:
    """Wrench about O, on the first body, of contact c per unit of its gap, by its condensed law."""
    W = work.contact_W[c]
    ground = model.contact_height.shape[0]
    if c >= ground:
        f = pair_force(work, c - ground, W[0], W[3], W[6])
        a = pair_arm(model, work, c - ground)
    else:
        k = work.contact_kin[c]
        i = model.contact_body[c]
        f = transposed_times(work.contact_frame[c], W[0], W[3], W[6])
        o = work.origin
        p = work.pos2[i]
        a = (p[0] - o[0] + k[3], p[1] - o[1] + k[4], p[2] - o[2] + k[5])
    return f, cross(a[0], a[1], a[2], f[0], f[1], f[2])


@late.add_bounce_composites.defined()
def add_bounce_composites(model: Model, work: Work) -> None:
    """A1 += e w d(phi1), A2 += (1 - e) w d(phi2) of the bodies of impacts, w the wrench per gap, all about O."""
    for m in range(work.counts[2]):
        for c in range(work.near[m, 0], work.near[m, 1]):
            b = work.bounce[c]
            if b[1] == 0.0:
                continue
            f, t = gap_wrench(model, work, c)
            for side in range(1 if c < model.contact_height.shape[0] else 2):
                i = model.contact_body[c]
                if c >= model.contact_height.shape[0]:
                    i = model.coupling_body[model.pair_coupling[c - model.contact_height.shape[0]], side]
                if i >= 0:
                    _add_outer(work.A1[i], f, t, b[1], b[2:8])
                    _add_outer(work.A2[i], f, t, 1.0 - b[1], b[8:14])


@kernel
def _add_outer(A: Vector, f: Vec3, t: Vec3, scale: float, row: Vector) -> None:
    """A (6 x 6) += scale (f, t) row^T."""
    for k in range(6):
        x = scale * row[k]
        for r in range(3):
            A[6 * r + k] += f[r] * x
            A[18 + 6 * r + k] += t[r] * x


@late.add_bounce_derivatives.defined()
def add_bounce_derivatives(model: Model, work: Work) -> None:
    """dR_dq, dR_dv -= the same across the two bodies of an impact."""
    ground = model.contact_height.shape[0]
    for j in range(model.pair_kind.shape[0]):
        b = work.bounce[ground + j]
        one = model.coupling_body[model.pair_coupling[j], 0]
        two = model.coupling_body[model.pair_coupling[j], 1]
        if b[1] == 0.0 or two < 0:
            continue
        f, t = gap_wrench(model, work, ground + j)
        for side in range(2):
            i = one if side == 0 else two
            k = two if side == 0 else one
            join(work.couple_wrench, f, t)
            _across(model, work, (i, k), -b[1], b[2:8], work.S1, work.dR_dq)
            _across(model, work, (i, k), -b[1], b[2:8], work.S1, work.dR_dv)
            _across(model, work, (i, k), b[1] - 1.0, b[8:14], work.S2, work.dR_dq)


@kernel
def _across(
    model: Model, work: Work, bodies: tuple[int, int], scale: float, row: Vector, S: Matrix, out: Matrix
) -> None:
    """out[j, k] += scale (S2[j].w) (row.S[k]), w in couple_wrench; j and k from the bodies up to the root."""
    k = bodies[1]
    while k >= 0:
        for e in range(model.body_vadr[k], model.body_vadr[k + 1]):
            x = scale * dot(row, S[e])
            add_column(model, work, bodies[0], x, e, out)
        k = model.body_parent[k]
