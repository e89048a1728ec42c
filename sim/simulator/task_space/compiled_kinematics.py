"""Kinematics that compiled functions of the user call: places, velocities, and their derivatives, by state.

pose              place of a frame, and its quaternion            jacobian           rows of both by tangent coordinates
velocity          of its place and its angular velocity           velocity_jacobian  by tangent state
center_of_mass    of all bodies                                   com_jacobian       by tangent coordinates

Velocities are the mean ones of the interval that led to a state, as in `frames`. Results are written into the scratch
of the call, and from there into the user's array, whatever its layout.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from sim.dynamics.coordinates import node_poses
from sim.dynamics.kinematics import velocity_columns
from sim.model.data import Data
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from sim.model.slots import Slot
from sim.simulator.simulator import Simulator
from sim.simulator.task_space.frames import frame_velocity, frame_velocity_jacobian
from sim.simulator.task_space.frozen_tables import freeze, put_table
from sim.simulator.task_space.knot_rows import carried, place_of, point_at, put_column
from sim.simulator.task_space.momenta import total_mass
from solvers.codes import Code
from solvers.compiler import kernel, link, optional, users_kernel
from solvers.dense import clear
from solvers.rotation import quat_mul
from solvers.types import Floats, Matrix, Vector

__all__ = ["CompiledKinematics", "KinematicQuantity"]


class KinematicQuantity(Code):
    """A quantity that a compiled function evaluates."""

    POSE = 0
    JACOBIAN = 1
    VELOCITY = 2
    VELOCITY_JACOBIAN = 3
    CENTER_OF_MASS = 4
    COM_JACOBIAN = 5


@kernel
def _pose(data: Data, i: int, place: Vector, out: Matrix) -> None:
    """out (1, 7) = [place; quaternion] of a frame of body i; of the world for i < 0."""
    if i < 0:
        for k in range(7):
            out[0, k] = place[k]
        return
    at = point_at(data, i, place_of(place), True)
    b = data.quat2[i]
    q = quat_mul(b[0], b[1], b[2], b[3], place[3], place[4], place[5], place[6])
    for k in range(3):
        out[0, k] = at[k]
    for k in range(4):
        out[0, 3 + k] = q[k]


@kernel
def _jacobian(model: Model, data: Data, i: int, place: Vector, out: Matrix) -> None:
    """out (6, nv) = [rows of the velocity of the frame's origin; of its angular velocity], world axes."""
    clear(out)
    at = place_of(place)
    if i >= 0:
        at = point_at(data, i, at, True)
    while i >= 0:
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            put_column(carried(data.S2, d, at), 1.0, 0, d, out)
            put_column((data.S2[d, 3], data.S2[d, 4], data.S2[d, 5]), 1.0, 3, d, out)
        i = model.body_parent[i]


@kernel
def _center_of_mass(model: Model, data: Data, out: Matrix) -> None:
    """out (1, 3) = sum m_i x_i / m"""
    clear(out)
    mass = total_mass(model)
    for i in range(model.body_mass.shape[0]):
        for k in range(3):
            out[0, k] += model.body_mass[i] * data.pos2[i, k] / mass


@kernel
def _com_jacobian(model: Model, data: Data, out: Matrix) -> None:
    """out (3, nv) = sum m_i dx_i / m"""
    clear(out)
    mass = total_mass(model)
    for body in range(model.body_mass.shape[0]):
        share, x = model.body_mass[body] / mass, data.pos2[body]
        at = (x[0], x[1], x[2])
        i = body
        while i >= 0:
            for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
                v = carried(data.S2, d, at)
                for k in range(3):
                    out[k, d] += share * v[k]
            i = model.body_parent[i]


@optional(Slot.KINEMATIC_QUANTITY)
def evaluate(
    model: Model, data: Data, quantity: int, h: float, body: int, place: Vector, x: Vector, out: Matrix
) -> None:
    """A quantity at x; out: see `_function`.

    Called by its address: as a part of each function that calls it, it was compiled anew, a second each time.
    """
    nq = data.theta1.shape[0]
    node_poses(model, data, h, x)
    if quantity == KinematicQuantity.POSE:
        _pose(data, body, place, out)
    elif quantity == KinematicQuantity.JACOBIAN:
        _jacobian(model, data, body, place, out)
    elif quantity == KinematicQuantity.CENTER_OF_MASS:
        _center_of_mass(model, data, out)
    elif quantity == KinematicQuantity.COM_JACOBIAN:
        _com_jacobian(model, data, out)
    else:
        clear(out)
        if body >= 0 and quantity == KinematicQuantity.VELOCITY:
            frame_velocity(data, h, body, place, out[0])
        elif body >= 0:
            velocity_columns(model, data.S1, x[nq:], -h, data.S3nu)
            frame_velocity_jacobian(model, data, h, body, place, out)


def _function(model: Model, h: float, quantity: int, body: int, place: Floats) -> Callable[[Any, Any], None]:
    """The function of a quantity, to be compiled among those of the user."""
    nv, nx = len(model.dof_body), int(model.body_qadr[-1]) + len(model.dof_body)
    rows, columns = {
        KinematicQuantity.POSE: (1, 7),
        KinematicQuantity.JACOBIAN: (6, nv),
        KinematicQuantity.VELOCITY: (1, 6),
        KinematicQuantity.VELOCITY_JACOBIAN: (6, 2 * nv),
        KinematicQuantity.CENTER_OF_MASS: (1, 3),
        KinematicQuantity.COM_JACOBIAN: (3, nv),
    }[KinematicQuantity(quantity)]
    linked = model._replace(optional=model.optional.copy())
    link(linked.optional, evaluate)
    layout, arrays, whole, numbers, size = freeze(linked)
    words, single = 3 * len(layout), rows == 1
    at, first = size + nx, size + nx + 7  # where the place begins, and the result
    end, code = first + rows * columns, int(quantity)

    def function(x: Any, out: Any) -> None:
        scratch, table = np.zeros(end), np.empty(words, np.int64)
        put_table(layout, whole.ctypes.data, numbers.ctypes.data, scratch.ctypes.data, table)
        for k in range(nx):
            scratch[size + k] = x[k]
        for k in range(7):
            scratch[at + k] = place[k]
        result = scratch[first:end].reshape(rows, columns)
        tree, moving = model_view(table[: 3 * arrays]), data_view(table[3 * arrays :])
        evaluate(tree, moving, code, h, body, scratch[at:first], scratch[size:at], result)
        for row in range(rows):
            for k in range(columns):
                if single:  # a constant: Numba compiles the branch that fits the dimension of out
                    out[k] = result[row, k]
                else:
                    out[row, k] = result[row, k]

    return function


class CompiledKinematics:
    """A function of (x, out) that compiled functions call, and Python.

    Args:
        sim: the simulator, whose mechanism is copied.
        quantity: name of the result, as in `Kinematics.compiled`.
        body: number of the frame's body, -1 for the world.
        place: (7,) point and quaternion of the frame on its body.
    """

    def __init__(self, sim: Simulator, quantity: KinematicQuantity, body: int, place: Floats) -> None:
        self._arguments = sim, quantity, body, place
        self._kernel: Any = users_kernel(_function(sim.model, float(sim.time_step), quantity, int(body), place))
        self.py_func = getattr(self._kernel, "py_func", self._kernel)

    def __call__(self, x: Any, out: Any) -> None:
        self._kernel(x, out)

    @property
    def _numba_type_(self) -> Any:
        return self._kernel._numba_type_

    def __reduce__(self) -> Any:
        """By its simulator, since its constants hold addresses of this process."""
        return CompiledKinematics, self._arguments

    def __repr__(self) -> str:
        return f"<compiled {self._arguments[1].name.lower()}(x, out)>"
