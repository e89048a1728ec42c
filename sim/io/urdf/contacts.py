"""Contacts from the collision shapes of links: balls and points that cannot enter the ground.

sphere      one ball
capsule     two balls
box         its eight corners
cylinder    points on both rims, the first along x; two balls of its radius for a wheel, at the ends of its axis,
            which is exact as long as the axis is level. A wheel is a cylinder whose link turns about its axis.
hull        its corners; collision_meshes.py makes hulls of meshes
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from sim.io.loader_choices import LoaderChoices
from sim.io.urdf.report import Notes
from sim.io.urdf.robot import Geometry
from sim.io.urdf.tree import MergedLinks, Place
from sim.io.urdf.xml import UrdfError
from sim.mechanism import checks
from sim.mechanism.contact import Contact
from sim.mechanism.pose import HERE, Pose
from solvers.types import Floats

Balls = list[tuple[Floats, float]]  # centre (3,) and radius [m]

ALL = "*"  # among the chosen links: all others
SHAPES = ("sphere", "box", "cylinder", "capsule", "hull")
FRICTION = 0.8  # where neither the caller nor the file says anything
_PARALLEL = 1e-3  # [rad, radii] by how much the axis of a wheel may miss that of its joint


def find_contacts(
    places: dict[str, Place],
    coms: dict[str, Floats],
    chosen: Sequence[str | Contact] | None,
    choices: LoaderChoices,
    notes: Notes,
) -> list[Contact]:
    """The contacts of the chosen links, or of all, with points measured from the centres of mass of their bodies.

    coms: centre of mass of every body in its own frame.
    """
    picked = _picked(places, chosen)
    out: list[Contact] = []
    taken: set[str] = set()
    for name, place in places.items():
        if name not in picked:
            continue
        body = place.group.name
        given = picked[name]
        named = chosen is not None and name in as_list(chosen)
        if body not in coms:
            if given or place.group.links and _shapes(place):
                notes.add("no contacts on links that are fixed to the world", [name])
            continue
        link = place.link
        friction = next(mu for mu in (choices.friction, link.friction, FRICTION) if mu is not None)
        for contact in given:
            point = place.pose.at(contact.point) - coms[body]
            out.append(replace(contact, body=body, point=point, name=_free(contact.name or name, taken)))
        if given:
            continue
        balls = [ball for shape in _shapes(place) for ball in _balls(shape, place, choices.rim_points)]
        for k, (point, radius) in enumerate(balls):
            ball = Contact(
                body,
                point - coms[body],
                radius,
                friction=friction,
                law=choices.law,
                name=_free(name if len(balls) == 1 else f"{name}_{k}", taken),
                restitution=link.restitution or 0.0,
                torsional_friction=link.torsional_friction or 0.0,
                rolling_friction=link.rolling_friction or 0.0,
            )
            out.append(ball)
        other = sorted({s.kind for s in link.collisions if s.kind not in SHAPES})
        for kind in other:
            notes.add(f"no contact from collision shapes of kind {kind!r}", [name])
        if named and not balls:
            raise link.element.error(
                f"contacts=...: the link has no sphere, box, cylinder, capsule or mesh to make contacts of; "
                f"place one in its frame with dojo.Contact({name!r}, point=(x, y, z), radius=...)"
            )
    return out


def as_list(chosen: str | Contact | Sequence[str | Contact]) -> list[str | Contact]:
    """Links and contacts that the caller chose, one of them included."""
    return [chosen] if isinstance(chosen, str | Contact) else list(chosen)


def _picked(places: dict[str, Place], chosen: Sequence[str | Contact] | None) -> dict[str, list[Contact]]:
    """The links that get contacts, each with those that the caller placed by hand.  ALL: every link, by its shapes."""
    if chosen is None:
        return {name: [] for name in places}
    parts = as_list(chosen)
    picked: dict[str, list[Contact]] = {name: [] for name in places} if ALL in parts else {}
    for part in parts:
        name = part.body if isinstance(part, Contact) else part
        if part == ALL:
            continue
        if name not in places:
            known = f"{checks.listed(places)}{checks.nearest(name, places)}"
            raise UrdfError(f"load_urdf(contacts=...): {name!r} is not a link of the file: {known}")
        picked.setdefault(name, []).extend([part] if isinstance(part, Contact) else [])
    return picked


def _free(name: str, taken: set[str]) -> str:
    """A name that no other contact has."""
    label, k = name, 0
    while label in taken:
        k += 1
        label = f"{name}_{k}"
    taken.add(label)
    return label


def _shapes(place: Place) -> list[Geometry]:
    """The collision shapes of a link that make contacts."""
    return [s for s in place.link.collisions if s.kind in SHAPES]


def _balls(shape: Geometry, place: Place, rim: int) -> Balls:
    """Centres in the frame of the body, and radii."""
    pose = place.pose.then(shape.pose)
    if shape.kind == "sphere":
        return [(pose.point, shape.sizes[0])]
    if shape.kind == "box":
        half = 0.5 * np.array(shape.sizes)
        return [(pose.at(half * signs), 0.0) for signs in product((-1, 1), repeat=3)]
    if shape.points is not None:
        return [(pose.at(corner), 0.0) for corner in shape.points]
    radius, length = shape.sizes
    ends = [np.array([0.0, 0.0, side * length / 2]) for side in (-1, 1)]
    if shape.kind == "capsule" or is_wheel(pose, radius, place.group):
        return [(pose.at(end), radius) for end in ends]
    angles = 2.0 * np.pi * np.arange(rim) / rim
    around = [radius * np.array([np.cos(a), np.sin(a), 0.0]) for a in angles]
    return [(pose.at(end + offset), 0.0) for end in ends for offset in around]


def is_wheel(pose: Pose, radius: float, body: MergedLinks) -> bool:
    """Whether a cylinder with this pose in its body turns about its own axis."""
    if body.joint is None or body.joint.kind != "revolute" or body.fixed:
        return False
    axis = body.joint.axis
    aligned = float(np.linalg.norm(np.cross(axis, pose.rotation[:, 2]))) < _PARALLEL
    off = float(np.linalg.norm(np.cross(axis, pose.point - HERE.point)))
    return aligned and off < _PARALLEL * max(radius, 1e-9)
