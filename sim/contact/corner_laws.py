"""Laws of the inactive corners of a mesh (corners.py), in sum, for the matrix of a step and for its derivatives:

    wrench = sum of (f, P x f),     d(wrench)/d(twist) = sum of (1, P x) W C + turning of the arms

P is the arm of a corner, f its impulse, C = d(gap, slip)/d(twist) and W = df/d(gap, slip), all in the frame (n, t1, t2)
of the contacts, about the centre of mass. With g, (x, y), R, S and q of corners.py

    W      d(impulse)/dg = -q S/g,     dbeta/dg = 2 mu^2 q/g (1 + g/R) (x, y)
           dbeta/d(x, y) = -2 mu^2 q (1 - (2 mu)^2 (x, y) (x, y)^T/(S R))
"""

from __future__ import annotations

from sim.contact.corners import Corners, corners_at, turn_of
from sim.dynamics.pose_jacobians import columns_to_origin, rows_to_origin
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import Corner, Inactive
from sim.model.slots import Slot
from solvers.compiler import inlined, kernel, optional
from solvers.lanes import LANES, Lanes, load, spread, store, total
from solvers.rotation import transposed_times
from solvers.types import Matrix, Vector

_WEAK = 174.0  # activation gaps beyond which e (inactive.py) is 1e-2 at most: Newton's method converges without


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
def _gather_near(model: Model, data: Data, c: int) -> int:
    """near_corners = the inactive corners of a cluster that are not weak; returns how many."""
    C, N, n = data.corners, data.near_corners, 0
    least = _WEAK * data.inactive[c, Inactive.ACTIVATION]
    for k in range(c, model.cluster_end[c]):
        if C[Corner.GAP, k] <= least and C[Corner.OUT, k] > 0.0:
            for r in range(N.shape[0]):
                N[r, n] = C[r, k]
            n += 1
    return n


@kernel
def _sum_laws(model: Model, data: Data, h: float, c: int, indefinite: float, corners: tuple[Matrix, int, int]) -> None:
    """corner_sums = sum of (1, P x) W C + turning of the arms, in the frame of the contacts, at configuration 3.

    corners: columns of a matrix like `data.corners` from the second up to the third.
    """
    S, (C, first, end) = data.corner_sums, corners
    turn = turn_of(model, data, h, c)
    w, (s0, s1, s2), i = turn.c, turn.s, 1.0 / h
    _clear(S)
    for j in range(first, end, LANES):
        k = corners_at(C, j, end, turn, data.inactive[c, Inactive.ACTIVATION], data.carry.inactive_kappa[0])
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
    """out[body] -= laws of the inactive corners, about O.  (nbody, 36)

    fresh: of configuration 3, and all of them, as derivatives need; otherwise of a near one, without the weak ones.
    """
    B, o = data.corner_block, data.origin
    for m in range(data.inactive_count[0]):
        c = data.inactive_first[m]
        row = data.inactive[c]
        weak = row[Inactive.LEAST_GAP] > _WEAK * row[Inactive.ACTIVATION]
        if row[Inactive.CORNERS] == 0.0 or (weak and not fresh):
            continue
        if fresh or row[Inactive.SHARE] != indefinite:
            if fresh:
                _sum_laws(model, data, h, c, indefinite, (data.corners, c, model.cluster_end[c]))
            else:
                _sum_laws(model, data, h, c, indefinite, (data.near_corners, 0, _gather_near(model, data, c)))
            _to_world(model.contact_frame[c], data.corner_sums, data.corner_law[c])
            row[Inactive.SHARE], row[Inactive.DRIFT] = indefinite, 0.0
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
