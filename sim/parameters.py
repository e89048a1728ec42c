"""Parameters of a mechanism by name: what they are, what they are now, and how a step feels them.

    kind:part[component]     mass:trunk   com:trunk[0]   spring:knee   friction:foot   gravity[2]   time_step

A name without a component stands for all of them, one without a part for all parts, in this order. `kind:*` is one
parameter that adds the same to all parts: the height of the ground is `contact_height:*`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.build import contact_frame, translation_axes
from sim.closing import is_weld, parts_of
from sim.effects import Effect
from sim.mechanism import Mechanism
from sim.model import Integers, Vector
from sim.parts import Body, Contact, Joint

Floats = NDArray[np.float64]
Term = tuple[Effect, int, int, float]  # effect, index, component, weight

INERTIA = ("xx", "yy", "zz", "xy", "xz", "yz")
UNITS = {
    "mass": "kg", "inertia": "kg m^2", "com": "m", "parent_point": "m", "child_point": "m", "orientation": "rad",
    "axis": "1", "spring": "N/m, N m/rad", "damper": "N s/m, N m s/rad", "rest": "m, rad", "armature": "kg, kg m^2",
    "lower": "m, rad", "upper": "m, rad", "cone": "rad", "friction": "1", "restitution": "1",
    "contact_point": "m", "contact_radius": "m",
    "contact_height": "m", "contact_normal": "1", "shape_a": "m", "shape_b": "m", "gravity": "m/s^2", "time_step": "s",
}  # fmt: skip
KINDS = tuple(UNITS)


class Parameter(NamedTuple):
    """One number of a mechanism."""

    kind: str
    part: str  # "" of gravity and time_step
    component: str  # "" of a single number
    value: float
    terms: tuple[Term, ...]

    @property
    def name(self) -> str:
        """kind:part[component]"""
        part = f":{self.part}" if self.part else ""
        return f"{self.kind}{part}" + (f"[{self.component}]" if self.component else "")


class Parameters(NamedTuple):
    """The parameters of a selection, in order; `rows` says which of them each of its names stands for."""

    names: tuple[str, ...]
    values: Floats  # (n,)
    rows: dict[str, slice]

    def __getitem__(self, name: str) -> Floats:  # type: ignore[override]
        """Values of one name of the selection."""
        return self.values[self.rows[name]]


class Plan(NamedTuple):
    """Parameters as kernels need them, see parameter_columns.py."""

    terms: Integers  # (m, 4)
    weights: Vector  # (m,)
    size: int


def all_parameters(mech: Mechanism, time_step: float) -> list[Parameter]:
    """Every parameter of the mechanism, kind by kind in the order of KINDS."""
    found: list[Parameter] = []
    shares = {joint.child for joint in mech.loops if is_weld(joint)}
    for body in mech.bodies:
        if body.mass > 0.0 and body.name not in shares:
            found += _body_parameters(mech, body)
    first = 0
    limit = 0
    for index, joint in enumerate(mech.joints):
        found += _geometry(joint, index, False) + _joint_space(joint, first)
        bounds = list(_limits(joint, limit))
        found += bounds
        first += joint.nv
        limit += len(bounds)
    for index, joint in enumerate(mech.loops):
        if not is_weld(joint):
            found += _geometry(joint, index, True)
    for index, contact in enumerate(mech.contacts):
        found += _contact_parameters(contact, index)
    found += _collision_parameters(mech)
    for k in range(3):
        value = float(np.asarray(mech.gravity)[k])
        found.append(Parameter("gravity", "", str(k), value, ((Effect.GRAVITY, 0, k, 1.0),)))
    found.append(Parameter("time_step", "", "", time_step, ((Effect.TIME_STEP, 0, 0, 1.0),)))
    return sorted(found, key=lambda p: KINDS.index(p.kind))


def _vector(kind: str, part: str, values: ArrayLike, terms: Callable[[int], Sequence[Term]]) -> list[Parameter]:
    """Parameters of the components of a vector; one without brackets when it has a single one."""
    numbers = np.atleast_1d(np.asarray(values, dtype=np.float64))
    labels = [""] if len(numbers) == 1 else [str(k) for k in range(len(numbers))]
    return [Parameter(kind, part, labels[k], float(x), tuple(terms(k))) for k, x in enumerate(numbers)]


def _body_parameters(mech: Mechanism, body: Body) -> list[Parameter]:
    """mass, inertia, com. The centre of mass is the origin of the body: everything else on it moves the other way.

    A body that closing joints have divided (closing.py) has those of the whole.
    """
    parts = [mech.body_names.index(name) for name in parts_of(mech.loops, body.name)]
    share = 1.0 / len(parts)
    J = np.asarray(body.inertia) / share
    entries = (J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])
    return [
        Parameter("mass", body.name, "", body.mass / share, tuple((Effect.MASS, i, 0, share) for i in parts)),
        *(
            Parameter("inertia", body.name, label, float(x), tuple((Effect.INERTIA, i, k, share) for i in parts))
            for k, (label, x) in enumerate(zip(INERTIA, entries, strict=True))
        ),
        *_vector("com", body.name, np.zeros(3), lambda k: [t for i in parts for t in _on_body(mech, i, k)]),
    ]


def _on_body(mech: Mechanism, i: int, k: int) -> Iterator[Term]:
    """-1 for axis k of every point given from the centre of mass of body i."""
    name = mech.bodies[i].name
    yield Effect.CHILD_POINT, i, k, -1.0
    for c, joint in enumerate(mech.joints):
        if joint.parent == name:
            yield Effect.PARENT_POINT, c, k, -1.0
    for m, joint in enumerate(mech.loops):
        if joint.parent == name:
            yield Effect.LOOP_PARENT, m, k, -1.0
        if joint.child == name:
            yield Effect.LOOP_CHILD, m, k, -1.0
    for c, contact in enumerate(mech.contacts):
        if contact.body == name:
            yield Effect.POINT, c, k, -1.0
    for j, touch in enumerate(mech.touches):
        if touch.feature == 0:
            for side in range(2):
                if touch.bodies[side] == i:
                    yield Effect.SHAPE_SHIFT, j, 3 * side + k, -1.0


def _geometry(joint: Joint, i: int, loop: bool) -> list[Parameter]:
    """parent_point, child_point, orientation, axis of a joint of the tree, or of one that closes a loop."""
    parent, child, turn = (
        (Effect.LOOP_PARENT, Effect.LOOP_CHILD, Effect.LOOP_TURN)
        if loop
        else (Effect.PARENT_POINT, Effect.CHILD_POINT, Effect.ORIENTATION)
    )
    found: list[Parameter] = []
    if not loop or joint.ntrans < 3:
        found += _vector("parent_point", joint.name, joint.parent_point, lambda k: [(parent, i, k, 1.0)])
        found += _vector("child_point", joint.name, joint.child_point, lambda k: [(child, i, k, 1.0)])
    if not loop or joint.nrot in (1, 3):
        found += _vector("orientation", joint.name, np.zeros(3), lambda k: [(turn, i, k, 1.0)])
    moves = 0 < joint.ntrans < 3 or 0 < joint.nrot < 3
    if moves and not loop and joint.cone is None:
        turns = axis_turns(joint.axis)
        found += _vector(
            "axis", joint.name, joint.axis, lambda k: [(Effect.AXIS, i, j, float(turns[j, k])) for j in range(3)]
        )
    return found


def axis_turns(axis: ArrayLike) -> Floats:
    """(3, 3) rotation of the directions of motion of a joint by its axis, which is kept at unit length.

    The directions across an axis a are laid out by Gram and Schmidt (build.py), so they also spin about it.
    """
    a = np.asarray(axis, dtype=np.float64)
    first, second, _ = translation_axes(2, a)
    e = np.eye(3)[next(k for k in range(3) if k != np.argmax(np.abs(a)))]
    return _frame_turns(a, first, second, e)


def normal_turns(normal: ArrayLike) -> Floats:
    """(3, 3) rotation of the frame of a contact by its normal, which is kept at unit length."""
    n, t1, t2 = contact_frame(normal)
    return _frame_turns(n, t1, t2, np.eye(3)[0 if abs(n[0]) < 0.9 else 1])


def _frame_turns(a: Floats, first: Floats, second: Floats, e: Floats) -> Floats:
    """a x da + (spin) a for da across a, where first = (e - a (a.e))/|..| and second = +-a x first follow a."""
    handed = np.cross(a, first) @ second
    spin = -handed * (a @ e) / np.linalg.norm(e - a * (a @ e)) * second
    skew = np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])
    return np.asarray((skew + np.outer(a, spin)) @ (np.eye(3) - np.outer(a, a)))


def _joint_space(joint: Joint, d: int) -> list[Parameter]:
    """spring, damper, rest, armature; a quaternion has one spring constant, and no armature."""
    plain = joint.ntrans if joint.nrot == 3 else joint.nv
    springs = np.asarray(joint.spring)[: plain + (joint.nrot == 3)]
    return [
        *_vector("spring", joint.name, springs, lambda k: [(Effect.SPRING, d + k, 0, 1.0)]),
        *_vector("damper", joint.name, joint.damper, lambda k: [(Effect.DAMPER, d + k, 0, 1.0)]),
        *_vector("rest", joint.name, joint.rest, lambda k: [(Effect.REST, d + min(k, plain), max(k - plain, 0), 1.0)]),
        *_vector(
            "armature", joint.name, np.asarray(joint.armature)[:plain], lambda k: [(Effect.ARMATURE, d + k, 0, 1.0)]
        ),
    ]


def _limits(joint: Joint, first: int) -> Iterator[Parameter]:
    """The finite bounds in the order of the model, numbered from `first`."""
    k = first
    for dof, pair in enumerate(joint.limits or ()):
        for kind, bound in zip(("lower", "upper"), pair, strict=True):
            if np.isfinite(bound):
                label = str(dof) if joint.nv > 1 else ""
                yield Parameter(kind, joint.name, label, float(bound), ((Effect.BOUND, k, 0, 1.0),))
                k += 1
    if joint.cone is not None:
        yield Parameter("cone", joint.name, "", float(joint.cone), ((Effect.BOUND, k, 0, 1.0),))


def _contact_parameters(contact: Contact, c: int) -> list[Parameter]:
    """Radius and normal of half-spaces only: a terrain is made for a radius, and has its own normals."""
    turns = normal_turns(contact.normal)
    found = [
        Parameter("friction", contact.name, "", contact.friction, ((Effect.FRICTION, c, 0, 1.0),)),
        Parameter("restitution", contact.name, "", contact.restitution, ((Effect.RESTITUTION, c, 0, 1.0),)),
        *_vector("contact_point", contact.name, contact.point, lambda k: [(Effect.POINT, c, k, 1.0)]),
        Parameter("contact_height", contact.name, "", contact.height, ((Effect.HEIGHT, c, 0, 1.0),)),
    ]
    if contact.terrain is not None:
        return found
    found.append(Parameter("contact_radius", contact.name, "", contact.radius, ((Effect.RADIUS, c, 0, 1.0),)))
    return found + _vector(
        "contact_normal",
        contact.name,
        contact.normal,
        lambda k: [(Effect.NORMAL, c, j, float(turns[j, k])) for j in range(3)],
    )


def _collision_parameters(mech: Mechanism) -> list[Parameter]:
    """friction, and the centres of both shapes in their bodies (or the world)."""
    found: list[Parameter] = []
    ground = len(mech.contacts)
    index = {name: i for i, name in enumerate(mech.body_names)}
    for collision in mech.collisions:
        mine = [j for j, t in enumerate(mech.touches) if t.name in (collision.name, f"{collision.name}_{t.feature}")]
        frictions = tuple((Effect.FRICTION, ground + j, 0, 1.0) for j in mine)
        found.append(Parameter("friction", collision.name, "", collision.friction, frictions))
        bounces = tuple((Effect.RESTITUTION, ground + j, 0, 1.0) for j in mine)
        found.append(Parameter("restitution", collision.name, "", collision.restitution, bounces))
        first = mech.touches[mine[0]]
        swapped = first.bodies[0] != index.get(collision.a, -1)
        for kind, side in (("shape_a", int(swapped)), ("shape_b", 1 - int(swapped))):
            found += _center(kind, collision.name, first.places[side, :3], mine[0], side)
    return found


def _center(kind: str, name: str, center: Floats, j: int, side: int) -> list[Parameter]:
    """The centre of shape `side` of the collision whose first pair is j."""
    return _vector(kind, name, center, lambda k: [(Effect.SHAPE_SHIFT, j, 3 * side + k, 1.0)])
