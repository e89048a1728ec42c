"""`collide`: one contact point of a pair of shapes, in two halves.

choose           which elements of the shapes make it: a discrete choice, after that of `arrange` for all points
collide_chosen   the contact of those elements: smooth in the pose
"""

from __future__ import annotations

from sim.contact.collision import box_axes, box_box, capsule_box, hulls
from sim.contact.collision.box_elements import put_elements
from sim.contact.collision.edge_axes import OPEN, Arrangement
from sim.contact.collision.ellipsoid import (
    cylinder_ellipsoid,
    ellipsoid_ellipsoid,
    ellipsoid_halfspace,
    polytope_ellipsoid,
)
from sim.contact.collision.exchange import exchange
from sim.contact.collision.halfspace import box_halfspace, capsule_halfspace, cylinder_halfspace, sphere_halfspace
from sim.contact.collision.segment import choose_points, put_points
from sim.contact.collision.sphere import sphere_box, sphere_capsule, sphere_cylinder, sphere_sphere, string
from sim.contact.collision.witness import ABSENT, absent
from sim.model.shape_kinds import SWAPPED, Pair
from solvers.compiler import inner_kernel, kernel
from solvers.types import Matrix, Vector


@kernel
def collide(kind: int, feature: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector, out: Vector) -> None:
    """Distance, normal and point of contact point `feature` of shapes a and b, with derivatives by the twist of a.

    kind     a Pair; feature: 0 to kinds.count(kind) - 1. Pair + SWAPPED: out is then that of b against a, in the frame
             of a, by the twist of b
    sizes    (8,) sizes of a from 0, of b from 4 [m], in the order of kinds.Shape
    hull     tables of polytopes (hull.py); one row will do where there are none
    R, r     pose of a in the frame of b: rotation (9,), row-major, and centre (3,) [m]
    out      (43,), overwritten, in the frame of b:
             0       phi, signed distance [m], negative inside; 1e9 if the point does not exist now
             1:4     n, unit normal from b to a
             4:7     p, midpoint of the two nearest points [m]
             7:25    dn/d(v, w), 25:43 dp/d(v, w): (3, 6), row-major; (v, w) is the twist of a about the origin of b:
                     dr = v + w x r, dR = [w] R
    d phi = n.(v + w x p).
    """
    choose(kind, feature, arrange(kind, sizes, hull, R, r, OPEN), sizes, hull, R, r, out)


@kernel
def open_sides(kind: int, sizes: Vector, R: Vector, r: Vector) -> int:
    """Axes that separate the shapes at this pose, and their sides: the candidates of `arrange` one step later.

    Of the axes that separate shapes at the end of a step, one that did so at its beginning is the one that was there
    all the time; the others mean that a body has gone around a corner of the other one, or through it, and a contact
    along them would push it on its way: it would gain energy.
    """
    kind %= SWAPPED
    if kind == Pair.BOX_BOX:
        return box_axes.open_sides((sizes[0], sizes[1], sizes[2]), (sizes[4], sizes[5], sizes[6]), R, r)
    if kind == Pair.CAPSULE_BOX:
        h = (sizes[4], sizes[5], sizes[6])
        return capsule_box.open_sides((r[0], r[1], r[2]), (R[2], R[5], R[8]), sizes[1], h)
    return OPEN


@kernel
def arrange(kind: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector, sides: int) -> Arrangement:
    """The discrete part of a collision: which face or edges of two boxes or polytopes decide, for all features.

    Once per pair and pose, where it saves most of the time of `collide`. sides: of the axes, those to choose from
    (`open_sides`); OPEN for all.
    """
    kind %= SWAPPED
    if kind == Pair.BOX_BOX:
        return box_axes.separation((sizes[0], sizes[1], sizes[2]), (sizes[4], sizes[5], sizes[6]), R, r, sides)
    if kind == Pair.CAPSULE_BOX:
        h = (sizes[4], sizes[5], sizes[6])
        return capsule_box.separation((r[0], r[1], r[2]), (R[2], R[5], R[8]), sizes[1], h, sides)
    if kind == Pair.POLYTOPE_POLYTOPE:
        return hulls.separation(sizes, hull, R, r)
    return 0, -1, 0.0, 1.0, 1.0


@kernel
def choose(
    kind: int, feature: int, arrangement: Arrangement, sizes: Vector, hull: Matrix, R: Vector, r: Vector, out: Vector
) -> int:
    """`collide`, with the result of `arrange`; also the elements that it found: a number, 0 for none."""
    code = _choose(kind % SWAPPED, feature, arrangement, sizes, hull, R, r, out)
    if kind >= SWAPPED and code != 0:
        exchange(R, r, out)
    return code


@inner_kernel
def _choose(
    kind: int, feature: int, arrangement: Arrangement, sizes: Vector, hull: Matrix, R: Vector, r: Vector, out: Vector
) -> int:
    if kind == Pair.BOX_BOX:
        ha, hb = (sizes[0], sizes[1], sizes[2]), (sizes[4], sizes[5], sizes[6])
        return box_box.choose_elements(feature, arrangement, ha, hb, R, r, out)
    if kind == Pair.CAPSULE_BOX:
        h = (sizes[4], sizes[5], sizes[6])
        return capsule_box.choose_elements(feature, arrangement, sizes[0], sizes[1], h, R, r, out)
    if kind == Pair.POLYTOPE_POLYTOPE:
        return hulls.choose_elements(feature, arrangement, sizes, hull, R, r, out)
    code = choose_points(feature, sizes, R, r) if kind == Pair.CAPSULE_CAPSULE else 1
    _put(kind, feature, code, sizes, hull, R, r, out)
    return code if out[0] < ABSENT else 0


@kernel
def collide_chosen(
    kind: int, feature: int, code: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector, out: Vector
) -> None:
    """Contact of the elements that `choose` found: smooth, wherever the shapes have moved to since then."""
    _put(kind % SWAPPED, feature, code, sizes, hull, R, r, out)
    if kind >= SWAPPED and code != 0:
        exchange(R, r, out)


@kernel
def instead(kind: int, feature: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector) -> int:
    """Elements for a point whose choice overlapped at this pose, where a step begins; 0 for none: it is omitted."""
    return hulls.face_towards(feature, sizes, hull, R, r) if kind % SWAPPED == Pair.POLYTOPE_POLYTOPE else 0


@inner_kernel
def _put(kind: int, feature: int, code: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector, out: Vector) -> None:
    if code == 0:
        absent(out)
    elif kind == Pair.SPHERE_SPHERE:
        sphere_sphere(sizes, r, out)
    elif kind == Pair.SPHERE_CAPSULE:
        sphere_capsule(sizes, r, out)
    elif kind == Pair.SPHERE_BOX:
        sphere_box(sizes, r, out)
    elif kind == Pair.SPHERE_CYLINDER:
        sphere_cylinder(sizes, r, out)
    elif kind == Pair.SPHERE_HALFSPACE:
        sphere_halfspace(sizes, r, out)
    elif kind == Pair.CAPSULE_CAPSULE:
        put_points(code, sizes, R, r, out)
    elif kind == Pair.CAPSULE_BOX:
        capsule_box.put_elements(code, sizes[0], sizes[1], (sizes[4], sizes[5], sizes[6]), R, r, out)
    elif kind == Pair.CAPSULE_HALFSPACE:
        capsule_halfspace(feature, sizes, R, r, out)
    elif kind == Pair.BOX_BOX:
        put_elements(code, (sizes[0], sizes[1], sizes[2]), (sizes[4], sizes[5], sizes[6]), R, r, out)
    elif kind == Pair.BOX_HALFSPACE:
        box_halfspace(feature, sizes, R, r, out)
    elif kind == Pair.CYLINDER_HALFSPACE:
        cylinder_halfspace(feature, sizes, R, r, out)
    elif kind == Pair.STRING:
        string(sizes, r, out)
    elif kind == Pair.ELLIPSOID_HALFSPACE:
        ellipsoid_halfspace(sizes, R, r, out)
    elif kind == Pair.ELLIPSOID_ELLIPSOID:
        ellipsoid_ellipsoid(sizes, R, r, out)
    elif kind == Pair.CYLINDER_ELLIPSOID:
        cylinder_ellipsoid(sizes, R, r, out)
    elif kind == Pair.POLYTOPE_ELLIPSOID:
        polytope_ellipsoid(sizes, hull, R, r, out)
    elif kind == Pair.POLYTOPE_POLYTOPE:
        hulls.put_elements(feature, code, sizes, hull, R, r, out)
    else:
        absent(out)
