"""One time step as the dense KKT system of maximal coordinates, solved by a smoothing Newton method.

The Jacobian is a complex step through all equations. Nothing here is shared with the engine: other unknowns, no
elimination, another method for the inequalities (the smoothing functions of Chen, Harker, Kanzow and Smale).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from naive.equations import Step, frictional
from naive.lagrangian import TINY, displacements
from naive.rotation import Array
from naive.scene import LINEAR, PlainScene, advance


@dataclass(frozen=True)
class NaiveSolution:
    q: Array  # (nq,) next coordinates
    v: Array  # (nv,) joint velocities of the step
    pos: Array  # (nbody, 3) next poses
    quat: Array  # (nbody, 4)
    contact_impulse: Array  # (ncontact, 3) world axes [N s]
    limit_impulse: Array  # (nlimit,)
    multipliers: Array  # joint impulses
    residual: float  # largest entry of the unsmoothed equations
    iterations: int


def jacobian(step: Step, y: Array, kappa: float, exact: bool) -> Array:
    """Complex step along every unknown at once."""
    return np.imag(step.residual(y + 1j * TINY * np.eye(len(y)), kappa, exact)).T / TINY


def newton(step: Step, y: Array, kappa: float, exact: bool, tolerance: float, limit: int) -> tuple[Array, float, int]:
    """Newton with halving on the Euclidean norm of the residual; stops at the tolerance or where it stalls."""
    r = step.residual(y, kappa, exact)
    for iteration in range(limit):
        if np.abs(r).max() < tolerance:
            return y, float(np.abs(r).max()), iteration
        dy = -np.linalg.solve(jacobian(step, y, kappa, exact), r)
        turns = step.h * np.linalg.norm(dy[: 6 * step.nbody].reshape(-1, 6)[:, 3:], axis=-1).max()
        alpha = min(1.0, 1.0 / max(turns, 1e-300))
        while alpha > 1e-7:
            trial = y + alpha * dy
            now = step.h * np.linalg.norm(trial[: 6 * step.nbody].reshape(-1, 6)[:, 3:], axis=-1).max()
            r_trial = step.residual(trial, kappa, exact) if now < 3.1 else np.full_like(r, np.inf)
            if np.linalg.norm(r_trial) < (1.0 - 1e-4 * alpha) * np.linalg.norm(r):
                break
            alpha /= 2.0
        else:
            return y, float(np.abs(r).max()), iteration
        y, r = trial, r_trial
    return y, float(np.abs(r).max()), limit


def interior(step: Step, y: Array) -> bool:
    """Every slack and impulse positive, every cone variable inside its cone."""
    blocks = np.split(y, np.cumsum(step.sizes)[:-1])[2:]
    inside = [block[:2].min() > 0.0 for block in blocks]
    for contact, block in zip(step.scene.contacts, blocks, strict=False):
        if frictional(contact) and contact.law == LINEAR:
            inside.append(block.min() > 0.0)
        elif frictional(contact):
            inside.append(block[2] > np.linalg.norm(block[3:5]))
            inside.append(contact.friction * block[1] > np.linalg.norm(block[5:7]))
    return bool(np.all(inside))


def follow(step: Step, y: Array, k: float, kappa: float, tolerance: float) -> tuple[Array, bool, int]:
    """Smoothed equations solved at k, then down to kappa by factors that shrink where Newton's method fails."""
    rate, count, solved = 0.1, 0, False
    good, k_good = y, k
    while True:
        goal = tolerance if k == kappa else 1e-2 * np.sqrt(k)
        trial, error, n = newton(step, good, k, False, goal, 30)
        count += n
        if error < max(goal, 1e-10):
            good, k_good, solved = trial, k, True
            if k == kappa:
                return good, True, count
            rate = max(rate**1.5, 0.03)
        elif not solved or rate > 0.95:
            return good, False, count
        else:
            rate = np.sqrt(rate)
        k = max(rate * k_good, kappa)


def solve(
    scene: PlainScene, q: Array, v: Array, u: Array, h: float, kappa: float, *, tolerance: float = 1e-13
) -> NaiveSolution:
    """Path following from a large kappa in the smoothed equations, then Newton on the bilinear ones."""
    step = Step(scene, q, v, u, h)
    count, hard = 0, scene.contacts or scene.limits
    for first, speed in ((1e-2, 1.0), (1.0, 1.0), (1e-2, 0.0), (1e2, 0.5), (1e4, 0.0), (kappa, 1.0)):
        k = max(first, kappa) if hard else kappa
        y, reached, n = follow(step, step.start(k, speed * v), k, kappa, tolerance)
        count += n
        if not reached:
            continue
        polished, error, n = newton(step, y, kappa, True, tolerance, 60)
        count += n
        if not interior(step, polished):  # the bilinear equations have other roots
            polished, error = y, float(np.abs(step.residual(y, kappa, True)).max())
        if error < 1e-10 and interior(step, polished):
            return solution(step, polished, error, count)
    raise RuntimeError(f"the reference did not solve its step in {count} iterations")


def solution(step: Step, y: Array, error: float, count: int) -> NaiveSolution:
    """Unknowns in readable form."""
    parts = np.split(y, np.cumsum(step.sizes)[:-1])
    z3 = step.next_poses(parts[0].reshape(-1, 6))
    v = displacements(step.scene, z3, step.z2) / step.h
    ncontact = len(step.scene.contacts)
    forces = [
        step.contact(c, part, z3, 0.0, True)[1][:3] for c, part in zip(step.scene.contacts, parts[2:], strict=False)
    ]
    return NaiveSolution(
        advance(step.scene, step.q2, v, step.h),
        v,
        *z3,
        np.array(forces).reshape(ncontact, 3),
        np.array([part[1] for part in parts[2 + ncontact :]]),
        parts[1],
        error,
        count,
    )
