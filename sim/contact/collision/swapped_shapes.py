"""Exchange of the two shapes of a contact, for obstacles whose shape comes first in the order of its pair."""

from __future__ import annotations

from sim.contact.collision.box import column, to_a
from sim.contact.collision.witness import axis, dot
from sim.model.model import Model
from sim.model.record_columns import Witness
from sim.model.slots import Slot
from solvers.compiler import inner_kernel, optional
from solvers.rotation import Vec3, cross, put_three, three
from solvers.types import Vector


@inner_kernel
def _columns(X: Vector, first: int, k: int) -> Vec3:
    """Column k of the 3 x 6 matrix that begins at `first`."""
    return X[first + k], X[first + 6 + k], X[first + 12 + k]


@inner_kernel
def _turn(R: Vector, r: Vector, out: Vector, first: int, sign: float, arm: Vec3, whole: float) -> None:
    """out[first : first + 18] = sign R^T (derivative of a vector in b's frame) + its motion with b

    The twist (v, w) of b, seen from a, is for b a twist of a: w' = -R w, v' = -R v + R w x r.
    arm: displacement with b, (whole v +) w x arm.
    """
    c0, c1, c2 = _columns(out, first, 0), _columns(out, first, 1), _columns(out, first, 2)
    c3, c4, c5 = _columns(out, first, 3), _columns(out, first, 4), _columns(out, first, 5)
    for k in range(6):
        g = column(R, k % 3)
        e = axis(k % 3, 1.0)
        if k < 3:
            y = (-g[0], -g[1], -g[2])
            w = (0.0, 0.0, 0.0)
            m = (whole * e[0], whole * e[1], whole * e[2])
        else:
            y = cross(g[0], g[1], g[2], r[0], r[1], r[2])
            w = (-g[0], -g[1], -g[2])
            m = cross(e[0], e[1], e[2], arm[0], arm[1], arm[2])
        d = (
            dot((c0[0], c1[0], c2[0]), y) + dot((c3[0], c4[0], c5[0]), w),
            dot((c0[1], c1[1], c2[1]), y) + dot((c3[1], c4[1], c5[1]), w),
            dot((c0[2], c1[2], c2[2]), y) + dot((c3[2], c4[2], c5[2]), w),
        )
        x = to_a(R, d)
        for i in range(3):
            out[first + 6 * i + k] = sign * x[i] + m[i]


@inner_kernel
def exchange(R: Vector, r: Vector, out: Vector) -> None:
    """out of a against b, in b's frame, made that of b against a, in a's frame.  R, r: pose of a in the frame of b.

    n' = -R^T n,   p' = R^T (p - r),   derivatives by the twist of b about the origin of a
    """
    n, p = three(out, Witness.NORMAL), three(out, Witness.POINT)
    n = to_a(R, (-n[0], -n[1], -n[2]))
    p = to_a(R, (p[0] - r[0], p[1] - r[1], p[2] - r[2]))
    _turn(R, r, out, Witness.NORMAL_RATE, -1.0, n, 0.0)
    _turn(R, r, out, Witness.POINT_RATE, 1.0, p, 1.0)
    put_three(n, Witness.NORMAL, out)
    put_three(p, Witness.POINT, out)


@optional(Slot.EXCHANGE_SHAPES)
def exchange_shapes(model: Model, R: Vector, r: Vector, out: Vector) -> None:
    """`exchange`, for pairs that are not of cylinders."""
    exchange(R, r, out)
