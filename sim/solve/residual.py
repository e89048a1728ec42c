"""The generalized residual of a step: body wrenches along the test directions, and joint forces."""

from __future__ import annotations

from sim.dynamics.elimination import project, subtree_sums
from sim.dynamics.joints.joint_forces import joint_impulses
from sim.dynamics.loops.gears import apply_gears
from sim.model.data import Data
from sim.model.model import Model
from solvers.compiler import kernel
from solvers.rotation import cross
from solvers.types import Vector


@kernel
def residual_scale(data: Data) -> float:
    """1 + largest incoming momentum: rounding grows with it, and so does the tolerance."""
    s = 1.0
    for i in range(data.momentum_in.shape[0]):
        for k in range(6):
            s = max(s, 1.0 + abs(data.momentum_in[i, k]))
    return s


@kernel
def rounding(model: Model, data: Data, h: float) -> float:
    """Residual that cannot be told from zero where it contains differences of rounded poses, divided by h."""
    total = 0.0
    o = abs(data.origin[0]) + abs(data.origin[1]) + abs(data.origin[2])
    for i in range(model.body_parent.shape[0]):
        x = abs(data.pos2[i, 0]) + abs(data.pos2[i, 1]) + abs(data.pos2[i, 2])
        J = model.body_inertia[i]
        total += model.body_mass[i] * x * (1.0 + x + o) + J[0] + J[4] + J[8]
    return 1e-15 * total / abs(h)


@kernel
def norm(x: Vector) -> float:
    """Largest absolute entry; NaN if any entry is NaN."""
    r = 0.0
    for d in range(x.shape[0]):
        a = abs(x[d])
        if not a <= r:
            r = a
    return r


@kernel
def absorb_residual(model: Model, data: Data) -> None:
    """momentum_out less the residual r of the joints: a motion carries over the momenta of exact steps, so
    that the tolerance of the solve does not add up.

    Each joint takes (f, m) = (sum r_k t_k, sum r_k a_k) at its point o from its body, and gives it to the parent: about
    the centre of mass x, (f, m + (o - x) x f). The total changes by the residual of joints on the world alone.
    """
    P = data.momentum_out
    for i in range(model.body_parent.shape[0]):
        if model.joint_nrot[i] == 2:  # the axes of a swing are not orthogonal
            continue
        p = model.body_parent[i]
        first = model.body_vadr[i] + model.joint_ntrans[i]
        for d in range(first, model.body_vadr[i + 1]):
            for k in range(3):
                m = data.residual[d] * data.S2[d, 3 + k]
                P[i, 3 + k] -= m
                if p >= 0:
                    P[p, 3 + k] += m
        for d in range(model.body_vadr[i], first):
            r = data.residual[d]
            s = data.S2[d]
            a = data.arm[i]
            x, y, z = cross(a[3], a[4], a[5], r * s[0], r * s[1], r * s[2])
            _add(P[i], -r, s, -x, -y, -z)
            if p >= 0:
                o, c = data.pos2[i], data.pos2[p]
                x, y, z = a[3] + o[0] - c[0], a[4] + o[1] - c[1], a[5] + o[2] - c[2]
                x, y, z = cross(x, y, z, r * s[0], r * s[1], r * s[2])
                _add(P[p], r, s, x, y, z)


@kernel
def _add(P: Vector, r: float, s: Vector, x: float, y: float, z: float) -> None:
    """P += (r s, (x, y, z))"""
    P[0], P[1], P[2] = P[0] + r * s[0], P[1] + r * s[1], P[2] + r * s[2]
    P[3], P[4], P[5] = P[3] + x, P[4] + y, P[5] + z


@kernel
def balance_to_wrench(data: Data) -> None:
    """wrench = balance, to which forces are then added."""
    for i in range(data.balance.shape[0]):
        for k in range(6):
            data.wrench[i, k] = data.balance[i, k]


@kernel
def project_wrench(model: Model, data: Data, h: float, q: Vector, v: Vector, u: Vector) -> float:
    """residual = S2^T (subtree sums of wrench) + springs, dampers, inputs, gears; returns the gap of the gears."""
    subtree_sums(model, data.wrench, data.subtree)
    project(model, data.S2, data.subtree, data.residual)
    joint_impulses(model, data, h, q, v, u)
    return apply_gears(model, data, h)
