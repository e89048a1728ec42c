"""Scenes: several robots and objects in one mechanism, obstacles, and other ground under it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim import checks
from sim.collisions import Collision
from sim.mechanism import Mechanism
from sim.parts import WORLD, Joint
from sim.shape_contacts import shape_contacts
from sim.shapes import Solid, Sphere, rotation_matrix
from sim.terrain.terrain import Terrain
from sim.urdf.stance import poses

Floats = NDArray[np.float64]

_CLEAR = 1e-9  # [m] between the lowest contact and the ground, see sim/urdf/stance.py


def added(mech: Mechanism, other: Mechanism, pose: ArrayLike, prefix: str, name: str | None) -> Mechanism:
    """Both in one mechanism, see `Mechanism.add`."""
    call = "Mechanism.add"
    if not isinstance(other, Mechanism):
        raise ValueError(f"{call}(other): expected a Mechanism, got {other!r}")
    if not np.array_equal(np.asarray(mech.gravity), np.asarray(other.gravity)):
        raise ValueError(f"{call}(other): {mech.name!r} has the gravity {mech.gravity}, {other.name!r} {other.gravity}")
    point, quat = _pose(f"{call}(pose)", pose)
    neutral = np.concatenate([np.asarray(mech.neutral), _moved_neutral(other, point, quat)])
    parts = _renamed(other, prefix)
    _refuse_clashes(call, mech, parts, other.name)
    joints = [_moved_joint(j, point, quat) for j in parts["joints"]]
    loops = [_moved_joint(j, point, quat) for j in parts["loops"]]
    collisions = [_moved_obstacle(c, point, quat) for c in parts["collisions"]]
    return Mechanism(
        [*mech.bodies, *parts["bodies"]],
        [*mech.joints, *joints],
        [*mech.contacts, *parts["contacts"]],
        [*(mech.inputs or ()), *parts["inputs"]],
        mech.gravity,
        mech.name if name is None else name,
        neutral,
        [*mech.collisions, *collisions],
        [*mech.loops, *loops],
        [*mech.gears, *parts["gears"]],
    )


def _pose(call: str, pose: ArrayLike) -> tuple[Floats, Floats]:
    """Translation and quaternion of (3,) or (7,) numbers."""
    given = checks.array(call, pose, (None,))
    if len(given) not in (3, 7):
        raise ValueError(f"{call}: expected a translation (3,), or with a quaternion (7,), got shape {given.shape}")
    quat = checks.quaternion(call, given[3:]) if len(given) == 7 else (1.0, 0.0, 0.0, 0.0)
    return given[:3], np.asarray(quat)


def _product(a: ArrayLike, b: ArrayLike) -> Floats:
    """Hamilton product of two quaternions."""
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    scalar = a[0] * b[0] - a[1:] @ b[1:]
    return np.concatenate([[scalar], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])])


def _renamed(mech: Mechanism, prefix: str) -> dict[str, list[Any]]:
    """The parts of a mechanism with the prefix before every name."""
    names = {
        "bodies": ("name",),
        "joints": ("name", "parent", "child"),
        "contacts": ("name", "body"),
        "inputs": ("name", "joint", "body"),
        "collisions": ("name", "a", "b"),
        "loops": ("name", "parent", "child"),
        "gears": ("name", "joint", "other"),
    }

    def changed(part: Any, keys: Sequence[str]) -> Any:
        given = {key: getattr(part, key) for key in keys}
        return replace(part, **{k: v if v is None or v == WORLD else prefix + v for k, v in given.items()})

    return {field: [changed(part, keys) for part in getattr(mech, field)] for field, keys in names.items()}


def _refuse_clashes(call: str, mech: Mechanism, parts: dict[str, list[Any]], other: str) -> None:
    """Refuse names that both have."""
    joints = {j.name for j in (*mech.joints, *mech.loops)}
    taken = {field: {p.name for p in getattr(mech, field)} for field in parts} | {"joints": joints, "loops": joints}
    singular = dict(zip(parts, ("body", "joint", "contact", "input", "collision", "joint", "gear"), strict=True))
    for field, found in parts.items():
        for part in found:
            if part.name in taken[field]:
                raise ValueError(
                    f"{call}(other): both have a {singular[field]} {part.name!r}; "
                    f"give a prefix=... for the names of {other!r}"
                )


def _moved_joint(joint: Joint, point: Floats, quat: Floats) -> Joint:
    """A joint with the world moved; of one that floats, the coordinates are moved instead."""
    if joint.parent != WORLD or (joint.kind == "floating" and not joint.close):
        return joint
    place = point + rotation_matrix(quat) @ np.asarray(joint.parent_point)
    return replace(joint, parent_point=place, orientation=_product(quat, joint.orientation))


def _moved_neutral(mech: Mechanism, point: Floats, quat: Floats) -> Floats:
    """The neutral coordinates, those of floating roots moved: q' = F^-1 T F q, F the frame of the joint."""
    q = np.array(mech.neutral, dtype=np.float64)
    for joint in mech.joints:
        if joint.parent != WORLD or joint.kind != "floating":
            continue
        at = mech.q_slice(joint.name)
        frame, origin = np.asarray(joint.orientation), np.asarray(joint.parent_point)
        back = frame * (1.0, -1.0, -1.0, -1.0)
        place = rotation_matrix(quat) @ (origin + rotation_matrix(frame) @ q[at][:3]) + point
        q[at.start : at.start + 3] = rotation_matrix(back) @ (place - origin)
        q[at.start + 3 : at.stop] = _product(back, _product(quat, _product(frame, q[at][3:])))
    return q


def _moved_obstacle(collision: Collision, point: Floats, quat: Floats) -> Collision:
    """An obstacle moves with the scene it comes with."""
    shape = collision.shape_b
    if collision.b != WORLD or shape is None:
        return collision
    centre = point + rotation_matrix(quat) @ np.asarray(shape.center)
    return replace(collision, shape_b=replace(shape, center=centre, orientation=_product(quat, shape.orientation)))


def with_obstacle(mech: Mechanism, shape: Solid, bodies: Sequence[str] | None, name: str, **options: Any) -> Mechanism:
    """See `Mechanism.with_obstacle`."""
    call = "Mechanism.with_obstacle"
    if bodies is None:
        balls = [c for c in mech.contacts if c.radius > 0.0]
        if not balls:
            raise ValueError(f"{call}: {mech.name!r} has no contact with a radius; say which bodies=[...]")
        found = [
            Collision(c.body, None, Sphere(radius=c.radius, center=c.point), shape, name=f"{name}-{c.name}", **options)
            for c in balls
        ]
    else:
        for body in bodies:
            checks.one_of(f"{call}(bodies=...)", body, mech.body_names)
        found = [Collision(body, None, None, shape, name=f"{name}-{body}", **options) for body in bodies]
    return with_collisions(mech, found)


def with_collisions(mech: Mechanism, collisions: Iterable[Collision]) -> Mechanism:
    """See `Mechanism.with_collisions`."""
    return replace(mech, collisions=[*mech.collisions, *collisions])


def on_terrain(
    mech: Mechanism, terrain: Terrain, contacts: Sequence[str] | None, bodies: Sequence[str], **options: Any
) -> Mechanism:
    """See `Mechanism.on`."""
    call = "Mechanism.on"
    if not isinstance(terrain, Terrain):
        raise ValueError(f"{call}(terrain): expected a Terrain, got {terrain!r}")
    names = [c.name for c in mech.contacts]
    for name in contacts or ():
        checks.one_of(f"{call}(contacts=...)", name, names)
    for name in bodies:
        checks.one_of(f"{call}(bodies=...)", name, mech.body_names)
    if options and not bodies:
        raise ValueError(f"{call}({', '.join(options)}=...): of the contacts of bodies=[...]; none are given")
    shaped = [c for b in mech.bodies if b.name in bodies for c in shape_contacts(f"{call}(bodies=...)", b, **options)]
    level: Any = {"normal": (0.0, 0.0, 1.0), "height": 0.0, "terrain": terrain}
    chosen = [*(names if contacts is None else contacts), *(c.name for c in shaped)]
    found = [*mech.contacts, *shaped]
    moved = replace(mech, contacts=[replace(c, **level) if c.name in chosen else c for c in found])
    return replace(moved, neutral=_standing(moved))


def _standing(mech: Mechanism) -> Floats:
    """Neutral coordinates with every floating root as high as its lowest contact touches the ground."""
    q = np.array(mech.neutral, dtype=np.float64)
    at = poses(mech, q)
    for joint in mech.joints:
        if joint.parent != WORLD or joint.kind != "floating":
            continue
        hanging = {joint.child}
        for other in mech.joints:
            if other.parent in hanging:
                hanging.add(other.child)
        first = mech.q_slice(joint.name).start
        rises = []
        for c in mech.contacts:
            centre = at[c.body].at(c.point)
            slope = float(c.normal_at(centre)[2])
            if c.body in hanging and slope > 0.0:
                rises.append((_CLEAR - float(c.gap(centre))) / slope)
        if rises:
            q[first : first + 3] += max(rises) * rotation_matrix(joint.orientation)[2]
    return q
