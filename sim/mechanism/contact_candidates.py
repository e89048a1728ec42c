"""Touch: a contact point that a collision may have, as kernels need it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from sim.mechanism.bounding_spheres import bounding_radius
from sim.mechanism.collision import Collision
from sim.mechanism.parts import WORLD, Body, Joint
from sim.mechanism.polytope import Polytope, hull_table
from sim.mechanism.shapes import Box, Capsule, Cylinder, HalfSpace, Solid, Sphere, String, rotation_matrix
from sim.model import shape_kinds
from sim.model.shape_kinds import CROSSINGS, EDGES, RIM_POINTS, SPARE

Floats = NDArray[np.float64]
End = tuple[int, Solid]  # body, -1 for the world, and shape


@dataclass(frozen=True)
class Touch:
    """One contact point that a collision may have, as kernels need it: a and b in the order of `collide`."""

    name: str
    bodies: tuple[int, int]  # -1 for the world
    kind: int
    feature: int
    sizes: Floats  # (8,)
    hulls: tuple[Floats, ...]  # tables of polytopes a and b, in the order of the pair, at the first point
    radii: tuple[float, float]  # of the balls around the shapes of a and b; infinite where there is none
    places: Floats  # (2, 12) centre and rotation of the shapes in their bodies
    friction: float
    law: str
    restitution: float
    collision: str


def touches(call: str, bodies: Sequence[Body], joints: Sequence[Joint], collisions: Sequence[Collision]) -> list[Touch]:
    """All contact points that collisions may have; those of the same two bodies follow one another.

    Parts fixed to one another cannot collide: no motion changes the gap, and the impulse is undetermined.
    """
    index = {body.name: i for i, body in enumerate(bodies)} | {WORLD: -1}
    holder = _holders(index, joints)
    found = [touch for collision in collisions for touch in _touches(call, bodies, index, collision)]
    found = [touch for touch in found if holder[touch.bodies[0]] != holder[touch.bodies[1]]]
    order = list(dict.fromkeys(touch.bodies for touch in found))
    return sorted(found, key=lambda touch: order.index(touch.bodies))


def _holders(index: dict[str, int], joints: Sequence[Joint]) -> dict[int, int]:
    """For each body the first of those fixed to it; -1 for bodies fixed to the world."""
    holder = {-1: -1}
    for i, joint in enumerate(joints):
        holder[i] = holder[index[joint.parent or WORLD]] if joint.nv == 0 else i
    return holder


def _touches(call: str, bodies: Sequence[Body], index: dict[str, int], collision: Collision) -> list[Touch]:
    call = f"{call}: collision {collision.name!r}"
    solids: list[End] = []
    for body, given in ((collision.a, collision.shape_a), (collision.b or WORLD, collision.shape_b)):
        i = index[body]
        shape = given if given is not None else bodies[i].shape
        if shape is None:
            raise ValueError(f"{call}: body {body!r} has no shape; give one to the body or to the collision")
        solids.append((i, shape))
    (a, first), (b, second) = solids
    if isinstance(first, String) and isinstance(second, String) and first.length != second.length:
        raise ValueError(f"{call}: both ends of a string have its length, got {first.length:g} and {second.length:g}")
    if isinstance(first, Polytope) and isinstance(second, HalfSpace):
        return _corners(collision, (a, first), (b, second))
    if isinstance(first, HalfSpace) and isinstance(second, Polytope) and b >= 0:
        return _corners(collision, (b, second), (a, first))
    for one, other in ((solids, second), (solids[::-1], first)):
        if isinstance(other, Cylinder) and type(one[0][1]) in (Capsule, Box, Polytope):
            return _on_cylinder(collision, one)
    if Polytope in (type(first), type(second)) and {type(first), type(second)} <= _CONVEX:
        return _polytopes(collision, solids if isinstance(second, Polytope) else solids[::-1])
    codes = [_CODES.get(type(first)), _CODES.get(type(second))]
    match = None if codes[0] is None or codes[1] is None else shape_kinds.pair(codes[0], codes[1])
    if match is None:
        names = f"{type(first).__name__} and {type(second).__name__}"
        raise ValueError(f"{call}: there is no collision of {names}: {_REASON}")
    kind, swapped = match
    return _features(collision, kind, solids[::-1] if swapped else solids)


def _features(collision: Collision, kind: shape_kinds.Pair, ends: list[End]) -> list[Touch]:
    """The contact points of two shapes in the order of their pair."""
    code, number = int(kind), shape_kinds.count(kind)
    rope = isinstance(ends[0][1], String)  # which pulls along itself, and does not rub
    sizes = np.zeros(8)
    around = []
    for k, (_, shape) in enumerate(ends):
        values = _sizes(shape)
        sizes[4 * k : 4 * k + len(values)] = values
        around.append(bounding_radius(_CODES[type(shape)], values))
    if ends[0][0] < 0:  # the world is always b
        ends, around, code = ends[::-1], around[::-1], code + shape_kinds.SWAPPED
    places = np.array([_place(shape) for _, shape in ends])
    return [
        Touch(
            collision.name if number == 1 else f"{collision.name}_{feature}",
            (ends[0][0], ends[1][0]),
            code,
            feature,
            sizes,
            (),
            (around[0], around[1]),
            places,
            0.0 if rope else collision.friction,
            "impact" if rope else collision.law,
            collision.restitution,
            collision.name,
        )
        for feature in range(number)
    ]


_REASON = "half-spaces do not end, so one of the two has to be another shape; the ends of a string are both strings"


def _corners(collision: Collision, solid: tuple[int, Polytope], ground: End) -> list[Touch]:
    """A polytope above a half-space touches it with its corners: points, each a ball without radius."""
    body, shape = solid
    places = np.array([_place(shape), _place(ground[1])])
    kind, bodies = int(shape_kinds.Pair.SPHERE_HALFSPACE), (body, ground[0])
    out = []
    for k, point in enumerate(np.asarray(shape.vertices) @ places[0, 3:].reshape(3, 3).T + places[0, :3]):
        where = places.copy()
        where[0, :3] = point
        law = (collision.friction, collision.law, collision.restitution, collision.name)
        out.append(Touch(f"{collision.name}_{k}", bodies, kind, 0, np.zeros(8), (), (0.0, np.inf), where, *law))
    return out


_CONVEX: set[type] = {Polytope, Box, Capsule, Sphere}


def _polytopes(collision: Collision, ends: list[End]) -> list[Touch]:
    """The contact points of a shape and a polytope: corners, and crossings of edges."""
    tables, radii = zip(*(hull_table(shape) for _, shape in ends), strict=True)
    corners = [table[1 : 1 + int(table[0, 0]), :3] for table in tables]
    around = [float(np.linalg.norm(c, axis=1).max()) + r for c, r in zip(corners, radii, strict=True)]
    thick = [r if len(c) < 4 else float(np.ptp(c, axis=0).min()) for c, r in zip(corners, radii, strict=True)]
    sizes = np.array([0.0, radii[0], thick[0], 0.0, 0.0, radii[1], thick[1], 0.0])
    number = len(corners[0]) + len(corners[1]) + (EDGES if tables[0][0, 1] > 0 else SPARE)
    return _points(collision, ends, shape_kinds.Pair.POLYTOPE_POLYTOPE, number, sizes, around, tables)


def _on_cylinder(collision: Collision, ends: list[End]) -> list[Touch]:
    """The contact points of a capsule, box or polytope and a cylinder: corners, points of rims, crossings."""
    table, radius = hull_table(ends[0][1])
    corners = table[1 : 1 + int(table[0, 0]), :3]
    cylinder = _sizes(ends[1][1])
    sizes = np.array([0.0, radius, radius or float(np.ptp(corners, axis=0).min()), 0.0, *cylinder, 0.0, 0.0])
    around = [
        float(np.linalg.norm(corners, axis=1).max()) + radius,
        bounding_radius(shape_kinds.Shape.CYLINDER, cylinder),
    ]
    number = len(corners) + CROSSINGS + (RIM_POINTS if table[0, 2] > 0 else 0)
    return _points(collision, ends, shape_kinds.Pair.POLYTOPE_CYLINDER, number, sizes, around, (table,))


def _points(
    collision: Collision,
    ends: list[End],
    kind: shape_kinds.Pair,
    number: int,
    sizes: Floats,
    around: list[float],
    tables: tuple[Floats, ...],
) -> list[Touch]:
    """The contact points of two shapes of which at least one has a table."""
    code = int(kind)
    if ends[0][0] < 0:  # the world is always b
        ends, around, code = ends[::-1], around[::-1], code + shape_kinds.SWAPPED
    places = np.array([_place(shape) for _, shape in ends])
    bodies, circles = (ends[0][0], ends[1][0]), (around[0], around[1])
    law = (collision.friction, collision.law, collision.restitution, collision.name)
    return [
        Touch(f"{collision.name}_{k}", bodies, code, k, sizes, tables if k == 0 else (), circles, places, *law)
        for k in range(number)
    ]


_CODES: dict[type, shape_kinds.Shape] = {
    Sphere: shape_kinds.Shape.SPHERE,
    Capsule: shape_kinds.Shape.CAPSULE,
    Box: shape_kinds.Shape.BOX,
    Cylinder: shape_kinds.Shape.CYLINDER,
    HalfSpace: shape_kinds.Shape.HALFSPACE,
    String: shape_kinds.Shape.STRING,
}


def _sizes(shape: Solid) -> tuple[float, ...]:
    """Sizes in the order of shape_kinds.Shape."""
    if isinstance(shape, Sphere):
        return (shape.radius,)
    if isinstance(shape, Capsule | Cylinder):
        return shape.radius, 0.5 * shape.length
    if isinstance(shape, Box):
        return 0.5 * shape.x, 0.5 * shape.y, 0.5 * shape.z
    return (shape.length,) if isinstance(shape, String) else ()


def _place(shape: Solid) -> Floats:
    """Centre and rotation of a shape in its body, (12,)."""
    return np.concatenate([np.asarray(shape.center), rotation_matrix(shape.orientation).ravel()])


def couples(found: Sequence[Touch]) -> list[tuple[int, int]]:
    """The pairs of bodies, in the order of their touches."""
    return [bodies for bodies, _ in groupby(found, key=lambda touch: touch.bodies)]
