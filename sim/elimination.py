"""Linear-time solution of the reduced Newton system H y = b by elimination from the leaves to the root.

    H = sum over bodies of S2^T A S3nu + joint blocks        (only pairs of joints on one branch are coupled)

H is not symmetric: rows are test directions at configuration 2, columns derivatives of configuration 3. Each joint is
eliminated as one block of up to six unknowns, with pivoting, as in Featherstone's articulated-body algorithm.
"""

from __future__ import annotations

from sim.model import Matrix, Model, Vector
from sim.work import Work
from solvers.jit import inlined, kernel
from solvers.lu import lu_factor, lu_sign, lu_solve, lu_solve_rows


@kernel
def add_children(model: Model, out: Matrix) -> None:
    """out[i] becomes the sum of out[b] over the bodies b of the subtree of i.  (nbody, n)"""
    for i in range(model.body_parent.shape[0] - 1, -1, -1):
        p = model.body_parent[i]
        if p >= 0:
            for k in range(out.shape[1]):
                out[p, k] += out[i, k]


@kernel
def subtree_sums(model: Model, wrench: Matrix, out: Matrix) -> None:
    """out[i] = sum of wrench[b] over the bodies b of the subtree of i.  (nbody, 6)"""
    for i in range(model.body_parent.shape[0]):
        for k in range(6):
            out[i, k] = wrench[i, k]
    add_children(model, out)


@kernel
def dot_six(a: Vector, b: Vector) -> float:
    """a . b of six numbers, as three sums of two: a long sum would wait for itself."""
    return (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3]) + (a[4] * b[4] + a[5] * b[5])


@kernel
def project(model: Model, S: Matrix, subtree: Matrix, out: Vector) -> None:
    """out[d] = S[d] . subtree[body of d].  (nv,)"""
    for d in range(out.shape[0]):
        out[d] = dot_six(S[d], subtree[model.dof_body[d]])


@kernel
def column_and_row(A: Vector, s: Vector, t: Vector, U: Vector, L: Vector) -> None:
    """U = A s, L = t^T A, in one pass over A."""
    s0, s1, s2, s3, s4, s5 = s[0], s[1], s[2], s[3], s[4], s[5]
    l0, l1, l2, l3, l4, l5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for r in range(6):
        a0, a1, a2, a3, a4, a5 = A[6 * r], A[6 * r + 1], A[6 * r + 2], A[6 * r + 3], A[6 * r + 4], A[6 * r + 5]
        f = t[r]
        U[r] = a0 * s0 + a1 * s1 + a2 * s2 + a3 * s3 + a4 * s4 + a5 * s5
        l0, l1, l2, l3, l4, l5 = l0 + f * a0, l1 + f * a1, l2 + f * a2, l3 + f * a3, l4 + f * a4, l5 + f * a5
    L[0], L[1], L[2], L[3], L[4], L[5] = l0, l1, l2, l3, l4, l5


@kernel
def _add_rest(A: Vector, U: Vector, L: Vector, out: Vector) -> None:
    """out += A - U L"""
    l0, l1, l2, l3, l4, l5 = L[0], L[1], L[2], L[3], L[4], L[5]
    for r in range(0, 36, 6):
        f = U[r // 6]
        out[r] += A[r] - f * l0
        out[r + 1] += A[r + 1] - f * l1
        out[r + 2] += A[r + 2] - f * l2
        out[r + 3] += A[r + 3] - f * l3
        out[r + 4] += A[r + 4] - f * l4
        out[r + 5] += A[r + 5] - f * l5


@kernel
def _pass_matrix(work: Work, first: int, end: int, A: Vector, out: Vector) -> None:
    """out += A - U L, U and L of the dofs from first to end; A is used up."""
    for d in range(first, end - 1):
        for r in range(6):
            f = work.U[d, r]
            for k in range(6):
                A[6 * r + k] -= f * work.L[d, k]
    if end > first:
        _add_rest(A, work.U[end - 1], work.L[end - 1], out)
    else:
        for k in range(36):
            out[k] += A[k]


@inlined
def joint_products(model: Model, work: Work, i: int) -> None:
    """U = A S3nu,  L = S2^T A,  D = S2^T U + joint block of joint i, at the articulated matrix of its body.

    L of a root is not computed: nothing is above it.
    """
    d0 = model.body_vadr[i]
    n = model.body_vadr[i + 1] - d0
    A = work.A[i]
    for d in range(d0, d0 + n):
        if model.body_parent[i] >= 0:
            column_and_row(A, work.S3nu[d], work.S2[d], work.U[d], work.L[d])
        else:
            for r in range(6):
                work.U[d, r] = dot_six(A[6 * r : 6 * r + 6], work.S3nu[d])
    D = work.D[i]
    B = work.joint_block[i]
    for a in range(n):
        for b in range(n):
            D[a * n + b] = B[a * n + b] + dot_six(work.S2[d0 + a], work.U[d0 + b])


@kernel
def factor(model: Model, work: Work) -> int:
    """Eliminate the joints from the leaves to the root; work.A is used up.

        U = A S3nu,   D = S2^T U + joint block,   L = D^-1 S2^T A,      A_parent += A - U L

    Returns the sign of det H, 0 when a joint block is singular.
    """
    sign = 1
    for i in range(model.body_parent.shape[0] - 1, -1, -1):
        d0 = model.body_vadr[i]
        n = model.body_vadr[i + 1] - d0
        p = model.body_parent[i]
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
        if p >= 0:
            _pass_matrix(work, d0, d0 + n, work.A[i], work.A[p])
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
            work.z[d] = b[d] - dot_six(work.S2[d], pi)
        if m == 1:
            work.z[d0] *= work.D[i, 0]
        elif m > 1:
            lu_solve(work.D[i], m, int(work.D[i, 36]), work.z, d0)
        q = model.body_parent[i]
        if q < 0:
            continue
        for d in range(d0, d0 + m):
            z = work.z[d]
            for k in range(6):
                pi[k] += work.U[d, k] * z
        for k in range(6):
            p[q, k] += pi[k]
    for i in range(n):
        d0 = model.body_vadr[i]
        end = model.body_vadr[i + 1]
        q = model.body_parent[i]
        Vi = V[i]
        for d in range(d0, end):
            out[d] = work.z[d] - (dot_six(work.L[d], V[q]) if q >= 0 else 0.0)
        for k in range(6):
            Vi[k] = V[q, k] if q >= 0 else 0.0
        for d in range(d0, end):
            y = out[d]
            for k in range(6):
                Vi[k] += work.S3nu[d, k] * y
