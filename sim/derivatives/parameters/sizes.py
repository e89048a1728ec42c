"""Parameters of collisions: sizes of their shapes; columns[:, col] -= w dR/d(size).

Distance, normal and point depend on a shape by the surface that is touched, and near it by the corner, edge, face or
ball that is there. When a size grows by ds, that element moves by e ds, as if the whole shape did: a corner of a box
away from the middle, an edge with it (motion along the edge has no effect), the surface of a ball along its normal. So
a size costs as much as a shift, with an e of its own for every point, and no pair of shapes needs more derivatives. The
surface of an ellipsoid also turns where it is touched: to first order that is all that a change of shape does there.
"""

from __future__ import annotations

from sim.contact.collision.witness import NOWHERE, dot
from sim.contact.pairs.pair_contact import gap_normal
from sim.contact.pairs.pair_pose import place_shape
from sim.contact.pairs.taut_string import is_taut
from sim.derivatives.parameters.directions import SIDE
from sim.derivatives.parameters.pair_columns import add_moved_shape, is_felt, pair_floor, row
from sim.derivatives.parameters.taut_string_columns import add_moved_end
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import Bounce, Witness
from sim.model.shape_kinds import SWAPPED, Pair, Size
from solvers.compiler import kernel
from solvers.rotation import Vec3, cross
from solvers.types import Vector


@kernel
def shape_sizes(model: Model, j: int, side: int) -> tuple[float, float]:
    """(radius, half length) of the shape of a (side 0) or b, of a capsule or cylinder."""
    kind = model.pair_kind[j]
    o = 4 * side if kind < SWAPPED else 4 * (1 - side)
    kind %= SWAPPED
    if kind == Pair.POLYTOPE_POLYTOPE or (
        o == 0 and (kind == Pair.POLYTOPE_CYLINDER or kind == Pair.POLYTOPE_ELLIPSOID)
    ):
        return model.pair_sizes[j, o + 1], 0.0
    return model.pair_sizes[j, o], model.pair_sizes[j, o + 1]


@kernel
def axis_and_side(data: Data, s: int, k: int, x: Vec3) -> tuple[Vec3, float]:
    """Axis k of shape s, and the sign of x, from its centre, along it."""
    R = data.shape_rot[s]
    axis = (R[k], R[3 + k], R[6 + k])
    return axis, 1.0 if dot(axis, x) >= 0.0 else -1.0


@kernel
def element_shift(
    model: Model, data: Data, j: int, which: int, phi: float, n: Vec3, p: Vec3, configuration: int
) -> Vec3:
    """e, world axes, of the shape and size `which` of pair j at configuration 1, 2 or 3.

    phi, n, p: distance, normal from b to a, and middle of the two nearest points there.
    """
    side, way = which // SIDE, which % SIDE
    out = 1.0 if side == 0 else -1.0  # n points into a, and out of b
    if way == Size.BALL:
        return -out * n[0], -out * n[1], -out * n[2]
    if way == Size.STRING:  # both ends by half of it
        return 0.5 * out * n[0], 0.5 * out * n[1], 0.5 * out * n[2]
    first = j - model.pair_feature[j]
    s = 2 * first + side
    pos = data.pos1 if configuration == 1 else (data.pos2 if configuration == 2 else data.pos3)
    rot = data.rot1 if configuration == 1 else (data.rot2 if configuration == 2 else data.rot3)
    place_shape(model, data, s, model.coupling_body[model.pair_coupling[j], side], pos, rot)
    radius, half = shape_sizes(model, j, side)
    r = 0.5 * phi + (radius if way == Size.ROD else 0.0)  # from the middle to the surface, or to the segment inside
    o = row(data.shape_pos[s], 0)
    x = (p[0] + out * r * n[0] - o[0], p[1] + out * r * n[1] - o[1], p[2] + out * r * n[2] - o[2])
    if way == Size.SCALE:
        return x
    if way >= Size.SEMI_X:
        axis, d = semi_axis(model, data, j, which)
        k = dot(axis, x) / d
        return k * axis[0], k * axis[1], k * axis[2]
    axis, end = axis_and_side(data, s, way - Size.SIDE_X.value if Size.SIDE_X <= way <= Size.SIDE_Z else 2, x)
    if way == Size.RIM:
        z = end * half
        return (x[0] - z * axis[0]) / radius, (x[1] - z * axis[1]) / radius, (x[2] - z * axis[2]) / radius
    return end * axis[0], end * axis[1], end * axis[2]


@kernel
def semi_axis(model: Model, data: Data, j: int, which: int) -> tuple[Vec3, float]:
    """Direction, world axes, and length of the semi-axis of an ellipsoid that is the size `which`."""
    side, k = which // SIDE, which % SIDE - Size.SEMI_X.value
    R = data.shape_rot[2 * (j - model.pair_feature[j]) + side]
    o = 4 * side if model.pair_kind[j] < SWAPPED else 4 * (1 - side)
    return (R[k], R[3 + k], R[6 + k]), model.pair_sizes[j, o + k]


@kernel
def element_turn(model: Model, data: Data, j: int, which: int, n: Vec3) -> Vec3:
    """By how much the surface of a shape turns where it is touched, world axes: dn = turn x n.

    Points of an ellipsoid move by E x, E = u u^T/d along a semi-axis of length d; its normals by -(I - n n^T) E n, as
    if it turned by E n x n.
    """
    if which % SIDE < Size.SEMI_X:
        return NOWHERE
    u, d = semi_axis(model, data, j, which)
    k = dot(u, n) / d
    return cross(k * u[0], k * u[1], k * u[2], n[0], n[1], n[2])


@kernel
def earlier_shift(model: Model, data: Data, j: int, which: int, b: Vector, configuration: int) -> Vec3:
    """`element_shift` at configuration 1 or 2, from the values of `look_back` (contact/restitution.py) in b."""
    first = configuration == 1
    n = row(b, Bounce.ROW1 if first else Bounce.ROW2)
    p = row(b, Bounce.POINT1 if first else Bounce.POINT2)
    gap = b[Bounce.GAP1 if first else Bounce.GAP2]
    return element_shift(model, data, j, which, gap, n, p, configuration)


@kernel
def add_shapes_size(model: Model, data: Data, h: float, first: int, which: int, w: float, col: int) -> None:
    """A size of a shape of the collision whose first pair this is; which: SIDE side + Size."""
    j = first
    while j < model.pair_kind.shape[0] and (j == first or model.pair_feature[j] > 0):
        if is_felt(model, data, j):
            c, o = model.contact_height.shape[0] + j, data.origin
            b = data.bounce[c]
            floor = 0.0
            if b[Bounce.RESTITUTION] > 0.0:
                e1, e2 = earlier_shift(model, data, j, which, b, 1), earlier_shift(model, data, j, which, b, 2)
                floor = pair_floor(data, c, which // SIDE, e1, e2)
            p = row(data.pair_frame[j], 9)
            e = element_shift(model, data, j, which, data.pair_out[j, Witness.GAP], gap_normal(model, data, j), p, 3)
            if is_taut(model, data, j):  # where it pulls along stays
                add_moved_end(model, data, (j, which // SIDE), (0.0, 0.0, 0.0), e, floor, w, col)
            else:
                n, r = gap_normal(model, data, j), 0.5 * data.pair_out[j, Witness.GAP]
                r = r if which < SIDE else -r  # from the middle to the surface
                x = (p[0] + r * n[0] - o[0], p[1] + r * n[1] - o[1], p[2] + r * n[2] - o[2])
                moved = (e, element_turn(model, data, j, which, n), x)
                add_moved_shape(model, data, h, (j, which // SIDE), moved, floor, w, col)
        j += 1
