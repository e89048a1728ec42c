"""Momentum balance of each body over a step, and its Jacobian: the discrete Euler-Lagrange equations.

Discrete Lagrangian of one body over an interval with rotation (c, s), c = cos(angle/2) > 0:

    L_d = m |x3 - x2|^2 / (2 h) + (2/h) s.J s psi(c) - (h/2) (V(2) + V(3)),      psi(c) = 2/3 + 1/(3 c^2)

psi = 1 is Dojo's Lagrangian (Howell et al. 2022), whose angular momentum J sin(angle)/h cannot exceed J/h, so that a
fast body may have no next state; psi = 1/c^2 is the Cayley map's. The blend cancels their leading errors (rotation
about a fixed axis is right to fourth order) and keeps the barrier at a half turn: every momentum has a next state.
"""

from __future__ import annotations

from sim.dynamics.angular_momentum import angular_momentum, angular_momentum_jacobian
from sim.dynamics.carry_over import advance, continues_motion
from sim.dynamics.displacements import previous_displacements, tree_displacements
from sim.dynamics.joints.damper import damper_lag
from sim.dynamics.joints.joint_motion import Increment
from sim.dynamics.kinematics import tree_poses
from sim.model.data import Data
from sim.model.model import InputKind, Model
from solvers.compiler import kernel
from solvers.dense import dot
from solvers.rotation import Mat3, cross, rotate
from solvers.types import Matrix, Vector

_HALF_TURN, _WHOLE_TURN = 9.8696, 39.4784  # pi^2 and (2 pi)^2, rounded down
_QUARTER = 0.7071  # cosine of half a quarter turn; as an angle, less than it about three axes


@kernel
def world_inertia(model: Model, rot: Matrix, out: Matrix) -> None:
    """out[i] = R J R^T.  rot, out: (nbody, 9)."""
    for i in range(rot.shape[0]):
        J = model.body_inertia
        for a in range(3):
            r0, r1, r2 = rot[i, 3 * a], rot[i, 3 * a + 1], rot[i, 3 * a + 2]
            t0 = r0 * J[i, 0] + r1 * J[i, 3] + r2 * J[i, 6]
            t1 = r0 * J[i, 1] + r1 * J[i, 4] + r2 * J[i, 7]
            t2 = r0 * J[i, 2] + r1 * J[i, 5] + r2 * J[i, 8]
            for b in range(3):
                out[i, 3 * a + b] = t0 * rot[i, 3 * b] + t1 * rot[i, 3 * b + 1] + t2 * rot[i, 3 * b + 2]


@kernel
def place_origin(model: Model, data: Data, q: Vector) -> None:
    """O at body 0 where that can move freely, at its joint otherwise."""
    free = model.body_parent.shape[0] > 0 and model.body_parent[0] < 0 and model.joint_ntrans[0] == 3
    for k in range(3):
        data.origin[k] = q[k] if free else model.joint_parent_point[0, k]


@kernel
def begin_step(model: Model, data: Data, h: float, q: Vector, v: Vector, u: Vector) -> bool:
    """Everything of a step that does not depend on its unknown: configurations 1 and 2, incoming momenta and impulses.

    momentum_in = (m (x2 - x1)/h + h m g + h f,  -P(c', -s') + h tau)      at the centre of mass

    -P(c', -s') is, in world axes, the P(c', s') with which the body left configuration 1: steps carry it over.

    False when a body turned by half a turn or more from 1 to 2: the state is invalid.
    """
    before = (data.origin[0], data.origin[1], data.origin[2])
    place_origin(model, data, q)
    if continues_motion(data, q, v):
        advance(model, data, h, q, v, before)
        world_inertia(model, data.rot2, data.inertia_world)
    else:
        data.carry.steps[0] = 0
        tree_poses(model, data, q)
        previous_displacements(model, data, h, q, v)
        world_inertia(model, data.rot2, data.inertia_world)
        mean_momenta(model, data, h)
    for i in range(model.body_parent.shape[0]):
        m = h * model.body_mass[i] * model.body_weight[i]
        for k in range(3):
            data.momentum_in[i, k] += m * model.gravity[k]
            data.momentum_in[i, k] += h * data.carry.external[i, k]
            data.momentum_in[i, 3 + k] += h * data.carry.external[i, 3 + k]
            data.body_impulse[i, k] = 0.0
            data.body_impulse[i, 3 + k] = 0.0
    representable = turns_below_half(model, data, h, v)
    for j in range(u.shape[0]):
        _apply_input(model, data, h, j, u[j])
    for d in range(v.shape[0]):
        data.rotor[d] = model.dof_armature[d] - damper_lag(model, h, d)
    return representable


@kernel
def mean_momenta(model: Model, data: Data, h: float) -> None:
    """momentum_in = (m (x2 - x1)/h, -P(c', -s')), from the moves of interval 1-2."""
    for i in range(model.body_parent.shape[0]):
        m = model.body_mass[i] / h
        t = data.turn_in[i]
        px, py, pz = angular_momentum(data.inertia_world, i, h, t[0], -t[1], -t[2], -t[3])
        for k in range(3):
            data.momentum_in[i, k] = m * data.move_in[i, k]
        data.momentum_in[i, 3], data.momentum_in[i, 4], data.momentum_in[i, 5] = -px, -py, -pz


@kernel
def turns_below_half(model: Model, data: Data, h: float, v: Vector) -> bool:
    """|h omega| < pi for the angular velocity of each body, omega = sum of the ancestors' rotation rates about S2."""
    for i in range(model.body_parent.shape[0]):
        p = model.body_parent[i]
        for k in range(3):
            w = data.subtree[p, 3 + k] if p >= 0 else 0.0
            for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
                w += h * v[d] * data.S2[d, 3 + k]
            data.subtree[i, 3 + k] = w
        x, y, z = data.subtree[i, 3], data.subtree[i, 4], data.subtree[i, 5]
        if not x * x + y * y + z * z < _HALF_TURN or not data.turn_in[i, 0] > 1e-3:
            return False
    return True


@kernel
def ends_below_half(model: Model, data: Data, h: float) -> bool:
    """`turns_below_half` at configuration 3, for the velocity data.nu: whether another step may begin there.

    Where no body turned by a quarter of a turn, and all coordinates together moved by less, all is well.
    """
    c = 1.0
    for i in range(data.turn.shape[0]):
        c = min(c, data.turn[i, 0])
    if c > _QUARTER and h * h * dot(data.nu, data.nu) < _QUARTER * _QUARTER:
        return True
    for i in range(model.body_parent.shape[0]):
        p, w = model.body_parent[i], data.twist[i]
        for k in range(3):
            w[3 + k] = data.twist[p, 3 + k] if p >= 0 else 0.0
            for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
                w[3 + k] += h * data.nu[d] * data.S3[d, 3 + k]
        if not w[3] * w[3] + w[4] * w[4] + w[5] * w[5] < _HALF_TURN or not data.turn[i, 0] > 1e-3:
            return False
    return True


@kernel
def _apply_input(model: Model, data: Data, h: float, j: int, u: float) -> None:
    """Add the impulse h u of a WORLD or BODY input to its body (JOINT inputs enter the generalized residual)."""
    if model.input_kind[j] == InputKind.JOINT:
        return
    i = model.input_index[j]
    w = model.input_wrench[j]
    f = (h * u * w[0], h * u * w[1], h * u * w[2])
    t = (h * u * w[3], h * u * w[4], h * u * w[5])
    if model.input_kind[j] == InputKind.BODY:
        f = rotate(data.rot2, i, f[0], f[1], f[2])
        t = rotate(data.rot2, i, t[0], t[1], t[2])
        for k in range(3):
            data.body_impulse[i, k] += f[k]
            data.body_impulse[i, 3 + k] += t[k]
    for k in range(3):
        data.momentum_in[i, k] += f[k]
        data.momentum_in[i, 3 + k] += t[k]


@kernel
def joints_below_turn(model: Model, nu: Vector, h: float) -> bool:
    """|h nu| < pi for rotations against the world, 2 pi for those between bodies: poses cannot tell further turns."""
    for i in range(model.body_parent.shape[0]):
        t = 0.0
        for d in range(model.body_vadr[i] + model.joint_ntrans[i], model.body_vadr[i + 1]):
            t += nu[d] * nu[d]
        if not h * h * t < (_HALF_TURN if model.body_parent[i] < 0 else _WHOLE_TURN):
            return False
    return True


@kernel
def momentum_balance(model: Model, data: Data, h: float, q: Vector) -> bool:
    """balance = momentum_out - momentum_in, as a wrench about O, at the trial velocity data.nu.

    momentum_out = (m (x3 - x2)/h, P(c, s))      at the centre of mass

    False when a body would turn by half a turn or more.   Fills configuration 3, move, turn, momentum_out, balance;
    rotation matrices are left to `turn_bodies`, for the balance has no use for them.
    """
    tree_displacements(model, data, Increment(q, data.nu, h), True)
    inside = joints_below_turn(model, data.nu, h)
    for i in range(model.body_parent.shape[0]):
        c, x, y, z = data.turn[i, 0], data.turn[i, 1], data.turn[i, 2], data.turn[i, 3]
        inside = inside and c > 1e-3
        p = data.momentum_out[i]
        p[3], p[4], p[5] = angular_momentum(data.inertia_world, i, h, c, x, y, z)
        m = model.body_mass[i] / h
        for k in range(3):
            p[k] = m * data.move[i, k]
        b = data.balance[i]
        for k in range(6):
            b[k] = p[k] - data.momentum_in[i, k]
        tx, ty, tz = cross(
            data.pos2[i, 0] - data.origin[0],
            data.pos2[i, 1] - data.origin[1],
            data.pos2[i, 2] - data.origin[2],
            b[0],
            b[1],
            b[2],
        )
        b[3], b[4], b[5] = b[3] + tx, b[4] + ty, b[5] + tz
    return inside


@kernel
def momentum_balance_jacobian(model: Model, data: Data, h: float, out: Matrix) -> None:
    """out[i] = d(balance)/d(twist of configuration 3), about O, 6 x 6 row-major.  (nbody, 36)"""
    for i in range(model.body_parent.shape[0]):
        c, x, y, z = data.turn[i, 0], data.turn[i, 1], data.turn[i, 2], data.turn[i, 3]
        J = angular_momentum_jacobian(data.inertia_world, i, h, c, x, y, z)
        body_jacobian(model, data, h, i, data.pos3, J, out[i])


@kernel
def body_jacobian(model: Model, data: Data, h: float, i: int, pos: Matrix, J: Mat3, A: Vector) -> None:
    """A = the block of body i by its pose at configuration k, 1 or 3, whose positions are `pos`; J = dP/dphi:

    [ m/h I       -m/h [dk]         ]
    [ m/h [d2]    J - m/h [d2] [dk] ]     d2, dk: from O to the centre of mass at 2 and k
    """
    m = model.body_mass[i] / h
    o = data.origin
    x2, y2, z2 = data.pos2[i, 0] - o[0], data.pos2[i, 1] - o[1], data.pos2[i, 2] - o[2]
    x, y, z = pos[i, 0] - o[0], pos[i, 1] - o[1], pos[i, 2] - o[2]
    for k in range(3):
        for j in range(3):
            A[6 * k + j] = 0.0
        A[7 * k] = m
    A[3], A[4], A[5] = 0.0, m * z, -m * y
    A[9], A[10], A[11] = -m * z, 0.0, m * x
    A[15], A[16], A[17] = m * y, -m * x, 0.0
    A[18], A[19], A[20] = 0.0, -m * z2, m * y2
    A[24], A[25], A[26] = m * z2, 0.0, -m * x2
    A[30], A[31], A[32] = -m * y2, m * x2, 0.0
    # -[d2] [dk] = (d2.dk) I - dk d2^T
    s = x2 * x + y2 * y + z2 * z
    A[21], A[22], A[23] = J[0] + m * (s - x * x2), J[1] - m * x * y2, J[2] - m * x * z2
    A[27], A[28], A[29] = J[3] - m * y * x2, J[4] + m * (s - y * y2), J[5] - m * y * z2
    A[33], A[34], A[35] = J[6] - m * z * x2, J[7] - m * z * y2, J[8] + m * (s - z * z2)
