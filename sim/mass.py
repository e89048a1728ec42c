"""The mass matrix of a tree, eliminated in linear time; of every joint one coordinate after the other."""

from __future__ import annotations

from sim.energy import spatial_inertia
from sim.model import Model, Vector
from sim.work import Work
from solvers.jit import kernel


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
        for d in range(model.body_vadr[i + 1] - 1, model.body_vadr[i] - 1, -1):
            S, U = work.S2[d], work.U[d]
            for k in range(6):
                U[k] = (
                    S[0] * A[k] + S[1] * A[6 + k] + S[2] * A[12 + k]
                    + S[3] * A[18 + k] + S[4] * A[24 + k] + S[5] * A[30 + k]
                )  # fmt: skip
            D = model.dof_armature[d]
            z = p[d]
            for k in range(6):
                D += S[k] * U[k]
                z -= S[k] * f[k]
            if not D > 0.0:
                return False
            D = 1.0 / D
            z *= D
            work.z[d], work.residual[d] = z, D
            for r in range(6):
                c = D * U[r]
                f[r] += U[r] * z
                for k in range(6):
                    A[6 * r + k] -= c * U[k]
        q = model.body_parent[i]
        if q >= 0:
            for k in range(6):
                work.wrench[q, k] += f[k]
            for k in range(36):
                work.A[q, k] += A[k]
    for i in range(n):
        V, q = work.twist[i], model.body_parent[i]
        for k in range(6):
            V[k] = work.twist[q, k] if q >= 0 else 0.0
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            S, U = work.S2[d], work.U[d]
            t = 0.0
            for k in range(6):
                t += U[k] * V[k]
            t = work.z[d] - work.residual[d] * t
            out[d] = t
            for k in range(6):
                V[k] += S[k] * t
    return True
