"""Steps of higher order: the variational step composed with itself over intervals g_1 h, g_2 h, ... of sum h.

The discrete Lagrangian of a step is symmetric, L_d(q2, q3; h) = -L_d(q3, q2; -h): rotational energy, gravity (half at
either end) and springs (at the middle) do not know which end came first. The map of coordinates and momentum at one
node to those at the next

    -D1 L_d(q2, q3) = p2,    p3 = D2 L_d(q2, q3)

is therefore its own adjoint, symplectic and of second order, and compositions with g_i = g_s+1-i reach order 4, 6, 8
(Yoshida 1990; Hairer, Lubich, Wanner, Geometric Numerical Integration, II.4 and V.3.2), with momentum as exact as
before. Dampers and inputs enter with half of their impulse at either end, which is symmetric too: the order is kept.
Some g_i are negative, for every order above 2 (Goldman and Kaper 1996): contacts and limits cannot be run backwards,
and a damper only as long as it is slow.

    state    x = [q; v], v at the node: p = M(q) v
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.dynamics import joints_below_turn
from sim.interval import arrive, solve_interval
from sim.layout import model_view, work_view
from sim.model import Matrix, Model, Options, Vector, Work
from sim.node import add_forces, momenta_of_velocity, place_node, velocity_of_momenta
from solvers.jit import kernel
from solvers.record import Table
from solvers.status import Status

_SOLVED = int(Status.SOLVED)
_NOT_FINITE = int(Status.NOT_FINITE)
_SINGULAR = int(Status.SINGULAR)
_ANGULAR_STEP = int(Status.ANGULAR_STEP)


class Composition(NamedTuple):
    """A composition, and what a rollout remembers on its way."""

    parts: Vector  # (s,) the g_i
    impulse: Vector  # (nv,) of springs, dampers and inputs at the node so far
    past: NDArray[np.float64]  # (depth, s, nv) velocities of the parts, less that of the node, in the last few steps
    missed: Matrix  # (s, nv) what the guesses of the parts of this step lacked
    blend: Matrix  # (s, s) how what the parts before a part lacked adds up to what it will lack


@kernel
def _predict(composition: Composition, known: int, part: int, v: Vector, out: Vector) -> None:
    """out = v + what this part added to it in the last steps, extrapolated (1; 2, -1; 3, -3, 1; ...), + what the parts
    before it turned out to lack, extrapolated in time.

    known: steps taken so far; v: (nv,) at the node.
    """
    past = composition.past
    depth = min(known, past.shape[0])
    for d in range(v.shape[0]):
        out[d] = v[d]
    c = float(depth)
    for j in range(1, depth + 1):
        row = past[(known - j) % past.shape[0], part]
        for d in range(v.shape[0]):
            out[d] += c * row[d]
        c *= -(depth - j) / (j + 1.0)
    missed = composition.missed
    for d in range(v.shape[0]):
        missed[part, d] = -out[d]
    for j in range(part):
        c = composition.blend[part, j]
        for d in range(v.shape[0]):
            out[d] += c * missed[j, d]


@kernel
def composed_step(
    model: Model, work: Work, options: Options, composition: Composition, known: int, u: Vector, x: Vector,
    report: Vector,
) -> int:  # fmt: skip
    """x = [q; v at the node] one step later, in place; returns the Status.   report: (5,) as in sim/step.py."""
    nq = work.theta1.shape[0]
    q, v = x[:nq], x[nq:]
    impulse, past = composition.impulse, composition.past
    if not joints_below_turn(model, v, options.h):
        return _ANGULAR_STEP
    place_node(model, work, q)
    momenta_of_velocity(model, work, v)
    for d in range(v.shape[0]):
        impulse[d] = 0.0
    before = 0.0
    report[1] = report[2] = report[3] = 0.0
    report[4] = -1.0
    for part in range(composition.parts.shape[0]):
        h = composition.parts[part] * options.h
        add_forces(model, work, 0.5 * (before + h), u, impulse)
        before = h
        _predict(composition, known, part, v, work.nu)
        r = solve_interval(model, work, options, h, q, impulse)
        report[1] += r.iterations
        report[2] = max(report[2], r.residual)
        if r.status != _SOLVED:
            return r.status
        for d in range(v.shape[0]):
            past[known % past.shape[0], part, d] = work.nu[d] - v[d]
            composition.missed[part, d] += work.nu[d]
        if not arrive(model, work, h, q, impulse):
            return _ANGULAR_STEP
    add_forces(model, work, 0.5 * before, u, impulse)
    return _SOLVED if velocity_of_momenta(model, work, impulse, v) else _SINGULAR


@kernel
def roll(
    model_at: Table, work_at: Table, settings: Vector, composition: Composition, us: Matrix, xs: Matrix,
    reports: Matrix,
) -> int:  # fmt: skip
    """xs[t + 1] = step(xs[t], us[t]) from xs[0]; returns the number of solved steps.

    us: (T, nu); xs: (T + 1, nx); reports: (T, 5).
    """
    model = model_view(model_at)
    work = work_view(work_at)
    options = Options(settings[0], settings[1], settings[2], int(settings[3]))
    for t in range(us.shape[0]):
        total = 0.0
        for k in range(xs.shape[1]):
            xs[t + 1, k] = xs[t, k]
        status = composed_step(model, work, options, composition, t, us[t], xs[t + 1], reports[t])
        for k in range(xs.shape[1]):
            total += xs[t + 1, k]
        if status == _SOLVED and not abs(total) < 1e300:
            status = _NOT_FINITE
        reports[t, 0] = status
        if status != _SOLVED:
            return t
    return us.shape[0]
