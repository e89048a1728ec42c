"""The mass matrix of a tree, eliminated in linear time; of every joint one coordinate after the other."""

from __future__ import annotations

from sim.elimination import dot_six
from sim.energy import spatial_inertia
from sim.model import Model, Vector
from sim.work import Work
from solvers.jit import kernel


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
def solve_mass(model: Model, work: Work, p: Vector, out: Vector) -> bool:
    """M out = p by elimination from the leaves to the root, one coordinate after the other: M is positive definite.

    up      U = A S,  D = S.U + armature,  z = (p - S.f)/D,      A -= U U^T/D,  f += U z;  both added to the parent's
    down    out = z - U.V/D,  V += S out

    False when M is singular.   Leaves the twists of the bodies in work.twist.
    """
    n = model.body_parent.shape[0]
    spatial_inertia(model, work, work.A)
    for i in range(n):
        for k in range(6):
            work.wrench[i, k] = 0.0
    for i in range(n - 1, -1, -1):
        A, f = work.A[i], work.wrench[i]
        q, first = model.body_parent[i], model.body_vadr[i]
        for d in range(model.body_vadr[i + 1] - 1, first - 1, -1):
            S, U = work.S2[d], work.U[d]
            s0, s1, s2, s3, s4, s5 = S[0], S[1], S[2], S[3], S[4], S[5]
            for k in range(6):
                U[k] = (
                    (s0 * A[k] + s1 * A[6 + k]) + (s2 * A[12 + k] + s3 * A[18 + k]) + (s4 * A[24 + k] + s5 * A[30 + k])
                )
            D = model.dof_armature[d] + dot_six(S, U)
            z = p[d] - dot_six(S, f)
            if not D > 0.0:
                return False
            D = 1.0 / D
            z *= D
            work.z[d], work.residual[d] = z, D
            for r in range(6):
                f[r] += U[r] * z
            if d == first and q >= 0:
                _add_rest(A, U, D, work.A[q])
            elif d > first:
                for r in range(6):
                    for k in range(6):
                        A[6 * r + k] -= D * U[r] * U[k]
        if q >= 0:
            for k in range(6):
                work.wrench[q, k] += f[k]
            if first == model.body_vadr[i + 1]:
                for k in range(36):
                    work.A[q, k] += A[k]
    for i in range(n):
        V, q = work.twist[i], model.body_parent[i]
        for k in range(6):
            V[k] = work.twist[q, k] if q >= 0 else 0.0
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            S = work.S2[d]
            t = work.z[d] - work.residual[d] * dot_six(work.U[d], V)
            out[d] = t
            for k in range(6):
                V[k] += S[k] * t
    return True
