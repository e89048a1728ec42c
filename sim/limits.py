"""Joint limits on the central path: s = gap, s gamma = kappa, generalized impulse d(gap)/d(coordinates) gamma.

    bound    gap = sign (theta3 - bound)                                   of one coordinate
    cone     gap = (a . R(r3) a - cos angle)/sin angle                     of a quaternion joint: the child's axis a
             stays within `angle` of the parent's; the gap is their angle's distance from it, to first order

Columns of `bound` (and of its steps): 0 slack s, 1 impulse gamma. Of a cone, `bound_row` has the torque p of a unit of
impulse in the child's axes at configuration 2, and the derivative c of the gap by v25:

    v = R(E) a,  b = R(r2)^T a,  E = exp(h w)        p = (v x b)/sin angle        c = h J(h w)^T p
    dp = (v b^T - (v.b) I)/sin angle u  for a rotation u = h J dw of configuration 3
"""

from __future__ import annotations

from math import cos, sin

from sim.model import Goal, Model, Vector, Work
from sim.rotation import Vec3, cross, left_jacobian, quat_exp, quat_matrix
from solvers.jit import kernel


@kernel
def limit_gaps(model: Model, work: Work, h: float) -> None:
    """bound_gap, and p of cones."""
    for k in range(model.limit_dof.shape[0]):
        if model.limit_cone[k]:
            _cone_gap(model, work, h, k)
        else:
            a = model.dof_qadr[model.limit_dof[k]]
            work.bound_gap[k] = model.limit_sign[k] * (work.theta3[a] - model.limit_bound[k])


@kernel
def _cone_axes(model: Model, work: Work, h: float, k: int) -> tuple[Vec3, Vec3]:
    """v, b: the axes of child and parent at configuration 3, in the child's axes at configuration 2."""
    d = model.limit_dof[k]
    i = model.dof_body[d]
    a = model.joint_axis[i]
    q = model.dof_qadr[d]
    e = quat_exp(h * work.nu[d], h * work.nu[d + 1], h * work.nu[d + 2])
    E = quat_matrix(e[0], e[1], e[2], e[3])
    R = quat_matrix(work.theta3[q], work.theta3[q + 1], work.theta3[q + 2], work.theta3[q + 3])
    x = R[0] * a[0] + R[3] * a[1] + R[6] * a[2]
    y = R[1] * a[0] + R[4] * a[1] + R[7] * a[2]
    z = R[2] * a[0] + R[5] * a[1] + R[8] * a[2]
    v = (
        E[0] * a[0] + E[1] * a[1] + E[2] * a[2],
        E[3] * a[0] + E[4] * a[1] + E[5] * a[2],
        E[6] * a[0] + E[7] * a[1] + E[8] * a[2],
    )
    return v, (E[0] * x + E[1] * y + E[2] * z, E[3] * x + E[4] * y + E[5] * z, E[6] * x + E[7] * y + E[8] * z)


@kernel
def _cone_gap(model: Model, work: Work, h: float, k: int) -> None:
    """Gap and p of a cone."""
    v, b = _cone_axes(model, work, h, k)
    scale = 1.0 / sin(model.limit_bound[k])
    x, y, z = cross(v[0], v[1], v[2], b[0], b[1], b[2])
    work.bound_gap[k] = scale * (v[0] * b[0] + v[1] * b[1] + v[2] * b[2] - cos(model.limit_bound[k]))
    work.bound_row[k, 0] = scale * x
    work.bound_row[k, 1] = scale * y
    work.bound_row[k, 2] = scale * z


@kernel
def add_limit_impulse(model: Model, work: Work, k: int, size: float, out: Vector) -> None:
    """out += the generalized impulse of limit k.   out: (nv,)."""
    d = model.limit_dof[k]
    if model.limit_cone[k]:
        for j in range(3):
            out[d + j] += work.bound_row[k, j] * size
    else:
        out[d] += model.limit_sign[k] * size


@kernel
def add_limit_blocks(model: Model, work: Work, h: float) -> None:
    """joint_block += h gamma/s on the diagonal; (gamma/s) p c^T - gamma dp h J of a cone."""
    for k in range(model.limit_dof.shape[0]):
        d = model.limit_dof[k]
        i = model.dof_body[d]
        n = model.body_vadr[i + 1] - model.body_vadr[i]
        a = d - model.body_vadr[i]
        if model.limit_cone[k]:
            _add_cone_block(model, work, h, k, work.joint_block[i], a * n + a, n)
        else:
            work.joint_block[i, a * n + a] += h * work.bound[k, 1] / work.bound[k, 0]


@kernel
def _add_cone_block(model: Model, work: Work, h: float, k: int, B: Vector, first: int, n: int) -> None:
    """B[3 x 3 from `first`, n per row] += (gamma/s) p c^T - gamma dp h J; fills c."""
    d = model.limit_dof[k]
    v, b = _cone_axes(model, work, h, k)
    J = left_jacobian(h * work.nu[d], h * work.nu[d + 1], h * work.nu[d + 2])
    p = work.bound_row[k]
    for j in range(3):
        p[3 + j] = h * (J[j] * p[0] + J[3 + j] * p[1] + J[6 + j] * p[2])
    dot = v[0] * b[0] + v[1] * b[1] + v[2] * b[2]
    ratio = work.bound[k, 1] / work.bound[k, 0]
    g = h * work.bound[k, 1] / sin(model.limit_bound[k])
    for j in range(3):
        bJ = b[0] * J[j] + b[1] * J[3 + j] + b[2] * J[6 + j]
        for r in range(3):
            B[first + r * n + j] += ratio * p[r] * p[3 + j] - g * (v[r] * bJ - dot * J[3 * r + j])


@kernel
def add_limit_derivatives(model: Model, work: Work, h: float) -> None:
    """dR_dq += gamma/s; of a cone (gamma/s) p p^T - gamma (b v^T - (v.b) I)/sin angle: b turns with q2, v does not."""
    for k in range(model.limit_dof.shape[0]):
        d = model.limit_dof[k]
        ratio = work.bound[k, 1] / work.bound[k, 0]
        if not model.limit_cone[k]:
            work.dR_dq[d, d] += ratio
            continue
        v, b = _cone_axes(model, work, h, k)
        p = work.bound_row[k]
        dot = v[0] * b[0] + v[1] * b[1] + v[2] * b[2]
        g = work.bound[k, 1] / sin(model.limit_bound[k])
        for r in range(3):
            for j in range(3):
                work.dR_dq[d + r, d + j] += ratio * p[r] * p[j] - g * b[r] * v[j]
            work.dR_dq[d + r, d + r] += g * dot


@kernel
def limit_constants(model: Model, work: Work, goal: Goal) -> None:
    """dnu += (impulse of size w), with d gamma = w - (gamma/s) d gap; w kept in bound_w."""
    for k in range(model.limit_dof.shape[0]):
        s = work.bound[k, 0]
        g = work.bound[k, 1]
        r = goal.kappa - s * g
        if goal.corrected:
            r -= work.bound_step[k, 0] * work.bound_step[k, 1]
        w = (r - g * goal.share * (work.bound_gap[k] - s)) / s
        work.bound_w[k] = w
        add_limit_impulse(model, work, k, w, work.dnu)


@kernel
def recover_limits(model: Model, work: Work, h: float, share: float) -> None:
    """bound_step from dnu."""
    for k in range(model.limit_dof.shape[0]):
        s = work.bound[k, 0]
        d = model.limit_dof[k]
        if model.limit_cone[k]:
            c = work.bound_row[k]
            t = c[3] * work.dnu[d] + c[4] * work.dnu[d + 1] + c[5] * work.dnu[d + 2]
        else:
            t = model.limit_sign[k] * h * work.dnu[d]
        work.bound_step[k, 0] = t + share * (work.bound_gap[k] - s)
        work.bound_step[k, 1] = work.bound_w[k] - work.bound[k, 1] / s * t
