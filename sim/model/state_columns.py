"""Names of the columns of states: z (nbody, 13) of bodies, and x (nx,) of a robot on a floating base.

z[:, BodyState.QUATERNION]        slices, for NumPy
z[i, BodyColumn.QUATERNION + 1]   first columns, for kernels
"""

from __future__ import annotations

from solvers.codes import Code

__all__ = ["BaseState", "BodyColumn", "BodyState"]


class BodyColumn(Code):
    """First column of each part of the maximal state of a body."""

    POSITION = 0  # (3,) of the centre of mass, world axes [m]
    VELOCITY = 3  # (3,) world axes [m/s]
    QUATERNION = 6  # (4,) w, x, y, z
    SPIN = 10  # (3,) angular velocity, axes of the body [rad/s]


class BodyState:
    """Parts of the maximal state of a body."""

    POSITION = slice(BodyColumn.POSITION, BodyColumn.VELOCITY)
    VELOCITY = slice(BodyColumn.VELOCITY, BodyColumn.QUATERNION)
    QUATERNION = slice(BodyColumn.QUATERNION, BodyColumn.SPIN)
    SCALAR = slice(BodyColumn.QUATERNION, BodyColumn.QUATERNION + 1)  # part of the quaternion
    VECTOR = slice(BodyColumn.QUATERNION + 1, BodyColumn.SPIN)  # part of the quaternion
    SPIN = slice(BodyColumn.SPIN, BodyColumn.SPIN + 3)


class BaseState:
    """Parts of a state that begins with the pose of a floating base."""

    POSITION = slice(0, 3)  # [m]
    QUATERNION = slice(3, 7)  # w, x, y, z
    SCALAR = slice(3, 4)  # part of the quaternion
    VECTOR = slice(4, 7)  # part of the quaternion
    POSE = slice(0, 7)
    JOINTS = 7  # first coordinate of the other joints
