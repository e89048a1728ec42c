"""Directions of the forces of loops where two branches of the motion meet at configuration 2.

There a combination of constraints, w = sum of c G, all but vanishes: the links of a parallelogram lie in one line, and
no force along them turns it. On the way through w changes its sign, and its direction on the branch of the motion is

    dw = sum of c (G at 3 - G at 1) / 2        modulo the other rows, in joint coordinates

with 3 where the velocity before leads, then where that of the solution does. It takes the place of w where w is small
against it; for a constraint that is redundant everywhere, dw vanishes as well. A force along dw does no work from 1
to 3.
"""

from __future__ import annotations

from sim.dynamics.displacements import tree_displacements, turn_bodies
from sim.dynamics.joints.joint_motion import Increment
from sim.dynamics.loops.closure import loop_rows
from sim.dynamics.loops.constraint_rows import add_along_path
from sim.model.data import Data
from sim.model.model import Model
from solvers.compiler import kernel
from solvers.types import Matrix, Vector

_MEETING_RESIDUAL = 0.02  # |w| / |dw|
_ROUNDING = 1e-10  # share of the largest w
_MIN_ROW_CHANGE = 0.1  # share of dw in the change of a row; less is a redundant one whose combination changes


@kernel
def _largest(a: Vector) -> float:
    """Largest absolute entry."""
    most = 0.0
    for k in range(a.shape[0]):
        most = max(most, abs(a[k]))
    return most


@kernel
def _add_directions(model: Model, S: Matrix, B: Matrix, sign: float, out: Matrix) -> None:
    """out[row] += sign S^T B, the generalized impulses of unit forces of the rows of loops."""
    for k in range(model.coupling_body.shape[0] - model.loop_ntrans.shape[0], model.coupling_body.shape[0]):
        for row in range(model.coupling_row[k], model.coupling_row[k + 1]):
            add_along_path(model, S, model.coupling_body[k, 0], sign, B[row], out[row])
            add_along_path(model, S, model.coupling_body[k, 1], -sign, B[row], out[row])


@kernel
def _next_pivot(data: Data, first: int, last: int) -> tuple[int, int, float, float]:
    """Row and column of the largest entry of w in the rows that are left, its size, and that of dw."""
    row, col = -1, 0
    best = 0.0
    change = 0.0
    for r in range(first, last):
        if data.loop_used[r] != 0:
            continue
        change = max(change, _largest(data.bifurcation_direction[r]))
        w = data.bifurcation_row[r]
        for c in range(w.shape[0]):
            if abs(w[c]) > best:
                best = abs(w[c])
                row, col = r, c
    return row, col, best, change


@kernel
def _eliminate(data: Data, first: int, last: int, p: int, c: int) -> None:
    """Row p out of the rows that are left: w and dw combined as w says, and dw modulo the row p."""
    w = data.bifurcation_row[p]
    dw = data.bifurcation_direction[p]
    data.loop_used[p] = 1
    for r in range(first, last):
        if data.loop_used[r] != 0:
            continue
        f = data.bifurcation_row[r, c] / w[c]
        for d in range(w.shape[0]):
            data.bifurcation_row[r, d] -= f * w[d]
            data.bifurcation_direction[r, d] -= f * dw[d]
        data.bifurcation_row[r, c] = 0.0
        f = data.bifurcation_direction[r, c] / w[c]
        for d in range(w.shape[0]):
            data.bifurcation_direction[r, d] -= f * w[d]


@kernel
def _set_rows(model: Model, data: Data, h: float, q: Vector, v: Vector) -> None:
    """bifurcation_row = w at configuration 2 and bifurcation_direction = dw, row by row; loop_scale = sizes of dw."""
    for row in range(data.bifurcation_direction.shape[0]):
        for d in range(data.bifurcation_direction.shape[1]):
            data.bifurcation_row[row, d] = 0.0
            data.bifurcation_direction[row, d] = 0.0
    tree_displacements(model, data, Increment(q, v, h), True)
    turn_bodies(data, data.rot3)
    _add_directions(model, data.S2, data.couple_B, 1.0, data.bifurcation_row)
    for m in range(model.loop_ntrans.shape[0]):
        loop_rows(model, data, m, data.pos3, data.rot3, data.couple_G)
    _add_directions(model, data.S3, data.couple_G, 0.5, data.bifurcation_direction)
    for m in range(model.loop_ntrans.shape[0]):
        loop_rows(model, data, m, data.pos1, data.rot1, data.couple_G)
    _add_directions(model, data.S1, data.couple_G, -0.5, data.bifurcation_direction)


@kernel
def lead_loops(model: Model, data: Data, h: float, q: Vector, v: Vector) -> None:
    """bifurcation_direction[row] = dw where it takes the place of a row of couple_B, which is 0 then; their number.

    q: (nq,) configuration 2; v: (nv,) a velocity that leads to 3; couple_B: directions at configuration 2.
    """
    data.bifurcation_count[0] = 0
    pairs = model.coupling_body.shape[0] - model.loop_ntrans.shape[0]
    first, last = int(model.coupling_row[pairs]), int(model.coupling_row[model.coupling_body.shape[0]])
    _set_rows(model, data, h, q, v)
    size = 0.0
    for row in range(first, last):
        data.loop_used[row] = 0
        data.loop_scale[row] = _largest(data.bifurcation_direction[row])
        size = max(size, _largest(data.bifurcation_row[row]))
    for _ in range(first, last):
        row, col, best, change = _next_pivot(data, first, last)
        if row < 0 or best < _MEETING_RESIDUAL * change:
            break
        _eliminate(data, first, last, row, col)
    for row in range(first, last):
        dw = _largest(data.bifurcation_direction[row])
        led = data.loop_used[row] == 0 and dw > max(_MIN_ROW_CHANGE * data.loop_scale[row], _ROUNDING * size)
        for d in range(data.bifurcation_direction.shape[1]):
            data.bifurcation_direction[row, d] = data.bifurcation_direction[row, d] / dw if led else 0.0
        for c in range(6):
            data.couple_B[row, c] = 0.0 if led else data.couple_B[row, c]
        data.bifurcation_count[0] += 1 if led else 0
