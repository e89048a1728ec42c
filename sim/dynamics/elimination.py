"""Linear-time solution of the reduced Newton system H y = b by elimination from the leaves to the root.

    H = sum over bodies of S2^T A S3nu + joint blocks        (only pairs of joints on one branch are coupled)

H is not symmetric: rows are test directions at configuration 2, columns derivatives of configuration 3. Each joint is
eliminated as one block of up to six unknowns, with pivoting, as in Featherstone's articulated-body algorithm.
"""

from __future__ import annotations

from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import JointFactor
from solvers.compiler import inlined, kernel
from solvers.lanes import Six, dot_lanes, load, minus_outer, plus, put, six, store, zeros
from solvers.lu import lu_factor, lu_sign, lu_solve, lu_solve_lanes
from solvers.types import Matrix, Vector

Twist = tuple[float, float, float, float, float, float]


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
def numbers(s: Vector) -> Twist:
    """Six numbers, read once: the compiler cannot tell that intermediate writes do not alias them."""
    return s[0], s[1], s[2], s[3], s[4], s[5]


@kernel
def times_row(A: Vector, k: int, s: Twist) -> float:
    """A[k : k + 6] . s, as three sums of two: a long sum would wait for itself."""
    return (A[k] * s[0] + A[k + 1] * s[1]) + (A[k + 2] * s[2] + A[k + 3] * s[3]) + (A[k + 4] * s[4] + A[k + 5] * s[5])


@kernel
def dot_six(a: Vector, b: Vector) -> float:
    """a . b of six numbers."""
    return times_row(a, 0, numbers(b))


@kernel
def project(model: Model, S: Matrix, subtree: Matrix, out: Vector) -> None:
    """out[d] = S[d] . subtree[body of d].  (nv,)"""
    for d in range(out.shape[0]):
        out[d] = dot_six(S[d], subtree[model.dof_body[d]])


@inlined
def _joint_products(model: Model, data: Data, i: int, a: Six) -> None:
    """U = A S3nu,  L = S2^T A,  D = S2^T U + joint block of joint i, at the articulated matrix A of its body.

    a: the rows of A, which are in data.articulated, too. L of a root is not computed: nothing is above it.
    """
    d0 = model.body_vadr[i]
    n = model.body_vadr[i + 1] - d0
    for d in range(d0, d0 + n):
        s = numbers(data.S3nu[d])
        for r in range(6):
            data.U[d, r] = times_row(data.articulated[6 * i + r], 0, s)
        if model.body_parent[i] >= 0:
            store(data.L, d, 0, dot_lanes(data.S2, d, 0, a))
    D = data.D[i]
    B = data.joint_block[i]
    for j in range(n):
        for k in range(n):
            D[j * n + k] = B[j * n + k] + dot_six(data.S2[d0 + j], data.U[d0 + k])


@kernel
def factor(model: Model, data: Data) -> int:
    """`factor_of` the matrices in data.A."""
    return factor_of(model, data, data.A)


@kernel
def factor_of(model: Model, data: Data, A: Matrix) -> int:
    """Eliminate the joints from the leaves to the root.   A: (nbody, 36), matrices of the bodies alone.

        U = A S3nu,   D = S2^T U + joint block,   L = D^-1 S2^T A,      A_parent += A - U L

    Returns the sign of det H, 0 when a joint block is singular.
    """
    sign = 1
    P = data.articulated
    for i in range(model.body_parent.shape[0]):
        if model.body_leaf[i] == 0:
            put(P, 6 * i, 0, zeros())
    for i in range(model.body_parent.shape[0] - 1, -1, -1):
        d0 = model.body_vadr[i]
        n = model.body_vadr[i + 1] - d0
        p = model.body_parent[i]
        D = data.D[i]
        a = load(A, i, 0), load(A, i, 6), load(A, i, 12), load(A, i, 18), load(A, i, 24), load(A, i, 30)
        if model.body_leaf[i] == 0:
            a = plus(a, six(P, 6 * i, 0))
        put(P, 6 * i, 0, a)
        _joint_products(model, data, i, a)
        if n == 1:
            if not abs(D[JointFactor.INVERSE]) > 1e-300:
                return 0
            if D[JointFactor.INVERSE] < 0.0:
                sign = -sign
            D[JointFactor.INVERSE] = 1.0 / D[JointFactor.INVERSE]
            store(data.L, d0, 0, D[JointFactor.INVERSE] * load(data.L, d0, 0))
        elif n > 1:
            swaps = lu_factor(D, n)
            if swaps < 0:
                return 0
            sign *= lu_sign(D, n, swaps)
            D[JointFactor.SWAPS] = float(swaps)
            if p >= 0:
                lu_solve_lanes(D, n, swaps, data.L, d0, 0)
        if p >= 0:
            for d in range(d0, d0 + n):
                a = minus_outer(a, data.U[d], load(data.L, d, 0))
            put(P, 6 * p, 0, plus(six(P, 6 * p, 0), a))
    return sign


@kernel
def solve(model: Model, data: Data, b: Vector, out: Vector) -> None:
    """H out = b with the factors of `factor`; leaves the twists of configuration 3 in data.twist.  out may be b.

    up      p_i += U z,   z = D^-1 (b - S2^T p)
    down    y = z - L V_parent,   V_i = V_parent + S3nu y
    """
    n = model.body_parent.shape[0]
    p = data.subtree
    V = data.twist
    for i in range(n):
        for k in range(6):
            p[i, k] = 0.0
    for i in range(n - 1, -1, -1):
        d0 = model.body_vadr[i]
        m = model.body_vadr[i + 1] - d0
        pi = p[i]
        for d in range(d0, d0 + m):
            data.z[d] = b[d] - dot_six(data.S2[d], pi)
        if m == 1:
            data.z[d0] *= data.D[i, JointFactor.INVERSE]
        elif m > 1:
            lu_solve(data.D[i], m, int(data.D[i, JointFactor.SWAPS]), data.z, d0)
        q = model.body_parent[i]
        if q < 0:
            continue
        for d in range(d0, d0 + m):
            z = data.z[d]
            for k in range(6):
                pi[k] += data.U[d, k] * z
        for k in range(6):
            p[q, k] += pi[k]
    for i in range(n):
        d0 = model.body_vadr[i]
        end = model.body_vadr[i + 1]
        q = model.body_parent[i]
        Vi = V[i]
        for d in range(d0, end):
            out[d] = data.z[d] - (dot_six(data.L[d], V[q]) if q >= 0 else 0.0)
        for k in range(6):
            Vi[k] = V[q, k] if q >= 0 else 0.0
        for d in range(d0, end):
            y = out[d]
            for k in range(6):
                Vi[k] += data.S3nu[d, k] * y
