"""Energy and momentum at the nodes of a motion, by the discrete Legendre transform of the interval that led there.

    p2 = d L_d(1, 2) / d(configuration 2)

Momentum is then conserved exactly, and the energy v.M v/2 + V, M v = p, keeps an error of second order for all times.
Contacts and inputs act between nodes and are not part of it; half the impulse of a damper is (joints/damper.py).
"""

from __future__ import annotations

from math import nan
from typing import NamedTuple

from sim.dynamics.angular_momentum import angular_momentum
from sim.dynamics.coordinates import node_poses
from sim.dynamics.elimination import factor, project, solve, subtree_sums
from sim.dynamics.joints.ball_spring import relative_to_rest
from sim.dynamics.joints.damper import node_damping
from sim.dynamics.loops.loop_velocity import close_velocity
from sim.dynamics.momentum_balance import world_inertia
from sim.model.data import Data
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from solvers.compiler import Table, kernel
from solvers.rotation import Vec3, cross, quat_exp, quat_mul
from solvers.types import Matrix, Vector


class Arrival(NamedTuple):
    """The bodies at the end of an interval, and how they moved over it."""

    pos: Matrix  # (nbody, 3)
    move: Matrix  # (nbody, 3)
    turn: Matrix  # (nbody, 4)
    inertia: Matrix  # (nbody, 9) world axes


@kernel
def arriving_momentum(model: Model, h: float, end: Arrival, origin: Vec3, fall: float, out: Matrix) -> None:
    """out[i] = momentum of body i at the node where the interval ends, world axes, about `origin`:

        linear     p = m (x2 - x1)/h + fall m g
        angular    x2 x p + P-(1, 2)

    fall: h/2 at the node, 0 before the forces there act.   out: (nbody, 6).
    Springs and joints are omitted: between bodies they cancel.
    """
    for i in range(model.body_parent.shape[0]):
        P, t, m = out[i], end.turn[i], model.body_mass[i]
        for k in range(3):
            P[k] = m * (end.move[i, k] / h + fall * model.body_weight[i] * model.gravity[k])
        x, y, z = end.pos[i, 0] - origin[0], end.pos[i, 1] - origin[1], end.pos[i, 2] - origin[2]
        mx, my, mz = cross(x, y, z, P[0], P[1], P[2])
        a, b, c = angular_momentum(end.inertia, i, h, t[0], -t[1], -t[2], -t[3])
        P[3], P[4], P[5] = mx - a, my - b, mz - c


@kernel
def node_momentum(model: Model, data: Data, h: float, x: Vector, out: Matrix) -> None:
    """`arriving_momentum` of the state x, about the origin of the world.   Fills configurations 1 and 2."""
    node_poses(model, data, h, x)
    world_inertia(model, data.rot2, data.inertia_world)
    end = Arrival(data.pos2, data.move_in, data.turn_in, data.inertia_world)
    arriving_momentum(model, h, end, (0.0, 0.0, 0.0), 0.5 * h, out)


@kernel
def add_spring_momentum(model: Model, h: float, q: Vector, v: Vector, out: Vector) -> None:
    """out += d(L_d - T_d)(1, 2)/d(q2): the half of the spring impulse at the node, and rotors (accumulated).

        scalar        -h k/2 ((q1 + q2)/2 - rest)^2 + I (q2 - q1)^2/(2 h)    -h k/2 ((q1 + q2)/2 - rest) + I v
        quaternion    -h k/2 |s1 + s2|^2                                     -h k/2 (c2 I - [s2]) (s1 + s2)

    s: vector part of the rotation from rest.   out: (nv,).
    """
    for i in range(model.body_parent.shape[0]):
        end = model.body_vadr[i + 1]
        if model.joint_nrot[i] == 3:
            end -= 3
            k = model.dof_spring[end]
            if k > 0.0:
                w = v[end : end + 3]
                r2 = relative_to_rest(model, i, q)
                e = quat_exp(-h * w[0], -h * w[1], -h * w[2])
                r1 = quat_mul(r2[0], r2[1], r2[2], r2[3], e[0], e[1], e[2], e[3])
                s0, s1, s2 = r1[1] + r2[1], r1[2] + r2[2], r1[3] + r2[3]
                t = cross(r2[1], r2[2], r2[3], s0, s1, s2)
                out[end] -= 0.5 * h * k * (r2[0] * s0 - t[0])
                out[end + 1] -= 0.5 * h * k * (r2[0] * s1 - t[1])
                out[end + 2] -= 0.5 * h * k * (r2[0] * s2 - t[2])
        for d in range(model.body_vadr[i], end):
            middle = q[model.dof_qadr[d]] - 0.5 * h * v[d] - model.dof_rest[d]
            out[d] += model.dof_armature[d] * v[d] - 0.5 * h * model.dof_spring[d] * middle


@kernel
def spatial_inertia(model: Model, origin: Vector, pos: Matrix, inertia: Matrix, out: Matrix) -> None:
    """out[i] = inertia of body i about O, 6 x 6 row-major, at positions pos (nbody, 3); inertia: (nbody, 9) world axes:

    [ m I       -m [d]           ]
    [ m [d]     J - m [d] [d]    ]       d: from O to the centre of mass
    """
    for i in range(model.body_parent.shape[0]):
        m = model.body_mass[i]
        x, y, z = pos[i, 0] - origin[0], pos[i, 1] - origin[1], pos[i, 2] - origin[2]
        s = x * x + y * y + z * z
        J = inertia[i]
        A = out[i]
        for k in range(36):
            A[k] = 0.0
        for k in range(3):
            A[7 * k] = m
        A[4], A[5], A[9], A[11], A[15], A[16] = m * z, -m * y, -m * z, m * x, m * y, -m * x
        A[19], A[20], A[24], A[26], A[30], A[31] = -m * z, m * y, m * z, -m * x, -m * y, m * x
        A[21], A[22], A[23] = J[0] + m * (s - x * x), J[1] - m * x * y, J[2] - m * x * z
        A[27], A[28], A[29] = J[3] - m * y * x, J[4] + m * (s - y * y), J[5] - m * y * z
        A[33], A[34], A[35] = J[6] - m * z * x, J[7] - m * z * y, J[8] + m * (s - z * z)


@kernel
def armature_blocks(model: Model, sign: float, h: float, out: Matrix) -> None:
    """out[i] = sign diag(I + C), n x n row-major, I the armatures of joint i, C its dampers' for h; (nbody, 36)."""
    for i in range(model.body_parent.shape[0]):
        d = model.body_vadr[i]
        n = model.body_vadr[i + 1] - d
        for k in range(n * n):
            out[i, k] = 0.0
        for k in range(n):
            out[i, k * n + k] = sign * (model.dof_armature[d + k] + node_damping(model, h, d + k))


@kernel
def factor_mass_matrix(model: Model, data: Data, h: float) -> bool:
    """M + C, M = S2^T (inertia) S2 + armature at configuration 2 in `data`, factored for `solve`; False when singular.

    h: length of the interval before the node, 0 for M alone.
    """
    spatial_inertia(model, data.origin, data.pos2, data.inertia_world, data.A)
    for d in range(data.S2.shape[0]):
        for k in range(6):
            data.S3nu[d, k] = data.S2[d, k]
    armature_blocks(model, 1.0, h, data.joint_block)
    return factor(model, data) != 0


@kernel
def solve_mass_matrix(model: Model, data: Data, h: float, p: Vector, out: Vector) -> bool:
    """out = (M + C)^-1 p at configuration 2 in `data`.

    Leaves the twists of the bodies in data.twist; False when M is singular.   p, out: (nv,).
    """
    if not factor_mass_matrix(model, data, h):
        return False
    solve(model, data, p, out)
    return True


@kernel
def node_velocity(model: Model, data: Data, h: float, x: Vector) -> bool:
    """data.dnu = P (M + C)^-1 p, P: loops/loop_velocity.py; p = S2^T (momenta of bodies) + springs, in data.residual.

    NaN, and False, when M is singular.
    """
    node_momentum(model, data, h, x, data.wrench)
    subtree_sums(model, data.wrench, data.subtree)
    project(model, data.S2, data.subtree, data.residual)
    nq = data.theta1.shape[0]
    add_spring_momentum(model, h, x[:nq], x[nq:], data.residual)
    if not solve_mass_matrix(model, data, h, data.residual, data.dnu):
        for d in range(data.dnu.shape[0]):
            data.dnu[d] = nan
        return False
    close_velocity(model, data, h, x[:nq], x[nq:], data.dnu)
    return True


@kernel
def kinetic_energy(model: Model, data: Data, h: float, x: Vector) -> float:
    """v.M v/2 = (p - C v).v/2 at the node."""
    node_velocity(model, data, h, x)
    energy = 0.0
    for d in range(data.dnu.shape[0]):
        v = data.dnu[d]
        energy += 0.5 * (data.residual[d] - node_damping(model, h, d) * v) * v
    return energy


@kernel
def gravity_energy(model: Model, pos: Matrix) -> float:
    """Sum of -m g.x [J], with each share of g.   pos: (nbody, 3) positions of the bodies, or displacements."""
    energy = 0.0
    for i in range(pos.shape[0]):
        m = model.body_mass[i] * model.body_weight[i]
        for k in range(3):
            energy -= m * model.gravity[k] * pos[i, k]
    return energy


@kernel
def spring_energy(model: Model, q: Vector) -> float:
    """Sum of k/2 (q - rest)^2 of scalar springs, and of 2 k |s|^2 of those of quaternion joints [J]."""
    energy = 0.0
    for i in range(model.body_parent.shape[0]):
        end = model.body_vadr[i + 1]
        if model.joint_nrot[i] == 3:
            end -= 3
            if model.dof_spring[end] > 0.0:
                r = relative_to_rest(model, i, q)
                energy += 2.0 * model.dof_spring[end] * (r[1] * r[1] + r[2] * r[2] + r[3] * r[3])
        for d in range(model.body_vadr[i], end):
            stretch = q[model.dof_qadr[d]] - model.dof_rest[d]
            energy += 0.5 * model.dof_spring[d] * stretch * stretch
    return energy


@kernel
def momentum_velocity(model: Model, data: Data, h: float, move: Matrix, turn: Matrix, v: Vector) -> float:
    """p.v of an interval [J], twice its kinetic energy; rotations by their sines."""
    energy = 0.0
    for i in range(model.body_parent.shape[0]):
        J = data.inertia_world[i]
        for r in range(3):
            energy += model.body_mass[i] * move[i, r] * move[i, r] / (h * h)
            for k in range(3):
                energy += 4.0 * turn[i, 1 + r] * J[3 * r + k] * turn[i, 1 + k] / (h * h)
    for d in range(v.shape[0]):
        energy += model.dof_armature[d] * v[d] * v[d]
    return energy


@kernel
def twice_kinetic(model: Model, data: Data, h: float, v: Vector) -> float:
    """p.v of the intervals 1-2 and 2-3 together [J]."""
    before = momentum_velocity(model, data, h, data.move_in, data.turn_in, v)
    return before + momentum_velocity(model, data, h, data.move, data.turn, data.nu)


@kernel
def unjoined_energy(model: Model, data: Data, h: float, v: Vector) -> float:
    """Kinetic energy at configuration 3 of bodies and rotors that arrive there, without their joints [J]:

        (sum of m |x3 - x2|^2/h^2 + P.J^-1 P + I v^2)/2

    P: angular momentum of a body at the end of the interval, turned back to configuration 2, as J is. No joint and
    no damper lets as much energy arrive: M^-1 is largest, for given momenta, where all bodies are free.
    """
    energy = 0.0
    for i in range(model.body_parent.shape[0]):
        J, t, m = data.inertia_world[i], data.turn[i], model.body_mass[i]
        P = angular_momentum(data.inertia_world, i, h, t[0], -t[1], -t[2], -t[3])
        a, b, c = cross(J[3], J[4], J[5], J[6], J[7], J[8])
        determinant = J[0] * a + J[1] * b + J[2] * c
        q0, q1, q2 = cross(J[6], J[7], J[8], J[0], J[1], J[2])
        r0, r1, r2 = cross(J[0], J[1], J[2], J[3], J[4], J[5])
        spin = P[0] * (a * P[0] + b * P[1] + c * P[2]) + P[1] * (q0 * P[0] + q1 * P[1] + q2 * P[2])
        energy += 0.5 * (spin + P[2] * (r0 * P[0] + r1 * P[1] + r2 * P[2])) / determinant
        for k in range(3):
            energy += 0.5 * m * data.move[i, k] * data.move[i, k] / (h * h)
    for d in range(v.shape[0]):
        energy += 0.5 * model.dof_armature[d] * v[d] * v[d]
    return energy


@kernel
def energies(model_at: Table, data_at: Table, h: float, xs: Matrix, out: Matrix) -> None:
    """out[t] = (kinetic, potential) energy of state t [J].   xs: (n, nx); out: (n, 2)."""
    model = model_view(model_at)
    data = data_view(data_at)
    for t in range(xs.shape[0]):
        out[t, 0] = kinetic_energy(model, data, h, xs[t])
        out[t, 1] = gravity_energy(model, data.pos2) + spring_energy(model, xs[t])


@kernel
def momenta(model_at: Table, data_at: Table, h: float, xs: Matrix, out: Matrix) -> None:
    """out[t] = (linear, angular about the origin of the world) momentum of state t.   xs: (n, nx); out: (n, 6)."""
    model = model_view(model_at)
    data = data_view(data_at)
    for t in range(xs.shape[0]):
        node_momentum(model, data, h, xs[t], data.wrench)
        for k in range(6):
            out[t, k] = 0.0
            for i in range(model.body_parent.shape[0]):
                out[t, k] += data.wrench[i, k]
