"""Mechanism: bodies hung on joints in a tree, with contacts and inputs; sorted and validated."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim import checks
from sim.collisions import Collision
from sim.coupling.closing import carried
from sim.dofs import components, dof_names
from sim.gear import Gear, check_gears
from sim.naming import name_contacts, name_inputs
from sim.pairs.touch import Touch, touches
from sim.parts import WORLD, Body, Contact, Input, Joint
from sim.shapes import Solid
from sim.terrain.terrain import Terrain
from sim.tree import check_axes, check_loops, check_masses, sort_tree


@dataclass(frozen=True, repr=False)
class Mechanism:
    """A tree of bodies. Afterwards body i hangs on joint i, and parents come before children.

    inputs    the entries of u in order; left out, every degree of freedom of every joint but the floating ones and
              those that close loops
    neutral   coordinates of the standing or hanging configuration: {joint name: its coordinates}, zero where left out,
              or all of q
    """

    bodies: Sequence[Body]
    joints: Sequence[Joint]
    contacts: Sequence[Contact] = ()
    inputs: Sequence[Input] | None = None
    gravity: ArrayLike = (0.0, 0.0, -9.81)  # [m/s^2]
    name: str = "mechanism"
    neutral: Mapping[str, ArrayLike] | ArrayLike | None = None
    collisions: Sequence[Collision] = ()
    loops: Sequence[Joint] = ()  # joints with close=True are moved here
    gears: Sequence[Gear] = ()

    def __post_init__(self) -> None:
        checks.name("Mechanism(name=...)", self.name)
        call = f"Mechanism({self.name!r}"
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
        ends = dict.fromkeys([*self.body_names, WORLD])
        for c in self.collisions:
            for name in (c.a, c.b):
                checks.one_of(f"{call}): body of collision {c.name!r}", name, ends)
        checks.distinct(f"{call}): collisions", (c.name for c in self.collisions))
        object.__setattr__(self, "contacts", name_contacts(f"{call})", self.contacts, self.body_names))
        object.__setattr__(self, "inputs", name_inputs(call, self.inputs or (), self.joints, self.body_names))
        object.__setattr__(self, "gravity", checks.vector(f"{call}, gravity=...)", self.gravity, 3))
        object.__setattr__(self, "neutral", self._coordinates(f"{call}, neutral=...)", self.neutral))

    def __repr__(self) -> str:
        parts: dict[str, Any] = {"bodies": self.bodies, "inputs": self.inputs, "contacts": self.contacts}
        parts |= {"collisions": self.collisions, "loops": self.loops, "gears": self.gears}
        sizes = "".join(f", {what} {len(found)}" for what, found in parts.items() if found)
        return f"{type(self).__name__}({self.name}, nq {self.nq}, nv {self.nv}{sizes})"

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

    @property
    def contact_names(self) -> tuple[str, ...]:
        """Names of the contacts: those with the ground, then the contact points of the collisions."""
        return (*(c.name for c in self.contacts), *(touch.name for touch in self.touches))

    @cached_property
    def touches(self) -> tuple[Touch, ...]:
        """The contact points that the collisions may have."""
        return tuple(touches(self))

    @cached_property
    def contact_normals(self) -> NDArray[np.float64]:
        """(ncontact, 3) outward normals of the ground at the contacts, world axes."""
        out = np.array([np.asarray(c.normal) for c in self.contacts], dtype=np.float64).reshape(-1, 3)
        out.flags.writeable = False
        return out

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the entries of u."""
        return tuple(i.name for i in self.inputs or ())

    @cached_property
    def dof_names(self) -> tuple[str, ...]:
        """Names of the degrees of freedom, (nv,), in the order of v: "knee", "base x", "base rz"."""
        return dof_names(self.joints)

    def components(self, *names: str) -> NDArray[np.int64]:
        """Numbers in a perturbation dx = [dq; dv] of joints and degrees of freedom.

        "base" is all of a joint, "base x" one of its degrees of freedom, "v base", "v base x" their velocities, "q" and
        "v" all coordinates and all velocities.
        """
        return components("Mechanism.components(...)", self.joints, names)

    def q_slice(self, joint: str) -> slice:
        """Where the coordinates of a joint are in q."""
        return self._slices[checks.one_of("Mechanism.q_slice(joint)", joint, self._slices)][0]

    def v_slice(self, joint: str) -> slice:
        """Where the velocities of a joint are in v."""
        return self._slices[checks.one_of("Mechanism.v_slice(joint)", joint, self._slices)][1]

    @cached_property
    def _slices(self) -> dict[str, tuple[slice, slice]]:
        """By joint, where it is in q and in v."""
        out, q, v = {}, 0, 0
        for joint in self.joints:
            out[joint.name] = slice(q, q := q + joint.nq), slice(v, v := v + joint.nv)
        return out

    def add(self, other: Mechanism, pose: ArrayLike = (0.0, 0.0, 0.0), prefix: str = "", name: str = "") -> Mechanism:
        """This mechanism and another one, in one: its bodies, joints, contacts, inputs and collisions after ours.

        pose     where the world of `other` is put: translation (3,) [m], or with a quaternion (7,). Its joints with the
                 world, its obstacles and its neutral state move there; its contacts touch the ground that they touched
                 before, and inputs along world axes keep them
        prefix   put before every name of `other`; a ValueError says which name both have
        """
        from sim.scene import added

        return added(self, other, pose, prefix, name or self.name)

    def on(
        self, terrain: Terrain, contacts: Sequence[str] | None = None, bodies: Sequence[str] = (), **options: Any
    ) -> Mechanism:
        """The same on other ground, under all contacts or those named; it stands there as high as it touches.

        Contacts keep their friction; what normal and height they had is replaced. The shapes of `bodies` touch it too,
        by balls and corners that are added as contacts (sim/shape_contacts.py); options: of these (friction, law,
        restitution).
        """
        from sim.scene import on_terrain

        return on_terrain(self, terrain, contacts, bodies, **options)

    def with_collisions(self, *collisions: Collision) -> Mechanism:
        """The same with more collisions."""
        from sim.scene import with_collisions

        return with_collisions(self, collisions)

    def with_obstacle(
        self, shape: Solid, bodies: Sequence[str] | None = None, name: str = "obstacle", **options: Any
    ) -> Mechanism:
        """The same with a fixed obstacle, placed in world axes by its centre and orientation.

        What touches the ground touches it too: the balls of the contacts; or, when given, the shapes of `bodies`.
        options: of Collision (friction, law, restitution).
        """
        from sim.scene import with_obstacle

        return with_obstacle(self, shape, bodies, name, **options)

    def _coordinates(self, call: str, given: Any) -> tuple[float, ...]:
        """q from a table by joint, or from a vector; quaternions are checked and normalised."""
        q = np.zeros(self.nq)
        table = {} if given is None else given
        if isinstance(table, Mapping):
            for name in table:
                checks.one_of(f"{call}: joint", name, self._slices)
        else:
            values = checks.array(call, table, (self.nq,))
            table = {j.name: values[self.q_slice(j.name)] for j in self.joints}
        for joint in self.joints:
            at = self.q_slice(joint.name)
            if joint.nrot == 3:
                q[at.stop - 4] = 1.0
            if joint.name in table:
                value = checks.array(f"{call}: joint {joint.name!r}", np.atleast_1d(table[joint.name]), (joint.nq,))
                q[at] = value
                if joint.nrot == 3:
                    q[at.stop - 4 : at.stop] = checks.quaternion(f"{call}: joint {joint.name!r}", value[-4:])
        return tuple(float(x) for x in q)


_KINDS = {
    "bodies": Body,
    "joints": Joint,
    "contacts": Contact,
    "inputs": Input,
    "collisions": Collision,
    "loops": Joint,
    "gears": Gear,
}


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
