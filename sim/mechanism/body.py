"""Body: a rigid body with its mass, inertia, shapes and pictures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.mechanism import checks
from sim.mechanism.composite_inertia import composite
from sim.mechanism.positional import few_positional
from sim.mechanism.shapes import Solid
from sim.mechanism.visual import Visual


@few_positional
@dataclass(frozen=True)
class Body:
    """A rigid body. Its frame has its origin at the centre of mass.

    A body of mass 0, without inertia and shape, connects the parts of a compound joint, such as a chain of hinges. A
    body with a mass has to hang on it.

    Attributes:
        name: name of the body.
        mass: mass [kg] (default 1).
        inertia: (3,) principal moments or (3, 3) matrix, about the centre of mass, body axes [kg m^2] (default None:
            that of `shape`).
        shape: shape for inertia, collisions and drawings, or several (default None: no shape). All of them can touch
            the ground (`Mechanism.with_terrain`), obstacles and other bodies, each with its own friction and
            restitution. Several shapes share the mass in proportion to their volumes; `shapes` has them as a tuple.
        visuals: picture of the body, if it differs from the shapes (default none).
        gravity_compensation: compensated share of its weight: 1 for a body that floats, such as the link of an arm
            whose drives carry it, 0 for none (default 0).

    Raises:
        ValueError: for a value out of range, or an inertia that no rigid body has; the message names the body.
    """

    name: str
    mass: float = 1.0  # [kg]
    inertia: ArrayLike | None = None
    shape: Solid | Sequence[Solid] | None = None
    _: KW_ONLY
    visuals: Sequence[Visual] = ()
    gravity_compensation: float = 0.0

    def __post_init__(self) -> None:
        checks.name("Body(name=...)", self.name)
        call = f"Body({self.name!r}"
        object.__setattr__(self, "shape", shape_of(f"{call}, shape=...)", self.shape))
        massless = isinstance(self.mass, int | float | np.number) and self.mass == 0
        if not massless or self.inertia is not None or self.shape is not None:
            object.__setattr__(self, "mass", checks.number(f"{call}, mass=...)", self.mass, above=0.0))
        object.__setattr__(self, "inertia", inertia_of(call, self))
        compensation = checks.number(f"{call}, gravity_compensation=...)", self.gravity_compensation)
        object.__setattr__(self, "gravity_compensation", compensation)
        object.__setattr__(self, "visuals", checks.items(f"{call}, visuals=...)", self.visuals, Visual))

    @property
    def shapes(self) -> tuple[Solid, ...]:
        """All of its shapes."""
        if self.shape is None:
            return ()
        return (self.shape,) if isinstance(self.shape, Solid) else tuple(self.shape)


def shape_of(call: str, given: Any) -> Any:
    """One shape, a tuple of several, or None; shapes of a body that have names have different ones."""
    if given is None or isinstance(given, Solid):
        return given
    found = tuple(given) if isinstance(given, Iterable) else (given,)
    for shape in found:
        if not isinstance(shape, Solid):
            raise ValueError(f"{call}: expected a shape, as Sphere(0.1), or several, got {given!r}")
    checks.distinct(f"{call}: shapes", (shape.name for shape in found if shape.name))
    return found if len(found) > 1 else found[0] if found else None


def inertia_of(call: str, body: Body) -> tuple[tuple[float, ...], ...]:
    """The inertia as rows, after the tests that every rigid body passes."""
    if body.mass == 0.0:
        return ((0.0, 0.0, 0.0),) * 3
    if body.inertia is None:
        matrix = inertia_of_shapes(call, body)
    else:
        flat = checks.ndim(f"{call}, inertia=...)", body.inertia) == 1
        matrix = checks.array(f"{call}, inertia=...)", body.inertia, (3,) if flat else (3, 3))
        matrix = np.diag(matrix) if matrix.ndim == 1 else matrix
    if np.abs(matrix - matrix.T).max() > 1e-9 * np.abs(matrix).max():
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


def inertia_of_shapes(call: str, body: Body) -> NDArray[np.float64]:
    """The inertia of one shape at the centre of mass, or of several that have theirs there."""
    if not body.shapes:
        raise ValueError(f"{call}): give inertia=..., or shape=... to compute it from")
    if len(body.shapes) == 1:
        if np.any(np.asarray(body.shapes[0].center)):
            raise ValueError(f"{call}): give inertia=...; the shape is not centred at the centre of mass")
        return body.shapes[0].inertia(body.mass)
    center, matrix = composite(body.shapes, body.mass)
    size = max(float(np.linalg.norm(shape.center)) + shape.bounding_radius() for shape in body.shapes)
    if not np.abs(center).max() <= 1e-9 * size:
        at = np.round(center, 9).tolist()
        raise ValueError(
            f"{call}): the centre of mass of its shapes is at {at}; a body has its origin there: move the centers of "
            "the shapes by the negative of that, or give inertia=..."
        )
    return matrix
