"""`collide`: one contact point of a pair of shapes, in two halves.

choose           which elements of the shapes make it: a discrete choice, after that of `arrange` for all points
collide_chosen   the contact of those elements: smooth in the pose

The kernels of each pair are in pair_kernels.py.
"""

from __future__ import annotations

from sim.contact.collision.edge_axes import OPEN, Arrangement
from sim.contact.collision.pair_kernels import (
    arrange_box_box,
    arrange_capsule_box,
    arrange_polytope_polytope,
    choose_box_box,
    choose_capsule_box,
    choose_capsule_capsule,
    choose_capsule_field,
    choose_polytope_polytope,
    face_polytope_polytope,
    put_contact,
    sides_box_box,
    sides_capsule_box,
)
from sim.contact.collision.polytope_polytope import apart_polytopes
from sim.contact.collision.swapped_shapes import exchange_shapes
from sim.contact.collision.witness import ABSENT
from sim.model.model import Model
from sim.model.record_columns import Witness
from sim.model.shape_kinds import SWAPPED, Pair
from solvers.compiler import inner_kernel, kernel
from solvers.types import Vector


@kernel
def collide(model: Model, kind: int, feature: int, sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    """Distance, normal and point of contact point `feature` of shapes a and b, with derivatives by the twist of a.

    model    its hull has the tables of polytopes (polytope_table.py), and the kernels of this kind are linked
    kind     a Pair; Pair + SWAPPED: out is then that of b against a, in the frame of a, by the twist of b
    feature  0 to shape_kinds.count(kind) - 1
    sizes    (8,) sizes of a from 0, of b from 4 [m], in the order of shape_kinds.Shape
    R, r     pose of a in the frame of b: rotation (9,), row-major, and centre (3,) [m]
    out      (43,), overwritten, in the frame of b:
             0       phi, signed distance [m], negative inside; 1e9 if the point does not exist now
             1:4     n, unit normal from b to a
             4:7     p, midpoint of the two nearest points [m]
             7:25    dn/d(v, w), 25:43 dp/d(v, w): (3, 6), row-major; (v, w) is the twist of a about the origin of b:
                     dr = v + w x r, dR = [w] R
    d phi = n.(v + w x p).
    """
    choose(model, kind, feature, arrange(model, kind, sizes, R, r, OPEN), sizes, R, r, out)


@kernel
def open_sides(model: Model, kind: int, sizes: Vector, R: Vector, r: Vector) -> int:
    """Axes that separate the shapes at this pose, and their sides: the candidates of `arrange` one step later.

    Of the axes that separate shapes at the end of a step, one that did so at its beginning is the one that was there
    all the time; the others mean that a body has gone around a corner of the other one, or through it, and a contact
    along them would push it on its way: it would gain energy.
    """
    kind %= SWAPPED
    if kind == Pair.BOX_BOX:
        return sides_box_box(model, sizes, R, r)
    if kind == Pair.CAPSULE_BOX:
        return sides_capsule_box(model, sizes, R, r)
    return OPEN


@kernel
def apart_at_least(model: Model, kind: int, sizes: Vector, R: Vector, r: Vector) -> float:
    """A bound of the distance of the two shapes that takes a small part of the time of `arrange`; -1e300 for none."""
    return apart_polytopes(model, sizes, R, r) if kind % SWAPPED == Pair.POLYTOPE_POLYTOPE else -1e300


@kernel
def arrange(model: Model, kind: int, sizes: Vector, R: Vector, r: Vector, sides: int) -> Arrangement:
    """The discrete part of a collision: which face or edges of two boxes or polytopes decide, for all features.

    Once per pair and pose, where it saves most of the time of `collide`. sides: of the axes, those to choose from
    (`open_sides`); OPEN for all.
    """
    kind %= SWAPPED
    if kind == Pair.BOX_BOX:
        return arrange_box_box(model, sizes, R, r, sides)
    if kind == Pair.CAPSULE_BOX:
        return arrange_capsule_box(model, sizes, R, r, sides)
    if kind == Pair.POLYTOPE_POLYTOPE:
        return arrange_polytope_polytope(model, sizes, R, r, sides)
    return 0, -1, 0.0, 1.0, 1.0


@kernel
def choose(
    model: Model, kind: int, feature: int, arrangement: Arrangement, sizes: Vector, R: Vector, r: Vector, out: Vector
) -> int:
    """`collide`, with the result of `arrange`; also the elements that it found: a number, 0 for none."""
    code = _choose(model, kind % SWAPPED, feature, arrangement, sizes, R, r, out)
    if kind >= SWAPPED and code != 0:
        exchange_shapes(model, R, r, out)
    return code


@inner_kernel
def _choose(
    model: Model, kind: int, feature: int, arrangement: Arrangement, sizes: Vector, R: Vector, r: Vector, out: Vector
) -> int:
    if kind == Pair.BOX_BOX:
        return choose_box_box(model, feature, arrangement, sizes, R, r, out)
    if kind == Pair.CAPSULE_BOX:
        return choose_capsule_box(model, feature, arrangement, sizes, R, r, out)
    if kind == Pair.POLYTOPE_POLYTOPE:
        return choose_polytope_polytope(model, feature, arrangement, sizes, R, r, out)
    code = 1
    if kind == Pair.CAPSULE_CAPSULE:
        code = choose_capsule_capsule(model, feature, sizes, R, r)
    elif kind == Pair.CAPSULE_FIELD:
        code = choose_capsule_field(model, feature, sizes, R, r)
    put_contact(model, kind, feature, code, sizes, R, r, out)
    return 0 if out[Witness.GAP] >= ABSENT else code  # NaN: the contact was not found, and the step fails


@kernel
def collide_chosen(
    model: Model, kind: int, feature: int, code: int, sizes: Vector, R: Vector, r: Vector, out: Vector
) -> None:
    """Contact of the elements that `choose` found: smooth, wherever the shapes have moved to since then."""
    put_contact(model, kind % SWAPPED, feature, code, sizes, R, r, out)
    if kind >= SWAPPED and code != 0:
        exchange_shapes(model, R, r, out)


@kernel
def instead(model: Model, kind: int, feature: int, sizes: Vector, R: Vector, r: Vector) -> int:
    """Elements for a point whose choice overlapped at this pose, where a step begins; 0 for none: it is omitted."""
    return face_polytope_polytope(model, feature, sizes, R, r) if kind % SWAPPED == Pair.POLYTOPE_POLYTOPE else 0
