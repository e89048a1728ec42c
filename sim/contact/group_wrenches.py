"""Wrenches of groups of contacts on a mechanism, about its centre of mass."""

from __future__ import annotations

from sim.dynamics.kinematics import tree_poses
from sim.dynamics.momentum_balance import place_origin
from sim.model.data import Data
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from solvers.compiler import Table, kernel
from solvers.rotation import cross
from solvers.types import Cube, Integers, Matrix, Vector


@kernel
def center_of_mass(model: Model, data: Data, q: Vector) -> tuple[float, float, float]:
    """Centre of mass of all bodies at the coordinates q [m]; writes configuration 2."""
    place_origin(model, data, q)
    tree_poses(model, data, q)
    x, y, z, total = 0.0, 0.0, 0.0, 0.0
    for i in range(model.body_parent.shape[0]):
        m = model.body_mass[i]
        x, y, z, total = x + m * data.pos2[i, 0], y + m * data.pos2[i, 1], z + m * data.pos2[i, 2], total + m
    return x / total, y / total, z / total


@kernel
def group_wrenches(
    model_at: Table, data_at: Table, xs: Matrix, forces: Cube, points: Cube, groups: Integers, out: Cube
) -> None:
    """out[r, g] = sum of (f, (p - com) x f) over the contacts of group g: force [N] and torque [N m], world axes.

    xs: (n, nx); forces, points: (n, ncontact, 3); groups: (ncontact,), -1 for a contact in none; out: (n, ngroup, 6).
    """
    model, data = model_view(model_at), data_view(data_at)
    nq = data.theta1.shape[0]
    for r in range(xs.shape[0]):
        x, y, z = center_of_mass(model, data, xs[r, :nq])
        for g in range(out.shape[1]):
            for k in range(6):
                out[r, g, k] = 0.0
        for c in range(groups.shape[0]):
            g, f, p = groups[c], forces[r, c], points[r, c]
            if g >= 0 and (f[0] != 0.0 or f[1] != 0.0 or f[2] != 0.0):
                tx, ty, tz = cross(p[0] - x, p[1] - y, p[2] - z, f[0], f[1], f[2])
                w = out[r, g]
                w[0], w[1], w[2] = w[0] + f[0], w[1] + f[1], w[2] + f[2]
                w[3], w[4], w[5] = w[3] + tx, w[4] + ty, w[5] + tz
