"""The kernels of each pair of shapes, as optional ones: a scene compiles those of its pairs only.

put       the contact of chosen elements; `put_contact` and the rest of collide.py dispatch on the kind of the pair
arrange   for boxes, capsules against boxes, and polytopes: the discrete choice for all points, and for each of them

A new pair has a Pair with its count (shape_kinds.py), a slot, and here a kernel, its entry in KERNELS, and its branch
in `put_contact`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from sim.contact.collision import box_axes, box_box, capsule_box, ellipsoid, polytope_polytope, segment
from sim.contact.collision.ball_level_set import capsule_field, choose_end, sphere_field
from sim.contact.collision.box_elements import put_elements
from sim.contact.collision.edge_axes import Arrangement
from sim.contact.collision.halfspace import box_halfspace, capsule_halfspace, cylinder_halfspace, sphere_halfspace
from sim.contact.collision.sphere import sphere_box, sphere_capsule, sphere_cylinder, sphere_sphere, string
from sim.contact.collision.witness import absent
from sim.model.model import Model
from sim.model.shape_kinds import Pair
from sim.model.slots import Slot
from solvers.compiler import inner_kernel, optional
from solvers.rotation import Vec3
from solvers.types import Vector


@inner_kernel
def half_sides(sizes: Vector, first: int) -> Vec3:
    """Half sides of a box: shape a has its sizes from 0, shape b from 4."""
    return sizes[first], sizes[first + 1], sizes[first + 2]


@optional(Slot.PUT_SPHERE_SPHERE)
def _sphere_sphere(model: Model, feature: int, code: int, sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    sphere_sphere(sizes, r, out)


@optional(Slot.PUT_SPHERE_CAPSULE)
def _sphere_capsule(model: Model, feature: int, code: int, sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    sphere_capsule(sizes, r, out)


@optional(Slot.PUT_SPHERE_BOX)
def _sphere_box(model: Model, feature: int, code: int, sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    sphere_box(sizes, r, out)


@optional(Slot.PUT_SPHERE_CYLINDER)
def _sphere_cylinder(model: Model, feature: int, code: int, sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    sphere_cylinder(sizes, r, out)


@optional(Slot.PUT_SPHERE_HALFSPACE)
def _sphere_halfspace(model: Model, feature: int, code: int, sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    sphere_halfspace(sizes, r, out)


@optional(Slot.PUT_CAPSULE_CAPSULE)
def _capsule_capsule(model: Model, feature: int, code: int, sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    segment.put_points(code, sizes, R, r, out)


@optional(Slot.PUT_CAPSULE_BOX)
def _capsule_box(model: Model, feature: int, code: int, sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    capsule_box.put_elements(code, sizes[0], sizes[1], half_sides(sizes, 4), R, r, out)


@optional(Slot.PUT_CAPSULE_HALFSPACE)
def _capsule_halfspace(model: Model, feature: int, code: int, sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    capsule_halfspace(feature, sizes, R, r, out)


@optional(Slot.PUT_BOX_BOX)
def _box_box(model: Model, feature: int, code: int, sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    put_elements(code, half_sides(sizes, 0), half_sides(sizes, 4), R, r, out)


@optional(Slot.PUT_BOX_HALFSPACE)
def _box_halfspace(model: Model, feature: int, code: int, sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    box_halfspace(feature, sizes, R, r, out)


@optional(Slot.PUT_CYLINDER_HALFSPACE)
def _cylinder_halfspace(
    model: Model, feature: int, code: int, sizes: Vector, R: Vector, r: Vector, out: Vector
) -> None:
    cylinder_halfspace(feature, sizes, R, r, out)


@optional(Slot.PUT_STRING)
def _string(model: Model, feature: int, code: int, sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    string(sizes, r, out)


@optional(Slot.PUT_ELLIPSOID_HALFSPACE)
def _ellipsoid_halfspace(
    model: Model, feature: int, code: int, sizes: Vector, R: Vector, r: Vector, out: Vector
) -> None:
    ellipsoid.ellipsoid_halfspace(sizes, R, r, out)


@optional(Slot.PUT_ELLIPSOID_ELLIPSOID)
def _ellipsoid_ellipsoid(
    model: Model, feature: int, code: int, sizes: Vector, R: Vector, r: Vector, out: Vector
) -> None:
    ellipsoid.ellipsoid_ellipsoid(sizes, R, r, out)


@optional(Slot.PUT_CYLINDER_ELLIPSOID)
def _cylinder_ellipsoid(
    model: Model, feature: int, code: int, sizes: Vector, R: Vector, r: Vector, out: Vector
) -> None:
    ellipsoid.cylinder_ellipsoid(sizes, R, r, out)


@optional(Slot.PUT_POLYTOPE_ELLIPSOID)
def _polytope_ellipsoid(
    model: Model, feature: int, code: int, sizes: Vector, R: Vector, r: Vector, out: Vector
) -> None:
    ellipsoid.polytope_ellipsoid(sizes, model.hull, R, r, out)


@optional(Slot.PUT_SPHERE_FIELD)
def _sphere_field(model: Model, feature: int, code: int, sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    sphere_field(sizes, model.hull, r, out)


@optional(Slot.PUT_CAPSULE_FIELD)
def _capsule_field(model: Model, feature: int, code: int, sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    capsule_field(feature, sizes, model.hull, R, r, out)


@optional(Slot.PUT_POLYTOPE_POLYTOPE)
def _polytope_polytope(model: Model, feature: int, code: int, sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    polytope_polytope.put_elements(feature, code, sizes, model.hull, R, r, out)


@optional(Slot.ARRANGE_CAPSULE_BOX)
def arrange_capsule_box(model: Model, sizes: Vector, R: Vector, r: Vector, sides: int) -> Arrangement:
    """`arrange` of collide.py for this pair."""
    return capsule_box.separation((r[0], r[1], r[2]), (R[2], R[5], R[8]), sizes[1], half_sides(sizes, 4), sides)


@optional(Slot.ARRANGE_BOX_BOX)
def arrange_box_box(model: Model, sizes: Vector, R: Vector, r: Vector, sides: int) -> Arrangement:
    """`arrange` of collide.py for this pair."""
    return box_axes.separation(half_sides(sizes, 0), half_sides(sizes, 4), R, r, sides)


@optional(Slot.ARRANGE_POLYTOPE_POLYTOPE)
def arrange_polytope_polytope(model: Model, sizes: Vector, R: Vector, r: Vector, sides: int) -> Arrangement:
    """`arrange` of collide.py for this pair."""
    return polytope_polytope.separation(sizes, model.hull, R, r)


@optional(Slot.SIDES_CAPSULE_BOX)
def sides_capsule_box(model: Model, sizes: Vector, R: Vector, r: Vector) -> int:
    """`open_sides` of collide.py for this pair."""
    return capsule_box.open_sides((r[0], r[1], r[2]), (R[2], R[5], R[8]), sizes[1], half_sides(sizes, 4))


@optional(Slot.SIDES_BOX_BOX)
def sides_box_box(model: Model, sizes: Vector, R: Vector, r: Vector) -> int:
    """`open_sides` of collide.py for this pair."""
    return box_axes.open_sides(half_sides(sizes, 0), half_sides(sizes, 4), R, r)


@optional(Slot.CHOOSE_CAPSULE_CAPSULE)
def choose_capsule_capsule(model: Model, feature: int, sizes: Vector, R: Vector, r: Vector) -> int:
    """`choose` of collide.py for this pair."""
    return segment.choose_points(feature, sizes, R, r)


@optional(Slot.CHOOSE_CAPSULE_FIELD)
def choose_capsule_field(model: Model, feature: int, sizes: Vector, R: Vector, r: Vector) -> int:
    """`choose` of collide.py for this pair."""
    return choose_end(feature, sizes, model.hull, R, r)


@optional(Slot.CHOOSE_CAPSULE_BOX)
def choose_capsule_box(
    model: Model, feature: int, arrangement: Arrangement, sizes: Vector, R: Vector, r: Vector, out: Vector
) -> int:
    """`choose` of collide.py for this pair."""
    return capsule_box.choose_elements(feature, arrangement, sizes[0], sizes[1], half_sides(sizes, 4), R, r, out)


@optional(Slot.CHOOSE_BOX_BOX)
def choose_box_box(
    model: Model, feature: int, arrangement: Arrangement, sizes: Vector, R: Vector, r: Vector, out: Vector
) -> int:
    """`choose` of collide.py for this pair."""
    return box_box.choose_elements(feature, arrangement, half_sides(sizes, 0), half_sides(sizes, 4), R, r, out)


@optional(Slot.CHOOSE_POLYTOPE_POLYTOPE)
def choose_polytope_polytope(
    model: Model, feature: int, arrangement: Arrangement, sizes: Vector, R: Vector, r: Vector, out: Vector
) -> int:
    """`choose` of collide.py for this pair."""
    return polytope_polytope.choose_elements(feature, arrangement, sizes, model.hull, R, r, out)


@optional(Slot.FACE_POLYTOPE_POLYTOPE)
def face_polytope_polytope(model: Model, feature: int, sizes: Vector, R: Vector, r: Vector) -> int:
    """`instead` of collide.py for this pair."""
    return polytope_polytope.face_towards(feature, sizes, model.hull, R, r)


@inner_kernel
def _put_field(
    model: Model, kind: int, feature: int, code: int, sizes: Vector, R: Vector, r: Vector, out: Vector
) -> None:
    """`put_contact` of a level set; of the others only those of cylinders come here, which have their own kernels."""
    if kind == Pair.SPHERE_FIELD:
        _sphere_field(model, feature, code, sizes, R, r, out)
    elif kind == Pair.CAPSULE_FIELD:
        _capsule_field(model, feature, code, sizes, R, r, out)
    else:
        absent(out)


@inner_kernel
def put_contact(
    model: Model, kind: int, feature: int, code: int, sizes: Vector, R: Vector, r: Vector, out: Vector
) -> None:
    """The contact of the elements `code` of a pair, without regard to whether its shapes are swapped."""
    if code == 0:
        absent(out)
    elif kind == Pair.SPHERE_SPHERE:
        _sphere_sphere(model, feature, code, sizes, R, r, out)
    elif kind == Pair.SPHERE_CAPSULE:
        _sphere_capsule(model, feature, code, sizes, R, r, out)
    elif kind == Pair.SPHERE_BOX:
        _sphere_box(model, feature, code, sizes, R, r, out)
    elif kind == Pair.SPHERE_CYLINDER:
        _sphere_cylinder(model, feature, code, sizes, R, r, out)
    elif kind == Pair.SPHERE_HALFSPACE:
        _sphere_halfspace(model, feature, code, sizes, R, r, out)
    elif kind == Pair.CAPSULE_CAPSULE:
        _capsule_capsule(model, feature, code, sizes, R, r, out)
    elif kind == Pair.CAPSULE_BOX:
        _capsule_box(model, feature, code, sizes, R, r, out)
    elif kind == Pair.CAPSULE_HALFSPACE:
        _capsule_halfspace(model, feature, code, sizes, R, r, out)
    elif kind == Pair.BOX_BOX:
        _box_box(model, feature, code, sizes, R, r, out)
    elif kind == Pair.BOX_HALFSPACE:
        _box_halfspace(model, feature, code, sizes, R, r, out)
    elif kind == Pair.CYLINDER_HALFSPACE:
        _cylinder_halfspace(model, feature, code, sizes, R, r, out)
    elif kind == Pair.STRING:
        _string(model, feature, code, sizes, R, r, out)
    elif kind == Pair.ELLIPSOID_HALFSPACE:
        _ellipsoid_halfspace(model, feature, code, sizes, R, r, out)
    elif kind == Pair.ELLIPSOID_ELLIPSOID:
        _ellipsoid_ellipsoid(model, feature, code, sizes, R, r, out)
    elif kind == Pair.CYLINDER_ELLIPSOID:
        _cylinder_ellipsoid(model, feature, code, sizes, R, r, out)
    elif kind == Pair.POLYTOPE_ELLIPSOID:
        _polytope_ellipsoid(model, feature, code, sizes, R, r, out)
    elif kind == Pair.POLYTOPE_POLYTOPE:
        _polytope_polytope(model, feature, code, sizes, R, r, out)
    else:
        _put_field(model, kind, feature, code, sizes, R, r, out)


KERNELS: dict[Pair, tuple[Callable[..., Any], ...]] = {
    Pair.SPHERE_SPHERE: (_sphere_sphere,),
    Pair.SPHERE_CAPSULE: (_sphere_capsule,),
    Pair.SPHERE_BOX: (_sphere_box,),
    Pair.SPHERE_CYLINDER: (_sphere_cylinder,),
    Pair.SPHERE_HALFSPACE: (_sphere_halfspace,),
    Pair.CAPSULE_CAPSULE: (_capsule_capsule, choose_capsule_capsule),
    Pair.CAPSULE_BOX: (_capsule_box, arrange_capsule_box, sides_capsule_box, choose_capsule_box),
    Pair.CAPSULE_HALFSPACE: (_capsule_halfspace,),
    Pair.BOX_BOX: (_box_box, arrange_box_box, sides_box_box, choose_box_box),
    Pair.BOX_HALFSPACE: (_box_halfspace,),
    Pair.CYLINDER_HALFSPACE: (_cylinder_halfspace,),
    Pair.STRING: (_string,),
    Pair.ELLIPSOID_HALFSPACE: (_ellipsoid_halfspace,),
    Pair.ELLIPSOID_ELLIPSOID: (_ellipsoid_ellipsoid,),
    Pair.CYLINDER_ELLIPSOID: (_cylinder_ellipsoid,),
    Pair.POLYTOPE_ELLIPSOID: (_polytope_ellipsoid,),
    Pair.SPHERE_FIELD: (_sphere_field,),
    Pair.CAPSULE_FIELD: (_capsule_field, choose_capsule_field),
    Pair.POLYTOPE_POLYTOPE: (
        _polytope_polytope,
        polytope_polytope.apart_polytopes,
        arrange_polytope_polytope,
        choose_polytope_polytope,
        face_polytope_polytope,
    ),
}
