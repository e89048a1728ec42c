"""Cone limit of a quaternion joint: the child's axis stays within an angle of the parent's.

    gap = (a . R(r3) a - cos angle)/sin angle      the distance of their angle from `angle` [rad], to first order

With the axes of child and parent at configuration 3, v = R(E) a and b = R(r2)^T a in the child's axes at
configuration 2, E = exp(h w), and for a rotation u = h J(h w) dw of configuration 3:

    p = (v x b)/sin angle                 torque per unit of impulse        d(gap) = p.u = c.dw,   c = h J^T p
    dp = (v b^T - (v.b) I) u/sin angle    by v25                            dp = -(b v^T - (v.b) I)/sin angle  by q2

`bound_row` holds (p, c). The impulse acts at configuration 3, where it has a direction even when the step began with
the axes aligned. These kernels are compiled by scenes with such a limit only.
"""

from __future__ import annotations

from math import cos, sin

from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import Bound, BoundRow
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.rotation import Vec3, cross, left_jacobian, quat_exp, quat_matrix


@kernel
def _cone_axes(model: Model, data: Data, h: float, k: int) -> tuple[Vec3, Vec3]:
    """v, b: the axes of child and parent at configuration 3, in the child's axes at configuration 2."""
    d = model.limit_dof[k]
    i = model.dof_body[d]
    a = model.joint_axis[i]
    q = model.dof_qadr[d]
    e = quat_exp(h * data.nu[d], h * data.nu[d + 1], h * data.nu[d + 2])
    E = quat_matrix(e[0], e[1], e[2], e[3])
    R = quat_matrix(data.theta3[q], data.theta3[q + 1], data.theta3[q + 2], data.theta3[q + 3])
    x = R[0] * a[0] + R[3] * a[1] + R[6] * a[2]
    y = R[1] * a[0] + R[4] * a[1] + R[7] * a[2]
    z = R[2] * a[0] + R[5] * a[1] + R[8] * a[2]
    v = (
        E[0] * a[0] + E[1] * a[1] + E[2] * a[2],
        E[3] * a[0] + E[4] * a[1] + E[5] * a[2],
        E[6] * a[0] + E[7] * a[1] + E[8] * a[2],
    )
    return v, (E[0] * x + E[1] * y + E[2] * z, E[3] * x + E[4] * y + E[5] * z, E[6] * x + E[7] * y + E[8] * z)


@optional(Slot.CONE_GAP)
def cone_gap(model: Model, data: Data, h: float, k: int) -> None:
    """bound_gap, and p in bound_row."""
    v, b = _cone_axes(model, data, h, k)
    scale = 1.0 / sin(model.limit_bound[k])
    x, y, z = cross(v[0], v[1], v[2], b[0], b[1], b[2])
    data.bound_gap[k] = scale * (v[0] * b[0] + v[1] * b[1] + v[2] * b[2] - cos(model.limit_bound[k]))
    data.bound_row[k, BoundRow.TORQUE] = scale * x
    data.bound_row[k, BoundRow.TORQUE + 1] = scale * y
    data.bound_row[k, BoundRow.TORQUE + 2] = scale * z


@optional(Slot.CONE_BLOCK)
def cone_block(model: Model, data: Data, h: float, k: int) -> None:
    """joint_block += (gamma/s) p c^T - gamma dp h J; fills c."""
    d = model.limit_dof[k]
    i = model.dof_body[d]
    n = model.body_vadr[i + 1] - model.body_vadr[i]
    first = (d - model.body_vadr[i]) * (n + 1)
    v, b = _cone_axes(model, data, h, k)
    J = left_jacobian(h * data.nu[d], h * data.nu[d + 1], h * data.nu[d + 2])
    p = data.bound_row[k]
    x, y, z = p[BoundRow.TORQUE], p[BoundRow.TORQUE + 1], p[BoundRow.TORQUE + 2]
    for j in range(3):
        p[BoundRow.RATE + j] = h * (J[j] * x + J[3 + j] * y + J[6 + j] * z)
    dot = v[0] * b[0] + v[1] * b[1] + v[2] * b[2]
    ratio = data.bound[k, Bound.IMPULSE] / data.bound[k, Bound.SLACK]
    g = h * data.bound[k, Bound.IMPULSE] / sin(model.limit_bound[k])
    for j in range(3):
        bJ = b[0] * J[j] + b[1] * J[3 + j] + b[2] * J[6 + j]
        for r in range(3):
            bent = g * (v[r] * bJ - dot * J[3 * r + j])
            data.joint_block[i, first + r * n + j] += ratio * p[r] * p[BoundRow.RATE + j] - bent


@optional(Slot.CONE_DERIVATIVE)
def cone_derivative(model: Model, data: Data, h: float, k: int) -> None:
    """dR_dq += (gamma/s) p p^T - gamma (b v^T - (v.b) I)/sin angle: b turns with q2, v does not."""
    d = model.limit_dof[k]
    v, b = _cone_axes(model, data, h, k)
    p = data.bound_row[k]
    ratio = data.bound[k, Bound.IMPULSE] / data.bound[k, Bound.SLACK]
    g = data.bound[k, Bound.IMPULSE] / sin(model.limit_bound[k])
    dot = v[0] * b[0] + v[1] * b[1] + v[2] * b[2]
    for r in range(3):
        for j in range(3):
            data.dR_dq[d + r, d + j] += ratio * p[r] * p[j] - g * b[r] * v[j]
        data.dR_dq[d + r, d + r] += g * dot
