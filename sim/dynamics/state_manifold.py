"""States x = [q; v] on their manifold: integrate and difference, with quaternions by right perturbation."""

from __future__ import annotations

from sim.dynamics.kinematics import displace
from sim.model.layout import model_view
from sim.model.model import Model
from solvers.compiler import Table, kernel
from solvers.rotation import quat_log, quat_mul
from solvers.types import Matrix, Vector


@kernel
def configuration_difference(model: Model, q0: Vector, q1: Vector, out: Vector) -> None:
    """out = q1 (-) q0, the inverse of q1 = q0 (+) out.

        scalar coordinates    q1 - q0
        quaternions           log(q0^* q1), a rotation vector of angle at most pi

    out: (nv,).
    """
    for i in range(model.body_parent.shape[0]):
        a = model.body_qadr[i]
        d = model.body_vadr[i]
        n = model.body_vadr[i + 1] - d
        quaternion = model.joint_nrot[i] == 3
        if quaternion:
            n -= 3
        for _ in range(n):
            out[d] = q1[a] - q0[a]
            a += 1
            d += 1
        if quaternion:
            t = quat_mul(q0[a], -q0[a + 1], -q0[a + 2], -q0[a + 3], q1[a], q1[a + 1], q1[a + 2], q1[a + 3])
            r = quat_log(t[0], t[1], t[2], t[3])
            for k in range(3):
                out[d + k] = r[k]


@kernel
def integrate_state(model: Model, x: Vector, dx: Vector, out: Vector) -> None:
    """out = x (+) dx = [q (+) dq; v + dv].   x, out: (nq + nv,); dx: (2 nv,)."""
    nv = model.dof_body.shape[0]
    nq = x.shape[0] - nv
    displace(model, x[:nq], dx[:nv], 1.0, out[:nq])
    for d in range(nv):
        out[nq + d] = x[nq + d] + dx[nv + d]


@kernel
def state_difference(model: Model, x0: Vector, x1: Vector, out: Vector) -> None:
    """out = x1 (-) x0 with x0 (+) out = x1.   x0, x1: (nq + nv,); out: (2 nv,)."""
    nv = model.dof_body.shape[0]
    nq = x0.shape[0] - nv
    configuration_difference(model, x0[:nq], x1[:nq], out[:nv])
    for d in range(nv):
        out[nv + d] = x1[nq + d] - x0[nq + d]


@kernel
def integrate_states(model_at: Table, xs: Matrix, dxs: Matrix, out: Matrix) -> None:
    """`integrate_state` row by row.   xs, out: (n, nx); dxs: (n, ndx)."""
    model = model_view(model_at)
    for t in range(xs.shape[0]):
        integrate_state(model, xs[t], dxs[t], out[t])


@kernel
def state_differences(model_at: Table, x0s: Matrix, x1s: Matrix, out: Matrix) -> None:
    """`state_difference` row by row.   x0s, x1s: (n, nx); out: (n, ndx)."""
    model = model_view(model_at)
    for t in range(x0s.shape[0]):
        state_difference(model, x0s[t], x1s[t], out[t])


@kernel
def normalize_state(model: Model, x: Vector, tolerance: float) -> int:
    """`normalise_quaternions` of one state: -1, or the body."""
    for i in range(model.body_parent.shape[0]):
        if model.joint_nrot[i] == 3:
            a = model.body_qadr[i] + model.joint_ntrans[i]
            s = (x[a] ** 2 + x[a + 1] ** 2 + x[a + 2] ** 2 + x[a + 3] ** 2) ** 0.5
            if not abs(s - 1.0) <= tolerance:
                return i
            if abs(s - 1.0) > 1e-12:
                for k in range(4):
                    x[a + k] /= s
    return -1


@kernel
def normalize_quaternions(model_at: Table, xs: Matrix, tolerance: float) -> int:
    """Scale the quaternions of every row to length one, in place, unless they are so to 1e-12 already.

    Returns -1, or row * nbody + body of the first one that is off by more than the tolerance.   xs: (n, nx).
    """
    model = model_view(model_at)
    for t in range(xs.shape[0]):
        body = normalize_state(model, xs[t], tolerance)
        if body >= 0:
            return t * model.body_parent.shape[0] + body
    return -1
