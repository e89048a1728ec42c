"""Tables of a mechanism for compiled functions: its tree as constants of the code, scratch on the memory of a call.

A table of Model or Data holds addresses. Those of a simulator end with it, and belong to one thread at a time. Here the
arrays of the tree are constants of the compiled code, and the arrays that its kinematics write are parts of a buffer
that the call allocates, so that functions outlive the simulator and run in any number of threads.

A row of a layout is (buffer, first word in it, rows, columns) of one array; the table follows from the addresses of the
buffers.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.model.data import Carry, Data
from sim.model.layout import sizes_of
from sim.model.model import Model
from solvers.compiler import Table, users_callee
from solvers.types import Floats, IntegerMatrix

__all__ = ["Frozen", "freeze", "put_table"]

_WHOLE, _NUMBERS, _SCRATCH = range(3)  # buffers: integers and floats of the tree, and that of a call
_TREE = ("body_", "joint_", "dof_", "optional")  # fields of Model that kinematics read begin so
# fields of Data that they write, with their columns
_BODIES = {
    "pos1": 3,
    "rot1": 9,
    "pos2": 3,
    "quat2": 4,
    "rot2": 9,
    "arm": 6,
    "turn_matrix": 9,
    "move_in": 3,
    "turn_in": 4,
}
_DOFS = {"S1": 6, "S2": 6, "S3nu": 6}


class Frozen(NamedTuple):
    """Constants of a compiled function."""

    layout: NDArray[np.int64]  # (arrays, 4) of Model, then of Data
    arrays: int  # of Model, the first ones of the layout
    whole: NDArray[np.int64]
    numbers: Floats
    size: int  # of the buffer of a call


def freeze(model: Model) -> Frozen:
    """The tree of a model.

    Args:
        model: its arrays.

    Returns:
        The constants.
    """
    rows: list[tuple[int, int, int, int]] = []
    buffers: tuple[list[NDArray[np.int64]], list[Floats]] = [], []
    for name, array in zip(model._fields, model, strict=True):
        kind = _WHOLE if array.dtype == np.int64 else _NUMBERS
        if not name.startswith(_TREE):
            array = array[:0]
        rows.append((kind, sum(a.size for a in buffers[kind]), *_shape(array)))
        buffers[kind].append(array.ravel())  # type: ignore[arg-type]
    count, sizes = len(rows), sizes_of(model)
    needs = {"origin": (3, 1), "theta1": (sizes.nq, 1)}
    needs |= {name: (sizes.nbody, columns) for name, columns in _BODIES.items()}
    needs |= {name: (sizes.nv, columns) for name, columns in _DOFS.items()}
    size = 0
    for name in (*Carry._fields, *(field for field in Data._fields if field != "carry")):
        shape = needs.get(name, (0, 1))
        rows.append((_SCRATCH, size, *shape))
        size += shape[0] * shape[1]
    whole, numbers = (np.concatenate(parts) for parts in buffers)
    return Frozen(np.array(rows, dtype=np.int64), count, whole.astype(np.int64), numbers.astype(np.float64), size)


def _shape(array: NDArray[np.generic]) -> tuple[int, int]:
    return array.shape[0], array.shape[1] if array.ndim == 2 else 1


@users_callee
def put_table(layout: IntegerMatrix, whole: int, numbers: int, scratch: int, table: Table) -> None:
    """The words of the arrays of a layout, by the addresses of the three buffers."""
    for k in range(layout.shape[0]):
        start = whole
        if layout[k, 0] == 1:
            start = numbers
        elif layout[k, 0] == 2:
            start = scratch
        table[3 * k] = start + 8 * layout[k, 1]
        table[3 * k + 1] = layout[k, 2]
        table[3 * k + 2] = layout[k, 3]
