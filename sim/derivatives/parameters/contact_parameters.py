"""Parameters of contacts and collisions."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from sim.derivatives.parameters.directions import SIDE, Effect
from sim.derivatives.parameters.parameter import Parameter, Term, vector
from sim.derivatives.parameters.tree_parameters import frame_turns
from sim.mechanism.axes import contact_frame
from sim.mechanism.collision import Collision
from sim.mechanism.contact import Contact
from sim.mechanism.contact_candidates import ContactCandidate
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.polytope import Polytope
from sim.mechanism.shapes import HalfSpace, Solid, String
from sim.model.record_columns import MomentRow
from sim.model.shape_kinds import Size
from solvers.types import Floats


def normal_turns(normal: ArrayLike) -> Floats:
    """(3, 3) rotation of the frame of a contact by its normal, which is kept at unit length."""
    n, t1, t2 = contact_frame(normal)
    return frame_turns(n, t1, t2, np.eye(3)[0 if abs(n[0]) < 0.9 else 1])


def contact_parameters(contact: Contact, c: int) -> list[Parameter]:
    """friction, restitution, contact_point, contact_height, contact_radius; contact_normal of half-spaces."""
    turns = normal_turns(contact.normal)
    found = [
        Parameter("friction", contact.name, "", contact.friction, ((Effect.FRICTION, c, 0, 1.0),)),
        Parameter("restitution", contact.name, "", contact.restitution, ((Effect.RESTITUTION, c, 0, 1.0),)),
        *turning_friction(contact, [c]),
        *vector("contact_point", contact.name, contact.point, lambda k: [(Effect.POINT, c, k, 1.0)]),
        Parameter("contact_height", contact.name, "", contact.height, ((Effect.HEIGHT, c, 0, 1.0),)),
        Parameter("contact_radius", contact.name, "", contact.radius, ((Effect.RADIUS, c, 0, 1.0),)),
    ]
    if contact.terrain is not None:
        return found
    return found + vector(
        "contact_normal",
        contact.name,
        contact.normal,
        lambda k: [(Effect.NORMAL, c, j, float(turns[j, k])) for j in range(3)],
    )


def turning_friction(part: Contact | Collision, contacts: list[int]) -> list[Parameter]:
    """torsional_friction and rolling_friction, each where it is not zero: without it there is no such law."""
    lengths = (part.torsional_friction or 0.0, part.rolling_friction or 0.0)
    return [
        Parameter(kind, part.name, "", length, tuple((Effect.TURNING_FRICTION, c, int(row), 1.0) for c in contacts))
        for row, kind, length in zip(MomentRow, ("torsional_friction", "rolling_friction"), lengths, strict=True)
        if length > 0.0
    ]


def collision_parameters(mech: Mechanism) -> Iterator[Parameter]:
    """friction, restitution, and of both shapes the centres in their bodies (or the world) and the sizes."""
    ground = len(mech.contacts)
    index = {name: i for i, name in enumerate(mech.body_names)}
    for collision in mech.collisions:
        mine = [j for j, candidate in enumerate(mech.contact_candidates) if candidate.collision == collision.name]
        if not mine:  # of two parts that are fixed to one another
            continue
        for kind, effect, value in (
            ("friction", Effect.FRICTION, collision.friction or 0.0),
            ("restitution", Effect.RESTITUTION, collision.restitution or 0.0),
        ):
            if kind == "restitution" or not isinstance(collision.shape_a, String):  # a string does not rub
                yield Parameter(kind, collision.name, "", value, tuple((effect, ground + j, 0, 1.0) for j in mine))
        yield from turning_friction(collision, [ground + j for j in mine])
        firsts = [
            j for j in mine if mech.contact_candidates[j].feature == 0
        ]  # the corners of a polytope are one by one
        swapped = mech.contact_candidates[mine[0]].bodies[0] != index.get(collision.a, -1)
        for side, letter in enumerate("ba" if swapped else "ab"):
            shape = shape_of(mech, collision, letter)
            yield from _center(f"shape_{letter}", collision.name, shape, side, firsts)
            candidates = {j: mech.contact_candidates[j] for j in firsts}
            for label, value, terms in _sizes(collision, letter, shape, side, candidates):
                yield Parameter(f"size_{letter}", collision.name, label, value, terms)


def _center(kind: str, name: str, shape: Solid, side: int, firsts: list[int]) -> list[Parameter]:
    """Where a shape sits, of a collision with these first pairs."""
    return vector(kind, name, shape.center, lambda k: [(Effect.SHAPE_SHIFT, j, 3 * side + k, 1.0) for j in firsts])


def shape_of(mech: Mechanism, collision: Collision, letter: str) -> Solid:
    """Shape a or b of a collision: its own, or that of the body."""
    own: Solid | None = collision.shape_a if letter == "a" else collision.shape_b
    body = collision.a if letter == "a" else collision.b
    return own if own is not None else mech.bodies[mech.body_names.index(body or "")].shapes[0]


def _sizes(
    collision: Collision, letter: str, shape: Solid, side: int, candidates: dict[int, ContactCandidate]
) -> Iterator[tuple[str, float, tuple[Term, ...]]]:
    """(component, value, terms) of the sizes of a shape; a polytope has one factor of its corners, 1 by default."""
    if isinstance(shape, String):
        if letter == "a":  # that of b has no meaning
            ends = [(Effect.SHAPE_SIZE, j, SIDE * s + Size.STRING, 1.0) for j in candidates for s in (0, 1)]
            yield "length", shape.length, tuple(ends)
        return
    against = collision.shape_b if letter == "a" else collision.shape_a
    if isinstance(shape, Polytope) and isinstance(against, HalfSpace):  # each corner is a point at its place
        moves = [
            (Effect.SHAPE_SHIFT, j, 3 * side + k, float(x))
            for j, candidate in candidates.items()
            for k, x in enumerate(candidate.places[side, :3] - np.asarray(shape.center))
        ]
        yield "scale", 1.0, tuple(moves)
        return
    for label, (size, unit) in shape.surface.items():
        value = float(getattr(shape, label, 1.0))
        yield label, value, tuple((Effect.SHAPE_SIZE, j, SIDE * side + size, unit) for j in candidates)
