"""FallCheck: whether the base of a robot that stands free is too low, or tilted too far."""

from __future__ import annotations

from math import cos, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sim.mechanism.axes import translation_axes
from sim.mechanism.forward_kinematics import body_poses
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import rotation_matrix
from sim.mechanism.stance import collisions_with_ground
from sim.mechanism.terrain import Terrain
from solvers.compiler import kernel
from solvers.types import Cube, Floats, Matrix, Vector

__all__ = ["FallCheck", "stands_free"]

_LOW = 0.5  # a base below this share of its first height has fallen
_TILTED = 0.5  # and so has one whose axis has a smaller cosine with the normal of the ground
_FLOOR = 0.1  # a plane with a normal that points up by more than this can be the floor
_LEVEL = 1e-6  # vertical part of a level axis


@kernel
def _posture(forms: Cube, slope: Vector, x: Vector, rotation: int) -> tuple[float, float]:
    """Cosine of the tilt and height above the origin of a plane, of a base whose rotation starts at x[rotation]."""
    n = forms.shape[1]
    w, half = x[rotation], 0.5 * x[rotation]
    upright, height = 0.0, 0.0
    for i in range(n):
        for j in range(n):
            if n == 2:
                product = (cos(half) if i == 0 else sin(half)) * (cos(half) if j == 0 else sin(half))
            else:
                product = (w if i == 0 else x[rotation + i]) * x[rotation + j]
            upright += forms[0, i, j] * product
            height -= forms[1, i, j] * product
    for i in range(slope.shape[0]):
        height += slope[i] * x[i]
    return upright, height


class FallCheck:
    """Whether a robot has fallen: its base is below half its first height, or tilted by more than 60 degrees.

    Environments ask for both at every step, so they are forms of the coordinates of the first joint, translations s
    and the unit quaternion r of its rotation:

        height   n.(p - o) / n_z  =  c + g.s - r^T K(O^T n / n_z, d) r       above the plane with normal n
        tilt     n.(R R_0^T n)    =  r^T K(O^T n, R_0^T n) r
        K(a, b)  with a.(R(r) b) = r^T K r: Davenport's matrix (Markley, Mortari 2000)

    with the orientation O of the joint and the point d of the base that it holds. Of a single rotation about an axis e
    the quaternion is (cos, e sin) of half the angle, and K is reduced to these two.

    A base that does not begin above the ground has no height to lose.

    Args:
        mechanism: the robot; its contacts, and half-spaces that it collides with, say where the ground is.
        x: (nx,) its first state.
        normal: (3,) outward normal of the ground.
    """

    def __init__(self, mechanism: Mechanism, x: Vector, normal: Vector) -> None:
        self.applies = stands_free(mechanism)
        if not self.applies:
            return
        self._joint = joint = mechanism.joints[0]
        floor = _floor(mechanism)
        self._hill = None if floor is None else floor.terrain
        up = np.array([0.0, 0.0, 1.0]) if floor is None or self._hill is not None else floor.normal
        outer, first = rotation_matrix(joint.orientation), body_poses([joint], x[: joint.nq])[joint.child]
        climb = outer.T @ up / up[2]
        upright, held = (outer.T @ normal, first.rotation.T @ normal), (climb, _numbers(joint.child_point))
        basis = np.eye(4)
        if joint.nrot == 1:
            basis = np.zeros((4, 2))
            basis[0, 0], basis[1:, 1] = 1.0, _numbers(joint.axis)
        self._forms = np.stack([basis.T @ _davenport(a, b) @ basis for a, b in (upright, held)])
        self._slope = translation_axes(joint.ntrans, joint.axis)[: joint.ntrans] @ climb
        self._rotation = joint.nq - (4 if joint.nrot == 3 else 1)  # where it starts in x
        self._level = float(up @ _numbers(joint.parent_point) / up[2])
        if floor is not None:
            self._level -= floor.height / float(up[2])
        first_height = self.height(x)
        self._lowest = _LOW * first_height if first_height > 0.0 else -np.inf

    def height(self, x: Vector) -> float:
        """Height of the base in the state x (nx,) above the ground below it [m]."""
        return self._above(x, _posture(self._forms, self._slope, x, self._rotation)[1])

    def __call__(self, x: Vector) -> bool:
        """Whether the robot has fallen in the state x (nx,)."""
        if not self.applies:
            return False
        upright, height = _posture(self._forms, self._slope, x, self._rotation)
        stands = upright >= _TILTED and self._above(x, height) >= self._lowest  # not of a state that is not finite
        return not stands

    def _above(self, x: Vector, height: float) -> float:
        if self._hill is None:
            return height + self._level
        place = body_poses([self._joint], x[: self._joint.nq])[self._joint.child].point
        return height + self._level - float(self._hill.height(place[0], place[1]))


class _Floor(NamedTuple):
    """The ground below a robot."""

    normal: Vector  # (3,) outward normal of the plane
    height: float  # of the plane along it, above the origin [m]
    terrain: Terrain | None = None  # instead of the plane


def _floor(mechanism: Mechanism) -> _Floor | None:
    """The first ground of a contact that can be the floor, or else the first such half-space of a collision."""
    for c in mechanism.contacts:
        if c.terrain is not None or np.asarray(c.normal)[2] > _FLOOR:
            return _Floor(np.asarray(c.normal), c.height, c.terrain)
    for _, plane in collisions_with_ground(mechanism):
        normal = rotation_matrix(plane.orientation)[:, 2]
        if normal[2] > _FLOOR:
            return _Floor(normal, float(normal @ _numbers(plane.center)))
    return None


def _numbers(value: ArrayLike) -> Vector:
    return np.asarray(value, dtype=np.float64)


def _davenport(a: Vector, b: Vector) -> Matrix:
    """K (4, 4) with a.(R(r) b) = r^T K r for unit quaternions r (w, x, y, z)."""
    K = np.empty((4, 4))
    K[0, 0] = a @ b
    K[0, 1:] = K[1:, 0] = np.cross(b, a)
    K[1:, 1:] = np.outer(a, b) + np.outer(b, a) - (a @ b) * np.eye(3)
    return K


def stands_free(mechanism: Mechanism) -> bool:
    """Whether the first joint lets its body move up and down and tip over: no pendulum and no arm."""
    base = mechanism.joints[0]
    return base.kind == "floating" or (base.kind == "planar_axis" and abs(_world_axis(base)[2]) < _LEVEL)


def _world_axis(joint: Joint) -> Floats:
    """Axis of a joint on the world, world axes."""
    return np.asarray(rotation_matrix(joint.orientation) @ np.asarray(joint.axis))
