"""The generalized residual of a step: body wrenches along the test directions, and what acts in the joints."""

from __future__ import annotations

from sim.elimination import project, subtree_sums
from sim.gears import apply_gears
from sim.joints import joint_impulses
from sim.model import Model, Vector, Work
from sim.rotation import cross, rotate
from solvers.jit import kernel


@kernel
def residual_scale(work: Work) -> float:
    """1 + largest incoming momentum: rounding grows with it, and so does the tolerance."""
    s = 1.0
    for i in range(work.momentum_in.shape[0]):
        for k in range(6):
            s = max(s, 1.0 + abs(work.momentum_in[i, k]))
    return s


@kernel
def rounding(model: Model, work: Work, h: float) -> float:
    """Residual that cannot be told from zero where it contains differences of rounded poses, divided by h."""
    total = 0.0
    o = abs(work.origin[0]) + abs(work.origin[1]) + abs(work.origin[2])
    for i in range(model.body_parent.shape[0]):
        x = abs(work.pos2[i, 0]) + abs(work.pos2[i, 1]) + abs(work.pos2[i, 2])
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
def absorb_residual(model: Model, work: Work) -> None:
    """momentum_out of the bodies on the world, less the residual r of their joints: so a motion hands on the momentum
    that its steps should have left, and the tolerance of the solve does not add up.

        (f, m) = (sum r_k t_k, sum r_k a_k) at the joint point;   (f, m + R2 p_child x f) at the centre of mass
    """
    for i in range(model.body_parent.shape[0]):
        if model.body_parent[i] >= 0 or model.joint_nrot[i] == 2:  # the axes of a swing are not orthogonal
            continue
        f0, f1, f2, m0, m1, m2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        first = model.body_vadr[i] + model.joint_ntrans[i]
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            s = work.S2[d]
            r = work.residual[d]
            if d < first:
                f0, f1, f2 = f0 + r * s[0], f1 + r * s[1], f2 + r * s[2]
            else:
                m0, m1, m2 = m0 + r * s[3], m1 + r * s[4], m2 + r * s[5]
        c = model.joint_child_point[i]
        x, y, z = rotate(work.rot2, i, c[0], c[1], c[2])
        x, y, z = cross(x, y, z, f0, f1, f2)
        p = work.momentum_out[i]
        p[0], p[1], p[2], p[3], p[4], p[5] = (
            p[0] - f0,
            p[1] - f1,
            p[2] - f2,
            p[3] - m0 - x,
            p[4] - m1 - y,
            p[5] - m2 - z,
        )


@kernel
def balance_to_wrench(work: Work) -> None:
    """wrench = balance: what forces are then added to."""
    for i in range(work.balance.shape[0]):
        for k in range(6):
            work.wrench[i, k] = work.balance[i, k]


@kernel
def project_wrench(model: Model, work: Work, h: float, q: Vector, v: Vector, u: Vector) -> float:
    """residual = S2^T (subtree sums of wrench) + springs, dampers, inputs, gears; returns the gap of the gears."""
    subtree_sums(model, work.wrench, work.subtree)
    project(model, work.S2, work.subtree, work.residual)
    joint_impulses(model, work, h, q, v, u)
    return apply_gears(model, work, h)
