"""Inactive corners of a mesh: their impulses, eight corners at a time.

Of a cluster of many corners only those that press, or may within the step, are active. The others follow their law
explicitly, as all inactive contacts do (inactive.py), and their stiffness is added to the matrix of the body
(corner_laws.py). Newton's method converges as if all were active, and derivatives are exact. Such a corner has no
variables and no line search, and costs a fraction of an active contact.

With g the gap, (x, y) the slip, R^2 = g^2 + (2 mu)^2 (x^2 + y^2), S = g + R and q = kappa/(g S):

    impulse    q S,   beta = -2 mu^2 q (x, y)

which is cone.py after elimination of gamma.

Rows of data.corners: Corner of sim/model/record_columns.py; where a cluster ends, lanes go on into the next one, which
the weights OUT leave out.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from sim.model.data import Data
from sim.model.model import Law, Model
from sim.model.record_columns import Cluster, Cone, ContactRow, Corner, Inactive
from sim.model.slots import Slot
from solvers.compiler import inlined, kernel, optional
from solvers.lanes import LANES, Lanes, at_least, keep, load, lowest, root, spread, store, total
from solvers.rotation import Vec3, cross, put_three, times, transposed_times
from solvers.types import Matrix

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
    weight: Lanes  # 1 of inactive corners, 0 of the others


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
    return Corners(a, b, c, gap, x, y, r, s, (kappa * weight) / (gap * s), m, weight)


@optional(Slot.EVALUATE_CORNERS)
def evaluate_corners(model: Model, data: Data, h: float, c: int) -> None:
    """Impulses of the inactive corners of a cluster at configuration 3: FORCE, ARMS and LEAST_GAP of Inactive, and GAP,
    IMPULSE and FRICTION of each corner.
    """
    row, C, end = data.inactive[c], data.corners, model.cluster_end[c]
    turn = turn_of(model, data, h, c)
    o = spread(0.0)
    N, X, Y = o, o, o
    n0, n1, n2, x0, x1, x2, y0, y1, y2 = o, o, o, o, o, o, o, o, o
    near = _FAR
    for j in range(c, end, LANES):
        k = corners_at(C, j, end, turn, row[Inactive.ACTIVATION], data.carry.inactive_kappa[0])
        f, along = k.q * k.total, k.m * k.q
        fx, fy = -1.0 * (along * k.x), -1.0 * (along * k.y)
        px, py, pz = load(C, Corner.POINT, j), load(C, Corner.POINT + 1, j), load(C, Corner.POINT + 2, j)
        N, X, Y = N + f, X + fx, Y + fy
        n0, n1, n2 = n0 + f * px, n1 + f * py, n2 + f * pz
        x0, x1, x2 = x0 + fx * px, x1 + fx * py, x2 + fx * pz
        y0, y1, y2 = y0 + fy * px, y1 + fy * py, y2 + fy * pz
        near = min(near, lowest(k.gap + _FAR * (spread(1.0) - k.weight)))
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
    row[Inactive.LEAST_GAP] = near


@kernel
def write_cones(model: Model, data: Data, c: int) -> None:
    """Cone variables of the inactive corners of a cluster as they were evaluated last."""
    C = data.corners
    for k in range(c, model.cluster_end[c]):
        if C[Corner.OUT, k] > 0.0:
            z = data.cone[k]
            z[Cone.SLACK], z[Cone.IMPULSE] = C[Corner.GAP, k], C[Corner.IMPULSE, k]
            z[Cone.FRICTION1], z[Cone.FRICTION2] = C[Corner.FRICTION1, k], C[Corner.FRICTION2, k]


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
def gather_corners(model: Model, data: Data, c: int, a: float, slack: float) -> bool:
    """Rows of `corners` of a cluster: corners are inactive whose gap at configuration 2, and after one more step like
    the last one, is more than a + slack; returns whether these are others than before.
    """
    C, F, changed = data.corners, model.contact_frame[c], False
    i = model.contact_body[c]
    n0, n1, n2 = transposed_times(data.rot2[i], F[0], F[1], F[2])
    height = F[0] * data.pos2[i, 0] + F[1] * data.pos2[i, 1] + F[2] * data.pos2[i, 2]
    fall, turn = _last_fall(model, data, c)
    for k in range(c, model.cluster_end[c]):
        p = model.contact_point[k]
        offset = model.contact_height[k] + model.contact_radius[k]
        ahead = min(0.0, fall + turn[0] * p[0] + turn[1] * p[1] + turn[2] * p[2])
        out = 1 if height + n0 * p[0] + n1 * p[1] + n2 * p[2] - offset + ahead > a + slack else 0
        changed = changed or out != C[Corner.OUT, k]
        C[Corner.POINT, k], C[Corner.POINT + 1, k], C[Corner.POINT + 2, k] = p[0], p[1], p[2]
        C[Corner.FRICTION, k] = model.contact_friction[k] if model.contact_law[k] == Law.NONLINEAR else 0.0
        C[Corner.OFFSET, k], C[Corner.OUT, k] = offset, out
        data.contact_out[k] = out
    return changed


@kernel
def _last_fall(model: Model, data: Data, c: int) -> tuple[float, Vec3]:
    """(f, t) of the body of a cluster: the gap of its corner p has grown by f + t.p in the step before.

    With the normal n, the displacement d, and the rotation Q of that step, R2 = Q R1:  f = n.d,  t = R2^T (n - Q n).
    """
    i, n = model.contact_body[c], model.contact_frame[c]
    q, d = data.turn_in[i], data.move_in[i]
    sx, sy, sz = cross(q[1], q[2], q[3], n[0], n[1], n[2])
    x, y, z = cross(q[1], q[2], q[3], sx, sy, sz)
    w = -2.0 * q[0]
    turn = transposed_times(data.rot2[i], w * sx - 2.0 * x, w * sy - 2.0 * y, w * sz - 2.0 * z)
    return n[0] * d[0] + n[1] * d[1] + n[2] * d[2], turn
