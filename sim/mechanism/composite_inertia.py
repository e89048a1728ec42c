"""Mass, centre of mass and inertia of several shapes of one density."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sim.mechanism.shapes import Solid
from solvers.types import Floats


def composite(shapes: Sequence[Solid], mass: float) -> tuple[Floats, Floats]:
    """(centre (3,), inertia about it (3, 3)) of shapes of one density, which have this mass together.

        m_k = m V_k / sum V,   c = sum m_k c_k / m,   J = sum J_k + m_k (|d|^2 I - d d^T),   d = c_k - c

    Where shapes overlap, the overlap counts twice.

    Args:
        shapes: solids with an end, in the axes of their body.
        mass: of all of them [kg].

    Returns:
        Centre from the origin of the body [m], and inertia [kg m^2], body axes.
    """
    volumes = np.array([shape.volume() for shape in shapes])
    masses = mass * volumes / volumes.sum()
    centers = np.array([shape.mass_center() for shape in shapes])
    center = masses @ centers / mass
    inertia = np.zeros((3, 3))
    for shape, own, at in zip(shapes, masses, centers, strict=True):
        d = at - center
        inertia += shape.central_inertia(float(own)) + own * (d @ d * np.eye(3) - np.outer(d, d))
    return center, inertia
