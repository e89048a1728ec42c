"""Inactive corners of a mesh: their impulses, and the matrix of their laws, eight corners at a time.

Of a cluster of many corners only those that press, or may within the step, are active. The others follow their law
explicitly, as all inactive contacts do (inactive.py), and their stiffness is added to the matrix of the body:

    wrench = sum of (f, P x f),     d(wrench)/d(twist) = sum of (1, P x) W C + turning of the arms

P is the arm of a corner, f its impulse, C = d(gap, slip)/d(twist) and W = df/d(gap, slip) on the central path of kappa,
all in the frame (n, t1, t2) of the contacts, about the centre of mass. A corner costs a tenth of an active contact: it
has no variables, and no line search. Newton's method converges as if all were active, and derivatives are exact.

With g the gap, (x, y) the slip, R^2 = g^2 + (2 mu)^2 (x^2 + y^2), S = g + R and q = kappa/(g S):

    impulse    q S,   beta = -2 mu^2 q (x, y)
    W          d(impulse)/dg = -q S/g,     dbeta/dg = 2 mu^2 q/g (1 + g/R) (x, y)
               dbeta/d(x, y) = -2 mu^2 q (1 - (2 mu)^2 (x, y) (x, y)^T/(S R))

which are those of cone.py after elimination of gamma.

Rows of data.corners: Corner of sim/model/record_columns.py; where a cluster ends, lanes go on into the next one, which
the weights OUT leave out.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from sim.dynamics.pose_jacobians import columns_to_origin, rows_to_origin
from sim.model.data import Data
from sim.model.model import Law, Model
from sim.model.record_columns import Cluster, Cone, ContactRow, Corner, Inactive
from sim.model.slots import Slot
from solvers.compiler import inlined, kernel, optional
from solvers.lanes import LANES, Lanes, at_least, keep, load, root, spread, store, total
from solvers.rotation import Vec3, put_three, times, transposed_times
from solvers.types import Matrix, Vector

_FAR = 1e9  # [m]


class Turn(NamedTuple):
    """Motion of a body, in the frame of its contacts."""

    n: Vec3  # the frame in the body
    x: Vec3
    y: Vec3
    height: float  # of the centre of mass, along n
    v: Vec3  # its velocity
    w: Vec3  # angular velocity
    c: float  # cosine of half the turn in this step, and its axis times the sine
    s: Vec3


class Corners(NamedTuple):
    """Eight corners: arms, gaps, slips, impulses, and the parts of their laws."""

    a: Lanes  # arm, in the frame
    b: Lanes
    c: Lanes
    gap: Lanes
    x: Lanes
    y: Lanes
    root: Lanes  # R
    total: Lanes  # S
    q: Lanes  # of inactive corners, 0 of the others
    m: Lanes  # 2 mu^2


@kernel
def turn_of(model: Model, data: Data, h: float, c: int) -> Turn:
    """The motion of the body of the cluster that begins at contact c."""
    i = model.contact_body[c]
    f, R = model.contact_frame[c], data.rot3[i]
    p, d, t = data.pos3[i], data.move[i], data.turn[i]
    s = times(f, t[1], t[2], t[3])
    v = times(f, d[0] / h, d[1] / h, d[2] / h)
    g = 2.0 / h
    return Turn(
        transposed_times(R, f[0], f[1], f[2]),
        transposed_times(R, f[3], f[4], f[5]),
        transposed_times(R, f[6], f[7], f[8]),
        f[0] * p[0] + f[1] * p[1] + f[2] * p[2],
        v,
        (g * s[0], g * s[1], g * s[2]),
        t[0],
        s,
    )


@inlined
def _along(n: Vec3, x: Lanes, y: Lanes, z: Lanes) -> Lanes:
    return n[0] * x + n[1] * y + n[2] * z


@inlined
def corners_at(C: Matrix, j: int, end: int, turn: Turn, least_gap: float, kappa: float) -> Corners:
    """Eight corners from contact j on, of a cluster that ends before `end`.   least_gap: of those that are inactive."""
    weight = keep((1 << min(LANES, end - j)) - 1, load(C, Corner.OUT, j))
    px, py, pz = load(C, Corner.POINT, j), load(C, Corner.POINT + 1, j), load(C, Corner.POINT + 2, j)
    a, b, c = _along(turn.n, px, py, pz), _along(turn.x, px, py, pz), _along(turn.y, px, py, pz)
    gap = at_least(spread(turn.height) + a - load(C, Corner.OFFSET, j), least_gap)
    x = spread(turn.v[1]) + turn.w[2] * a - turn.w[0] * c
    y = spread(turn.v[2]) + turn.w[0] * b - turn.w[1] * a
    mu = load(C, Corner.FRICTION, j)
    m = 2.0 * (mu * mu)
    r = root(gap * gap + (2.0 * m) * (x * x + y * y))
    s = gap + r
    return Corners(a, b, c, gap, x, y, r, s, (kappa * weight) / (gap * s), m)


@optional(Slot.EVALUATE_CORNERS)
def evaluate_corners(model: Model, data: Data, h: float, c: int) -> None:
    """Impulses of the inactive corners of a cluster at configuration 3: FORCE, ARMS and LEAST_GAP of Inactive, and the
    cone variables of each.
    """
    row, C, end = data.inactive[c], data.corners, model.cluster_end[c]
    turn = turn_of(model, data, h, c)
    o = spread(0.0)
    N, X, Y = o, o, o
    n0, n1, n2, x0, x1, x2, y0, y1, y2 = o, o, o, o, o, o, o, o, o
    for j in range(c, end, LANES):
        k = corners_at(C, j, end, turn, row[Inactive.ACTIVATION], data.carry.inactive_kappa[0])
        f, along = k.q * k.total, k.m * k.q
        fx, fy = -1.0 * (along * k.x), -1.0 * (along * k.y)
        px, py, pz = load(C, Corner.POINT, j), load(C, Corner.POINT + 1, j), load(C, Corner.POINT + 2, j)
        N, X, Y = N + f, X + fx, Y + fy
        n0, n1, n2 = n0 + f * px, n1 + f * py, n2 + f * pz
        x0, x1, x2 = x0 + fx * px, x1 + fx * py, x2 + fx * pz
        y0, y1, y2 = y0 + fy * px, y1 + fy * py, y2 + fy * pz
        store(C, Corner.GAP, j, k.gap)
        store(C, Corner.IMPULSE, j, f)
        store(C, Corner.FRICTION1, j, fx)
        store(C, Corner.FRICTION2, j, fy)
    F = model.contact_frame[c]
    fn, f1, f2 = total(N), total(X), total(Y)
    for e in range(3):
        row[Inactive.FORCE + e] = fn * F[e] + f1 * F[3 + e] + f2 * F[6 + e]
    put_three((total(n0), total(n1), total(n2)), Inactive.ARMS, row)
    put_three((total(x0), total(x1), total(x2)), Inactive.ARMS + 3, row)
    put_three((total(y0), total(y1), total(y2)), Inactive.ARMS + 6, row)
    row[Inactive.LEAST_GAP] = _write_cones(model, data, c)


@kernel
def _write_cones(model: Model, data: Data, c: int) -> float:
    """Cone variables of the inactive corners of a cluster as they were evaluated; returns their least gap."""
    C, near = data.corners, _FAR
    for k in range(c, model.cluster_end[c]):
        if C[Corner.OUT, k] > 0.0:
            z = data.cone[k]
            z[Cone.SLACK], z[Cone.IMPULSE] = C[Corner.GAP, k], C[Corner.IMPULSE, k]
            z[Cone.FRICTION1], z[Cone.FRICTION2] = C[Corner.FRICTION1, k], C[Corner.FRICTION2, k]
            near = min(near, z[Cone.SLACK])
    return near


@inlined
def _add(S: Matrix, r: int, x: Lanes) -> None:
    store(S, r, 0, load(S, r, 0) + x)


@inlined
def _add_column(S: Matrix, j: int, k: Corners, n: Lanes, x: Lanes, y: Lanes) -> None:
    """Column j of the sums += (f, P x f), f = (n, x, y)."""
    _add(S, j, n)
    _add(S, 6 + j, x)
    _add(S, 12 + j, y)
    _add(S, 18 + j, k.b * y - k.c * x)
    _add(S, 24 + j, k.c * n - k.a * y)
    _add(S, 30 + j, k.a * x - k.b * n)


@inlined
def _clear(S: Matrix) -> None:
    for r in range(36):
        store(S, r, 0, spread(0.0))


@kernel
def _sum_laws(model: Model, data: Data, h: float, c: int, indefinite: float) -> None:
    """corner_sums = sum of (1, P x) W C + turning of the arms, in the frame of the contacts, at configuration 3."""
    S, end = data.corner_sums, model.cluster_end[c]
    turn = turn_of(model, data, h, c)
    w, (s0, s1, s2), i = turn.c, turn.s, 1.0 / h
    _clear(S)
    for j in range(c, end, LANES):
        k = corners_at(data.corners, j, end, turn, data.inactive[c, Inactive.ACTIVATION], data.carry.inactive_kappa[0])
        a, b, d = k.a, k.b, k.c
        f, u, z = k.q * k.total, k.m * k.q, (2.0 * k.m) / (k.total * k.root)
        n = -1.0 * (f / k.gap)
        t = indefinite * ((u / k.gap) * (spread(1.0) + k.gap / k.root))
        xn, yn = t * k.x, t * k.y
        xx, xy, yy = i * (u * (z * (k.x * k.x) - spread(1.0))), i * (u * (z * (k.x * k.y))), k.y * k.y
        yy = i * (u * (z * yy - spread(1.0)))
        o = spread(0.0)
        _add_column(S, 0, k, n, xn, yn)
        _add_column(S, 1, k, o, xx, xy)
        _add_column(S, 2, k, o, xy, yy)
        p, r = s1 * a - w * d - (2.0 * s0) * b, w * b + s2 * a - (2.0 * s0) * d
        _add_column(S, 3, k, o, xx * p + xy * r, xy * p + yy * r)
        p, r = s2 * d + s0 * a, s2 * b - w * a - (2.0 * s1) * d
        _add_column(S, 4, k, n * d, xn * d + xx * p + xy * r, yn * d + xy * p + yy * r)
        p, r = w * a + s1 * d - (2.0 * s2) * b, s0 * a + s1 * b
        _add_column(S, 5, k, -1.0 * (n * b), xx * p + xy * r - xn * b, xy * p + yy * r - yn * b)
        _add_turn(S, k, indefinite * f, -indefinite * (u * k.x), -indefinite * (u * k.y))


@inlined
def _add_turn(S: Matrix, k: Corners, n: Lanes, x: Lanes, y: Lanes) -> None:
    """Torques by rotations += P f^T - (P.f) I, the turning of the arms under the impulses f = (n, x, y)."""
    dot = k.a * n + k.b * x + k.c * y
    _add(S, 21, k.a * n - dot)
    _add(S, 22, k.a * x)
    _add(S, 23, k.a * y)
    _add(S, 27, k.b * n)
    _add(S, 28, k.b * x - dot)
    _add(S, 29, k.b * y)
    _add(S, 33, k.c * n)
    _add(S, 34, k.c * x)
    _add(S, 35, k.c * y - dot)


@kernel
def _sum_slips(model: Model, data: Data, h: float, c: int) -> None:
    """corner_sums = sum of (1, P x) W C2, C2 = d(slip)/d(twist of configuration 2) of `add_slip_jacobian`."""
    S, end = data.corner_sums, model.cluster_end[c]
    turn = turn_of(model, data, h, c)
    w, (s0, s1, s2), i = turn.c, turn.s, 1.0 / h
    _clear(S)
    for j in range(c, end, LANES):
        k = corners_at(data.corners, j, end, turn, data.inactive[c, Inactive.ACTIVATION], data.carry.inactive_kappa[0])
        a, b, d, o = k.a, k.b, k.c, spread(0.0)
        u, z = i * (k.m * k.q), (2.0 * k.m) / (k.total * k.root)
        xx, xy, yy = z * (k.x * k.x) - spread(1.0), u * (z * (k.x * k.y)), z * (k.y * k.y) - spread(1.0)
        xx, yy = u * xx, u * yy
        _add_column(S, 1, k, o, -1.0 * xx, -1.0 * xy)
        _add_column(S, 2, k, o, -1.0 * xy, -1.0 * yy)
        p, r = s1 * a + w * d, s2 * a - w * b
        _add_column(S, 3, k, o, xx * p + xy * r, xy * p + yy * r)
        p, r = -s2 * d - s0 * a, s2 * b + w * a
        _add_column(S, 4, k, o, xx * p + xy * r, xy * p + yy * r)
        p, r = s1 * d - w * a, -s0 * a - s1 * b
        _add_column(S, 5, k, o, xx * p + xy * r, xy * p + yy * r)


@kernel
def _to_world(F: Vector, S: Matrix, out: Vector) -> None:
    """out = the sums in world axes: F^T X F of each of the four blocks X."""
    for r in range(2):
        for e in range(2):
            first = 18 * r + 3 * e
            for p in range(3):
                at = first + 6 * p
                x, y, z = total(load(S, at, 0)), total(load(S, at + 1, 0)), total(load(S, at + 2, 0))
                out[at], out[at + 1], out[at + 2] = transposed_times(F, x, y, z)
            for q in range(3):
                at = first + q
                out[at], out[at + 6], out[at + 12] = transposed_times(F, out[at], out[at + 6], out[at + 12])


@optional(Slot.ADD_CORNER_LAWS)
def add_corner_laws(model: Model, data: Data, h: float, indefinite: float, fresh: bool, out: Matrix) -> None:
    """out[body] -= laws of the inactive corners, about O.  (nbody, 36)   fresh: of configuration 3, as derivatives have
    to be; otherwise of a near one.
    """
    B, o = data.corner_block, data.origin
    for m in range(data.inactive_count[0]):
        c = data.inactive_first[m]
        row = data.inactive[c]
        if row[Inactive.CORNERS] == 0.0:
            continue
        if fresh or row[Inactive.SHARE] != indefinite:
            _sum_laws(model, data, h, c, indefinite)
            _to_world(model.contact_frame[c], data.corner_sums, data.corner_law[c])
            row[Inactive.SHARE] = indefinite
        i = model.contact_body[c]
        for k in range(36):
            B[k] = data.corner_law[c, k]
        p = data.pos2[i]
        rows_to_origin(B, p[0] - o[0], p[1] - o[1], p[2] - o[2])
        p = data.pos3[i]
        columns_to_origin(B, p[0] - o[0], p[1] - o[1], p[2] - o[2])
        for k in range(36):
            out[i, k] -= B[k]


@optional(Slot.ADD_CORNER_SLIPS)
def add_corner_slips(model: Model, data: Data, h: float) -> None:
    """A2[body] -= laws of the inactive corners by pose 2, on which slips depend (at the centre of mass)."""
    B = data.corner_block
    for m in range(data.inactive_count[0]):
        c = data.inactive_first[m]
        if data.inactive[c, Inactive.CORNERS] > 0.0:
            _sum_slips(model, data, h, c)
            _to_world(model.contact_frame[c], data.corner_sums, B)
            i = model.contact_body[c]
            for k in range(36):
                data.A2[i, k] -= B[k]


@optional(Slot.REPORT_CORNERS)
def report_corners(model: Model, data: Data, h: float, c: int, out: Matrix) -> None:
    """Rows of the inactive corners of a cluster, as `report_contact`."""
    if model.cluster[c, Cluster.CORNERS] == 0.0:
        return
    i, F = model.contact_body[c], model.contact_frame[c]
    R, o, turn = data.rot3[i], data.pos3[i], turn_of(model, data, h, c)
    v1, v2, (w0, w1, w2) = turn.v[1], turn.v[2], turn.w
    for k in range(c, model.cluster_end[c]):
        if data.contact_out[k] == 0:
            continue
        p, z, row = model.contact_point[k], data.cone[k], out[k]
        x, y, up = times(R, p[0], p[1], p[2])
        a, b, d = times(F, x, y, up)
        s1, s2 = v1 + w2 * a - w0 * d, v2 + w0 * b - w1 * a
        f = transposed_times(F, z[Cone.IMPULSE], z[Cone.FRICTION1], z[Cone.FRICTION2])
        put_three(f, ContactRow.IMPULSE, row)
        put_three((o[0] + x, o[1] + y, o[2] + up), ContactRow.POINT, row)
        put_three((F[0], F[1], F[2]), ContactRow.NORMAL, row)
        row[ContactRow.GAP] = turn.height + a - model.contact_height[k] - model.contact_radius[k]
        row[ContactRow.SLIP] = sqrt(s1 * s1 + s2 * s2)


@kernel
def least_corner_gap(model: Model, data: Data, c: int) -> float:
    """Least gap of the inactive corners of a cluster at configuration 3."""
    C, F, i, near = data.corners, model.contact_frame[c], model.contact_body[c], _FAR
    n0, n1, n2 = transposed_times(data.rot3[i], F[0], F[1], F[2])
    for k in range(c, model.cluster_end[c]):
        if C[Corner.OUT, k] > 0.0:
            rise = n0 * C[Corner.POINT, k] + n1 * C[Corner.POINT + 1, k] + n2 * C[Corner.POINT + 2, k]
            near = min(near, rise - C[Corner.OFFSET, k])
    return near + F[0] * data.pos3[i, 0] + F[1] * data.pos3[i, 1] + F[2] * data.pos3[i, 2]


@kernel
def gather_corners(model: Model, data: Data, c: int, a: float) -> bool:
    """Rows of `corners` of a cluster: corners are inactive whose gap at configuration 2 is more than a; returns
    whether these are others than before.
    """
    C, F, changed = data.corners, model.contact_frame[c], False
    i = model.contact_body[c]
    n0, n1, n2 = transposed_times(data.rot2[i], F[0], F[1], F[2])
    height = F[0] * data.pos2[i, 0] + F[1] * data.pos2[i, 1] + F[2] * data.pos2[i, 2]
    for k in range(c, model.cluster_end[c]):
        p = model.contact_point[k]
        offset = model.contact_height[k] + model.contact_radius[k]
        out = 1 if height + n0 * p[0] + n1 * p[1] + n2 * p[2] - offset > a else 0
        changed = changed or out != C[Corner.OUT, k]
        C[Corner.POINT, k], C[Corner.POINT + 1, k], C[Corner.POINT + 2, k] = p[0], p[1], p[2]
        C[Corner.FRICTION, k] = model.contact_friction[k] if model.contact_law[k] == Law.NONLINEAR else 0.0
        C[Corner.OFFSET, k], C[Corner.OUT, k] = offset, out
        data.contact_out[k] = out
    return changed
