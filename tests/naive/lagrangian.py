"""The discrete Lagrangian of one interval, in maximal coordinates, and its derivatives at the nodes.

    L_d(z1, z2) = sum_b [ m/(2h) |x2 - x1|^2 + T_d(q1, q2) + h/2 m g.(x1 + x2) ] - sum_joints V_d(z1, z2)
    T_d = (2/h) s.Js psi(c),   (c, s) = q1^* q2, c > 0,   psi = 2/3 + 1/(3 c^2)
    V_d = h/2 k ((theta1 + theta2)/2 - rest)^2        for a scalar coordinate
    V_d = 2 h k |(s1 + s2)/2|^2,  s_i = vec(exp(rest)^* qrel_i)      for a quaternion

The momentum at node 2 of the interval that ends there is dL_d/dz2. Variations of a body are (dx, dphi), world axes.
"""

from __future__ import annotations

import numpy as np

from naive import rotation as rot
from naive.rotation import Array
from naive.scene import UNIT, ZERO, PlainJoint, PlainScene, advance, poses, split

Poses = tuple[Array, Array]  # positions (..., nbody, 3), quaternions (..., nbody, 4)
TINY = 1e-30  # complex step


def psi(c: Array) -> tuple[Array, Array]:
    """Blend of the rotational energy and its derivative."""
    return 2.0 / 3.0 + 1.0 / (3.0 * c * c), -2.0 / (3.0 * c**3)


def turn(q1: Array, q2: Array) -> tuple[Array, Array]:
    """(c, s) = q1^* q2 with c > 0."""
    q = rot.mul(rot.conj(q1), q2)
    q = np.where(np.real(q[..., :1]) < 0.0, -q, q)
    return q[..., :1], q[..., 1:]


def rotational_energy(inertia: Array, q1: Array, q2: Array, h: float) -> Array:
    """T_d of one body over one interval [J s]."""
    c, s = turn(q1, q2)
    return 2.0 / h * (rot.dot(s, s @ inertia.T) * psi(c)[0])[..., 0]


def leaving_momentum(inertia: Array, q2: Array, q3: Array, h: float) -> Array:
    """P+ = -dT_d(q2, q3)/dphi2: q2 -> exp(dphi) q2 gives dc = s.b/2, ds = -(c b + b x s)/2 with b = R2^T dphi."""
    c, s = turn(q2, q3)
    Js = np.einsum("...ij,...j->...i", inertia, s)
    value, slope = psi(c)
    body = 2.0 / h * (value * (c * Js + rot.cross(s, Js)) - 0.5 * rot.dot(s, Js) * slope * s)
    return rot.rotate(q2, body)


def arriving_momentum(inertia: Array, q1: Array, q2: Array, h: float) -> Array:
    """P- = dT_d(q1, q2)/dphi2: q2 -> q2 exp(b) gives dc = -s.b/2, ds = (c b + s x b)/2 with b = R2^T dphi."""
    c, s = turn(q1, q2)
    Js = np.einsum("...ij,...j->...i", inertia, s)
    value, slope = psi(c)
    body = 2.0 / h * (value * (c * Js - rot.cross(s, Js)) - 0.5 * rot.dot(s, Js) * slope * s)
    return rot.rotate(q2, body)


# -- joints ------------------------------------------------------------------------------------------------------------


def pair(joint: PlainJoint, child: int, z: Poses) -> tuple[Array, Array, Array, Array]:
    """Poses of the parent (the world for -1) and the child."""
    pos, quat = z
    if joint.parent < 0:
        return ZERO, UNIT, pos[..., child, :], quat[..., child, :]
    return pos[..., joint.parent, :], quat[..., joint.parent, :], pos[..., child, :], quat[..., child, :]


def separation(joint: PlainJoint, child: int, z: Poses) -> tuple[Array, Array]:
    """Translation and rotation of the child in the joint frame, (..., 3) and (..., 4)."""
    xa, qa, xb, qb = pair(joint, child, z)
    frame = rot.mul(qa, joint.offset)
    d = xb + rot.rotate(qb, joint.child_point) - xa - rot.rotate(qa, joint.parent_point)
    return rot.rotate(rot.conj(frame), d), rot.mul(rot.conj(frame), qb)


def complement(rows: Array) -> Array:
    """Orthonormal rows that complete the given orthonormal rows to a basis of space."""
    return np.linalg.svd(rows)[2][len(rows) :] if len(rows) else np.eye(3)


def constraint(joint: PlainJoint, child: int, z: Poses) -> Array:
    """Constraints of a joint: 3 - ntrans translations and 3 - nrot components of the relative rotation."""
    d, q = separation(joint, child, z)
    rows = [d @ complement(joint.trans_axes).T]
    if joint.lead:  # the two translations across the axis, and the one along it for every radian about it
        ahead = d @ joint.axis[:, None] / joint.lead - rot.log(q) @ joint.axis[:, None]
        ahead = ahead - 2.0 * np.pi * np.round(np.real(ahead) / (2.0 * np.pi))
        rows = [d @ complement(joint.axis[None]).T, joint.lead * ahead]
    if joint.nrot == 1:
        rows.append(q[..., 1:] @ complement(joint.axis[None]).T)
    elif joint.nrot == 2:
        rows.append(q[..., 1:] @ joint.axis[:, None])
    elif joint.nrot == 0:
        rows.append(q[..., 1:])
    return np.concatenate(rows, axis=-1)


def displacement(joint: PlainJoint, child: int, z: Poses, reference: Poses) -> Array:
    """Free motion of a joint from the reference poses: translations, then the rotation vector in the child's axes.

    Of a swing, the difference of the rotation vectors from the joint frame.
    """
    d, q = separation(joint, child, z)
    d0, q0 = separation(joint, child, reference)
    rows = [(d - d0) @ joint.trans_axes.T]
    if joint.nrot == 2:
        rows.append((rot.log(q) - rot.log(q0)) @ joint.swing_axes.T)
    elif joint.nrot:
        phi = rot.log(rot.mul(rot.conj(q0), q))
        rows.append(phi if joint.nrot == 3 else phi @ joint.axis[:, None])
    return np.concatenate(rows, axis=-1)


def displacements(scene: PlainScene, z: Poses, reference: Poses) -> Array:
    """All joints, (..., nv)."""
    rows = [displacement(joint, i, z, reference) for i, joint in enumerate(scene.joints)]
    return np.concatenate(rows, axis=-1)


def constraints(scene: PlainScene, z: Poses) -> Array:
    """All joints, (..., 6 nbody - nv)."""
    return np.concatenate([constraint(joint, i, z) for i, joint in enumerate(scene.joints)], axis=-1)


def varied(z: Poses) -> Poses:
    """The poses after a complex step along each of the 6 nbody variations: leading axis 6 nbody."""
    pos, quat = z
    n = len(pos)
    step = 1j * TINY * np.eye(6 * n).reshape(6 * n, n, 6)
    return pos + step[..., :3], rot.mul(rot.exp(step[..., 3:]), quat[None])


def spring_impulse(scene: PlainScene, q1: Array, q2: Array, moved: Array | None, h: float) -> Array:
    """-d(V_d(1,2) + V_d(2,3))/d(joint displacement at 2), (..., nv), [N s, N m s].

    moved: the displacements from 2 to 3, (..., nv); None leaves V_d(2,3) out.
    Quaternions: -h k/2 (c2 x + x cross s2) with x = s1 + s2, plus s2 + s3.
    """
    lead = () if moved is None else moved.shape[:-1]
    out, start = [], 0
    for joint, a, b in zip(scene.joints, split(scene, q1), split(scene, q2), strict=True):
        k, r = (np.broadcast_to(value, joint.nv) for value in (joint.spring, joint.rest))
        n = joint.nv - (3 if joint.nrot == 3 else 0)
        ends = np.array(a[:n] + b[:n]) / 2.0 - r[:n]
        total = ends if moved is None else ends + b[:n] + moved[..., start : start + n] / 2.0 - r[:n]
        out.append(-h * k[:n] / 2.0 * total)
        if joint.nrot == 3:
            back = rot.conj(rot.exp(r[n:]))
            s1, s2 = rot.mul(back, a[n:]), rot.mul(back, b[n:])
            x = s1[1:] + s2[1:]
            if moved is not None:
                s3 = rot.mul(s2, rot.exp(moved[..., start + n : start + n + 3]))
                x = x + s2[1:] + s3[..., 1:]
            out.append(-h * k[n] / 2.0 * (s2[0] * x + rot.cross(x, s2[1:])))
        start += joint.nv
    return np.concatenate([np.broadcast_to(part, lead + part.shape[-1:]) for part in out], axis=-1)


# -- nodes -------------------------------------------------------------------------------------------------------------


def node_momentum(scene: PlainScene, q: Array, v: Array, h: float) -> Array:
    """dL_d(1, 2)/dz2 of every body, (nbody, 6): force about and moment about its centre of mass, world axes."""
    q1 = advance(scene, q, -v, h)
    z1, z2 = poses(scene, q1), poses(scene, q)
    p = np.zeros((len(scene.bodies), 6))
    for b, body in enumerate(scene.bodies):
        p[b, :3] = body.mass * ((z2[0][b] - z1[0][b]) / h + 0.5 * h * scene.gravity)
        p[b, 3:] = arriving_momentum(body.inertia, z1[1][b], z2[1][b], h)
    free = np.imag(displacements(scene, varied(z2), z2)) / TINY  # (6 nbody, nv)
    pull = spring_impulse(scene, q1, q, None, h) + armatures(scene) * v
    return p + (free @ pull).reshape(-1, 6)


def armatures(scene: PlainScene) -> Array:
    """Inertia of every coordinate alone, (nv,)."""
    return np.concatenate([np.broadcast_to(joint.armature, joint.nv) for joint in scene.joints])


def dampers(scene: PlainScene) -> Array:
    """Damper of every coordinate, (nv,)."""
    return np.concatenate([np.broadcast_to(joint.damper, joint.nv) for joint in scene.joints])


def stiffness(scene: PlainScene, h: float) -> Array:
    """z = h d (M^-1)_dd with all hinges at half a radian and all other coordinates at zero, (nv,)."""
    turned = {0: (), 1: (0.5,), 2: (0.0, 0.0), 3: (1.0, 0.0, 0.0, 0.0)}
    q = np.concatenate([np.r_[np.zeros(len(j.trans_axes)), turned[j.nrot]] for j in scene.joints])
    d = dampers(scene)
    return h * d * np.diag(np.linalg.inv(mass_matrix(scene, q))) if d.any() else d


def lag(scene: PlainScene, h: float) -> Array:
    """Weight of the velocity before the node in the impulse of a damper, (nv,)."""
    z = stiffness(scene, h)
    return 3.0 * h * dampers(scene) / (6.0 + z + z * z)


def damped_mass(scene: PlainScene, q: Array, h: float) -> Array:
    """M + C: maps the velocity of the node to the momentum that arrives there."""
    z = stiffness(scene, h)
    share = 3.0 * z / (6.0 + z + z * z)  # lag/I; a body with nothing but the damper has I v2 = (I - lag) v
    return mass_matrix(scene, q) + np.diag(lag(scene, h) / (1.0 - share))


def motion_subspace(scene: PlainScene, q: Array) -> Array:
    """Variations of the bodies per unit of joint displacement, (6 nbody, nv): inverse of the maps by least squares."""
    z = poses(scene, q)
    G = np.imag(constraints(scene, varied(z))).T / TINY
    B = np.imag(displacements(scene, varied(z), z)).T / TINY
    return np.linalg.solve(np.vstack((G, B)), np.vstack((np.zeros((len(G), len(B))), np.eye(len(B)))))


def mass_matrix(scene: PlainScene, q: Array) -> Array:
    """Joint-space inertia, (nv, nv)."""
    S = motion_subspace(scene, q)
    M = np.zeros((6 * len(scene.bodies),) * 2)
    for b, (body, R) in enumerate(zip(scene.bodies, rot.matrix(poses(scene, q)[1]), strict=True)):
        M[6 * b : 6 * b + 3, 6 * b : 6 * b + 3] = body.mass * np.eye(3)
        M[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6] = R @ body.inertia @ R.T
    return S.T @ M @ S + np.diag(armatures(scene))


def potential(scene: PlainScene, q: Array) -> float:
    """Gravity and springs at a configuration [J]."""
    total = -sum(b.mass * scene.gravity @ x for b, x in zip(scene.bodies, poses(scene, q)[0], strict=True))
    for joint, a in zip(scene.joints, split(scene, q), strict=True):
        k, r = (np.broadcast_to(value, joint.nv) for value in (joint.spring, joint.rest))
        n = joint.nv - (3 if joint.nrot == 3 else 0)
        total += 0.5 * np.sum(k[:n] * (a[:n] - r[:n]) ** 2)
        if joint.nrot == 3:
            s = rot.mul(rot.conj(rot.exp(r[n:])), a[n:])[1:]
            total += 2.0 * k[n] * (s @ s)
    return float(total)


def energy(scene: PlainScene, q: Array, v: Array, h: float) -> float:
    """v.M v / 2 + V with the velocity v of the node [J]."""
    p = motion_subspace(scene, q).T @ node_momentum(scene, q, v, h).ravel()
    node = np.linalg.solve(damped_mass(scene, q, h), p)
    return float(0.5 * node @ mass_matrix(scene, q) @ node) + potential(scene, q)


def momentum(scene: PlainScene, q: Array, v: Array, h: float) -> Array:
    """Linear and angular momentum about the origin, (6,)."""
    p = node_momentum(scene, q, v, h)
    x = poses(scene, q)[0]
    return np.concatenate((p[:, :3].sum(0), (p[:, 3:] + rot.cross(x, p[:, :3])).sum(0)))


def start(scene: PlainScene, q: Array, v: Array, h: float) -> Array:
    """Joint velocities of the interval that ends at q with the velocity v of the node."""
    S, target = motion_subspace(scene, q), damped_mass(scene, q, h) @ v
    nu = np.array(v, dtype=float)
    for _ in range(30):
        error = S.T @ node_momentum(scene, q, nu, h).ravel() - target
        if np.abs(error).max() < 1e-13 * max(1.0, np.abs(target).max()):
            break
        step = 1e-6
        columns = [
            S.T @ (node_momentum(scene, q, nu + step * e, h) - node_momentum(scene, q, nu - step * e, h)).ravel()
            for e in np.eye(scene.nv)
        ]
        nu = nu - np.linalg.solve(np.array(columns).T / (2.0 * step), error)
    return nu
