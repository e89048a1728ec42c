"""Derivatives of a step with impacts (restitution.py): the floor of an impact moves with configurations 1 and 2.

    d(impulse)/d(floor) = -d(impulse)/d(gap),      dfloor = e dphi1 + (1 - e) dphi2

of the branch that was taken. Much of it cancels: a body that starts a little higher lands as much later, and bounces as
fast. So of impacts on the ground the changes of gap, floor and slip by a column are summed before the stiffness of the
contact, up to 1e8 times the inertia over h, multiplies them: it is in the matrix that is eliminated, data.A, but not in
A2 and A3. Scenes without restitution do not compile these kernels.
"""

from __future__ import annotations

from sim.contact.ground_contact import add_contact_law
from sim.contact.moments.contact_moments import add_impact_moment, add_moment_law, moment_by_gap
from sim.contact.pairs.pair_contact import pair_arm, pair_force
from sim.contact.pairs.pair_stiffness import slip_rate
from sim.derivatives.coupling_gradient import add_column
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import Bounce, Kin
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.dense import dot
from solvers.rotation import Vec3, cross, join, three, transposed_times
from solvers.types import Matrix, Vector


@kernel
def gap_wrench(model: Model, data: Data, c: int) -> tuple[Vec3, Vec3]:
    """Wrench about O, on the first body, of contact c per unit of its gap, by its condensed law."""
    W = data.contact_W[c]
    ground = model.contact_height.shape[0]
    if c >= ground:
        f = pair_force(data, c - ground, W[0], W[3], W[6])
        a = pair_arm(model, data, c - ground)
    else:
        k = data.contact_kin[c]
        i = model.contact_body[c]
        f = transposed_times(data.contact_frame[c], W[0], W[3], W[6])
        o = data.origin
        p = data.pos2[i]
        a = (p[0] - o[0] + k[Kin.ARM], p[1] - o[1] + k[Kin.ARM + 1], p[2] - o[2] + k[Kin.ARM + 2])
    x, y, z = cross(a[0], a[1], a[2], f[0], f[1], f[2])
    m = moment_by_gap(model, data, c)
    return f, (x + m[0], y + m[1], z + m[2])


@optional(Slot.ADD_BOUNCE_COMPOSITES, default=False)
def add_bounce_composites(model: Model, data: Data) -> bool:
    """Of pairs A1 += e w d(phi1), A2 += (1 - e) w d(phi2) of the bodies of impacts, w the wrench per gap, all about O.

    A = A3 with the laws of impacts on the ground, if there are any; returns whether.
    """
    impacts = False
    ground = model.contact_height.shape[0]
    for i in range(data.A.shape[0]):
        for k in range(36):
            data.A[i, k] = data.A3[i, k]
    for m in range(data.active_count[0]):
        c = data.active[m]
        b = data.bounce[c]
        if b[Bounce.RESTITUTION] == 0.0:
            continue
        if c < ground:
            impacts = True
            add_contact_law(model, data, c, data.A)
            add_moment_law(model, data, c, data.A)
            continue
        f, t = gap_wrench(model, data, c)
        for side in range(2):
            i = model.coupling_body[model.pair_coupling[c - ground], side]
            if i >= 0:
                _add_outer(data.A1[i], f, t, b[Bounce.RESTITUTION], b[Bounce.ROW1 : Bounce.ROW2])
                _add_outer(data.A2[i], f, t, 1.0 - b[Bounce.RESTITUTION], b[Bounce.ROW2 : Bounce.GAP1])
    return impacts


@kernel
def _add_outer(A: Vector, f: Vec3, t: Vec3, scale: float, row: Vector) -> None:
    """A (6 x 6) += scale (f, t) row^T."""
    for k in range(6):
        x = scale * row[k]
        for r in range(3):
            A[6 * r + k] += f[r] * x
            A[18 + 6 * r + k] += t[r] * x


@optional(Slot.ADD_BOUNCE_DERIVATIVES)
def add_bounce_derivatives(model: Model, data: Data, h: float) -> None:
    """dR_dq, dR_dv of impacts with the ground; of pairs, -= the same across the two bodies."""
    ground = model.contact_height.shape[0]
    for m in range(data.active_ground_count[0]):
        c = data.active[m]
        if data.bounce[c, Bounce.RESTITUTION] != 0.0:
            _add_ground(model, data, h, c)
            _add_composites(model, data, h, c)
    for j in range(model.pair_kind.shape[0]):
        b = data.bounce[ground + j]
        one = model.coupling_body[model.pair_coupling[j], 0]
        two = model.coupling_body[model.pair_coupling[j], 1]
        if b[Bounce.RESTITUTION] == 0.0 or two < 0:
            continue
        f, t = gap_wrench(model, data, ground + j)
        for side in range(2):
            i = one if side == 0 else two
            k = two if side == 0 else one
            join(data.couple_wrench, f, t)
            _across(model, data, (i, k), -b[Bounce.RESTITUTION], b[Bounce.ROW1 : Bounce.ROW2], data.S1, data.dR_dq)
            _across(model, data, (i, k), -b[Bounce.RESTITUTION], b[Bounce.ROW1 : Bounce.ROW2], data.S1, data.dR_dv)
            _across(model, data, (i, k), b[Bounce.RESTITUTION] - 1.0, b[Bounce.ROW2 : Bounce.GAP1], data.S2, data.dR_dq)


@kernel
def _rates(model: Model, data: Data, h: float, c: int, twists: tuple[Vector, Vector, Vector]) -> Vec3:
    """d(gap - floor, slip) of an impact on the ground by the twists of configurations 1, 2 and 3."""
    s1, s, t = twists
    b, k, F = data.bounce[c], data.contact_kin[c], data.contact_frame[c]
    i = model.contact_body[c]
    o, p = data.origin, data.pos2[i]
    e = (s[3], s[4], s[5])
    u, v, w = cross(s[3], s[4], s[5], p[0] - o[0], p[1] - o[1], p[2] - o[2])
    x = (s[0] + u, s[1] + v, s[2] + w)
    r = three(k, Kin.ARM)
    gap = (
        dot(k[Kin.BY_TRANSLATION : Kin.BY_TRANSLATION + 3], t[:3])
        + dot(k[Kin.BY_ROTATION : Kin.BY_ROTATION + 3], t[3:])
        - b[Bounce.RESTITUTION] * dot(b[Bounce.ROW1 : Bounce.ROW2], s1)
        - (1.0 - b[Bounce.RESTITUTION]) * dot(b[Bounce.ROW2 : Bounce.GAP1], s)
    )
    one = (
        dot(k[Kin.BY_TRANSLATION + 3 : Kin.BY_TRANSLATION + 6], t[:3])
        + dot(k[Kin.BY_ROTATION + 3 : Kin.BY_ROTATION + 6], t[3:])
        + slip_rate(F[3], F[4], F[5], r, data.turn[i], x, e) / h
    )
    two = (
        dot(k[Kin.BY_TRANSLATION + 6 : Kin.BY_TRANSLATION + 9], t[:3])
        + dot(k[Kin.BY_ROTATION + 6 : Kin.BY_TRANSLATION], t[3:])
        + slip_rate(F[6], F[7], F[8], r, data.turn[i], x, e) / h
    )
    return gap, one, two


@kernel
def _impulse_wrench(model: Model, data: Data, h: float, c: int, twists: tuple[Vector, Vector, Vector]) -> None:
    """couple_wrench = the wrench of W (gap, slip) about O, and its moment, by the twists of configurations 1, 2, 3."""
    g = _rates(model, data, h, c, twists)
    W, k, o = data.contact_W[c], data.contact_kin[c], data.origin
    p = data.pos2[model.contact_body[c]]
    fn = W[0] * g[0] + W[1] * g[1] + W[2] * g[2]
    f1 = W[3] * g[0] + W[4] * g[1] + W[5] * g[2]
    f2 = W[6] * g[0] + W[7] * g[1] + W[8] * g[2]
    f = transposed_times(data.contact_frame[c], fn, f1, f2)
    t = cross(p[0] - o[0] + k[Kin.ARM], p[1] - o[1] + k[Kin.ARM + 1], p[2] - o[2] + k[Kin.ARM + 2], f[0], f[1], f[2])
    join(data.couple_wrench, f, t)
    add_impact_moment(model, data, h, c, g[0], twists[1], twists[2], data.couple_wrench)


@kernel
def _add_ground(model: Model, data: Data, h: float, c: int) -> None:
    """dR_dq -= S2_j.w, w the wrench by the rates of gap and slip, dR_dv -= that by configuration 1, of one contact."""
    none = data.pair_rows[0]
    for k in range(6):
        none[k] = 0.0
    i = model.contact_body[c]
    while i >= 0:
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            s1 = data.S1[d]
            _impulse_wrench(model, data, h, c, (s1, data.S2[d], data.S3[d]))
            add_column(model, data, model.contact_body[c], -1.0, d, data.dR_dq)
            _impulse_wrench(model, data, h, c, (s1, none, none))
            add_column(model, data, model.contact_body[c], -1.0, d, data.dR_dv)
        i = model.body_parent[i]


@kernel
def _add_composites(model: Model, data: Data, h: float, c: int) -> None:
    """A1, A2, A3 of the body of one contact and those above it, once they are composites, and their products with S2 in
    G: for parameters.
    """
    none, unit = data.pair_rows[0], data.pair_rows[1]
    for k in range(6):
        none[k] = unit[k] = 0.0
    for k in range(6):
        unit[k] = 1.0
        _impulse_wrench(model, data, h, c, (unit, none, none))
        _subtract_column(model, data, c, data.A1, 0, k)
        _impulse_wrench(model, data, h, c, (none, unit, none))
        _subtract_column(model, data, c, data.A2, 6, k)
        _impulse_wrench(model, data, h, c, (none, none, unit))
        _subtract_column(model, data, c, data.A3, 12, k)
        unit[k] = 0.0


@kernel
def _subtract_column(model: Model, data: Data, c: int, A: Matrix, first: int, k: int) -> None:
    """Column k of A[i] -= couple_wrench, i from the body of contact c up to the root; G, whose columns of A are from
    `first` on, likewise.
    """
    i = model.contact_body[c]
    while i >= 0:
        for r in range(6):
            A[i, 6 * r + k] -= data.couple_wrench[r]
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            data.G[d, first + k] -= dot(data.S2[d], data.couple_wrench)
        i = model.body_parent[i]


@kernel
def _across(
    model: Model, data: Data, bodies: tuple[int, int], scale: float, row: Vector, S: Matrix, out: Matrix
) -> None:
    """out[j, k] += scale (S2[j].w) (row.S[k]), w in couple_wrench; j and k from the bodies up to the root."""
    k = bodies[1]
    while k >= 0:
        for e in range(model.body_vadr[k], model.body_vadr[k + 1]):
            x = scale * dot(row, S[e])
            add_column(model, data, bodies[0], x, e, out)
        k = model.body_parent[k]
