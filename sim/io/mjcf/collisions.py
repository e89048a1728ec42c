"""Collisions from the geoms of an MJCF file: bodies with one another, and with geoms that are fixed to the world.

Two geoms meet where MuJoCo lets them: contype and conaffinity fit, they move relative to one another, neither body is
the parent of the other (but the world, or where a flag allows it), the file does not <exclude> their bodies; or a
<pair> names them. Friction is the larger of both, or that of the geom with priority, or of the <pair>; condim 1 is
without. Planes are left to sim/io/mjcf/contacts.py, but for geoms that have no balls or points to stand on: those
collide with a half-space.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from typing import Any

from sim.io.loader_choices import LoaderChoices
from sim.io.mjcf.contacts import STANDING, Rubbing, fixed_planes, label_on, listed, plane_pose, rubbing
from sim.io.mjcf.flags import parents_apart
from sim.io.mjcf.welded_bodies import NO_SHAPE, PLANE, GeomGroup, Where, name_of, solid_of
from sim.io.urdf.report import Notes
from sim.mechanism.collision import Collision
from sim.mechanism.joint import WORLD
from sim.mechanism.shapes import Capsule, HalfSpace, Solid, Sphere


def find_collisions(model: Any, where: Where, choices: LoaderChoices, notes: Notes) -> list[Collision]:
    """The collisions of all geoms that may meet."""
    chosen, law = choices.friction, choices.law
    out = []
    for a, b, rubbed in _pairs(model, where):
        names = [name_of(model, "geom", g) for g in (a, b)]
        first, second = (_solid(model, where, g) for g in (a, b))
        for g, name, solid in zip((a, b), names, (first, second), strict=True):
            if solid is None:
                notes.add(f"no collisions of geoms of kind {NO_SHAPE[int(model.geom_type[g])]}", [name], warn=True)
        if first is None or second is None:
            continue
        one, other = (group.name if group else WORLD for group in (_owner(model, where, a), _owner(model, where, b)))
        mu, name = rubbed.friction if chosen is None else chosen, f"{names[0]}-{names[1]}"
        if rubbed.margin:
            first, second = _grown(first, second, rubbed.margin, name, notes)
        kind = "impact" if rubbed.slippery else law
        turning = rubbed.turning(choices)
        out.append(Collision(one, other, first, second, friction=mu, law=kind, name=name, **turning))
    return out


def find_on_planes(model: Any, where: Where, choices: LoaderChoices) -> list[Collision]:
    """The collisions of geoms without balls and points with all planes that they touch."""
    chosen, law = choices.friction, choices.law
    planes, pairs = fixed_planes(model, where), listed(model)
    out = []
    for g in range(model.ngeom):
        group, solid = _owner(model, where, g), _solid(model, where, g)
        if group is None or solid is None or int(model.geom_type[g]) in STANDING:
            continue
        rough = {p: rubbed for p in planes if (rubbed := rubbing(model, pairs, g, p))}
        for p, rubbed in rough.items():
            plane = plane_pose(model, p)
            center = plane.point + rubbed.margin * plane.rotation[:, 2]
            ground = HalfSpace(center=center, orientation=plane.quaternion)
            mu, kind = rubbed.friction if chosen is None else chosen, "impact" if rubbed.slippery else law
            name = label_on(model, g, p, list(rough))
            turning = rubbed.turning(choices)
            out.append(Collision(group.name, None, solid, ground, friction=mu, law=kind, name=name, **turning))
    return out


def _grown(a: Solid, b: Solid, margin: float, name: str, notes: Notes) -> tuple[Solid, Solid]:
    """Two shapes that touch at a distance: the round ones among them are larger, by half of the margin if both are."""
    count = isinstance(a, Sphere | Capsule) + isinstance(b, Sphere | Capsule)
    if not count:
        notes.add("margins between geoms that are neither spheres nor capsules are omitted", [name], warn=True)
    first, second = (
        replace(shape, radius=shape.radius + margin / count) if isinstance(shape, Sphere | Capsule) else shape
        for shape in (a, b)
    )
    return first, second


def _pairs(model: Any, where: Where) -> Iterator[tuple[int, int, Rubbing]]:
    """Geoms a < b that may meet, planes aside, and how they touch."""
    named, apart = listed(model), parents_apart(model)
    for a, b in combinations(range(model.ngeom), 2):
        owners = _owner(model, where, a), _owner(model, where, b)
        if owners[0] is owners[1] or PLANE in (model.geom_type[a], model.geom_type[b]):
            continue
        if apart and _related(*owners) and (a, b) not in named:
            continue
        rubbed = rubbing(model, named, a, b)
        if rubbed is not None:
            yield a, b, rubbed


def _owner(model: Any, where: Where, g: int) -> GeomGroup | None:
    """The group of a geom, None for the world."""
    return where[int(model.geom_bodyid[g])][0]


def _related(a: GeomGroup | None, b: GeomGroup | None) -> bool:
    """Whether one hangs on the other; everything may meet the world."""
    return a is not None and b is not None and (a.parent is b or b.parent is a)


def _solid(model: Any, where: Where, g: int) -> Solid | None:
    """The shape of a geom, from the centre of mass of its body, or in the world; None where there is none."""
    group, frame = where[int(model.geom_bodyid[g])]
    return solid_of(model, g, frame, group.com if group else 0.0)
