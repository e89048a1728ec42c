"""Parameters of bodies, joints, gears and inputs."""

from __future__ import annotations

from collections.abc import Iterator, Set

import numpy as np
from numpy.typing import ArrayLike

from sim.derivatives.parameters.directions import Effect
from sim.derivatives.parameters.parameter import Parameter, Term, vector
from sim.mechanism.axes import translation_axes
from sim.mechanism.body import Body
from sim.mechanism.joint import Joint
from sim.mechanism.loop_joints import parts_of
from sim.mechanism.mechanism import Mechanism
from solvers.types import Floats

_INERTIA = ("xx", "yy", "zz", "xy", "xz", "yz")


def body_parameters(mech: Mechanism, body: Body) -> list[Parameter]:
    """mass, inertia, com. The centre of mass is the origin of the body: everything else on it moves the other way.

    A body that closing joints have divided (mechanism/loop_joints.py) has those of the whole.
    """
    parts = [mech.body_names.index(name) for name in parts_of(mech.loops, body.name)]
    fraction = 1.0 / len(parts)
    J = np.asarray(body.inertia) / fraction
    entries = (J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])
    return [
        Parameter("mass", body.name, "", body.mass / fraction, tuple((Effect.MASS, i, 0, fraction) for i in parts)),
        *(
            Parameter("inertia", body.name, label, float(x), tuple((Effect.INERTIA, i, k, fraction) for i in parts))
            for k, (label, x) in enumerate(zip(_INERTIA, entries, strict=True))
        ),
        *vector("com", body.name, np.zeros(3), lambda k: [t for i in parts for t in _on_body(mech, i, k)]),
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
    for j, candidate in enumerate(mech.contact_candidates):
        if candidate.feature == 0:
            for side in range(2):
                if candidate.bodies[side] == i:
                    yield Effect.SHAPE_SHIFT, j, 3 * side + k, -1.0


def geometry_parameters(joint: Joint, i: int, loop: bool) -> list[Parameter]:
    """parent_point, child_point, orientation, axis, pitch of a joint of the tree, or of one that closes a loop."""
    parent, child, turn = (
        (Effect.LOOP_PARENT, Effect.LOOP_CHILD, Effect.LOOP_TURN)
        if loop
        else (Effect.PARENT_POINT, Effect.CHILD_POINT, Effect.ORIENTATION)
    )
    found: list[Parameter] = []
    if not loop or joint.ntrans < 3:
        found += vector("parent_point", joint.name, joint.parent_point, lambda k: [(parent, i, k, 1.0)])
        found += vector("child_point", joint.name, joint.child_point, lambda k: [(child, i, k, 1.0)])
    if not loop or joint.nrot in (1, 3):
        found += vector("orientation", joint.name, np.zeros(3), lambda k: [(turn, i, k, 1.0)])
    moves = 0 < joint.ntrans < 3 or 0 < joint.nrot < 3
    if moves and not loop and joint.cone is None:
        turns = axis_turns(joint.axis)
        found += vector(
            "axis", joint.name, joint.axis, lambda k: [(Effect.AXIS, i, j, float(turns[j, k])) for j in range(3)]
        )
    if joint.lead != 0.0:
        found.append(Parameter("pitch", joint.name, "", joint.pitch, ((Effect.LEAD, i, 0, joint.lead / joint.pitch),)))
    return found


def axis_turns(axis: ArrayLike) -> Floats:
    """(3, 3) rotation of the directions of motion of a joint by its axis, which is kept at unit length.

    The directions across an axis a are laid out by Gram and Schmidt (pack.py), so they also spin about it.
    """
    a = np.asarray(axis, dtype=np.float64)
    first, second, _ = translation_axes(2, a)
    e = np.eye(3)[next(k for k in range(3) if k != np.argmax(np.abs(a)))]
    return frame_turns(a, first, second, e)


def frame_turns(a: Floats, first: Floats, second: Floats, e: Floats) -> Floats:
    """a x da + (spin) a for da across a, where first = (e - a (a.e))/|..| and second = +-a x first follow a."""
    handed = np.cross(a, first) @ second
    spin = -handed * (a @ e) / np.linalg.norm(e - a * (a @ e)) * second
    skew = np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])
    return np.asarray((skew + np.outer(a, spin)) @ (np.eye(3) - np.outer(a, a)))


def joint_parameters(joint: Joint, d: int, driven: Set[str | None]) -> list[Parameter]:
    """spring, damper, rest, armature; a quaternion has one spring constant, and no armature.

    driven: names of joints with position servos, whose springs are one with theirs: they have no rest.
    """
    plain = joint.scalar_count
    springs = np.asarray(joint.spring)[: plain + (joint.nrot == 3)]
    rests = () if joint.name in driven else joint.rest
    if joint.name in driven and np.any(joint.rest):
        springs = springs[:0]
    return [
        *vector("spring", joint.name, springs, lambda k: [(Effect.SPRING, d + k, 0, 1.0)]),
        *vector("damper", joint.name, joint.damper, lambda k: [(Effect.DAMPER, d + k, 0, 1.0)]),
        *vector("rest", joint.name, rests, lambda k: [(Effect.REST, d + min(k, plain), max(k - plain, 0), 1.0)]),
        *vector(
            "armature", joint.name, np.asarray(joint.armature)[:plain], lambda k: [(Effect.ARMATURE, d + k, 0, 1.0)]
        ),
    ]


def limit_parameters(joint: Joint, first: int) -> Iterator[Parameter]:
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


def gear_parameters(mech: Mechanism) -> Iterator[Parameter]:
    """gear_ratio, gear_offset."""
    for k, gear in enumerate(mech.gears):
        yield Parameter("gear_ratio", gear.name, "", gear.ratio, ((Effect.GEAR_RATIO, k, 0, 1.0),))
        yield Parameter("gear_offset", gear.name, "", gear.offset, ((Effect.GEAR_OFFSET, k, 0, 1.0),))


def input_parameters(mech: Mechanism) -> Iterator[Parameter]:
    """input_force, input_torque: force and torque per unit of an input on a body."""
    for j, part in enumerate(mech.inputs or ()):
        if part.body is not None:
            for first, kind, values in ((0, "input_force", part.force), (3, "input_torque", part.torque)):
                for k, x in enumerate(np.asarray(values)):
                    yield Parameter(kind, part.name, str(k), float(x), ((Effect.INPUT, j, first + k, 1.0),))
