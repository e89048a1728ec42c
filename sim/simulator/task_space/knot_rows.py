"""Rows: the knots of a trajectory at which a quantity is evaluated, and the buffers for its values and derivatives.

Velocities are the mean ones of the interval that led to a state, as in `Simulator.maximal`: differences of places over
the time step. They are functions of the state alone, and exact.
"""

from __future__ import annotations

from typing import NamedTuple

from sim.model.data import Data
from solvers.compiler import kernel
from solvers.rotation import Vec3, cross, inverse_right_jacobian, quat_log, rotate, times, transposed_times
from solvers.types import Cube, Integers, Matrix, Vector


class Rows(NamedTuple):
    """Knots, and the buffers that a kernel fills for each."""

    xs: Matrix  # (T + 1, nx) states, in
    us: Matrix  # (T, nu) inputs, in
    knots: Integers  # (m,), in
    values: Matrix  # (m, d)
    jacobians: Cube  # (m, d, ndx + nu) derivatives by tangent state and input, or (0, d, ndx + nu) for values alone


@kernel
def carried(S: Matrix, d: int, x: Vec3) -> Vec3:
    """Velocity of the point x under column d, a twist about the origin of the world: v + a x x."""
    u, v, w = cross(S[d, 3], S[d, 4], S[d, 5], x[0], x[1], x[2])
    return S[d, 0] + u, S[d, 1] + v, S[d, 2] + w


@kernel
def point_at(data: Data, i: int, p: Vec3, second: bool) -> Vec3:
    """Place of the point p of body i at configuration 2 or 1; p from the centre of mass, body axes."""
    pos = data.pos2 if second else data.pos1
    r = rotate(data.rot2 if second else data.rot1, i, p[0], p[1], p[2])
    return pos[i, 0] + r[0], pos[i, 1] + r[1], pos[i, 2] + r[2]


@kernel
def point_move(data: Data, i: int, p: Vec3) -> Vec3:
    """Displacement of the point p of body i from configuration 1 to 2."""
    a = rotate(data.rot2, i, p[0], p[1], p[2])
    b = rotate(data.rot1, i, p[0], p[1], p[2])
    m = data.move_in[i]
    return m[0] + (a[0] - b[0]), m[1] + (a[1] - b[1]), m[2] + (a[2] - b[2])


@kernel
def body_rotation(data: Data, i: int) -> Vec3:
    """Rotation vector t of body i from configuration 1 to 2, world axes."""
    w = data.turn_in[i]
    return quat_log(w[0], w[1], w[2], w[3])


@kernel
def rotation_rates(data: Data, t: Vec3, d: int) -> tuple[Vec3, Vec3]:
    """Derivatives of the rotation vector t = log(q2 q1^*) by dof d of the coordinates, and of the velocities:

        Jl^-1 S2_a - Jr^-1 S1_a,    -Jr^-1 S1v_a,    Jl^-1 = (Jr^-1)^T

    with the columns S1v = d(pose 1)/dv in S3nu.
    """
    J = inverse_right_jacobian(t[0], t[1], t[2])
    a = transposed_times(J, data.S2[d, 3], data.S2[d, 4], data.S2[d, 5])
    b = times(J, data.S1[d, 3], data.S1[d, 4], data.S1[d, 5])
    c = times(J, data.S3nu[d, 3], data.S3nu[d, 4], data.S3nu[d, 5])
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2]), (-c[0], -c[1], -c[2])


@kernel
def move_rates(data: Data, d: int, here: Vec3, before: Vec3) -> tuple[Vec3, Vec3]:
    """Derivatives of the displacement of a point from `before` to `here`, by dof d of coordinates and velocities."""
    a = carried(data.S2, d, here)
    b = carried(data.S1, d, before)
    c = carried(data.S3nu, d, before)
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2]), (-c[0], -c[1], -c[2])


@kernel
def put_column(v: Vec3, scale: float, row: int, column: int, J: Matrix) -> None:
    """J[row : row + 3, column] = scale v"""
    for k in range(3):
        J[row + k, column] = scale * v[k]


@kernel
def add_column(v: Vec3, scale: float, row: int, column: int, J: Matrix) -> None:
    """J[row : row + 3, column] += scale v"""
    for k in range(3):
        J[row + k, column] += scale * v[k]


@kernel
def place_of(place: Vector) -> Vec3:
    """The point of a frame (point, quaternion) in its body."""
    return place[0], place[1], place[2]
