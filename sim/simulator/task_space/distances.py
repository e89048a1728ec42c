"""Distances of the shapes of two bodies, or of a body and an obstacle, by state.

Each contact point of a collision has a distance; the shapes are apart by the least of them. A point that the shapes do
not have at a pose counts as 1 m away. The elements that make a point are chosen at every pose: at a change of elements
the distance is continuous, and its derivative is that of one side.

    dphi = n . (v_a + w_a x p - v_b - w_b x p)      n from b to a, p midway between the nearest points
"""

from __future__ import annotations

from sim.contact.collision.collide import arrange, choose
from sim.contact.collision.edge_axes import OPEN
from sim.contact.pairs.pair_contact import is_absent
from sim.contact.pairs.pair_pose import place_shapes
from sim.dynamics.kinematics import tree_poses
from sim.model.data import Data
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from sim.model.record_columns import Witness
from sim.simulator.task_space.knot_rows import Rows, carried
from solvers.compiler import Table, kernel
from solvers.dense import clear
from solvers.rotation import Vec3, rotate, three
from solvers.types import Vector


@kernel
def find_points(model: Model, data: Data, first: int) -> None:
    """pair_out of all points of the collision that begins at pair `first`, at configuration 2."""
    place_shapes(model, data, first, data.pos2, data.rot2)
    kind, sizes, pose = model.pair_kind[first], model.pair_sizes[first], data.pair_relative[first]
    faces = arrange(model, kind, sizes, pose[:9], pose[9:], OPEN)
    j = first
    while j < model.pair_kind.shape[0] and (j == first or model.pair_feature[j] > 0):
        choose(model, kind, j - first, faces, sizes, pose[:9], pose[9:], data.pair_out[j])
        j += 1


@kernel
def add_side(model: Model, data: Data, i: int, sign: float, n: Vec3, p: Vec3, out: Vector) -> None:
    """out += sign n . (velocity of the point p of body i) by dq."""
    while i >= 0:
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            v = carried(data.S2, d, p)
            out[d] += sign * (n[0] * v[0] + n[1] * v[1] + n[2] * v[2])
        i = model.body_parent[i]


@kernel
def distances(model_at: Table, data_at: Table, rows: Rows) -> None:
    """Distance of every pair at all knots [m].   values: (m, npair)."""
    model = model_view(model_at)
    data = data_view(data_at)
    for k in range(3):
        data.origin[k] = 0.0
    for row in range(rows.knots.shape[0]):
        tree_poses(model, data, rows.xs[rows.knots[row], : data.theta1.shape[0]])
        if rows.jacobians.shape[0] > 0:
            clear(rows.jacobians[row])
        first = 0
        for j in range(model.pair_kind.shape[0]):
            if model.pair_feature[j] == 0:
                first = j
                find_points(model, data, j)
            absent = is_absent(data, j)
            rows.values[row, j] = 1.0 if absent else data.pair_out[j, Witness.GAP]
            if rows.jacobians.shape[0] > 0 and not absent:
                s = 2 * first + 1
                n = rotate(data.shape_rot, s, *three(data.pair_out[j], Witness.NORMAL))
                r = rotate(data.shape_rot, s, *three(data.pair_out[j], Witness.POINT))
                p = (r[0] + data.shape_pos[s, 0], r[1] + data.shape_pos[s, 1], r[2] + data.shape_pos[s, 2])
                bodies = model.coupling_body[model.pair_coupling[j]]
                add_side(model, data, bodies[0], 1.0, n, p, rows.jacobians[row, j])
                add_side(model, data, bodies[1], -1.0, n, p, rows.jacobians[row, j])
