"""Poses of the shapes of a collision, and their relative pose."""

from __future__ import annotations

from math import sqrt

from sim.dynamics.frame_placement import place_frame
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import PairBound, RelativePose
from sim.model.shape_kinds import SWAPPED
from solvers.compiler import kernel
from solvers.rotation import three
from solvers.types import Matrix


@kernel
def place_shape(model: Model, data: Data, row: int, i: int, pos: Matrix, rot: Matrix) -> None:
    """World pose of shape `row` on body i, -1 for the world, at the poses pos (nbody, 3), rot (nbody, 9) of bodies."""
    c = model.pair_place[row]
    place_frame(c[:3], c[3:], i, pos, rot, data.shape_pos[row], data.shape_rot[row])


@kernel
def relative_pose(data: Data, j: int, a: int, b: int) -> None:
    """pair_relative[j] = (R_b^T R_a, R_b^T (o_a - o_b)): shape a in the frame of shape b (their rows)."""
    A = data.shape_rot[a]
    B = data.shape_rot[b]
    out = data.pair_relative[j]
    x = data.shape_pos[a, 0] - data.shape_pos[b, 0]
    y = data.shape_pos[a, 1] - data.shape_pos[b, 1]
    z = data.shape_pos[a, 2] - data.shape_pos[b, 2]
    for r in range(3):
        for c in range(3):
            out[3 * r + c] = B[r] * A[c] + B[3 + r] * A[3 + c] + B[6 + r] * A[6 + c]
        out[RelativePose.CENTER + r] = B[r] * x + B[3 + r] * y + B[6 + r] * z


@kernel
def place_shapes(model: Model, data: Data, first: int, pos: Matrix, rot: Matrix) -> None:
    """World poses of the shapes of the collision whose first pair this is, and of one to the other in its order."""
    k = model.pair_coupling[first]
    place_shape(model, data, 2 * first, model.coupling_body[k, 0], pos, rot)
    place_shape(model, data, 2 * first + 1, model.coupling_body[k, 1], pos, rot)
    swapped = 1 if model.pair_kind[first] >= SWAPPED else 0
    relative_pose(data, first, 2 * first + swapped, 2 * first + 1 - swapped)


@kernel
def balls_apart(model: Model, data: Data, j: int) -> float:
    """Distance of the balls around the shapes of the collision that begins at pair j, at pair_relative: theirs is not
    less.
    """
    x, y, z = three(data.pair_relative[j], RelativePose.CENTER)
    return sqrt(x * x + y * y + z * z) - model.pair_bound[j, PairBound.RADII]
