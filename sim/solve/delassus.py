"""The coupling of impulses of contacts and joint limits: G = J H^-1 B^T, after Delassus.

The elimination of H (elimination.py) goes from a body to the root and back. On the way up the answer to an impulse
has entries of the joints on that way alone, and so have, on the way down, the rates of a body:

    G_ab = sum over the joints that are ancestors of both of  rate_a(d) z_b(d)

    z = -D^-1 S2^T p,   p_parent = p + U z        from p = -B^T e at the body of b
    rate = r.S3nu,      r_parent = r - rate L     from r = J at the body of a
"""

from __future__ import annotations

from sim.contact.ground_contact import add_contact_wrench
from sim.dynamics.elimination import dot_six
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import JointFactor, Kin
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.lu import lu_solve
from solvers.types import Vector


@kernel
def _add_six(a: float, s: Vector, out: Vector) -> None:
    """out += a s, of six numbers."""
    for k in range(6):
        out[k] += a * s[k]


@kernel
def _rates_above(model: Model, data: Data, i: int, a: int) -> None:
    """Rates of row a by the joints from body i to the root; data.twist[i] holds r, of all bodies in turn."""
    r = data.twist[i]
    while i >= 0:
        d0, end = model.body_vadr[i], model.body_vadr[i + 1]
        for d in range(d0, end):
            data.reach[d, a] = dot_six(r, data.S3nu[d])
        i = model.body_parent[i]
        if i >= 0:  # a root has no L
            for d in range(d0, end):
                _add_six(-data.reach[d, a], data.L[d], r)


@optional(Slot.CONTACT_RATES)
def contact_rates(model: Model, data: Data, c: int, a: int) -> None:
    """Rows a, a + 1, a + 2: gap and slip of contact c."""
    i = model.contact_body[c]
    J = data.contact_kin[c]
    for e in range(3):
        r = data.twist[i]
        for k in range(3):
            r[k], r[3 + k] = J[Kin.BY_TRANSLATION + 3 * e + k], J[Kin.BY_ROTATION + 3 * e + k]
        _rates_above(model, data, i, a + e)


@kernel
def limit_rates(model: Model, data: Data, k: int, h: float, a: int) -> None:
    """Row a: the gap of limit k of one coordinate."""
    d = model.limit_dof[k]
    q = model.body_parent[model.dof_body[d]]
    rate = h * model.limit_sign[k]
    data.reach[d, a] = rate
    if q >= 0:
        for e in range(6):
            data.twist[q, e] = -rate * data.L[d, e]
        _rates_above(model, data, q, a)


@kernel
def _answer(model: Model, data: Data, i: int, b: int, size: int) -> None:
    """Column b from the load p in data.subtree[i], which goes up, and z of the joint of i as it comes in."""
    g = data.delassus[b]
    p = data.subtree[i]
    for k in range(size):
        g[k] = 0.0
    while i >= 0:
        d0 = model.body_vadr[i]
        n = model.body_vadr[i + 1] - d0
        for d in range(d0, d0 + n):
            data.z[d] -= dot_six(data.S2[d], p)
        if n == 1:
            data.z[d0] *= data.D[i, JointFactor.INVERSE]
        elif n > 1:
            lu_solve(data.D[i], n, int(data.D[i, JointFactor.SWAPS]), data.z, d0)
        for d in range(d0, d0 + n):
            z, rates = data.z[d], data.reach[d]
            for k in range(size):
                g[k] += z * rates[k]
            _add_six(z, data.U[d], p)
            data.z[d] = 0.0
        i = model.body_parent[i]


@optional(Slot.CONTACT_ANSWERS)
def contact_answers(model: Model, data: Data, c: int, b: int, size: int) -> None:
    """Columns b, b + 1, b + 2: unit impulses of contact c, normal and tangents."""
    i = model.contact_body[c]
    for e in range(3):
        for k in range(6):
            data.subtree[i, k] = 0.0
        add_contact_wrench(
            model, data, c, 1.0 if e == 0 else 0.0, 1.0 if e == 1 else 0.0, 1.0 if e == 2 else 0.0, data.subtree
        )
        _answer(model, data, i, b + e, size)


@kernel
def limit_answers(model: Model, data: Data, k: int, b: int, size: int) -> None:
    """Column b: a unit impulse of limit k of one coordinate."""
    d = model.limit_dof[k]
    i = model.dof_body[d]
    for e in range(6):
        data.subtree[i, e] = 0.0
    data.z[d] = model.limit_sign[k]
    _answer(model, data, i, b, size)


@optional(Slot.DELASSUS)
def delassus(model: Model, data: Data, h: float, points: int, size: int) -> None:
    """Columns of G, as rows of data.delassus, of the contacts and limits in data.reach_of.

    points: contacts, of three rows each;  size: rows.   Destroys data.twist, data.subtree, data.z.
    """
    for d in range(data.z.shape[0]):
        data.z[d] = 0.0
        row = data.reach[d]
        for a in range(size):
            row[a] = 0.0
    for a in range(points):
        contact_rates(model, data, data.reach_of[3 * a], 3 * a)
    for a in range(3 * points, size):
        limit_rates(model, data, data.reach_of[a], h, a)
    for b in range(points):
        contact_answers(model, data, data.reach_of[3 * b], 3 * b, size)
    for b in range(3 * points, size):
        limit_answers(model, data, data.reach_of[b], b, size)
