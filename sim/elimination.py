"""Linear-time solution of the reduced Newton system H y = b by elimination from the leaves to the root.

    H = sum over bodies of S2^T A S3nu + joint blocks        (only pairs of joints on one branch are coupled)

H is not symmetric: rows are test directions at configuration 2, columns derivatives of configuration 3. Each joint is
eliminated as one block of up to six unknowns, with pivoting, as in Featherstone's articulated-body algorithm.
"""

from __future__ import annotations

from sim.model import Matrix, Model, Vector, Work
from solvers.jit import inlined, kernel
from solvers.lu import lu_factor, lu_sign, lu_solve, lu_solve_rows


@kernel
def subtree_sums(model: Model, wrench: Matrix, out: Matrix) -> None:
    """out[i] = sum of wrench[b] over the bodies b of the subtree of i.  (nbody, 6)"""
    n = model.body_parent.shape[0]
    for i in range(n):
        for k in range(6):
            out[i, k] = wrench[i, k]
    for i in range(n - 1, -1, -1):
        p = model.body_parent[i]
        if p >= 0:
            for k in range(6):
                out[p, k] += out[i, k]


@kernel
def project(model: Model, S: Matrix, subtree: Matrix, out: Vector) -> None:
    """out[d] = S[d] . subtree[body of d].  (nv,)"""
    for d in range(out.shape[0]):
        a = S[d]
        f = subtree[model.dof_body[d]]
        out[d] = a[0] * f[0] + a[1] * f[1] + a[2] * f[2] + a[3] * f[3] + a[4] * f[4] + a[5] * f[5]


@inlined
def joint_products(model: Model, work: Work, i: int) -> None:
    """U = A S3nu,  L = S2^T A,  D = S2^T U + joint block of joint i, at the articulated matrix of its body."""
    A = work.A[i]
    d0 = model.body_vadr[i]
    n = model.body_vadr[i + 1] - d0
    for d in range(d0, d0 + n):
        s = work.S3nu[d]
        t = work.S2[d]
        U = work.U[d]
        L = work.L[d]
        for r in range(6):
            U[r] = (
                A[6 * r] * s[0] + A[6 * r + 1] * s[1] + A[6 * r + 2] * s[2]
                + A[6 * r + 3] * s[3] + A[6 * r + 4] * s[4] + A[6 * r + 5] * s[5]
            )  # fmt: skip
        for k in range(6):
            L[k] = (
                t[0] * A[k] + t[1] * A[6 + k] + t[2] * A[12 + k]
                + t[3] * A[18 + k] + t[4] * A[24 + k] + t[5] * A[30 + k]
            )  # fmt: skip
    D = work.D[i]
    B = work.joint_block[i]
    for a in range(n):
        t = work.S2[d0 + a]
        for b in range(n):
            U = work.U[d0 + b]
            dot = t[0] * U[0] + t[1] * U[1] + t[2] * U[2] + t[3] * U[3] + t[4] * U[4] + t[5] * U[5]
            D[a * n + b] = B[a * n + b] + dot


@kernel
def factor(model: Model, work: Work) -> int:
    """Eliminate the joints from the leaves to the root; work.A is overwritten by the articulated matrices.

        U = A S3nu,   D = S2^T U + joint block,   L = D^-1 S2^T A,      A_parent += A - U L

    Returns the sign of det H, 0 when a joint block is singular.
    """
    A = work.A
    sign = 1
    for i in range(model.body_parent.shape[0] - 1, -1, -1):
        d0 = model.body_vadr[i]
        n = model.body_vadr[i + 1] - d0
        p = model.body_parent[i]
        Ai = A[i]
        D = work.D[i]
        joint_products(model, work, i)
        if n == 1:
            if not abs(D[0]) > 1e-300:
                return 0
            if D[0] < 0.0:
                sign = -sign
            D[0] = 1.0 / D[0]
            for k in range(6):
                work.L[d0, k] *= D[0]
        elif n > 1:
            swaps = lu_factor(D, n)
            if swaps < 0:
                return 0
            sign *= lu_sign(D, n, swaps)
            D[36] = float(swaps)
            if p >= 0:
                lu_solve_rows(D, n, swaps, work.L, d0)
        if p < 0:
            continue
        for a in range(n):
            U = work.U[d0 + a]
            L = work.L[d0 + a]
            for r in range(6):
                f = U[r]
                for k in range(6):
                    Ai[6 * r + k] -= f * L[k]
        for k in range(36):
            A[p, k] += Ai[k]
    return sign


@kernel
def solve(model: Model, work: Work, b: Vector, out: Vector) -> None:
    """H out = b with the factors of `factor`; leaves the twists of configuration 3 in work.twist.  out may be b.

    up      p_i += U z,   z = D^-1 (b - S2^T p)
    down    y = z - L V_parent,   V_i = V_parent + S3nu y
    """
    n = model.body_parent.shape[0]
    p = work.subtree
    V = work.twist
    for i in range(n):
        for k in range(6):
            p[i, k] = 0.0
    for i in range(n - 1, -1, -1):
        d0 = model.body_vadr[i]
        m = model.body_vadr[i + 1] - d0
        pi = p[i]
        for d in range(d0, d0 + m):
            t = work.S2[d]
            work.z[d] = b[d] - (t[0] * pi[0] + t[1] * pi[1] + t[2] * pi[2] + t[3] * pi[3] + t[4] * pi[4] + t[5] * pi[5])
        if m == 1:
            work.z[d0] *= work.D[i, 0]
        elif m > 1:
            lu_solve(work.D[i], m, int(work.D[i, 36]), work.z, d0)
        q = model.body_parent[i]
        if q < 0:
            continue
        for a in range(m):
            for k in range(6):
                pi[k] += work.U[d0 + a, k] * work.z[d0 + a]
        for k in range(6):
            p[q, k] += pi[k]
    for i in range(n):
        d0 = model.body_vadr[i]
        m = model.body_vadr[i + 1] - d0
        q = model.body_parent[i]
        Vi = V[i]
        for k in range(6):
            Vi[k] = V[q, k] if q >= 0 else 0.0
        for d in range(d0, d0 + m):
            L = work.L[d]
            y = work.z[d]
            if q >= 0:
                y -= L[0] * Vi[0] + L[1] * Vi[1] + L[2] * Vi[2] + L[3] * Vi[3] + L[4] * Vi[4] + L[5] * Vi[5]
            out[d] = y
        for d in range(d0, d0 + m):
            y = out[d]
            for k in range(6):
                Vi[k] += work.S3nu[d, k] * y
