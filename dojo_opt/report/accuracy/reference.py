"""References independent of our simulator: equations of motion in continuous time, integrated by DOP853.

motion       any tree, by Newton and Euler for each body and Jacobians of its centre of mass
pendulum     a chain of equal links in a plane, in absolute angles
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import solveh_banded

from sim.model.model import InputKind, Model
from solvers.types import Floats

_TOLERANCE = 1e-12


class TreeReference:
    """q'' of a tree without contacts, limits and loops: M(q) v' = forces - M-free accelerations, in NumPy.

    Springs, dampers, armatures and inputs of joints are represented; inputs on bodies are not, and must be zero; joints
    with two rotations, loops and gears are not (scenes.not_in_reference).
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self.nq, self.nv = int(model.body_qadr[-1]), len(model.dof_body)
        self._offset = [_matrix(f) for f in model.joint_offset]

    def accelerations(self, q: Floats, v: Floats, u: Floats | None = None) -> Floats:
        """v' at (q, v) under the inputs u (nu,).

            sum of J^T (m (g - a) ; -(I alpha + w x I w)) + joint forces = M v'

        J: of the centre of mass and the orientation of each body; a, alpha: its accelerations when v' = 0.
        """
        model = self.model
        n = len(model.body_mass)
        R, x = np.empty((n, 3, 3)), np.empty((n, 3))
        w, acc, alpha = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3))
        lin, ang = np.zeros((n, 3, self.nv)), np.zeros((n, 3, self.nv))
        M, f = np.diag(model.dof_armature), self._joint_forces(q, v, u)
        for i in range(n):
            p = int(model.body_parent[i])
            arm = model.joint_parent_point[i]
            Q, o = self._offset[i], arm
            wp = ap = alp = np.zeros(3)
            if p >= 0:
                r = R[p] @ arm
                Q, o, wp, alp = R[p] @ Q, x[p] + r, w[p], alpha[p]
                ap = acc[p] + _cross(alp, r) + _cross(wp, _cross(wp, r))
                lin[i], ang[i] = lin[p] - _skew(r) @ ang[p], ang[p]
            a, d = int(model.body_qadr[i]), int(model.body_vadr[i])
            for k in range(int(model.joint_ntrans[i])):
                t = Q @ model.joint_trans_axes[i, 3 * k : 3 * k + 3]
                s = q[a] * t
                o = o + s
                ap = ap + _cross(alp, s) + _cross(wp, _cross(wp, s)) + 2.0 * v[d] * _cross(wp, t)
                lin[i] -= _skew(s) @ ang[i]
                lin[i, :, d] += t
                a, d = a + 1, d + 1
            R[i], w[i], alpha[i] = Q, wp, alp
            if model.joint_nrot[i] == 1:
                axis = Q @ model.joint_axis[i]
                R[i] = Q @ _turn(model.joint_axis[i], q[a])
                s, t = model.joint_lead[i] * q[a] * axis, model.joint_lead[i] * axis
                o = o + s
                ap = ap + _cross(alp, s) + _cross(wp, _cross(wp, s)) + 2.0 * v[d] * _cross(wp, t)
                lin[i] -= _skew(s) @ ang[i]
                lin[i, :, d] += t
                w[i], alpha[i] = wp + v[d] * axis, alp + v[d] * _cross(wp, axis)
                ang[i, :, d] = axis
            elif model.joint_nrot[i] == 3:
                R[i] = Q @ _matrix(q[a : a + 4] / np.linalg.norm(q[a : a + 4]))
                rate = R[i] @ v[d : d + 3]
                w[i], alpha[i] = wp + rate, alp + _cross(wp, rate)
                ang[i, :, d : d + 3] = R[i]
            r = -R[i] @ model.joint_child_point[i]
            x[i] = o + r
            acc[i] = ap + _cross(alpha[i], r) + _cross(w[i], _cross(w[i], r))
            lin[i] -= _skew(r) @ ang[i]
            m, J = model.body_mass[i], R[i] @ model.body_inertia[i].reshape(3, 3) @ R[i].T
            M += m * lin[i].T @ lin[i] + ang[i].T @ J @ ang[i]
            f += m * lin[i].T @ (model.body_weight[i] * model.gravity - acc[i]) - ang[i].T @ (
                J @ alpha[i] + _cross(w[i], J @ w[i])
            )
        return np.asarray(np.linalg.solve(M, f))

    def _joint_forces(self, q: Floats, v: Floats, u: Floats | None) -> Floats:
        """Springs, dampers and inputs of the joints, (nv,)."""
        model = self.model
        f = -model.dof_damper * v
        for i in range(len(model.body_mass)):
            a, d, stop = int(model.body_qadr[i]), int(model.body_vadr[i]), int(model.body_vadr[i + 1])
            n = stop - d - (3 if model.joint_nrot[i] == 3 else 0)
            f[d : d + n] -= model.dof_spring[d : d + n] * (q[a : a + n] - model.dof_rest[d : d + n])
            if model.joint_nrot[i] == 3 and model.dof_spring[stop - 3] > 0.0:
                s = _product(_exponential(-model.dof_rest[stop - 3 : stop]), q[a + n : a + n + 4])
                f[stop - 3 : stop] -= 2.0 * model.dof_spring[stop - 3] * s[0] * s[1:]
        for j, force in enumerate(() if u is None else u):
            if model.input_kind[j] == InputKind.JOINT:
                f[model.input_index[j]] += model.input_wrench[j, 0] * force
            elif force != 0.0:
                raise ValueError("reference: inputs on bodies are not represented")
        return f

    def rates(self, y: Floats, u: Floats | None = None) -> Floats:
        """d[q; v]/dt."""
        q, v = y[: self.nq], y[self.nq :]
        return np.concatenate([self._coordinate_rates(q, v), self.accelerations(q, v, u)])

    def _coordinate_rates(self, q: Floats, v: Floats) -> Floats:
        """dq/dt: v for scalars, q (0, w)/2 for quaternions."""
        out = np.empty(self.nq)
        for i in range(len(self.model.body_mass)):
            a, d = int(self.model.body_qadr[i]), int(self.model.body_vadr[i])
            n = int(self.model.body_vadr[i + 1]) - d - (3 if self.model.joint_nrot[i] == 3 else 0)
            out[a : a + n] = v[d : d + n]
            if self.model.joint_nrot[i] == 3:
                out[a + n : a + n + 4] = 0.5 * _product(q[a + n : a + n + 4], np.r_[0.0, v[d + n : d + n + 3]])
        return out

    def run(self, q: Floats, v: Floats, times: Floats, u: Floats | None = None) -> tuple[Floats, Floats]:
        """(q (n, nq), v (n, nv)) at the times, the first of which is the start; quaternions of length one."""
        ys = integrate(lambda y: self.rates(y, u), np.concatenate([q, v]), times)
        for i in range(len(self.model.body_mass)):
            if self.model.joint_nrot[i] == 3:
                stop = int(self.model.body_qadr[i + 1])
                ys[:, stop - 4 : stop] /= np.linalg.norm(ys[:, stop - 4 : stop], axis=1, keepdims=True)
        return ys[:, : self.nq], ys[:, self.nq :]


def pendulum(model: Model, q: Floats, v: Floats, times: Floats) -> tuple[Floats, Floats]:
    """(q, v) at the times of a chain of equal links that turn about x, in absolute angles phi.

    Unknown are the forces f_j between links j - 1 and j, in the plane (y, z). With the direction e = (sin, -cos) of a
    link, n = (cos, sin), A, C = +-I/m + l^2/(4 J) n n^T, joints stay together when

        C_j-1 f_j-1 + (A_j-1 + A_j) f_j + C_j f_j+1 = -l/2 (e_j-1 phi_j-1'^2 + e_j phi_j'^2)
        J phi_j'' = -l/2 n.(f_j + f_j+1)

    a banded system, so that a hundred links take no longer than their number.
    """
    n = len(model.body_mass)
    m, l = float(model.body_mass[0]), 2.0 * float(model.joint_child_point[0, 2])
    J, g = float(model.body_inertia[0, 0]), -float(model.gravity[2])

    def rates(y: Floats) -> Floats:
        phi, rate = y[:n], y[n:]
        c, s = np.cos(phi), np.sin(phi)
        k = l * l / (4.0 * J)
        nn = k * np.array([c * c, c * s, s * s])
        A, C = nn + np.array([[1.0], [0.0], [1.0]]) / m, nn - np.array([[1.0], [0.0], [1.0]]) / m
        D = A.copy()
        D[:, 1:] += A[:, :-1]
        band = np.zeros((4, 2 * n))
        band[3, 0::2], band[3, 1::2], band[2, 1::2] = D[0], D[2], D[1]
        band[1, 2::2], band[1, 3::2], band[2, 2::2], band[0, 3::2] = C[0, :-1], C[2, :-1], C[1, :-1], C[1, :-1]
        pull = -0.5 * l * rate**2 * np.array([s, -c])
        pull[:, 1:] += pull[:, :-1].copy()
        pull[1, 0] += g
        f = solveh_banded(band, pull.T.ravel()).reshape(n, 2)
        f[:-1] += f[1:].copy()
        return np.concatenate([rate, -0.5 * l / J * (c * f[:, 0] + s * f[:, 1])])

    ys = integrate(rates, np.concatenate([np.cumsum(q), np.cumsum(v)]), times)
    return np.diff(ys[:, :n], axis=1, prepend=0.0), np.diff(ys[:, n:], axis=1, prepend=0.0)


def integrate(rates: Callable[[Floats], Floats], start: Floats, times: Floats) -> Floats:
    """Solutions of y' = rates(y) at the times, from `start` at the first; (n, len(start))."""
    out = solve_ivp(
        lambda _, y: rates(y), (times[0], times[-1]), start, "DOP853", t_eval=times, rtol=_TOLERANCE, atol=1e-13
    )
    if not out.success:
        raise RuntimeError(f"reference: {out.message}")
    return np.asarray(out.y.T)


def _cross(a: Floats, b: Floats) -> Floats:
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _skew(a: Floats) -> Floats:
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def _turn(axis: Floats, angle: float) -> Floats:
    """Rodrigues' formula."""
    K = _skew(axis)
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def _matrix(q: Floats) -> Floats:
    """R(q) of a unit quaternion."""
    K = _skew(q[1:])
    return np.eye(3) + 2.0 * q[0] * K + 2.0 * K @ K


def _product(a: Floats, b: Floats) -> Floats:
    """Hamilton product."""
    return np.concatenate([[a[0] * b[0] - a[1:] @ b[1:]], a[0] * b[1:] + b[0] * a[1:] + _cross(a[1:], b[1:])])


def _exponential(t: Floats) -> Floats:
    """Quaternion of a rotation vector."""
    angle = float(np.linalg.norm(t))
    return np.concatenate([[np.cos(0.5 * angle)], 0.5 * np.sinc(0.5 * angle / np.pi) * t])
