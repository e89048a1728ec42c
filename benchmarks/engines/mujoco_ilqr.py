"""The plain way to plan through contact with MuJoCo: derivatives by `mjd_transitionFD`, iLQR in NumPy.

A competent user could write this in a day: a yardstick for the time of an iteration. It solves the same `Problem`: the
same mechanism (mujoco_scene.py), the same knots with as many time steps as MuJoCo needs, and the very same objective.
The expansion of the objective is compiled here, in its favour. Dynamics and their one-sided differences are MuJoCo's C;
backward pass and line search are NumPy. Multiple shooting with FDDP's gaps, regularised Q_uu, augmented Lagrangian.

It does not soften contact on the way: contact is as soft as MuJoCo's default solimp and solref make it, or switches
on smoothly with `MujocoSettings.smooth`. Its backward pass knows no control limits: rollouts clip the inputs.

Tassa, Mansard, Todorov 2014 (backward pass); Mastalli et al. 2020, "Crocoddyl" (gaps and their line search).
"""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import numpy as np

from benchmarks.engines import mujoco_scene
from benchmarks.engines.mujoco_warnings import quiet
from dojo_opt.planning.objective import Objective
from dojo_opt.planning.options import Options
from dojo_opt.planning.problem import Problem
from solvers.types import Matrix, Vector

FD_STEP = 1e-6  # one-sided
STEP = 0.0125  # [s] longest time step: with 25 ms the trot diverges, with 10 and 5 ms iterations take longer
PRESS = 2e-3  # [m] by which a guess of states is lowered: at an exact touch MuJoCo's differences reach 1e5
ARMIJO, ASCENT, HALVINGS = 1e-2, 2.0, 8
MU_FIRST, MU_LAST = 1e-6, 1e6  # regularisation of Q_uu, relative to the control weight


class MujocoSettings(NamedTuple):
    """How MuJoCo is used."""

    step: float = STEP  # [s] longest time step
    centered: bool = False  # differences
    smooth: bool = False  # solimp[0] = 0: a contact that begins has no force yet


class Solution(NamedTuple):
    """The solver's result and its cost."""

    x: Matrix  # (T + 1, nq + nv)
    u: Matrix  # (T, nu)
    K: Any  # (T, nu, ndx) of the last backward pass
    cost: float
    violation: float
    gap: float
    iterations: int
    seconds: Vector  # (iterations,) of processor time
    history: Matrix  # (iterations, 3) cost, violation, gap
    message: str = ""  # why it did not succeed


class MujocoIlqr:
    """iLQR on `problem`, which has a fixed start, with `substeps` steps per knot, of at most `settings.step`."""

    def __init__(self, problem: Problem, settings: MujocoSettings = MujocoSettings()) -> None:  # noqa: B008
        import mujoco

        self._mujoco = mujoco
        self._problem = problem
        self._settings = settings
        self.substeps = int(np.ceil(problem.knot_time / settings.step - 1e-9))
        self.time_step = problem.knot_time / self.substeps
        self._model = mujoco_scene.load(problem.sim.model, self.time_step, integrator="Euler")
        if settings.smooth:
            self._model.pair_solimp[:, 0] = 0.0
        self._data = mujoco.MjData(self._model)
        self._objective = Objective(problem, Options())
        self._limits = problem.control_limits or (-np.inf, np.inf)

    def solve(self, *, max_iterations: int = 200, violation: float = 1e-3, tolerance: float = 1e-3) -> Solution:
        """Plan from the guess of the problem; tolerances as in `Options`."""
        with quiet():
            return self._solve(max_iterations, violation, tolerance)

    def _solve(self, max_iterations: int, tight: float, tolerance: float) -> Solution:
        objective, (xs, us) = self._objective, self._guess()
        objective.reset()
        merit, mu, alpha = objective.evaluate(xs, us)[1], 0.0, 1.0
        K, k = np.zeros((len(us), us.shape[1], self._problem.sim.ndx)), np.zeros_like(us)
        seconds: list[float] = []
        history: list[tuple[float, float, float]] = []
        message = "" if np.isfinite(merit) else "the rollout of the guess is lost"
        while not message:
            start, before = time.process_time(), merit
            if alpha > 0.0:  # else the last derivatives are still valid at (xs, us)
                A, B, gaps = self._linearize(xs, us)
            objective.expand(xs, us)
            gains = self._backward(A, B, gaps, mu)
            if gains is None:
                message = "the backward pass fails at any regularisation"
                break
            K, k, mu = gains
            predicted = self._predicted(A, B, gaps, K, k)
            alpha, merit, xs, us = self._search(merit, xs, us, gaps, K, k, predicted)
            mu = max(10.0 * mu, MU_FIRST) if alpha < 0.1 else (0.1 * mu if mu > MU_FIRST else 0.0)
            seconds.append(time.process_time() - start)
            gap = float(np.abs(gaps).max()) * (1.0 - alpha)
            history.append((objective.evaluate(xs, us)[0], objective.violation(xs, us), gap))
            if gap < 1e-8 and alpha > 0.0 and abs(before - merit) <= tolerance * abs(before):
                if history[-1][1] <= tight:
                    break
                objective.update_multipliers(xs, us)
                merit = objective.evaluate(xs, us)[1]
            if len(seconds) >= max_iterations:
                message = "the iterations are used up"
            elif mu > MU_LAST:
                message = "no step is accepted at any regularisation"
        gap = float(np.abs(self._gaps(xs, us)).max())
        found = (objective.evaluate(xs, us)[0], objective.violation(xs, us), gap, len(seconds))
        return Solution(xs, us, K, *found, np.array(seconds), np.array(history), message)

    def replay(self, solution: Solution, refine: int = 5) -> tuple[Matrix, Matrix]:
        """(xs, us) of a solution under its gains, with time steps `refine` times as short."""
        fine = MujocoIlqr(self._problem, self._settings._replace(step=self.time_step / refine))
        with quiet():
            return fine.rollout(solution.x, solution.u, None, solution.K, np.zeros_like(solution.u), 0.0)

    def _guess(self) -> tuple[Matrix, Matrix]:
        """States and inputs to start from: the states of the problem, or the rollout of its inputs."""
        problem = self._problem
        us = np.clip(problem.controls0, *self._limits)
        if problem.states0 is None:
            return self.rollout(np.tile(problem.start, (problem.horizon + 1, 1)), us, None, None, None, 1.0)
        xs = problem.states0.copy()
        xs[1:, 2] -= PRESS
        return xs, us

    def _search(
        self, merit: float, xs: Matrix, us: Matrix, gaps: Matrix, K: Any, k: Matrix, predicted: tuple[float, float]
    ) -> tuple[float, float, Matrix, Matrix]:
        """(step size, merit, xs, us) of the first of 1, 1/2, 1/4, ... with enough decrease; 0 and the old ones if none.

        Closing gaps may cost: when the model predicts an increase, one up to ASCENT times as large is allowed.
        """
        for alpha in 0.5 ** np.arange(HALVINGS):
            x_new, u_new = self.rollout(xs, us, gaps, K, k, alpha)
            new = self._objective.evaluate(x_new, u_new)[1]
            change = alpha * (predicted[0] + 0.5 * alpha * predicted[1])
            if new - merit <= (ARMIJO if change < 0.0 else ASCENT) * change:  # false for NaN
                return float(alpha), new, x_new, u_new
        return 0.0, merit, xs, us

    def _set(self, x: Vector, u: Vector) -> None:
        """The state, without memory of the previous one."""
        self._data.qpos[:], self._data.qvel[:] = x[: self._model.nq], x[self._model.nq :]
        self._data.ctrl[:] = u
        self._data.qacc_warmstart[:] = 0.0

    def _next(self) -> Vector:
        return np.concatenate([self._data.qpos, self._data.qvel])

    def _gaps(self, xs: Matrix, us: Matrix) -> Matrix:
        """(T + 1, ndx) f(x_t, u_t) (-) x_{t+1}; row 0 is zero."""
        gaps = np.zeros((len(xs), self._problem.sim.ndx))
        for t, u in enumerate(us):
            self._set(xs[t], u)
            self._mujoco.mj_step(self._model, self._data, self.substeps)
            gaps[t + 1] = self._difference(self._next(), xs[t + 1])
        return gaps

    def _linearize(self, xs: Matrix, us: Matrix) -> tuple[Any, Any, Matrix]:
        """A (T, ndx, ndx) and B (T, ndx, nu), chained over the time steps of each knot, and the gaps (T + 1, ndx)."""
        sim, T, model, data = self._problem.sim, len(us), self._model, self._data
        A, B, gaps = np.empty((T, sim.ndx, sim.ndx)), np.empty((T, sim.ndx, sim.nu)), np.zeros((T + 1, sim.ndx))
        step_A, step_B = np.empty((sim.ndx, sim.ndx)), np.empty((sim.ndx, sim.nu))
        for t in range(T):
            self._set(xs[t], us[t])
            for i in range(self.substeps):
                self._mujoco.mjd_transitionFD(model, data, FD_STEP, self._settings.centered, step_A, step_B, None, None)
                self._mujoco.mj_step(model, data)
                A[t] = step_A @ A[t] if i else step_A
                B[t] = step_A @ B[t] + step_B if i else step_B
            gaps[t + 1] = self._difference(self._next(), xs[t + 1])
        return A, B, gaps

    def _difference(self, x: Vector, origin: Vector) -> Vector:
        """x (-) origin in the tangent space, (ndx,)."""
        nq, nv = self._model.nq, self._model.nv
        dx = np.empty(2 * nv)
        self._mujoco.mj_differentiatePos(self._model, dx[:nv], 1.0, origin[:nq], x[:nq])
        dx[nv:] = x[nq:] - origin[nq:]
        return dx

    def _backward(self, A: Any, B: Any, gaps: Matrix, mu: float) -> tuple[Any, Matrix, float] | None:
        """Gains K (T, nu, ndx), k (T, nu), and the regularisation at which every Q_uu was positive definite, if any.

        V_x <- V_x + V_xx gap,  Q_z = l_z + F^T V_x,  Q_zz = l_zz + F^T V_xx F,  F = (A, B)
        (k, K) = -(Q_uu + mu w I)^-1 (Q_u, Q_ux)
        """
        g, H, n = self._objective.g, self._objective.H, A.shape[1]
        T, m = B.shape[0], B.shape[2]
        F = np.concatenate([A, B], axis=2)
        unit = np.trace(H[0, n:, n:]) / m
        K, k = np.empty((T, m, n)), np.empty((T, m))
        while True:
            V_x, V_xx = g[T, :n], H[T, :n, :n]
            try:
                for t in range(T - 1, -1, -1):
                    Q_z = g[t] + F[t].T @ (V_x + V_xx @ gaps[t + 1])
                    Q_zz = H[t] + F[t].T @ V_xx @ F[t]
                    lower = np.linalg.cholesky(Q_zz[n:, n:] + mu * unit * np.eye(m))
                    right = np.column_stack([Q_zz[n:, :n], Q_z[n:]])
                    gains = -np.linalg.solve(lower.T, np.linalg.solve(lower, right))
                    K[t], k[t] = gains[:, :n], gains[:, n]
                    cross = K[t].T @ Q_zz[n:, :n]
                    V_x = Q_z[:n] + K[t].T @ (Q_z[n:] + Q_zz[n:, n:] @ k[t]) + Q_zz[n:, :n].T @ k[t]
                    V_xx = Q_zz[:n, :n] + cross + cross.T + K[t].T @ Q_zz[n:, n:] @ K[t]
                    V_xx = 0.5 * (V_xx + V_xx.T)
                return K, k, mu
            except np.linalg.LinAlgError:
                if mu > MU_LAST:
                    return None
                mu = max(10.0 * mu, MU_FIRST)

    def _predicted(self, A: Any, B: Any, gaps: Matrix, K: Any, k: Matrix) -> tuple[float, float]:
        """(d0, d1): the linear model of the full step changes the merit by  a d0 + a^2/2 d1."""
        g, H, n = self._objective.g, self._objective.H, A.shape[1]
        z, d0, d1 = np.zeros(n + B.shape[2]), 0.0, 0.0
        for t in range(len(k)):
            z[n:] = k[t] + K[t] @ z[:n]
            d0, d1 = d0 + g[t] @ z, d1 + z @ H[t] @ z
            z[:n] = A[t] @ z[:n] + B[t] @ z[n:] + gaps[t + 1]
        dx = z[:n]
        return float(d0 + g[-1, :n] @ dx), float(d1 + dx @ H[-1, :n, :n] @ dx)

    def rollout(
        self, xs: Matrix, us: Matrix, gaps: Matrix | None, K: Any, k: Matrix | None, alpha: float
    ) -> tuple[Matrix, Matrix]:
        """u = us + a k + K (x (-) xs), with the share 1 - a of every gap left open; gains None: open loop."""
        x_new, u_new = xs.copy(), us.copy()
        for t in range(len(us)):
            if K is not None and k is not None:
                u_new[t] = us[t] + alpha * k[t] + K[t] @ self._difference(x_new[t], xs[t])
            u_new[t] = np.clip(u_new[t], *self._limits)
            self._set(x_new[t], u_new[t])
            self._mujoco.mj_step(self._model, self._data, self.substeps)
            x_new[t + 1] = self._next()
            if not np.all(np.isfinite(x_new[t + 1])):
                x_new[t + 1 :] = np.nan  # so that its merit is, too
                break
            if gaps is not None and alpha < 1.0:
                x_new[t + 1] = self._problem.sim.integrate(x_new[t + 1], (alpha - 1.0) * gaps[t + 1])
        return x_new, u_new
