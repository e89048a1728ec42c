"""The equations of one time step in maximal coordinates: slow and plain, nothing eliminated.

Unknowns: v25, w25 of every body (x3 = x2 + h v25, q3 = q2 exp(h w25)), joint multipliers, cone variables.
Equations: momentum balance of every body at configuration 2, joint constraints at configuration 3, contact laws and
limits on the central path. Joint impulses act through the transpose of the constraint Jacobian at configuration 2.
"""

from __future__ import annotations

import numpy as np

from naive import rotation as rot
from naive.lagrangian import (
    TINY,
    Poses,
    armatures,
    arriving_momentum,
    constraints,
    dampers,
    displacements,
    lag,
    leaving_momentum,
    separation,
    spring_impulse,
    varied,
)
from naive.rotation import Array
from naive.scene import BODY, IMPACT, JOINT, LINEAR, Limit, PlainContact, PlainScene, advance, poses


def bilinear(x: Array, y: Array, kappa: float) -> Array:
    """x y - kappa."""
    return x * y - kappa


def smoothed(x: Array, y: Array, kappa: float) -> Array:
    """x + y - sqrt((x - y)^2 + 4 kappa): zero exactly where x y = kappa, x > 0, y > 0."""
    return x + y - np.sqrt((x - y) ** 2 + 4.0 * kappa)


def bilinear_cone(x: Array, y: Array, kappa: float) -> Array:
    """Jordan product of the second-order cone, minus kappa e."""
    return np.concatenate((rot.dot(x, y) - kappa, x[..., :1] * y[..., 1:] + y[..., :1] * x[..., 1:]), axis=-1)


def smoothed_cone(x: Array, y: Array, kappa: float) -> Array:
    """x + y - ((x - y)^2 + 4 kappa e)^(1/2) in the Jordan algebra (Fukushima, Luo, Tseng 2002).

    The root of w = (w0, w1) is (a, w1/(2a)) with a^2 = (w0 + sqrt(det w))/2.
    """
    d = x - y
    d0, d1 = d[..., :1], d[..., 1:]
    n1 = rot.dot(d1, d1)
    w0, w1 = d0 * d0 + n1 + 4.0 * kappa, 2.0 * d0 * d1
    det = (d0 * d0 - n1) ** 2 + 8.0 * kappa * (d0 * d0 + n1) + 16.0 * kappa**2
    a = np.sqrt((w0 + np.sqrt(det)) / 2.0)
    return x + y - np.concatenate((a, w1 / (2.0 * a)), axis=-1)


class Step:
    """The equations of one step from (q, v) under the input u."""

    def __init__(self, scene: PlainScene, q: Array, v: Array, u: Array, h: float) -> None:
        self.scene, self.h, self.q2, self.u = scene, h, q, u
        self.q1 = advance(scene, q, -v, h)
        self.z1, self.z2 = poses(scene, self.q1), poses(scene, q)
        self.nbody = len(scene.bodies)
        self.G = np.imag(constraints(scene, varied(self.z2))).T / TINY  # (nlambda, 6 nbody)
        self.B = np.imag(displacements(scene, varied(self.z2), self.z2)).T / TINY  # (nv, 6 nbody)
        self.armature, self.v1 = armatures(scene), v
        self.damper, self.lag = dampers(scene), lag(scene, h)
        self.inertia = np.array([body.inertia for body in scene.bodies])
        self.mass = np.array([body.mass for body in scene.bodies])
        self.incoming = np.concatenate(
            (
                self.mass[:, None] * (self.z2[0] - self.z1[0]) / h,
                arriving_momentum(self.inertia, self.z1[1], self.z2[1], h),
            ),
            axis=-1,
        )
        self.applied = h * self.input_wrench()
        self.applied[:, :3] += h * self.mass[:, None] * scene.gravity
        self.sizes = [6 * self.nbody, len(self.G), *map(contact_size, scene.contacts), *[2] * len(scene.limits)]

    def input_wrench(self) -> Array:
        """Force and torque of the inputs on every body, (nbody, 6)."""
        out = np.zeros((self.nbody, 6))
        for unit, amount in zip(self.scene.inputs, self.u, strict=True):
            if unit.kind == JOINT:
                out += amount * self.B[unit.index].reshape(-1, 6)
                continue
            force, torque = amount * unit.wrench[:3], amount * unit.wrench[3:]
            if unit.kind == BODY:
                force, torque = (rot.rotate(self.z2[1][unit.index], part) for part in (force, torque))
            out[unit.index] += np.concatenate((force, torque))
        return out

    def next_poses(self, twist: Array) -> Poses:
        """Configuration 3 from (v25, w25), twist (..., nbody, 6)."""
        return self.z2[0] + self.h * twist[..., :3], rot.mul(self.z2[1], rot.exp(self.h * twist[..., 3:]))

    def residual(self, y: Array, kappa: float, exact: bool) -> Array:
        """All equations, (..., n)."""
        scene, h = self.scene, self.h
        parts = np.split(y, np.cumsum(self.sizes)[:-1], axis=-1)
        twist = parts[0].reshape(*y.shape[:-1], self.nbody, 6)
        z3 = self.next_poses(twist)
        balance = np.concatenate(
            (
                self.mass[:, None] * (z3[0] - self.z2[0]) / h,
                leaving_momentum(self.inertia, self.z2[1], z3[1], h),
            ),
            axis=-1,
        )
        balance = balance - self.incoming - self.applied
        moved = displacements(scene, z3, self.z2)
        joint = spring_impulse(scene, self.q1, self.q2, moved, h)
        joint = joint - self.damper * moved + self.lag * (moved / h - self.v1)
        joint = joint - self.armature * (moved / h - self.v1)
        rows = []
        for contact, unknown in zip(scene.contacts, parts[2:], strict=False):
            law, wrench = self.contact(contact, unknown, z3, kappa, exact)
            rows.append(law)
            balance[..., contact.body, :] -= wrench
        for limit, unknown in zip(scene.limits, parts[2 + len(scene.contacts) :], strict=True):
            law, direction = (
                self.cone(limit, unknown, z3, kappa, exact)
                if limit.sign == 0.0
                else (self.limit(limit, unknown, moved, kappa, exact), limit.sign)
            )
            rows.append(law)
            if limit.sign == 0.0:
                joint[..., limit.dof : limit.dof + 3] += unknown[..., 1:] * direction
            else:
                joint[..., limit.dof] += direction * unknown[..., 1]
        flat = balance.reshape(*y.shape[:-1], -1) - parts[1] @ self.G - joint @ self.B
        return np.concatenate((flat, constraints(scene, z3), *rows), axis=-1)

    def limit(self, limit: Limit, unknown: Array, moved: Array, kappa: float, exact: bool) -> Array:
        """slack = sign (theta3 - bound), slack gamma = kappa; unknown = (slack, gamma)."""
        theta = self.q2[self.coordinate(limit.dof)] + moved[..., limit.dof]
        slack, gamma = unknown[..., 0], unknown[..., 1]
        law = bilinear(slack, gamma, kappa) if exact else smoothed(slack, gamma, kappa)
        return np.stack((limit.sign * (theta - limit.bound) - slack, law), axis=-1)

    def cone(self, limit: Limit, unknown: Array, z3: Poses, kappa: float, exact: bool) -> tuple[Array, Array]:
        """slack = (a.c - cos angle)/sin angle, a and c the axes of parent and child; torque c x a/sin per impulse.

        The torque acts in the child's axes at configuration 2, like the rotation vector of `displacement`.
        """
        i = self.carrier(limit.dof)
        axis, sine = self.scene.joints[i].axis, np.sin(limit.bound)
        q2, q3 = (separation(self.scene.joints[i], i, z)[1] for z in (self.z2, z3))
        child = rot.rotate(q3, axis)
        gap = (child @ axis - np.cos(limit.bound)) / sine
        torque = rot.rotate(rot.conj(q2), rot.cross(child, np.broadcast_to(axis, child.shape)) / sine)
        slack, gamma = unknown[..., 0], unknown[..., 1]
        law = bilinear(slack, gamma, kappa) if exact else smoothed(slack, gamma, kappa)
        return np.stack((gap - slack, law), axis=-1), torque

    def carrier(self, dof: int) -> int:
        """Index of the joint of a degree of freedom."""
        return int(np.searchsorted(np.cumsum([joint.nv for joint in self.scene.joints]), dof, side="right"))

    def coordinate(self, dof: int) -> int:
        """Index in q of a scalar degree of freedom."""
        q = v = 0
        for joint in self.scene.joints:
            if dof < v + joint.nv:
                return q + dof - v
            q, v = q + joint.nq, v + joint.nv
        raise IndexError(dof)

    def gap_and_slip(self, contact: PlainContact, z3: Poses) -> tuple[Array, Array, Array]:
        """phi = n.(x3 + R3 p) - rho - height, v_t = T ((x3 - x2)/h + (2/h) s_w x r), r = R3 p - rho n."""
        b, n, tangents = contact.body, contact.frame[0], contact.frame[1:]
        x3, q3 = z3[0][..., b, :], z3[1][..., b, :]
        center = rot.rotate(q3, contact.point)
        arm = center - contact.radius * n
        sine = rot.rotate(self.z2[1][b], rot.mul(rot.conj(self.z2[1][b]), q3)[..., 1:])
        slip = ((x3 - self.z2[0][b]) / self.h + rot.cross(2.0 / self.h * sine, arm)) @ tangents.T
        return (x3 + center) @ n - contact.radius - contact.height, slip, arm

    def contact(self, contact: PlainContact, y: Array, z3: Poses, kappa: float, exact: bool) -> tuple[Array, Array]:
        """Law of one contact and its wrench on the body about the centre of mass; y as in `contact_size`."""
        gap, slip, arm = self.gap_and_slip(contact, z3)
        product = bilinear if exact else smoothed
        s, gamma, mu = y[..., 0], y[..., 1], contact.friction
        force = gamma[..., None] * contact.frame[0]
        rows = [(gap - s)[..., None], product(s, gamma, kappa)[..., None]]
        if frictional(contact) and contact.law == LINEAR:
            slack, psi, s_beta, beta = y[..., 2:3], y[..., 3:4], y[..., 4:8], y[..., 8:12]
            along = np.concatenate((slip, -slip), axis=-1)  # +t1, +t2, -t1, -t2
            rows += [mu * gamma[..., None] - beta.sum(-1, keepdims=True) - slack, along + psi - s_beta]
            rows += [product(slack, psi, kappa), product(s_beta, beta, kappa)]
            force = force + (beta[..., :2] - beta[..., 2:]) @ contact.frame[1:]
        elif frictional(contact):
            psi, eta, beta = y[..., 2:3], y[..., 3:5], y[..., 5:7]
            impulse = np.concatenate((mu * gamma[..., None], beta), axis=-1)
            velocity = np.concatenate((psi, eta), axis=-1)
            cone = bilinear_cone if exact else smoothed_cone
            rows += [slip - eta, cone(impulse, velocity, kappa)]
            force = force + beta @ contact.frame[1:]
        return np.concatenate(rows, axis=-1), np.concatenate((force, rot.cross(arm, force)), axis=-1)

    def start(self, kappa: float, v: Array) -> Array:
        """Bodies moved by the joint velocities v; cones on the central path there."""
        z3 = poses(self.scene, advance(self.scene, self.q2, v, self.h))
        turned = rot.log(rot.mul(rot.conj(self.z2[1]), z3[1]))
        twist = np.concatenate((z3[0] - self.z2[0], turned), axis=-1) / self.h
        y = [twist.ravel(), np.zeros(len(self.G))]
        for contact in self.scene.contacts:
            gap, slip, _ = self.gap_and_slip(contact, z3)
            y.append(central_path(contact, float(gap), slip, kappa))
        moved = displacements(self.scene, z3, self.z2)
        for limit in self.scene.limits:
            if limit.sign == 0.0:
                gap = float(self.cone(limit, np.ones(2), z3, kappa, False)[0][0]) + 1.0
            else:
                gap = limit.sign * (self.q2[self.coordinate(limit.dof)] + moved[limit.dof] - limit.bound)
            s = max(gap, np.sqrt(kappa))
            y.append(np.array([s, kappa / s]))
        return np.concatenate(y)


def frictional(contact: PlainContact) -> bool:
    """Friction has its own variables only where there is any."""
    return contact.law != IMPACT and contact.friction > 0.0


def contact_size(contact: PlainContact) -> int:
    """(s, gamma); then (psi, eta 2, beta 2) for the cone, (slack, psi, s_beta 4, beta 4) for the pyramid."""
    if not frictional(contact):
        return 2
    return 12 if contact.law == LINEAR else 7


def central_path(contact: PlainContact, gap: float, slip: Array, kappa: float) -> Array:
    """A point of the cone near the central path at a given gap and slip."""
    s = max(gap, np.sqrt(kappa))
    gamma, mu = kappa / s, contact.friction
    if not frictional(contact):
        return np.array([s, gamma])
    if contact.law == LINEAR:
        psi = np.abs(slip).max() + 4.0 * s / mu
        s_beta = psi + np.concatenate((slip, -slip))
        beta = kappa / s_beta
        slack = mu * gamma - beta.sum()
        return np.concatenate(([s, gamma, max(slack, 0.1 * mu * gamma), psi], s_beta, beta))
    a = s / (2.0 * mu)
    psi = a + np.sqrt(a * a + slip @ slip)
    return np.concatenate(([s, gamma, psi], slip, -mu * gamma * slip / psi))
