"""Velocities at one moment: of the joints at the node of a state, and of the bodies that joint velocities move."""

from __future__ import annotations

from sim.dynamics.energy import node_velocity
from sim.dynamics.kinematics import tree_poses
from sim.model.data import Data
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from solvers.compiler import Table, kernel
from solvers.rotation import cross
from solvers.types import Matrix, Vector


@kernel
def node_velocities(model_at: Table, data_at: Table, h: float, xs: Matrix, out: Matrix) -> None:
    """out[t] = (M(q) + C)^-1 p of state t, p its momentum by the discrete Legendre transform, C: joints/damper.py.

    xs: (n, nx); out: (n, nv).
    """
    model = model_view(model_at)
    data = data_view(data_at)
    for t in range(xs.shape[0]):
        node_velocity(model, data, h, xs[t])
        for d in range(out.shape[1]):
            out[t, d] = data.dnu[d]


@kernel
def joint_twists(model: Model, data: Data, v: Vector) -> None:
    """data.twist[i] = sum over the joints above body i of S2 v: about O, world axes.   v: (nv,)."""
    for i in range(model.body_parent.shape[0]):
        p = model.body_parent[i]
        for k in range(6):
            w = data.twist[p, k] if p >= 0 else 0.0
            for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
                w += data.S2[d, k] * v[d]
            data.twist[i, k] = w


@kernel
def body_states(model_at: Table, data_at: Table, xs: Matrix, out: Matrix) -> None:
    """out = [position, velocity (world), quaternion, omega (body)] of each body at [q; joint velocities] of each row.

    xs: (n, nx); out: (n * nbody, 13).
    """
    model = model_view(model_at)
    data = data_view(data_at)
    nbody = model.body_parent.shape[0]
    nq = data.theta1.shape[0]
    for k in range(3):
        data.origin[k] = 0.0
    for t in range(xs.shape[0]):
        q = xs[t, :nq]
        tree_poses(model, data, q)
        joint_twists(model, data, xs[t, nq:])
        for i in range(nbody):
            V = data.twist[i]
            x = data.pos2[i]
            R = data.rot2[i]
            z = out[t * nbody + i]
            turn = cross(V[3], V[4], V[5], x[0], x[1], x[2])
            for k in range(3):
                z[k] = x[k]
                z[3 + k] = V[k] + turn[k]
                z[10 + k] = R[k] * V[3] + R[3 + k] * V[4] + R[6 + k] * V[5]
            for k in range(4):
                z[6 + k] = data.quat2[i, k]
