"""Mechanism: bodies hung on joints in a tree, with contacts and inputs; sorted and validated."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim import drawn
from sim.mechanism import checks
from sim.mechanism.body import Body
from sim.mechanism.collision import Collision, shape_by_shape
from sim.mechanism.contact import Contact
from sim.mechanism.contact_candidates import ContactCandidate, contact_candidates
from sim.mechanism.dofs import components, dof_names
from sim.mechanism.forward_kinematics import body_poses
from sim.mechanism.gear import Gear, check_gears, geared
from sim.mechanism.input import Input
from sim.mechanism.joint import WORLD, Joint
from sim.mechanism.joint_coordinates import coordinate_limits, coordinates, joint_places
from sim.mechanism.loop_joints import carried
from sim.mechanism.moved_scene import moved_coordinates, moved_joint, moved_obstacle, moved_visual
from sim.mechanism.naming import name_contacts, name_inputs
from sim.mechanism.renamed import renamed
from sim.mechanism.rising_bases import CARRIES, rising_bases
from sim.mechanism.self_collisions import self_collisions
from sim.mechanism.shape_contacts import shape_contacts
from sim.mechanism.shapes import Solid, Sphere
from sim.mechanism.terrain import Terrain
from sim.mechanism.tree import check_axes, check_loops, check_masses, sort_tree
from sim.mechanism.visual import Visual
from solvers.types import Floats, Integers


@dataclass(frozen=True, repr=False)
class Mechanism:
    """A tree of bodies. Afterwards body i hangs on joint i, and parents come before children.

    Attributes:
        bodies: the bodies.
        joints: the joints, one per body; those with close=True are moved to `loops`.
        contacts: contacts with the ground (default none).
        inputs: entries of u in order (default None: every degree of freedom of every joint but the floating ones and
            those that close loops).
        gravity: (3,) acceleration of gravity [m/s^2] (default 9.81 downwards).
        name: name of the mechanism.
        neutral: coordinates of the standing or hanging configuration: {joint name: its coordinates}, zero for joints
            without a name in it, but by a gear with one that has; or all of q (default None: zero).
        collisions: collisions of bodies with each other and with obstacles (default none). "self" stands for all pairs
            of shapes but those of links that a joint connects, and those that overlap in the neutral state
            (self_collisions.py).
        loops: joints that close loops (default none).
        gears: couplings of joint coordinates (default none).
        scenery: parts of pictures that are fixed to the world (default none).

    Raises:
        ValueError: the parts are no tree, a name is unknown or used twice, or a value is out of range.
    """

    bodies: Sequence[Body]
    joints: Sequence[Joint]
    contacts: Sequence[Contact] = ()
    inputs: Sequence[Input] | None = None
    gravity: ArrayLike = (0.0, 0.0, -9.81)
    name: str = "mechanism"
    neutral: Mapping[str, ArrayLike] | ArrayLike | None = None
    collisions: Sequence[Collision] = ()
    loops: Sequence[Joint] = ()
    gears: Sequence[Gear] = ()
    scenery: Sequence[Visual] = ()

    def __post_init__(self) -> None:
        checks.name("Mechanism(name=...)", self.name)
        call = f"Mechanism({self.name!r}"
        itself = isinstance(self.collisions, str)
        if itself:
            checks.one_of(f"{call}, collisions=...)", str(self.collisions), ("self",))
            object.__setattr__(self, "collisions", ())
        for field, kind in _KINDS.items():
            if field != "inputs" or self.inputs is not None:
                object.__setattr__(self, field, _parts(f"{call}, {field}=...)", getattr(self, field), kind))
        loops = (*self.loops, *(j for j in self.joints if j.close))
        tree = tuple(j for j in self.joints if not j.close)
        if self.inputs is None:
            object.__setattr__(self, "inputs", _every_dof(tree))
        driven = {part.joint for part in self.inputs or () if part.joint is not None}
        bodies, tree, loops = carried(f"{call})", self.bodies, tree, loops, driven)
        object.__setattr__(self, "bodies", bodies)
        object.__setattr__(self, "joints", tree)
        object.__setattr__(self, "loops", check_loops(f"{call})", loops, self.bodies, self.joints))
        bodies, joints = sort_tree(f"{call})", self.bodies, self.joints)
        object.__setattr__(self, "bodies", bodies)
        object.__setattr__(self, "joints", joints)
        check_masses(f"{call})", bodies, joints)
        check_axes(f"{call})", bodies, joints)
        check_gears(f"{call})", self.gears, joints)
        if self.nv == 0:
            raise ValueError(f"{call}): no joint is free to move")
        neutral = coordinates(f"{call}, neutral=...)", self.joints, self.neutral)
        if self.gears and isinstance(self.neutral, Mapping):
            neutral = geared(neutral, self.neutral, self.joints, self.gears)
        object.__setattr__(self, "neutral", neutral)
        if itself:
            object.__setattr__(self, "collisions", tuple(self.self_collisions()[0]))
        ends = dict.fromkeys([*self.body_names, WORLD])
        for c in self.collisions:
            for name in (c.a, c.b):
                checks.one_of(f"{call}): body of collision {c.name!r}", name, ends)
        checks.distinct(f"{call}): collisions", (c.name for c in self.collisions))
        single = shape_by_shape(self.collisions, {b.name: b for b in self.bodies})
        object.__setattr__(self, "collisions", single)
        checks.distinct(f"{call}): collisions", (c.name for c in single))
        object.__setattr__(self, "contacts", name_contacts(f"{call})", self.contacts, self.body_names))
        object.__setattr__(self, "inputs", name_inputs(call, self.inputs or (), self.joints, self.body_names))
        object.__setattr__(self, "gravity", checks.vector(f"{call}, gravity=...)", self.gravity, 3))

    def __repr__(self) -> str:
        parts: dict[str, Any] = {"bodies": self.bodies, "inputs": self.inputs, "contacts": self.contacts}
        parts |= {"collisions": self.collisions, "loops": self.loops, "gears": self.gears}
        sizes = "".join(f", {part} {len(found)}" for part, found in parts.items() if found)
        return f"{type(self).__name__}({self.name}, nq {self.nq}, nv {self.nv}{sizes})"

    def _repr_html_(self) -> str:
        return drawn(self) + f"<p>{escape(repr(self))}</p>"

    @property
    def nbody(self) -> int:
        """Number of bodies, and of joints."""
        return len(self.bodies)

    @cached_property
    def nq(self) -> int:
        """Number of coordinates."""
        return sum(j.nq for j in self.joints)

    @cached_property
    def nv(self) -> int:
        """Number of degrees of freedom."""
        return sum(j.nv for j in self.joints)

    @cached_property
    def body_names(self) -> tuple[str, ...]:
        """Names of the bodies, in tree order."""
        return tuple(b.name for b in self.bodies)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in tree order."""
        return tuple(j.name for j in self.joints)

    @cached_property
    def ground_contact_names(self) -> tuple[str, ...]:
        """Names of the contacts with the ground."""
        return tuple(c.name for c in self.contacts)

    @cached_property
    def contact_names(self) -> tuple[str, ...]:
        """Names of the contacts: those with the ground, then the contact points of the collisions."""
        return (*self.ground_contact_names, *(candidate.name for candidate in self.contact_candidates))

    @cached_property
    def contact_candidates(self) -> tuple[ContactCandidate, ...]:
        """The contact points that the collisions may have."""
        return tuple(contact_candidates(f"Mechanism({self.name!r})", self.bodies, self.joints, self.collisions))

    @cached_property
    def contact_normals(self) -> NDArray[np.float64]:
        """(ncontact, 3) outward normals of the ground at the contacts, world axes."""
        out = np.array([np.asarray(c.normal) for c in self.contacts], dtype=np.float64).reshape(-1, 3)
        out.flags.writeable = False
        return out

    @cached_property
    def coordinate_limits(self) -> tuple[Floats, Floats]:
        """(lower, upper) limits of the coordinates, (nq,) each, infinite where there are none [m, rad]."""
        return coordinate_limits(self.joints)

    @cached_property
    def rising_bases(self) -> tuple[tuple[str, Integers, Floats], ...]:
        """Bases that can move straight up in the neutral state: see rising_bases.py."""
        return tuple(rising_bases(self.joints, self.bodies, np.asarray(self.neutral)))

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the entries of u."""
        return tuple(i.name for i in self.inputs or ())

    @cached_property
    def input_limits(self) -> tuple[Floats, Floats]:
        """(lower, upper) limits of the entries of u, (nu,) each, infinite where there are none [N, N m]."""
        table = np.array([i.limits for i in self.inputs or ()], dtype=np.float64).reshape(-1, 2)
        table.flags.writeable = False
        return table[:, 0], table[:, 1]

    @cached_property
    def dof_names(self) -> tuple[str, ...]:
        """Names of the degrees of freedom, (nv,), in the order of v: "knee", "base x", "base rz"."""
        return dof_names(self.joints)

    def components(self, *names: str) -> NDArray[np.int64]:
        """Indices into a perturbation dx = [dq; dv] of joints and degrees of freedom.

        Args:
            *names: "base" is all of a joint, "base x" one of its degrees of freedom, "v base", "v base x" their
                velocities, "q" and "v" all coordinates and all velocities.

        Returns:
            Indices (n,), in the order of the names.

        Raises:
            ValueError: a name is unknown; the message suggests a known one.
        """
        return components("Mechanism.components(...)", self.joints, names)

    def q_slice(self, joint: str) -> slice:
        """Place of the coordinates of a joint.

        Args:
            joint: name of the joint.

        Returns:
            The slice of q (nq,), and of a state x (nx,).

        Raises:
            ValueError: the name is unknown; the message suggests a known one.
        """
        return self._slices[checks.one_of("Mechanism.q_slice(joint)", joint, self._slices)][0]

    def v_slice(self, joint: str) -> slice:
        """Place of the velocities of a joint.

        Args:
            joint: name of the joint.

        Returns:
            The slice of v (nv,), and of the coordinates in a perturbation dx.

        Raises:
            ValueError: the name is unknown; the message suggests a known one.
        """
        return self._slices[checks.one_of("Mechanism.v_slice(joint)", joint, self._slices)][1]

    @cached_property
    def _slices(self) -> dict[str, tuple[slice, slice]]:
        """By joint, its slices of q and v."""
        return {joint.name: (q, v) for joint, q, v in joint_places(self.joints)}

    def add(self, other: Mechanism, pose: ArrayLike = (0.0, 0.0, 0.0), prefix: str = "", name: str = "") -> Mechanism:
        """The union of this mechanism and another one, whose bodies, joints, contacts, inputs and collisions come last.

        Args:
            other: the mechanism to add.
            pose: place of the world of `other`: translation (3,) [m], or with a quaternion (7,). Its joints with the
                world, its obstacles and its neutral state move there; its contacts keep their ground, and inputs along
                world axes keep their axes.
            prefix: text before every name of `other`.
            name: name of the new mechanism; that of this one by default.

        Returns:
            The new mechanism.

        Raises:
            ValueError: both have a part of the same name, or their gravity differs.
        """
        return _added(self, other, pose, prefix, checks.name_or("Mechanism.add(name=...)", name, self.name))

    on = renamed("with_terrain")

    def with_terrain(
        self, terrain: Terrain, contacts: Sequence[str] | None = None, bodies: Sequence[str] = (), **options: Any
    ) -> Mechanism:
        """The same mechanism on other ground; its neutral state stands on it with the lowest contact.

        Bases move up or down for that: those that float, and those of planar robots and on vertical slides, unless
        their height has limits. Others stay where they are, and so do obstacles, also a half-space that collides with
        shapes in place of the ground.

        Args:
            terrain: the ground. Contacts keep their friction; their normal and height are replaced.
            contacts: names of the contacts above it; all by default.
            bodies: names of bodies whose shapes touch it too, by balls and corners that are added as contacts
                (shape_contacts.py).
            **options: friction, law, restitution, torsional_friction, rolling_friction of the added contacts.

        Returns:
            The new mechanism.

        Raises:
            ValueError: a name is unknown, or a body has a shape without balls and corners.
        """
        return _on_terrain(self, terrain, contacts, bodies, **options)

    def with_collisions(self, *collisions: Collision) -> Mechanism:
        """The same mechanism with more collisions.

        Args:
            *collisions: the collisions.

        Returns:
            The new mechanism.

        Raises:
            ValueError: a name is unknown or used twice.
        """
        return replace(self, collisions=[*self.collisions, *collisions])

    def self_collisions(self) -> tuple[list[Collision], list[str]]:
        """The pairs of `collisions="self"`: all pairs of shapes of bodies that no joint connects.

        Returns:
            (the collisions, the names of the pairs that overlap in the neutral state and are omitted).
        """
        return self_collisions(self.bodies, self.joints, self.loops, np.array(self.neutral))

    def with_obstacle(
        self, shape: Solid, bodies: Sequence[str] | None = None, name: str = "obstacle", **options: Any
    ) -> Mechanism:
        """The same mechanism with a fixed obstacle.

        Args:
            shape: the obstacle, placed in world axes by its centre and orientation.
            bodies: names of bodies, all of whose shapes touch it; by default the balls of the contacts touch it.
            name: prefix of the names of the collisions.
            **options: friction, law, restitution, torsional_friction, rolling_friction of Collision.

        Returns:
            The new mechanism.

        Raises:
            ValueError: a name is unknown, or no contact has a radius.
        """
        return _with_obstacle(self, shape, bodies, name, **options)

    if not TYPE_CHECKING:  # which would take it for a promise of any attribute

        def __getattr__(self, name: str) -> Any:
            """The error for a name that a mechanism does not have, with the way to those of a simulator."""
            way = f"; a simulator has: dojo.Simulator(mechanism, time_step=0.01).{name}" * (name in _OF_SIMULATORS)
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}{way}", name=name, obj=self)


_KINDS = {
    "bodies": Body,
    "joints": Joint,
    "contacts": Contact,
    "inputs": Input,
    "collisions": Collision,
    "loops": Joint,
    "gears": Gear,
    "scenery": Visual,
}


# methods of Simulator that a user may look for here
_OF_SIMULATORS = (
    "step", "rollout", "rollout_batch", "step_batch", "linearize", "linearize_rollout", "vjp", "reactions", "describe",
    "parameters", "maximal", "minimal", "velocity", "state_from_velocity", "energy",
)  # fmt: skip


def _every_dof(joints: Sequence[Joint]) -> tuple[Input, ...]:
    """An input for every degree of freedom of every joint but the floating ones."""
    return tuple(Input(j.name, dof=d) for j in joints if j.kind != "floating" for d in range(j.nv))


def _parts(call: str, given: Any, kind: type) -> tuple[Any, ...]:
    """The parts as a tuple, each of the expected kind."""
    parts = tuple(given) if isinstance(given, Iterable) else (given,)
    for part in parts:
        if not isinstance(part, kind):
            raise ValueError(f"{call}: expected a list of {kind.__name__}, got {part!r}")
    return parts


# -- scenes: several robots and objects in one mechanism, obstacles, and other ground ----------------------------------

_FREE = {"low": -np.inf, "gear": 1.0}  # of a report, for an input that its file does not have
_CLEAR = 1e-9  # [m] between the lowest contact and the ground, see stance.py


def _added(mech: Mechanism, other: Mechanism, pose: ArrayLike, prefix: str, name: str) -> Mechanism:
    """Both in one mechanism, see `Mechanism.add`."""
    call = "Mechanism.add"
    if not isinstance(other, Mechanism):
        raise ValueError(f"{call}(other): expected a Mechanism, got {other!r}")
    if not np.array_equal(np.asarray(mech.gravity), np.asarray(other.gravity)):
        raise ValueError(f"{call}(other): {mech.name!r} has the gravity {mech.gravity}, {other.name!r} {other.gravity}")
    prefix = checks.name_or(f"{call}(prefix=...)", prefix, "")
    point, quat = _placed(f"{call}(pose)", pose)
    neutral = np.concatenate(
        [np.asarray(mech.neutral), moved_coordinates(other.joints, np.asarray(other.neutral), point, quat)]
    )
    parts = _renamed(other, prefix)
    _refuse_clashes(call, mech, parts, other.name)
    joints = [moved_joint(j, point, quat) for j in parts["joints"]]
    loops = [moved_joint(j, point, quat) for j in parts["loops"]]
    collisions = [moved_obstacle(c, point, quat) for c in parts["collisions"]]
    carrier, report = _with_report(mech, other, prefix)
    given: dict[str, Any] = {
        "bodies": [*mech.bodies, *parts["bodies"]],
        "joints": [*mech.joints, *joints],
        "contacts": [*mech.contacts, *parts["contacts"]],
        "inputs": [*(mech.inputs or ()), *parts["inputs"]],
        "gravity": mech.gravity,
        "name": name,
        "neutral": neutral,
        "collisions": [*mech.collisions, *collisions],
        "loops": [*mech.loops, *loops],
        "gears": [*mech.gears, *parts["gears"]],
        "scenery": [*mech.scenery, *(moved_visual(v, point, quat) for v in other.scenery)],
    }
    return Mechanism(**given) if report is None else replace(carrier, **{**given, "report": report})


def _with_report(mech: Mechanism, other: Mechanism, prefix: str) -> tuple[Mechanism, Any]:
    """The first of two mechanisms of a scene that comes from a file, and its report for both, with the links of both.

    Frames of the other file that are fixed to the world are omitted: they do not move with its pose.
    """
    mine, theirs = getattr(mech, "report", None), getattr(other, "report", None)
    before, after = (0, len(other.inputs or ())) if mine is not None else (len(mech.inputs or ()), 0)
    report = mine if mine is not None else theirs
    if report is None:
        return mech, None
    changes: dict[str, Any] = {}
    for field in fields(report):
        value = getattr(report, field.name)
        if isinstance(value, np.ndarray):  # of every input
            free = _FREE.get(field.name, np.inf)
            changes[field.name] = np.concatenate([np.full(before, free), value, np.full(after, free)])
    places = "links" if hasattr(report, "links") else "bodies"
    added = (getattr(theirs, "links", None) or getattr(theirs, "bodies", None) or {}).items()
    moved = {prefix + k: replace(link, body=prefix + link.body) for k, link in added if link.body is not None}
    changes[places] = {**moved, **(getattr(mine, places) if mine is not None else {})}
    return (mech if mine is not None else other), replace(report, **changes)


def _placed(call: str, pose: ArrayLike) -> tuple[Floats, Floats]:
    """Translation and quaternion of (3,) or (7,) numbers."""
    given = checks.array(call, pose, (None,))
    if len(given) not in (3, 7):
        raise ValueError(f"{call}: expected a translation (3,), or with a quaternion (7,), got shape {given.shape}")
    quat = checks.quaternion(call, given[3:]) if len(given) == 7 else (1.0, 0.0, 0.0, 0.0)
    return given[:3], np.asarray(quat)


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


def _with_obstacle(mech: Mechanism, shape: Solid, bodies: Sequence[str] | None, name: str, **options: Any) -> Mechanism:
    """See `Mechanism.with_obstacle`."""
    call = "Mechanism.with_obstacle"
    name = checks.name(f"{call}(name=...)", name)
    if bodies is None:
        balls = [c for c in mech.contacts if c.radius > 0.0]
        if not balls:
            raise ValueError(f"{call}: {mech.name!r} has no contact with a radius; give bodies=[...]")
        found = [
            Collision(c.body, None, Sphere(radius=c.radius, center=c.point), shape, name=f"{name}-{c.name}", **options)
            for c in balls
        ]
    else:
        bodies = checks.names(f"{call}(bodies=...)", bodies)
        for body in bodies:
            checks.one_of(f"{call}(bodies=...)", body, mech.body_names)
        found = [Collision(body, None, None, shape, name=f"{name}-{body}", **options) for body in bodies]
    return mech.with_collisions(*found)


def _on_terrain(
    mech: Mechanism, terrain: Terrain, contacts: Sequence[str] | None, bodies: Sequence[str], **options: Any
) -> Mechanism:
    """See `Mechanism.with_terrain`."""
    call = "Mechanism.with_terrain"
    if not isinstance(terrain, Terrain):
        raise ValueError(f"{call}(terrain): expected a Terrain, got {terrain!r}")
    names = [c.name for c in mech.contacts]
    contacts = names if contacts is None else checks.names(f"{call}(contacts=...)", contacts)
    bodies = checks.names(f"{call}(bodies=...)", bodies)
    for name in contacts:
        checks.one_of(f"{call}(contacts=...)", name, names)
    for name in bodies:
        checks.one_of(f"{call}(bodies=...)", name, mech.body_names)
    if options and not bodies:
        raise ValueError(
            f"{call}({', '.join(options)}=...): these are options of contacts of bodies=[...], and no bodies are given"
        )
    shaped = [c for b in mech.bodies if b.name in bodies for c in shape_contacts(f"{call}(bodies=...)", b, **options)]
    level: Any = {"normal": (0.0, 0.0, 1.0), "height": 0.0, "terrain": terrain}
    chosen = [*contacts, *(c.name for c in shaped)]
    found = [*mech.contacts, *shaped]
    moved = replace(mech, contacts=[replace(c, **level) if c.name in chosen else c for c in found])
    return replace(moved, neutral=_standing(moved))


def _standing(mech: Mechanism) -> Floats:
    """Neutral coordinates with every base that can rise as high as its lowest contact touches the ground."""
    q = np.array(mech.neutral, dtype=np.float64)
    at = body_poses(mech.joints, q)
    for base, place, rates in mech.rising_bases:
        hanging = {base}
        for other in mech.joints:
            if other.parent in hanging:
                hanging.add(other.child)
        rises = []
        for c in mech.contacts:
            center = at[c.body].at(c.point)
            slope = float(c.normal_at(center)[2])
            if c.body in hanging and (c.terrain is not None or slope >= CARRIES):
                rises.append((_CLEAR - float(c.gap(center))) / slope)
        if rises:
            q[place] += max(rises) * rates
    return q
