"""Small discrete systems with the array-level interface of `Simulator`, for tests of the planner alone.

Slow and obvious: plain Python, derivatives by central differences on the manifold.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from solvers.status import Status


class Shot(NamedTuple):
    x: Any
    u: Any
    status: Status
    solved_knots: int
    residual: float


class SystemTrial(NamedTuple):
    x: Any
    u: Any
    status: Status
    solved_knots: int
    steps: Any = None


class SystemLinearization(NamedTuple):
    A: Any
    B: Any
    x_next: Any
    status: Any


class DiscreteSystem:
    """x = [q; v]; `quaternion` is the address of one free rotation in q, or None."""

    nq = nv = nu = 1
    quaternion: int | None = None
    time_step = 0.1
    kappa = 1e-6

    def __init__(self) -> None:
        self.nx, self.ndx = self.nq + self.nv, 2 * self.nv
        self.calls: list[float] = []
        dofs, inputs = (tuple(f"{what} {i}" for i in range(n)) for what, n in (("dof", self.nv), ("input", self.nu)))
        joints = (SimpleNamespace(nv=self.nv, limits=None),)
        self.mechanism = SimpleNamespace(dof_names=dofs, input_names=inputs, joints=joints)

    def neutral(self):
        return self.integrate(
            np.eye(1, self.nx, self.quaternion or 0)[0] * (self.quaternion is not None), np.zeros(self.ndx)
        )

    def move(self, x, u, kappa):
        """Next state, or None when it cannot be solved."""
        raise NotImplementedError

    def integrate(self, x, dx):
        x, dx = np.asarray(x, float), np.asarray(dx, float)
        if self.quaternion is None:
            return x + dx
        a = self.quaternion
        turn = Rotation.from_rotvec(dx[..., a : a + 3])
        quat = (Rotation.from_quat(x[..., a : a + 4], scalar_first=True) * turn).as_quat(scalar_first=True)
        quat = np.where(np.sum(quat * x[..., a : a + 4], axis=-1, keepdims=True) < 0, -quat, quat)
        return np.concatenate([x[..., :a] + dx[..., :a], quat, x[..., a + 4 :] + dx[..., a + 3 :]], axis=-1)

    def difference(self, x1, x0):
        x1, x0 = np.asarray(x1, float), np.asarray(x0, float)
        if self.quaternion is None:
            return x1 - x0
        a = self.quaternion
        r0 = Rotation.from_quat(x0[..., a : a + 4], scalar_first=True)
        r1 = Rotation.from_quat(x1[..., a : a + 4], scalar_first=True)
        turn = (r0.inv() * r1).as_rotvec()
        return np.concatenate([x1[..., :a] - x0[..., :a], turn, x1[..., a + 4 :] - x0[..., a + 4 :]], axis=-1)

    def advance(self, x, u, substeps, kappa):
        self.calls.append(kappa)
        for _ in range(substeps):
            x = self.move(x, u, kappa)
            if x is None:
                return None
        return x

    def rollout_feedback(
        self, x0, us, xs=None, ks=None, Ks=None, gaps=None, alpha=1.0, limits=None, substeps=1, kappa=None
    ):
        T = len(us)
        x, u = np.full((T + 1, self.nx), np.nan), np.full((T, self.nu), np.nan)
        x[0] = x0
        for t in range(T):
            u[t] = us[t]
            if ks is not None:
                u[t] += alpha * ks[t]
            if Ks is not None:
                u[t] += Ks[t] @ self.difference(x[t], xs[t])
            if limits is not None:
                u[t] = np.clip(u[t], *limits)
            following = self.advance(x[t], u[t], substeps, kappa)
            if following is None:
                return Shot(x, u, Status.MAX_ITERATIONS, t, np.inf)
            x[t + 1] = following
            if gaps is not None:
                x[t + 1] = self.integrate(x[t + 1], (alpha - 1.0) * gaps[t + 1])
        return Shot(x, u, Status.SOLVED, T, 0.0)

    def horizon(self, knots, substeps=1, limits=None):
        return SystemHorizon(self, substeps, limits)

    def linearize_trajectory(self, xs, us, substeps=1, kappa=None):
        T = len(us)
        A, B = np.zeros((T, self.ndx, self.ndx)), np.zeros((T, self.ndx, self.nu))
        x_next, status = np.zeros((T, self.nx)), np.zeros(T, dtype=np.int64)
        eps = 1e-6
        for t in range(T):
            center = self.advance(xs[t], us[t], substeps, kappa)
            if center is None:
                status[t] = Status.MAX_ITERATIONS
                continue
            x_next[t] = center
            for out, size, shift in (
                (A[t], self.ndx, lambda d, t=t: (self.integrate(xs[t], d), us[t])),
                (B[t], self.nu, lambda d, t=t: (xs[t], us[t] + d)),
            ):
                for i in range(size):
                    step = np.zeros(size)
                    step[i] = eps
                    plus, minus = (self.advance(*shift(s), substeps, kappa) for s in (step, -step))
                    out[:, i] = (self.difference(plus, center) - self.difference(minus, center)) / (2 * eps)
        return SystemLinearization(A, B, x_next, status)


class SystemHorizon:
    """The interface of `sim.horizon.Horizon` around a system; it learns nothing from previous steps."""

    def __init__(self, system, substeps, limits):
        self.system, self.substeps, self.limits = system, substeps, limits

    def states(self, call, xs):
        return np.array(xs)

    def roll(self, x0, xs, us, kappa, *, k=None, K=None, gaps=None, alpha=1.0, **hints):
        gaps = gaps if alpha < 1.0 else None
        shot = self.system.rollout_feedback(x0, us, xs, k, K, gaps, alpha, self.limits, self.substeps, kappa)
        return SystemTrial(shot.x, shot.u, shot.status, shot.solved_knots)

    def linearize(self, xs, us, kappa, guess=None):
        return self.system.linearize_trajectory(xs, us, self.substeps, kappa)

    def gaps(self, linear, xs):
        gaps = np.zeros((len(xs), self.system.ndx))
        gaps[1:] = self.system.difference(linear.x_next, xs[1:])
        return gaps


class DoubleIntegrator(DiscreteSystem):
    """A unit mass on a line, pushed: linear."""

    def move(self, x, u, kappa):
        v = x[1] + self.time_step * u[0]
        return np.array([x[0] + self.time_step * v, v])


class Pendulum(DiscreteSystem):
    """A damped point pendulum, angle 0 hanging, torque at the pivot; beyond `too_fast` it cannot be stepped."""

    too_fast = np.inf

    def move(self, x, u, kappa):
        v = x[1] + self.time_step * (u[0] - 9.81 * np.sin(x[0]) - 0.1 * x[1])
        if not abs(v) < self.too_fast:
            return None
        return np.array([x[0] + self.time_step * v, v])


class SmoothedWall(DiscreteSystem):
    """A unit mass on a line that a wall at 0 keeps out by the force kappa / distance, implicit: smooth contact."""

    def move(self, x, u, kappa):
        h, free = self.time_step, x[0] + self.time_step * (x[1] + self.time_step * u[0])
        q = 0.5 * (free + np.sqrt(free * free + 4.0 * h * h * kappa))  # q (q - free) = h^2 kappa
        return np.array([q, (q - x[0]) / h])


class FreeBody(DiscreteSystem):
    """Position and attitude of a body with unit mass and inertia; force in world, torque in body axes."""

    nq, nv, nu, quaternion = 7, 6, 6, 3

    def move(self, x, u, kappa):
        v = x[7:] + self.time_step * np.asarray(u)
        following = self.integrate(x, np.concatenate([self.time_step * v, np.zeros(6)]))
        following[7:] = v
        return following
