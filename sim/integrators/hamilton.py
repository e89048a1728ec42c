"""Hamilton's equations of a tree without contacts, limits and loops: rates of coordinates and momenta.

With p_d = S_d . P the momentum of joint coordinate d, P the momentum on the subtree of its body, S_d its column,

    q' = v,  p = M(q) v,        p_d' = S_d' . P + S_d . F + joint force,        S_d' = W x S_d

for columns move with the bodies: W is the twist of the body for a rotation, of its parent for a translation; F is the
wrench of gravity and inputs on the subtree. No accelerations appear, and no derivatives of M. The momenta of a root
that floats freely are the whole momentum of its tree about O in world axes: its rate is the wrench from outside, and
where there is none the momentum does not change, whatever integrates it.

    momenta    (nv,) p_d [N s, N m s]; of a free root (linear, angular about O), world axes

O stays where it is while these momenta are in use. All wrenches and momenta of bodies are about O, in world axes.
"""

from __future__ import annotations

from sim.dynamics.elimination import dot_six, project
from sim.dynamics.energy import spring_energy
from sim.dynamics.external_forces import outer_wrenches
from sim.dynamics.joints.ball_spring import relative_to_rest
from sim.dynamics.joints.swing import swing_curvature
from sim.dynamics.kinematics import tree_poses
from sim.dynamics.mass_matrix import solve_mass
from sim.dynamics.momentum_balance import world_inertia
from sim.dynamics.velocity import joint_twists
from sim.model.data import Data
from sim.model.model import InputKind, Model
from solvers.compiler import kernel
from solvers.rotation import cross, inverse_right_jacobian
from solvers.types import Vector

_JOINT = int(InputKind.JOINT)


@kernel
def place(model: Model, data: Data) -> None:
    """Configuration 2 at the coordinates data.theta1."""
    q = data.theta1
    tree_poses(model, data, q)
    world_inertia(model, data.rot2, data.inertia_world)


@kernel
def subtree_momenta(model: Model, data: Data) -> None:
    """data.subtree[i] = momentum of the subtree of body i, of the twists in `data`: m (V + W x r), r x that + J W."""
    n = model.body_parent.shape[0]
    o = data.origin
    for i in range(n):
        V = data.twist[i]
        J = data.inertia_world[i]
        P = data.subtree[i]
        m = model.body_mass[i]
        x, y, z = data.pos2[i, 0] - o[0], data.pos2[i, 1] - o[1], data.pos2[i, 2] - o[2]
        a, b, c = cross(V[3], V[4], V[5], x, y, z)
        P[0], P[1], P[2] = m * (V[0] + a), m * (V[1] + b), m * (V[2] + c)
        a, b, c = cross(x, y, z, P[0], P[1], P[2])
        P[3] = a + J[0] * V[3] + J[1] * V[4] + J[2] * V[5]
        P[4] = b + J[3] * V[3] + J[4] * V[4] + J[5] * V[5]
        P[5] = c + J[6] * V[3] + J[7] * V[4] + J[8] * V[5]
    for i in range(n - 1, -1, -1):
        p = model.body_parent[i]
        if p >= 0:
            for k in range(6):
                data.subtree[p, k] += data.subtree[i, k]


@kernel
def momenta_of_velocity(model: Model, data: Data, v: Vector, out: Vector) -> None:
    """out = the momenta of joint velocities v at the configuration in `data`."""
    joint_twists(model, data, v)
    subtree_momenta(model, data)
    project(model, data.S2, data.subtree, out)
    for d in range(v.shape[0]):
        out[d] += model.dof_armature[d] * v[d]
    for i in range(model.root_free.shape[0]):
        if model.root_free[i] == 1:
            for k in range(6):
                out[model.body_vadr[i] + k] = data.subtree[i, k]


@kernel
def velocity_of_momenta(model: Model, data: Data, momenta: Vector) -> bool:
    """data.nu = M^-1 p at the configuration in `data`, with the twists and momenta of the bodies; False if singular."""
    p = data.rhs
    for d in range(momenta.shape[0]):
        p[d] = momenta[d]
    for i in range(model.root_free.shape[0]):
        if model.root_free[i] == 1:
            d = model.body_vadr[i]
            for k in range(d, d + 6):
                S = data.S2[k]
                p[k] = S[0] * momenta[d] + S[1] * momenta[d + 1] + S[2] * momenta[d + 2]
                p[k] += S[3] * momenta[d + 3] + S[4] * momenta[d + 4] + S[5] * momenta[d + 5]
    if not solve_mass(model, data, p, data.nu):
        return False
    subtree_momenta(model, data)
    return True


@kernel
def node_energy(model: Model, data: Data) -> tuple[float, float]:
    """Kinetic energy, and energy of the springs, at the evaluation that is in `data` [J]."""
    kinetic = 0.0
    for d in range(data.nu.shape[0]):
        p = dot_six(data.S2[d], data.subtree[model.dof_body[d]]) + model.dof_armature[d] * data.nu[d]
        kinetic += 0.5 * p * data.nu[d]
    return kinetic, spring_energy(model, data.theta1)


@kernel
def outer_power(model: Model, data: Data, u: Vector) -> float:
    """Power of gravity and inputs [W], with the wrenches on subtrees that `momentum_rates` leaves in data.balance."""
    power = 0.0
    for d in range(data.nu.shape[0]):
        power += dot_six(data.S2[d], data.balance[model.dof_body[d]]) * data.nu[d]
    for j in range(u.shape[0]):
        if model.input_kind[j] == _JOINT:
            power += model.input_wrench[j, 0] * u[j] * data.nu[model.input_index[j]]
    return power


@kernel
def column_rate(model: Model, data: Data, i: int, d: int) -> tuple[float, float, float, float, float, float]:
    """S_d' = W x S_d, d of joint i: W is the twist of body i for rotations, of its parent for translations."""
    S = data.S2[d]
    if d >= model.body_vadr[i] + model.joint_ntrans[i]:
        W = data.twist[i]
    elif model.body_parent[i] >= 0:
        W = data.twist[model.body_parent[i]]
    else:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    a, b, c = cross(W[3], W[4], W[5], S[0], S[1], S[2])
    x, y, z = cross(W[0], W[1], W[2], S[3], S[4], S[5])
    r = cross(W[3], W[4], W[5], S[3], S[4], S[5])
    return a + x, b + y, c + z, r[0], r[1], r[2]


@kernel
def joint_forces(model: Model, q: Vector, v: Vector, u: Vector, out: Vector) -> None:
    """out = -k (q - rest) - d v + g u of every joint coordinate; of quaternions -2 k c s, (c, s) the turn from rest."""
    for i in range(model.body_parent.shape[0]):
        stop = model.body_vadr[i + 1]
        if model.joint_nrot[i] == 3:
            stop -= 3
            r = relative_to_rest(model, i, q)
            k = 2.0 * model.dof_spring[stop] * r[0]
            for j in range(3):
                out[stop + j] = -k * r[1 + j]
        for d in range(model.body_vadr[i], stop):
            out[d] = -model.dof_spring[d] * (q[model.dof_qadr[d]] - model.dof_rest[d])
    for d in range(v.shape[0]):
        out[d] -= model.dof_damper[d] * v[d]
    for j in range(u.shape[0]):
        if model.input_kind[j] == _JOINT:
            out[model.input_index[j]] += model.input_wrench[j, 0] * u[j]


@kernel
def momentum_rates(model: Model, data: Data, u: Vector, out: Vector) -> None:
    """out = p' with the velocity and the momenta of the bodies in `data`."""
    F = data.balance
    outer_wrenches(model, data, u, F)
    joint_forces(model, data.theta1, data.nu, u, out)
    for i in range(model.root_free.shape[0]):
        P, f = data.subtree[i], F[i]
        if model.root_free[i] == 1:
            for k in range(6):
                out[model.body_vadr[i] + k] = f[k]
            continue
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            r, S = column_rate(model, data, i, d), data.S2[d]
            out[d] += r[0] * P[0] + r[1] * P[1] + r[2] * P[2] + r[3] * P[3] + r[4] * P[4] + r[5] * P[5]
            out[d] += S[0] * f[0] + S[1] * f[1] + S[2] * f[2] + S[3] * f[3] + S[4] * f[4] + S[5] * f[5]
        if model.joint_nrot[i] == 2:
            _add_swing(model, data, i, out)


@kernel
def _add_swing(model: Model, data: Data, i: int, out: Vector) -> None:
    """out[d] += P . sum_k v_k d(S_d)/d(q_k), beyond turning, of the two rotations of a swing (joints/swing.py)."""
    d, a = model.body_vadr[i + 1] - 2, model.body_qadr[i + 1] - 2
    R, v = data.dR_dq, data.nu
    for k in range(2):
        R[d + k, d] = R[d + k, d + 1] = 0.0
    swing_curvature(model, data, i, data.theta1[a], data.theta1[a + 1])
    for k in range(2):
        out[d + k] += R[d + k, d] * v[d] + R[d + k, d + 1] * v[d + 1]


@kernel
def coordinate_rates(model: Model, shift: Vector, v: Vector, out: Vector) -> None:
    """out = rate of the shift r of the coordinates q (+) r: v for scalars, J^-1(r) w for quaternions q exp(r)."""
    for d in range(v.shape[0]):
        out[d] = v[d]
    for i in range(model.body_parent.shape[0]):
        if model.joint_nrot[i] == 3:
            d = model.body_vadr[i + 1] - 3
            J = inverse_right_jacobian(shift[d], shift[d + 1], shift[d + 2])
            for k in range(3):
                out[d + k] = J[3 * k] * v[d] + J[3 * k + 1] * v[d + 1] + J[3 * k + 2] * v[d + 2]
