"""Cylinders against polytopes and cylinders: all contact points of a collision chosen at once, then one at a time.

As collide.py, whose conventions hold; apart from it, so that scenes without such collisions do not compile them.
`turned` (12,) is scratch; a pose is (R, r).
"""

from __future__ import annotations

from sim.contact.collision import cylinder_cylinder, polytope_cylinder
from sim.contact.collision.swapped_shapes import exchange
from sim.model.shape_kinds import SWAPPED, Pair
from solvers.compiler import kernel
from solvers.types import Integers, Matrix, Vector

Pose = tuple[Vector, Vector]


@kernel
def separation_of_cylinder(
    kind: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector, turned: Vector, codes: Integers, out: Vector
) -> float:
    """Signed distance of the two shapes; uses up `out`. codes is not written."""
    if kind % SWAPPED == Pair.POLYTOPE_CYLINDER:
        return polytope_cylinder.survey(sizes, hull, R, r, out, codes, 0, 0)[0] - sizes[1]
    cylinder_cylinder.turn_around(R, r, turned)
    return cylinder_cylinder.survey(sizes, R, r, turned, out, codes, 0, 0)[0]


@kernel
def apart_from_cylinder(kind: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector) -> float:
    """A bound of `separation_of_cylinder` that takes a small part of its time."""
    if kind % SWAPPED == Pair.POLYTOPE_CYLINDER:
        return polytope_cylinder.apart_at_least(sizes, hull, R, r) - sizes[1]
    return cylinder_cylinder.apart_at_least(sizes, R, r)


@kernel
def choose_on_cylinder(
    kind: int, sizes: Vector, hull: Matrix, pose: Pose, turned: Vector, codes: Integers, first: int, out: Vector
) -> None:
    """codes[first:] = the elements of the shapes that make all contact points; `out` is scratch."""
    R, r = pose
    if kind % SWAPPED == Pair.POLYTOPE_CYLINDER:
        polytope_cylinder.choose_elements(sizes, hull, R, r, codes, first, out)
    else:
        cylinder_cylinder.choose_elements(sizes, R, r, turned, codes, first, out)


@kernel
def collide_with_cylinder(
    kind: int, feature: int, code: int, sizes: Vector, hull: Matrix, pose: Pose, turned: Vector, out: Vector
) -> None:
    """Contact of the elements `code` that were chosen for contact point `feature`: smooth in the pose."""
    R, r = pose
    if kind % SWAPPED == Pair.POLYTOPE_CYLINDER:
        polytope_cylinder.put_elements(feature, code, sizes, hull, R, r, out)
    else:
        cylinder_cylinder.put_elements(feature, code, sizes, R, r, turned, out)
    if kind >= SWAPPED and code != 0:
        exchange(R, r, out)


@kernel
def instead_on_cylinder(kind: int, feature: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector) -> int:
    """Elements for a point whose choice overlapped at this pose, where a step begins; 0 for none: it is omitted."""
    if kind % SWAPPED == Pair.POLYTOPE_CYLINDER:
        return polytope_cylinder.corner_instead(feature, sizes, hull, R, r)
    return 0
