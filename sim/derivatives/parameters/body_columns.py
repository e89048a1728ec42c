"""Parameters of bodies and joints that do not change the geometry: dR/d(parameter) of the residual of a step.

Every kernel does columns[:, col] -= w dR/d(parameter). A change of the wrench on body i by (f, m), about O, reaches the
joints between the body and the root: dR_d = S2_d.(f, m).
"""

from __future__ import annotations

from math import cos, sin

from sim.contact.pairs.wrench_columns import unit_vector
from sim.derivatives.parameters.directions import At
from sim.dynamics.joints.ball_spring import spring_turns
from sim.dynamics.joints.damper import damper_lag, lag_rates
from sim.dynamics.joints.dry_friction import add_dry_time_step
from sim.model.data import Data
from sim.model.model import InputKind, Model
from sim.model.record_columns import Bound
from solvers.compiler import kernel
from solvers.rotation import Quat, Vec3, cross, left_jacobian, rotate
from solvers.types import Vector


@kernel
def add_wrench(model: Model, data: Data, i: int, f: Vec3, m: Vec3, w: float, col: int) -> None:
    """The wrench (f, m) on body i, about O."""
    while i >= 0:
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            s = data.S2[d]
            t = s[0] * f[0] + s[1] * f[1] + s[2] * f[2] + s[3] * m[0] + s[4] * m[1] + s[5] * m[2]
            data.columns[d, col] -= w * t
        i = model.body_parent[i]


@kernel
def moment(data: Data, i: int, f: Vec3, t: Vec3) -> Vec3:
    """Moment about O of the force f at the centre of mass of body i at 2, and the torque t."""
    o = data.origin
    x, y, z = cross(data.pos2[i, 0] - o[0], data.pos2[i, 1] - o[1], data.pos2[i, 2] - o[2], f[0], f[1], f[2])
    return t[0] + x, t[1] + y, t[2] + z


@kernel
def add_mass(model: Model, data: Data, h: float, i: int, w: float, col: int) -> None:
    """f = (x3 - 2 x2 + x1)/h - h g, of g the share that acts"""
    g, s = model.gravity, h * model.body_weight[i]
    a, b, c = data.pos1[i], data.pos2[i], data.pos3[i]
    f = (
        (c[0] - 2.0 * b[0] + a[0]) / h - s * g[0],
        (c[1] - 2.0 * b[1] + a[1]) / h - s * g[1],
        (c[2] - 2.0 * b[2] + a[2]) / h - s * g[2],
    )
    add_wrench(model, data, i, f, moment(data, i, f, (0.0, 0.0, 0.0)), w, col)


@kernel
def _momentum(h: float, c: float, s: Vec3, js: Vec3) -> Vec3:
    """P = (2/h) (psi (c J s + s x J s) - s.J s psi'/2 s), from J s: see momentum_balance.py."""
    psi = 2.0 / 3.0 + 1.0 / (3.0 * c * c)
    dpsi = -2.0 / (3.0 * c * c * c)
    x, y, z = cross(s[0], s[1], s[2], js[0], js[1], js[2])
    k = s[0] * js[0] + s[1] * js[1] + s[2] * js[2]
    a = 2.0 / h * psi
    b = -k * dpsi / h
    return a * (c * js[0] + x) + b * s[0], a * (c * js[1] + y) + b * s[1], a * (c * js[2] + z) + b * s[2]


@kernel
def _unit_spin(data: Data, i: int, e: int, s: Vec3) -> Vec3:
    """J s of body i at 2 for a unit entry e of J: xx, yy, zz, xy, xz, yz."""
    R = data.rot2[i]
    a = e if e < 3 else (1 if e == 5 else 0)
    b = e if e < 3 else (1 if e == 3 else 2)
    A = (R[a], R[3 + a], R[6 + a])
    B = (R[b], R[3 + b], R[6 + b])
    p = A[0] * s[0] + A[1] * s[1] + A[2] * s[2]
    q = B[0] * s[0] + B[1] * s[1] + B[2] * s[2]
    if a == b:
        return A[0] * p, A[1] * p, A[2] * p
    return A[0] * q + B[0] * p, A[1] * q + B[1] * p, A[2] * q + B[2] * p


@kernel
def add_inertia(model: Model, data: Data, h: float, i: int, e: int, w: float, col: int) -> None:
    """m = P+ - P-, both linear in J"""
    t = data.turn[i]
    s = (t[1], t[2], t[3])
    p = _momentum(h, t[0], s, _unit_spin(data, i, e, s))
    t = data.turn_in[i]
    s = (-t[1], -t[2], -t[3])
    q = _momentum(h, t[0], s, _unit_spin(data, i, e, s))
    add_wrench(model, data, i, (0.0, 0.0, 0.0), (p[0] + q[0], p[1] + q[1], p[2] + q[2]), w, col)


@kernel
def add_gravity(model: Model, data: Data, h: float, k: int, w: float, col: int) -> None:
    """f = -h m e_k on every body, of gravity the share that acts"""
    e = unit_vector(k)
    for i in range(model.body_parent.shape[0]):
        m = -h * model.body_mass[i] * model.body_weight[i]
        f = (m * e[0], m * e[1], m * e[2])
        add_wrench(model, data, i, f, moment(data, i, f, (0.0, 0.0, 0.0)), w, col)


@kernel
def is_quaternion(model: Model, d: int) -> bool:
    """Whether degree of freedom d is one of the three rotations of a quaternion."""
    i = model.dof_body[d]
    return model.joint_nrot[i] == 3 and d >= model.body_vadr[i + 1] - 3


@kernel
def _turn_product(c: float, s: Vec3, y: Vec3) -> Vec3:
    """(c I - [s]) y"""
    a, b, d = cross(s[0], s[1], s[2], y[0], y[1], y[2])
    return c * y[0] - a, c * y[1] - b, c * y[2] - d


@kernel
def _spring_sum(r1: Quat, r2: Quat, r3: Quat) -> Vec3:
    """y = s1 + 2 s2 + s3"""
    return r1[1] + 2.0 * r2[1] + r3[1], r1[2] + 2.0 * r2[2] + r3[2], r1[3] + 2.0 * r2[3] + r3[3]


@kernel
def _scalar_spring(model: Model, data: Data, at: At, d: int) -> float:
    """q + h (nu - v)/4 - rest"""
    return at.q[model.dof_qadr[d]] + 0.25 * at.h * (data.nu[d] - at.v[d]) - model.dof_rest[d]


@kernel
def add_spring(model: Model, data: Data, at: At, d: int, w: float, col: int) -> None:
    """h (q + h (nu - v)/4 - rest); of a quaternion joint, d its first rotation, (h/2) (c2 I - [s2]) (s1 + 2 s2 + s3)"""
    X = data.columns
    if not is_quaternion(model, d):
        X[d, col] -= w * at.h * _scalar_spring(model, data, at, d)
        return
    r1, r2, r3 = spring_turns(model, data, at.h, at.q, at.v, model.dof_body[d])
    t = _turn_product(r2[0], (r2[1], r2[2], r2[3]), _spring_sum(r1, r2, r3))
    for k in range(3):
        X[d + k, col] -= 0.5 * w * at.h * t[k]


@kernel
def _left_turn(r: Quat, e: Vec3) -> Quat:
    """Change of the quaternion r under the left rotation e: (-s.e, c e + e x s)/2"""
    x, y, z = cross(e[0], e[1], e[2], r[1], r[2], r[3])
    c = r[0]
    return (
        -0.5 * (r[1] * e[0] + r[2] * e[1] + r[3] * e[2]),
        0.5 * (c * e[0] + x),
        0.5 * (c * e[1] + y),
        0.5 * (c * e[2] + z),
    )


@kernel
def add_damper(model: Model, data: Data, at: At, d: int, w: float, col: int) -> None:
    """h nu - d(lag)/d(damper) (nu - v)"""
    by_damper, _ = lag_rates(model, at.h, d)
    data.columns[d, col] -= w * at.h * (data.nu[d] - by_damper * (data.nu[d] - at.v[d]))


@kernel
def add_seen(model: Model, data: Data, at: At, d: int, w: float, col: int) -> None:
    """-d(lag)/d(inertia that the damper sees) (nu - v)"""
    _, by_seen = lag_rates(model, at.h, d)
    data.columns[d, col] -= w * by_seen * (data.nu[d] - at.v[d])


@kernel
def add_rest(model: Model, data: Data, at: At, d: int, k: int, w: float, col: int) -> None:
    """-h k; for a quaternion joint, a left rotation of all its rotations by -J(rest)^T e_k"""
    X = data.columns
    if not is_quaternion(model, d):
        X[d, col] += w * at.h * model.dof_spring[d]
        return
    J = left_jacobian(model.dof_rest[d], model.dof_rest[d + 1], model.dof_rest[d + 2])
    e = (-J[3 * k], -J[3 * k + 1], -J[3 * k + 2])
    r1, r2, r3 = spring_turns(model, data, at.h, at.q, at.v, model.dof_body[d])
    d1, d2, d3 = _left_turn(r1, e), _left_turn(r2, e), _left_turn(r3, e)
    a = _turn_product(r2[0], (r2[1], r2[2], r2[3]), _spring_sum(d1, d2, d3))
    b = _turn_product(d2[0], (d2[1], d2[2], d2[3]), _spring_sum(r1, r2, r3))
    g = 0.5 * w * at.h * model.dof_spring[d]
    for j in range(3):
        X[d + j, col] -= g * (a[j] + b[j])


@kernel
def add_bound(model: Model, data: Data, k: int, w: float, col: int) -> None:
    """-gamma/s;  of a cone of angle t  (gamma/s) (1 - gap cot t) p + gamma cot t p"""
    d = model.limit_dof[k]
    X = data.columns
    gamma = data.bound[k, Bound.IMPULSE]
    ratio = gamma / data.bound[k, Bound.SLACK]
    if model.limit_cone[k] == 0:
        X[d, col] += w * ratio
        return
    t = model.limit_bound[k]
    cot = cos(t) / sin(t)
    f = ratio * (1.0 - data.bound_gap[k] * cot) + gamma * cot
    for j in range(3):
        X[d + j, col] -= w * f * data.bound_row[k, j]


@kernel
def _input_wrench(model: Model, data: Data, j: int, u: Vector) -> tuple[Vec3, Vec3]:
    """Force and torque of input j on its body, world axes; zero for one on a joint."""
    if model.input_kind[j] == InputKind.JOINT:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    e = model.input_wrench[j]
    f = (u[j] * e[0], u[j] * e[1], u[j] * e[2])
    t = (u[j] * e[3], u[j] * e[4], u[j] * e[5])
    if model.input_kind[j] == InputKind.WORLD:
        return f, t
    i = model.input_index[j]
    return rotate(data.rot2, i, f[0], f[1], f[2]), rotate(data.rot2, i, t[0], t[1], t[2])


@kernel
def add_input(model: Model, data: Data, at: At, j: int, k: int, w: float, col: int) -> None:
    """f = -h u e_k (k < 3), t = -h u e_k-3, of an input on a body"""
    g = -at.h * at.u[j]
    e = unit_vector(k % 3)
    i = model.input_index[j]
    if model.input_kind[j] != InputKind.WORLD:
        e = rotate(data.rot2, i, e[0], e[1], e[2])
    e = (g * e[0], g * e[1], g * e[2])
    f, t = (e, (0.0, 0.0, 0.0)) if k < 3 else ((0.0, 0.0, 0.0), e)
    add_wrench(model, data, i, f, moment(data, i, f, t), w, col)


@kernel
def add_time_step(model: Model, data: Data, at: At, w: float, col: int) -> None:
    """dR/dh where h v15 and h v25 stay, without contacts:

    body     -(balance + h (m g + f))/h - (m g + f),   f the inputs and external wrenches
    joint    spring impulse/h - u,   -I (nu - v)/h of an armature,   (lag/h - d(lag)/dh) (nu - v) of a damper
    """
    h, g = at.h, model.gravity
    X = data.columns
    for i in range(model.body_parent.shape[0]):
        m = -2.0 * model.body_mass[i] * model.body_weight[i]
        b = data.balance[i]
        e = data.carry.external[i]
        f = (m * g[0] - 2.0 * e[0], m * g[1] - 2.0 * e[1], m * g[2] - 2.0 * e[2])
        t = moment(data, i, f, (-2.0 * e[3], -2.0 * e[4], -2.0 * e[5]))
        f = (f[0] - b[0] / h, f[1] - b[1] / h, f[2] - b[2] / h)
        t = (t[0] - b[3] / h, t[1] - b[4] / h, t[2] - b[5] / h)
        add_wrench(model, data, i, f, t, w, col)
    for j in range(model.input_kind.shape[0]):
        i = model.input_index[j]
        if model.input_kind[j] == InputKind.JOINT:
            X[i, col] += w * model.input_wrench[j, 0] * at.u[j]
        else:
            f, t = _input_wrench(model, data, j, at.u)
            add_wrench(model, data, i, f, moment(data, i, f, t), -2.0 * w, col)
    add_dry_time_step(model, data, h, w, col)
    for d in range(at.v.shape[0]):
        by_damper, _ = lag_rates(model, h, d)
        X[d, col] += w * (model.dof_damper[d] * by_damper - damper_lag(model, h, d) / h) * (data.nu[d] - at.v[d])
        if not is_quaternion(model, d):
            X[d, col] -= w * model.dof_spring[d] * _scalar_spring(model, data, at, d)
            X[d, col] += w * model.dof_armature[d] * (data.nu[d] - at.v[d]) / h
        elif d == model.body_vadr[model.dof_body[d] + 1] - 3:
            add_spring(model, data, at, d, w * model.dof_spring[d] / h, col)
