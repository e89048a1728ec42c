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

from sim.dynamics import world_inertia
from sim.elimination import dot_six, project
from sim.energy import spring_energy
from sim.joints.ball_spring import relative_to_rest
from sim.kinematics import tree_poses
from sim.late import swing_curvature
from sim.mass import solve_mass
from sim.model import InputKind, Integers, Model, Vector
from sim.outer import outer_wrenches
from sim.rotation import cross, inverse_right_jacobian
from sim.velocity import joint_twists
from sim.work import Work
from solvers.compiler import kernel

_JOINT = int(InputKind.JOINT)


@kernel
def place(model: Model, work: Work) -> None:
    """Configuration 2 at the coordinates work.theta1."""
    q = work.theta1
    tree_poses(model, work, q)
    world_inertia(model, work.rot2, work.inertia_world)


@kernel
def subtree_momenta(model: Model, work: Work) -> None:
    """work.subtree[i] = momentum of the subtree of body i, of the twists in `work`: m (V + W x r), r x that + J W."""
    n = model.body_parent.shape[0]
    o = work.origin
    for i in range(n):
        V = work.twist[i]
        J = work.inertia_world[i]
        P = work.subtree[i]
        m = model.body_mass[i]
        x, y, z = work.pos2[i, 0] - o[0], work.pos2[i, 1] - o[1], work.pos2[i, 2] - o[2]
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
                work.subtree[p, k] += work.subtree[i, k]


@kernel
def momenta_of_velocity(model: Model, work: Work, free: Integers, v: Vector, out: Vector) -> None:
    """out = the momenta of joint velocities v at the configuration in `work`."""
    joint_twists(model, work, v)
    subtree_momenta(model, work)
    project(model, work.S2, work.subtree, out)
    for d in range(v.shape[0]):
        out[d] += model.dof_armature[d] * v[d]
    for i in range(free.shape[0]):
        if free[i] == 1:
            for k in range(6):
                out[model.body_vadr[i] + k] = work.subtree[i, k]


@kernel
def velocity_of_momenta(model: Model, work: Work, free: Integers, momenta: Vector) -> bool:
    """work.nu = M^-1 p at the configuration in `work`, with the twists and momenta of the bodies; False if singular."""
    p = work.rhs
    for d in range(momenta.shape[0]):
        p[d] = momenta[d]
    for i in range(free.shape[0]):
        if free[i] == 1:
            d = model.body_vadr[i]
            for k in range(d, d + 6):
                S = work.S2[k]
                p[k] = S[0] * momenta[d] + S[1] * momenta[d + 1] + S[2] * momenta[d + 2]
                p[k] += S[3] * momenta[d + 3] + S[4] * momenta[d + 4] + S[5] * momenta[d + 5]
    if not solve_mass(model, work, p, work.nu):
        return False
    subtree_momenta(model, work)
    return True


@kernel
def node_energy(model: Model, work: Work) -> tuple[float, float]:
    """Kinetic energy, and energy of the springs, at the evaluation that is in `work` [J]."""
    kinetic = 0.0
    for d in range(work.nu.shape[0]):
        p = dot_six(work.S2[d], work.subtree[model.dof_body[d]]) + model.dof_armature[d] * work.nu[d]
        kinetic += 0.5 * p * work.nu[d]
    return kinetic, spring_energy(model, work.theta1)


@kernel
def outer_power(model: Model, work: Work, u: Vector) -> float:
    """Power of gravity and inputs [W], with the wrenches on subtrees that `momentum_rates` leaves in work.balance."""
    power = 0.0
    for d in range(work.nu.shape[0]):
        power += dot_six(work.S2[d], work.balance[model.dof_body[d]]) * work.nu[d]
    for j in range(u.shape[0]):
        if model.input_kind[j] == _JOINT:
            power += u[j] * work.nu[model.input_index[j]]
    return power


@kernel
def column_rate(model: Model, work: Work, i: int, d: int) -> tuple[float, float, float, float, float, float]:
    """S_d' = W x S_d, d of joint i: W is the twist of body i for rotations, of its parent for translations."""
    S = work.S2[d]
    if d >= model.body_vadr[i] + model.joint_ntrans[i]:
        W = work.twist[i]
    elif model.body_parent[i] >= 0:
        W = work.twist[model.body_parent[i]]
    else:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    a, b, c = cross(W[3], W[4], W[5], S[0], S[1], S[2])
    x, y, z = cross(W[0], W[1], W[2], S[3], S[4], S[5])
    r = cross(W[3], W[4], W[5], S[3], S[4], S[5])
    return a + x, b + y, c + z, r[0], r[1], r[2]


@kernel
def joint_forces(model: Model, q: Vector, v: Vector, u: Vector, out: Vector) -> None:
    """out = -k (q - rest) - d v + u of every joint coordinate; of quaternions -2 k c s, (c, s) the turn from rest."""
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
            out[model.input_index[j]] += u[j]


@kernel
def momentum_rates(model: Model, work: Work, free: Integers, u: Vector, out: Vector) -> None:
    """out = p' with the velocity and the momenta of the bodies in `work`."""
    F = work.balance
    outer_wrenches(model, work, u, F)
    joint_forces(model, work.theta1, work.nu, u, out)
    for i in range(free.shape[0]):
        P, f = work.subtree[i], F[i]
        if free[i] == 1:
            for k in range(6):
                out[model.body_vadr[i] + k] = f[k]
            continue
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            r, S = column_rate(model, work, i, d), work.S2[d]
            out[d] += r[0] * P[0] + r[1] * P[1] + r[2] * P[2] + r[3] * P[3] + r[4] * P[4] + r[5] * P[5]
            out[d] += S[0] * f[0] + S[1] * f[1] + S[2] * f[2] + S[3] * f[3] + S[4] * f[4] + S[5] * f[5]
        if model.joint_nrot[i] == 2:
            _add_swing(model, work, i, out)


@kernel
def _add_swing(model: Model, work: Work, i: int, out: Vector) -> None:
    """out[d] += P . sum_k v_k d(S_d)/d(q_k), beyond turning, of the two rotations of a swing (joints/swing.py)."""
    d, a = model.body_vadr[i + 1] - 2, model.body_qadr[i + 1] - 2
    R, v = work.dR_dq, work.nu
    for k in range(2):
        R[d + k, d] = R[d + k, d + 1] = 0.0
    swing_curvature(model, work, i, work.theta1[a], work.theta1[a + 1])
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
