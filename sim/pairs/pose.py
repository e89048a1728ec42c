"""Where the shapes of a collision are, and how they lie to one another."""

from __future__ import annotations

from sim.collision.kinds import SWAPPED
from sim.frame import place_frame
from sim.model import Matrix, Model
from sim.work import Work
from solvers.compiler import kernel


@kernel
def place_shape(model: Model, work: Work, row: int, i: int, pos: Matrix, rot: Matrix) -> None:
    """World pose of shape `row` on body i, -1 for the world, at the poses pos (nbody, 3), rot (nbody, 9) of bodies."""
    c = model.pair_place[row]
    place_frame(c[:3], c[3:], i, pos, rot, work.shape_pos[row], work.shape_rot[row])


@kernel
def relative_pose(work: Work, j: int, a: int, b: int) -> None:
    """pair_relative[j] = (R_b^T R_a, R_b^T (o_a - o_b)): shape a in the frame of shape b (their rows)."""
    A = work.shape_rot[a]
    B = work.shape_rot[b]
    out = work.pair_relative[j]
    x = work.shape_pos[a, 0] - work.shape_pos[b, 0]
    y = work.shape_pos[a, 1] - work.shape_pos[b, 1]
    z = work.shape_pos[a, 2] - work.shape_pos[b, 2]
    for r in range(3):
        for c in range(3):
            out[3 * r + c] = B[r] * A[c] + B[3 + r] * A[3 + c] + B[6 + r] * A[6 + c]
        out[9 + r] = B[r] * x + B[3 + r] * y + B[6 + r] * z


@kernel
def place_shapes(model: Model, work: Work, first: int, pos: Matrix, rot: Matrix) -> None:
    """World poses of the shapes of the collision whose first pair this is, and of one to the other in its order."""
    k = model.pair_coupling[first]
    place_shape(model, work, 2 * first, model.coupling_body[k, 0], pos, rot)
    place_shape(model, work, 2 * first + 1, model.coupling_body[k, 1], pos, rot)
    swapped = 1 if model.pair_kind[first] >= SWAPPED else 0
    relative_pose(work, first, 2 * first + swapped, 2 * first + 1 - swapped)
