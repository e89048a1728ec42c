"""The manifold of states: addresses of the tangent components, and differences between states in compiled loops."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.simulator.simulator import Simulator
from solvers.compiler import kernel, users_callee
from solvers.rotation import inverse_right_jacobian, quat_exp, quat_log, quat_mul

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Integers = NDArray[np.int64]


_NEXT, _AFTER = np.array([1, 2, 0]), np.array([2, 0, 1])  # cyclic


def cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """a x b along the last axis, (..., 3); leading axes are broadcast. A tenth of the time of `np.cross`."""
    return a[..., _NEXT] * b[..., _AFTER] - a[..., _AFTER] * b[..., _NEXT]


def tangent_layout(sim: Simulator, x: Vector) -> Integers:
    """(ndx,) address in x of each scalar tangent component; -(a + 1) for the three of a quaternion that starts at a.

    Found by moving each component in the simulator: one that changes a single coordinate is a scalar.
    """
    layout = np.empty(sim.ndx, dtype=np.int64)
    address, i = 0, 0
    while i < sim.nv:
        step = np.zeros(sim.ndx)
        step[i] = 0.1
        change = sim.integrate(x, step)[: sim.nq] - x[: sim.nq]
        if abs(change[address] - 0.1) < 1e-9 and np.count_nonzero(np.abs(change) > 1e-12) == 1:
            layout[i] = address
            address, i = address + 1, i + 1
        else:
            layout[i : i + 3] = -(address + 1)
            address, i = address + 4, i + 3
    layout[sim.nv :] = np.arange(sim.nq, sim.nx)
    return layout


@kernel
def state_difference(layout: Integers, x: Vector, reference: Vector, out: Vector) -> None:
    """out = x (-) reference, in the tangent space at the reference: scalars by difference, quaternions by
    log(reference^* q).
    """
    i = 0
    while i < layout.shape[0]:
        a = layout[i]
        if a >= 0:
            out[i] = x[a] - reference[a]
            i += 1
        else:
            a = -a - 1
            r0, r1, r2, r3 = reference[a], reference[a + 1], reference[a + 2], reference[a + 3]
            q = quat_mul(r0, -r1, -r2, -r3, x[a], x[a + 1], x[a + 2], x[a + 3])
            out[i], out[i + 1], out[i + 2] = quat_log(q[0], q[1], q[2], q[3])
            i += 3


@kernel
def state_residual(layout: Integers, xs: Matrix, knots: Integers, reference: Matrix, out: Matrix) -> None:
    """out[i] = xs[knots[i]] (-) reference[i]."""
    for row in range(knots.shape[0]):
        state_difference(layout, xs[knots[row]], reference[row], out[row])


@users_callee
def displace(layout: Integers, x: Vector, i: int, step: float, out: Vector) -> None:
    """The numbers of component i of out = x (+) step e_i; the others keep their values, and a step of 0 restores x."""
    a = layout[i]
    if a >= 0:
        out[a] = x[a] + step
        return
    first = i
    while first > 0 and layout[first - 1] == a:
        first -= 1
    a = -a - 1
    w, dx, dy, dz = quat_exp(
        step if i == first else 0.0, step if i == first + 1 else 0.0, step if i == first + 2 else 0.0
    )
    out[a], out[a + 1], out[a + 2], out[a + 3] = quat_mul(x[a], x[a + 1], x[a + 2], x[a + 3], w, dx, dy, dz)


@kernel
def add_rotation_block(r: Vector, gradient: Vector, hessian: Vector, i: int, c: int, g: Vector, H: Matrix) -> None:
    """g[c:c+3] += J^T gradient[i:i+3],  H[c:c+3, c:c+3] += J^T diag(hessian[i:i+3]) J,  J = d log(exp(r) exp(d))/dd."""
    J = inverse_right_jacobian(r[i], r[i + 1], r[i + 2])
    for k in range(3):
        for row in range(3):
            a = J[3 * k + row]
            g[c + row] += a * gradient[i + k]
            for column in range(3):
                H[c + row, c + column] += a * hessian[i + k] * J[3 * k + column]
