"""Starts: the stage that fits a guess, the first state as a decision, and the gains of a repeated motion."""

from __future__ import annotations

from typing import Any

import numpy as np

from dojo_opt.planning.iterate import Iterate
from dojo_opt.planning.objective import Objective
from dojo_opt.planning.options import Stage
from dojo_opt.planning.problem import Problem
from dojo_opt.planning.task_space.task_term import PeriodicTaskTerm
from dojo_opt.planning.term import PeriodicTerm
from sim.mechanism.shapes import rotation_matrices
from sim.model.state_columns import BodyState
from sim.simulator.horizon import Horizon
from sim.simulator.simulator import Simulator
from solvers.riccati import Quadratic, Regularization, backward, value_hessian, work_size
from solvers.status import Status
from solvers.types import Floats

_GOOD_FIT = 2.0  # times the least sum of squared gaps: a guess fits a smoother stage nearly as well
_REST = 1e-9  # [m, rad] largest motion from one knot to the next of a joint at rest
_ASKED = 1e-6  # [m, rad, m/s, rad/s] Newton step above which the objective asks a joint to move
_ROUNDED = 1e-12  # of the largest gradient: a smaller one is rounding, such as that of a wrist that turns about the tip
_CURVED = 1e-8  # curvature, relative to that of the components, below which a direction is rounding
_CYCLES = 200  # a trot takes 20
_TOLERANCE = 1e-8  # change of the value from one cycle to the next, relative to its largest curvature
_LOOKS, _NEAR = 8, 0.01  # knots of a guess whose contacts are looked at, and gap of one within reach [m]
_TRUST = 1e-2  # share of the regularisation that holds the start, relative to the curvature there


def only_stops(sim: Simulator, xs: Floats) -> bool:
    """Whether stops of joints are all that smoothing acts on near a guess of states, looked at at some knots.

    Smooth stages find contacts, and where joints with dry friction begin to slide. Stops need none: a smooth one pushes
    a joint that rests there away, and the plan has to follow it back from stage to stage.
    """
    mech = sim.mechanism
    limits = [np.asarray(joint.limits, dtype=np.float64) for joint in mech.joints if joint.limits]
    stops = any(np.isfinite(pair).any() for pair in limits)
    if not stops or mech.collisions or any(np.any(joint.friction) for joint in mech.joints):
        return False
    bodies = sim.maximal(xs[:: -(-len(xs) // _LOOKS)])
    for contact in mech.contacts:
        z = bodies[:, mech.body_names.index(contact.body)]
        at = z[:, :3] + rotation_matrices(z[:, BodyState.QUATERNION]) @ np.asarray(contact.point)
        if np.any(contact.gap(at) <= _NEAR):
            return False
    return True


def fitting_stage(horizon: Horizon, now: Iterate, stages: tuple[Stage, ...], least: int = 0) -> tuple[int, Any]:
    """The stage that a guess of states fits best, and its derivatives; None if no stage can be linearised.

    It is the smoothest down to which the guess fits nearly as well as at harder ones. A good reference leaves small
    gaps at a hard contact and large ones at a smooth one, where contact begins above the ground; smoothing it first
    would only lead away from it. A poor one fits nowhere, and needs all the stages.

    least: number of the first stage that counts.
    """
    best, chosen, there = np.inf, least, None
    for i in range(len(stages) - 1, least - 1, -1):
        linear = horizon.linearize(now.x, now.u, stages[i].kappa_eval)
        misfit = np.inf if np.any(linear.status) else float(np.sum(horizon.gaps(linear, now.x) ** 2))
        if misfit <= _GOOD_FIT * best and misfit < np.inf:
            chosen, there = i, linear
        elif best < np.inf:
            break
        best = min(best, misfit)
    return chosen, there


def at_rest(sim: Simulator, objective: Objective, now: Iterate) -> bool:
    """Whether a joint rests in the states from the second on, though it starts elsewhere or has to move.

    Such a guess fits a hard contact because nothing happens there. It does not show how contact moves that joint:
    smooth stages find that out.
    """
    start, *_ = steps = np.abs(sim.difference(now.x[1:], now.x[:-1]))[:, : sim.nv]
    objective.expand(now.x, now.u)
    gradient = np.abs(objective.g[1:, : sim.ndx])
    curvature = np.abs(objective.H[1:].diagonal(axis1=1, axis2=2)[:, : sim.ndx])
    asked = np.any(gradient > np.maximum(_ASKED * curvature, _ROUNDED * gradient.max()), axis=0)
    asked = asked[: sim.nv] | asked[sim.nv :] | (start > _ASKED)
    rests = np.all(steps[1:] <= _REST, axis=0)
    first = 0
    for joint in sim.mechanism.joints:
        dofs = slice(first, first := first + joint.nv)
        if rests[dofs].all() and asked[dofs].any():
            return True
    return False


class FreeStart:
    """Newton step of x_0, from the value function of the backward pass at t = 0.

    Terms that couple the end to the start make the value of a state depend on the start dx_0 = s as well:

        V(dx, s) = v dx + 1/2 dx^T V dx + w s + 1/2 s^T W s + dx^T X s,     du = k + K dx + S s

    K and k are those of the pass without s. At t = 0, where dx = s, the minimum over s is the step of the start.
    """

    def __init__(self, problem: Problem) -> None:
        self._free = problem.free_start
        self._terms = [term for term in problem.constraints if isinstance(term, PeriodicTerm | PeriodicTaskTerm)]
        self.step = np.zeros(problem.sim.ndx)

    @property
    def stride(self) -> Floats | None:
        """(ndx,) displacement over one period, None unless all of the end is tied to the start."""
        ties = (term for term in self._terms if isinstance(term, PeriodicTerm))
        return next((term.shift for term in ties if term.mask.all()), None)

    def solve(
        self, model: Quadratic, K: Floats, k: Floats, mu: float, unit: Floats, xs: Floats, us: Floats
    ) -> tuple[Floats, float, float]:
        """(k + S s, d0 and d1 of the step with s); `step` is s, in tangent coordinates at the present start."""
        T, m, n = K.shape
        X, W, w, ends = self._couple(n, xs, us)
        V, v = model.H[T, :n, :n], model.g[T, :n]
        S = np.zeros((T, m, n))
        for t in range(T - 1, -1, -1):
            F = np.concatenate([model.A[t], model.B[t]], axis=1)
            v = v + V @ model.gaps[t + 1]
            w = w + X.T @ model.gaps[t + 1]
            Q, q, R = model.H[t] + F.T @ V @ F, model.g[t] + F.T @ v, F.T @ X
            Quu, Qux = Q[n:, n:], Q[n:, :n]
            held = (k[t] <= model.lo[t]) | (k[t] >= model.hi[t])
            free = np.flatnonzero(~held)
            if free.size:
                firm = (Quu + mu * np.diag(unit))[np.ix_(free, free)]
                S[t, free] = -np.linalg.solve(firm, R[n + free])
            W = W + S[t].T @ Quu @ S[t] + S[t].T @ R[n:] + R[n:].T @ S[t]
            w = w + S[t].T @ (Quu @ k[t] + q[n:]) + R[n:].T @ k[t]
            X = R[:n] + K[t].T @ (Quu @ S[t] + R[n:]) + Qux.T @ S[t]
            v = q[:n] + K[t].T @ (Quu @ k[t] + q[n:]) + Qux.T @ k[t]
            V = Q[:n, :n] + K[t].T @ (Quu @ K[t] + Qux) + Qux.T @ K[t]
            V = 0.5 * (V + V.T)  # its asymmetry would grow with the motion without feedback: 1e17 in two trots
        self.step = self._newton(V + X + X.T + W, v + w, mu)
        k = k + S @ self.step
        return k, *self._predict(model, K, k, ends)

    def _couple(self, n: int, xs: Floats, us: Floats) -> tuple[Floats, Floats, Floats, list[tuple[Floats, ...]]]:
        """X, W, w at the end."""
        X, W, w = np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
        ends: list[tuple[Floats, ...]] = []
        for term in self._terms:
            end, start, first, second = term.coupling(xs, us)
            X += end.T @ (second[:, None] * start)
            W += start.T @ (second[:, None] * start)
            w += start.T @ first
            ends.append((end, start, first, second))
        return X, W, w, ends

    def _newton(self, H: Floats, g: Floats, mu: float) -> Floats:
        """-H^-1 g on the free components, each in units of its own curvature; directions without curvature are left."""
        step = np.zeros(len(g))
        H = 0.5 * (H + H.T)[np.ix_(self._free, self._free)]
        own = np.diag(H)
        unit = np.where(own > _CURVED**2 * own.max(), 1.0 / np.sqrt(np.maximum(own, 1e-100)), 0.0)
        values, vectors = np.linalg.eigh(unit[:, None] * H * unit)
        curved = values > _CURVED
        along = vectors[:, curved].T @ (unit * g[self._free])
        step[self._free] = -unit * (vectors[:, curved] @ (along / (values[curved] * (1.0 + _TRUST * mu))))
        return step

    def _predict(self, model: Quadratic, K: Floats, k: Floats, ends: list[tuple[Floats, ...]]) -> tuple[float, float]:
        """d0 and d1 of the step with s, from the linear rollout."""
        T, _, n = K.shape
        dx, d0, d1 = self.step, 0.0, 0.0
        for t in range(T):
            z = np.concatenate([dx, k[t] + K[t] @ dx])
            d0 += float(model.g[t] @ z)
            d1 += float(z @ model.H[t] @ z)
            dx = model.gaps[t + 1] + model.A[t] @ dx + model.B[t] @ z[n:]
        d0 += float(model.g[T, :n] @ dx)
        d1 += float(dx @ model.H[T, :n, :n] @ dx)
        for end, start, first, second in ends:
            r0, rT = start @ self.step, end @ dx
            d0 += float(first @ r0)
            d1 += float(second @ (r0 * (r0 + 2.0 * rT)))
        return d0, d1


def periodic_gains(model: Quadratic) -> Floats | None:
    """K (T, nu, ndx) of the cycle around which `model` is expanded, repeated for ever; None where that has no solution.

    Backward passes over the cycle, each from the value at the start of the one before, until that repeats itself, too.
    Those of a single cycle look no further than its end: repeated, they let a robot fall that these hold up.
    Controls at a limit get no feedback.
    """
    T, n, m = model.B.shape
    K, k = np.zeros((T, m, n)), np.zeros((T, m))
    buffer, free = np.zeros(work_size(n, m)), np.zeros(m, dtype=np.int64)
    H = model.H.copy()
    H[T] = 0.0
    H[T, :n, :n] = model.H[0, :n, :n]
    cycle = model._replace(g=np.zeros_like(model.g), H=H, gaps=np.zeros_like(model.gaps))
    V = H[T, :n, :n]
    for _ in range(_CYCLES):
        if backward(cycle, Regularization(0.0, 0.0, np.ones(m)), K, k, free, buffer).status != Status.SOLVED:
            return None
        before = value_hessian(buffer, n)
        change = np.abs(before - V).max()
        V[:] = before
        if change <= _TOLERANCE * np.abs(V).max():
            return K
    return None
