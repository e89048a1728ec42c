"""The mass matrix of a tree, eliminated in linear time; of every joint one coordinate after the other."""

from __future__ import annotations

from sim.dynamics.elimination import dot_six
from sim.dynamics.energy import spatial_inertia
from sim.model.data import Data
from sim.model.model import Model
from solvers.compiler import kernel
from solvers.dense import clear
from solvers.types import Matrix, Vector


@kernel
def _add_rest(A: Vector, U: Vector, D: float, out: Vector) -> None:
    """out += A - D U U^T: A without the last coordinate of its joint, on the way to the parent's."""
    u0, u1, u2, u3, u4, u5 = U[0], U[1], U[2], U[3], U[4], U[5]
    for r in range(6):
        c, k = D * U[r], 6 * r
        out[k] += A[k] - c * u0
        out[k + 1] += A[k + 1] - c * u1
        out[k + 2] += A[k + 2] - c * u2
        out[k + 3] += A[k + 3] - c * u3
        out[k + 4] += A[k + 4] - c * u4
        out[k + 5] += A[k + 5] - c * u5


@kernel
def eliminate_mass(
    model: Model, S: Matrix, A: Matrix, f: Matrix, U: Matrix, z: Vector, diagonal: Vector, p: Vector
) -> bool:
    """M = S^T A S + armature + C from the leaves to the root, one coordinate after the other: M is positive definite.

        U = A S,  D = S.U + armature + C,  z = (p - S.f)/D,      A -= U U^T/D,  f += U z;  both added to the parent's

    diagonal: C in, the diagonal of a matrix; 1/D out. False when M is singular.
    S, U: (nv, 6); A: (nbody, 36), destroyed; f: (nbody, 6), zeros, destroyed; z, diagonal, p: (nv,).
    """
    for i in range(model.body_parent.shape[0] - 1, -1, -1):
        a, g = A[i], f[i]
        q, first = model.body_parent[i], model.body_vadr[i]
        for d in range(model.body_vadr[i + 1] - 1, first - 1, -1):
            u = U[d]
            s0, s1, s2, s3, s4, s5 = S[d, 0], S[d, 1], S[d, 2], S[d, 3], S[d, 4], S[d, 5]
            for k in range(6):
                u[k] = (
                    (s0 * a[k] + s1 * a[6 + k]) + (s2 * a[12 + k] + s3 * a[18 + k]) + (s4 * a[24 + k] + s5 * a[30 + k])
                )
            D = model.dof_armature[d] + diagonal[d] + dot_six(S[d], u)
            if not D > 0.0:
                return False
            D = 1.0 / D
            z[d], diagonal[d] = (p[d] - dot_six(S[d], g)) * D, D
            for r in range(6):
                g[r] += u[r] * z[d]
            if d == first and q >= 0:
                _add_rest(a, u, D, A[q])
            elif d > first:
                for r in range(6):
                    for k in range(6):
                        a[6 * r + k] -= D * u[r] * u[k]
        if q >= 0:
            for k in range(6):
                f[q, k] += g[k]
            if first == model.body_vadr[i + 1]:
                for k in range(36):
                    A[q, k] += a[k]
    return True


@kernel
def mass_velocities(model: Model, S: Matrix, U: Matrix, z: Vector, diagonal: Vector, V: Matrix, out: Vector) -> None:
    """out = M^-1 p after `eliminate_mass`, on the way down    out = z - U.V/D,  V += S out.

    V: (nbody, 6), the twists of the bodies, out. `out` may be z.
    """
    for i in range(model.body_parent.shape[0]):
        W, q = V[i], model.body_parent[i]
        for k in range(6):
            W[k] = V[q, k] if q >= 0 else 0.0
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            t = z[d] - diagonal[d] * dot_six(U[d], W)
            out[d] = t
            for k in range(6):
                W[k] += S[d, k] * t


@kernel
def solve_mass(model: Model, data: Data, p: Vector, out: Vector) -> bool:
    """M out = p by `eliminate_mass`.   False when M is singular.   Leaves the twists of the bodies in data.twist."""
    spatial_inertia(model, data.origin, data.pos2, data.inertia_world, data.A)
    clear(data.wrench)
    for d in range(p.shape[0]):
        data.residual[d] = 0.0
    if not eliminate_mass(model, data.S2, data.A, data.wrench, data.U, data.z, data.residual, p):
        return False
    mass_velocities(model, data.S2, data.U, data.z, data.residual, data.twist, out)
    return True
