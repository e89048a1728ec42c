"""ContactCandidate: a contact point that a collision may have, as kernels need it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from math import inf

import numpy as np

from sim.mechanism.body import Body
from sim.mechanism.collision import Collision
from sim.mechanism.joint import WORLD, Joint
from sim.mechanism.polytope import Polytope, hull_table
from sim.mechanism.shapes import HalfSpace, Solid, String, rotation_matrix
from sim.mechanism.signed_distance import SignedDistance
from sim.model import shape_kinds
from solvers.types import Floats

End = tuple[int, Solid]  # body, -1 for the world, and shape


@dataclass(frozen=True)
class ContactCandidate:
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
    moment_friction: tuple[float, float]  # torsional and rolling [m]
    collision: str
    reach: float  # infinite where there is none


def contact_candidates(
    call: str, bodies: Sequence[Body], joints: Sequence[Joint], collisions: Sequence[Collision]
) -> list[ContactCandidate]:
    """All contact points that collisions may have; those of the same two bodies follow one another.

    Parts fixed to one another cannot collide: no motion changes the gap, and the impulse is undetermined.
    """
    index = {body.name: i for i, body in enumerate(bodies)} | {WORLD: -1}
    holder = _holders(index, joints)
    found = [candidate for collision in collisions for candidate in _candidates(call, bodies, index, collision)]
    found = [candidate for candidate in found if holder[candidate.bodies[0]] != holder[candidate.bodies[1]]]
    order = list(dict.fromkeys(candidate.bodies for candidate in found))
    return sorted(found, key=lambda candidate: order.index(candidate.bodies))


def _holders(index: dict[str, int], joints: Sequence[Joint]) -> dict[int, int]:
    """For each body the first of those fixed to it; -1 for bodies fixed to the world."""
    holder = {-1: -1}
    for i, joint in enumerate(joints):
        holder[i] = holder[index[joint.parent or WORLD]] if joint.nv == 0 else i
    return holder


def _candidates(
    call: str, bodies: Sequence[Body], index: dict[str, int], collision: Collision
) -> list[ContactCandidate]:
    call = f"{call}: collision {collision.name!r}"
    solids: list[End] = []
    for body, given in ((collision.a, collision.shape_a), (collision.b or WORLD, collision.shape_b)):
        i = index[body]
        shapes = (given,) if given is not None else bodies[i].shapes
        if not shapes:
            raise ValueError(f"{call}: body {body!r} has no shape; give one to the body or to the collision")
        solids.append((i, shapes[0]))  # the only one, see collision.py
    (a, first), (b, second) = solids
    if isinstance(first, String) and isinstance(second, String) and first.length != second.length:
        raise ValueError(f"{call}: both ends of a string have its length, got {first.length:g} and {second.length:g}")
    if isinstance(first, _STANDING) and isinstance(second, HalfSpace):
        return _corners(collision, (a, first), (b, second))
    if isinstance(first, HalfSpace) and isinstance(second, _STANDING) and b >= 0:
        return _corners(collision, (b, second), (a, first))
    match = shape_kinds.pair(first.code, second.code)
    if match is None:
        names = f"{type(first).__name__} and {type(second).__name__}"
        raise ValueError(f"{call}: there is no collision of {names}: {_REASON}")
    kind, swapped = match
    if kind == shape_kinds.Pair.POLYTOPE_POLYTOPE:  # of two polytopes that are one in other pairs, b is the polytope
        swapped = not isinstance(second, Polytope)
    return _points(collision, kind, solids[::-1] if swapped else solids)


def _points(collision: Collision, kind: shape_kinds.Pair, ends: list[End]) -> list[ContactCandidate]:
    """The contact points of two shapes in the order of their pair."""
    rope = isinstance(ends[0][1], String)  # which pulls along itself, and does not rub
    sizes = np.zeros(8)
    values: tuple[float, ...]
    around, corners, tables = [0.0, 0.0], [0, 0], []
    for k, (_, shape) in enumerate(ends):
        if isinstance(shape, SignedDistance):
            tables.append(shape.level_set.table)
            thick = float(np.ptp(shape.outline(), axis=0).min())
            values, around[k] = (0.0, shape.offset, thick), shape.bounding_radius()
        elif shape_kinds.tables(kind)[k]:
            table, radius = hull_table(shape)
            points = table[1 : 1 + int(table[0, 0]), :3]
            thick = radius if len(points) < 4 else float(np.ptp(points, axis=0).min())
            values = (0.0, radius, thick)
            around[k], corners[k] = float(np.linalg.norm(points, axis=1).max()) + radius, len(points)
            tables.append(table)
        else:
            values, around[k] = shape.sizes(), shape.bounding_radius()
        sizes[4 * k : 4 * k + len(values)] = values
    code, number = int(kind), shape_kinds.count(kind, (corners[0], corners[1]))
    if ends[0][0] < 0:  # the world is always b
        ends, around, code = ends[::-1], around[::-1], code + shape_kinds.SWAPPED
    places = np.array([_place(shape) for _, shape in ends])
    return [
        ContactCandidate(
            collision.name if number == 1 else f"{collision.name}_{feature}",
            (ends[0][0], ends[1][0]),
            code,
            feature,
            sizes,
            tuple(tables) if feature == 0 else (),
            (around[0], around[1]),
            places,
            0.0 if rope else collision.friction or 0.0,
            "impact" if rope else collision.law,
            collision.restitution or 0.0,
            (0.0, 0.0) if rope else _moment_friction(collision),
            collision.name,
            inf if collision.reach is None else collision.reach,
        )
        for feature in range(number)
    ]


_STANDING = (Polytope, SignedDistance)  # on a plane, with points
_REASON = (
    "half-spaces do not end, so one of the two has to be another shape; the ends of a string are both strings; "
    "a signed distance collides with spheres, capsules and half-spaces"
)


def _corners(collision: Collision, solid: tuple[int, Polytope | SignedDistance], ground: End) -> list[ContactCandidate]:
    """A polytope above a half-space touches it with its corners: points, each a ball without radius; a signed distance
    with the points of its stance, each with the offset around it.
    """
    body, shape = solid
    places = np.array([_place(shape), _place(ground[1])])
    kind, bodies = int(shape_kinds.Pair.SPHERE_HALFSPACE), (body, ground[0])
    stance, out = shape.stance(), []
    sizes = np.zeros(8)
    sizes[0] = stance.radius
    for k, point in enumerate(stance.points @ places[0, 3:].reshape(3, 3).T + places[0, :3]):
        where = places.copy()
        where[0, :3] = point
        law = (
            collision.friction or 0.0,
            collision.law,
            collision.restitution or 0.0,
            _moment_friction(collision),
            collision.name,
        )
        reach = inf if collision.reach is None else collision.reach
        out.append(
            ContactCandidate(
                f"{collision.name}_{k}", bodies, kind, 0, sizes.copy(), (), (stance.radius, np.inf), where, *law, reach
            )
        )
    return out


def _moment_friction(collision: Collision) -> tuple[float, float]:
    """Torsional and rolling friction [m]."""
    return collision.torsional_friction or 0.0, collision.rolling_friction or 0.0


def _place(shape: Solid) -> Floats:
    """Centre and rotation of a shape in its body, (12,)."""
    return np.concatenate([np.asarray(shape.center), rotation_matrix(shape.orientation).ravel()])


def couples(found: Sequence[ContactCandidate]) -> list[tuple[int, int]]:
    """The pairs of bodies, in the order of their candidates."""
    return [bodies for bodies, _ in groupby(found, key=lambda candidate: candidate.bodies)]
