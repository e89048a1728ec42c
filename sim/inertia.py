"""The inertia of a rigid body as a user gives it: a matrix, principal moments, or that of a shape; checked."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sim import checks

if TYPE_CHECKING:
    from sim.parts import Body


def inertia_of(call: str, body: Body) -> tuple[tuple[float, ...], ...]:
    """The inertia as rows, after the tests that every rigid body passes."""
    if body.mass == 0.0:
        return ((0.0, 0.0, 0.0),) * 3
    if body.inertia is None:
        if body.shape is None:
            raise ValueError(f"{call}): give inertia=..., or a shape=... to take it from")
        if np.any(np.asarray(body.shape.center)):
            raise ValueError(f"{call}): give inertia=...; the shape is not centred at the centre of mass")
        matrix = body.shape.inertia(body.mass)
    else:
        matrix = checks.array(f"{call}, inertia=...)", body.inertia, (3,) if np.ndim(body.inertia) == 1 else (3, 3))
        matrix = np.diag(matrix) if matrix.ndim == 1 else matrix
    if not np.allclose(matrix, matrix.T, rtol=0, atol=1e-9 * np.abs(matrix).max()):
        raise ValueError(f"{call}, inertia=...): expected a symmetric matrix, got {matrix.tolist()}")
    matrix = 0.5 * (matrix + matrix.T)
    a, b, c = np.linalg.eigvalsh(matrix)
    if a <= 0.0:
        raise ValueError(f"{call}, inertia=...): not positive definite, its principal moments are {a:g}, {b:g}, {c:g}")
    if c > (a + b) * (1 + 1e-6):
        raise ValueError(
            f"{call}, inertia=...): no rigid body has principal moments {a:g}, {b:g}, {c:g}: "
            "the largest exceeds the sum of the others"
        )
    return tuple(tuple(float(x) for x in row) for row in matrix)
