"""Visual: a part of the picture of a body, without contact."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.mechanism import checks
from sim.mechanism.positional import few_positional
from sim.mechanism.shapes import Solid
from sim.mechanism.short_repr import short_repr

STEEL = (0.56, 0.64, 0.72)  # colour of parts without one


@few_positional
@dataclass(frozen=True)
class Visual:
    """A shape, the mesh of a file, or triangles, placed in a body.

    Attributes:
        shape: a solid with its own place (default None: a mesh or triangles).
        mesh: path of an STL, OBJ, DAE or glTF file, read when it is drawn by the extra `meshes` (default none).
        triangles: (vertices (n, 3), faces (k, 3)) (default none).
        scale: (3,) factors of a mesh or triangles (default 1).
        center: (3,) origin of a mesh or triangles, from the centre of mass, body axes [m] (default zero).
        orientation: (4,) unit quaternion (w, x, y, z) from the axes of a mesh or triangles to body axes (default none).
        color: red, green, blue, or with alpha, from 0 to 1 (default None: that of the mesh, or grey).

    Raises:
        ValueError: for none or several of shape, mesh and triangles, or a value out of range.
    """

    shape: Solid | None = None
    _: KW_ONLY
    mesh: str = ""
    triangles: tuple[NDArray[np.float64], NDArray[np.int64]] | None = None
    scale: ArrayLike = (1.0, 1.0, 1.0)
    center: ArrayLike = (0.0, 0.0, 0.0)
    orientation: ArrayLike = (1.0, 0.0, 0.0, 0.0)
    color: ArrayLike | None = None

    __repr__ = short_repr

    def _has_mesh(self) -> bool:
        """Whether a mesh is given as the path of its file."""
        if isinstance(self.mesh, str) and not self.mesh:
            return False
        checks.path("Visual(mesh=...)", self.mesh)
        return True

    def __post_init__(self) -> None:
        given: list[Any] = [self.shape is not None, self._has_mesh(), self.triangles is not None]
        if sum(given) != 1:
            raise ValueError("Visual(...): give one of shape=..., mesh=... and triangles=...")
        if self.shape is not None and not isinstance(self.shape, Solid):
            raise TypeError(f"Visual(shape): expected a shape, got {checks.shown(self.shape)}")
        for field in ("scale", "center"):
            object.__setattr__(self, field, checks.vector(f"Visual({field}=...)", getattr(self, field), 3))
        object.__setattr__(self, "orientation", checks.quaternion("Visual(orientation=...)", self.orientation))
        if self.color is not None:
            rgba = checks.array("Visual(color=...)", self.color, (None,))
            if len(rgba) not in (3, 4) or not np.all((rgba >= 0.0) & (rgba <= 1.0)):
                raise ValueError(f"Visual(color=...): expected 3 or 4 numbers from 0 to 1, got {self.color!r}")
            object.__setattr__(self, "color", tuple(float(c) for c in rgba))
