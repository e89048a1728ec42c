"""assemble: the parts of a Mechanism from a URDF file and the choices of the caller."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from sim.io.loader_choices import LoaderChoices
from sim.io.self_collisions import with_self_collisions
from sim.io.urdf.contacts import find_contacts
from sim.io.urdf.inertia import RigidInertia, combined, fault, repaired
from sim.io.urdf.loops import UrdfLoop, closing_joint, zero_poses
from sim.io.urdf.mimic import follower_value, leader_of, loose_leaders, mimic_gears, with_leaders
from sim.io.urdf.report import LinkFrame, Notes, UrdfMechanism, UrdfReport, UrdfWarning
from sim.io.urdf.robot import Robot, UrdfJoint
from sim.io.urdf.solids import body_shapes, body_visuals, collision_shapes
from sim.io.urdf.tree import MergedLinks, Place, group, held_pose, ordered
from sim.io.urdf.xml import UrdfError
from sim.mechanism import checks
from sim.mechanism.body import Body
from sim.mechanism.composite_inertia import composite
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.joint import KINDS, WORLD, Joint
from sim.mechanism.pose import Pose
from sim.mechanism.stance import lifted, penetrations, resting
from solvers.types import Floats

ROOT_JOINT = {
    False: "floating_base",
    True: "fixed_base",
}  # by whether the base is fixed; behind the link's name if taken
DENSITY = 1000.0  # [kg/m^3] of repaired links without a mass
_NOTHING = 1e-12  # [m^2] an inertia over a mass that is none
_ENDS_SHOWN = 6  # last links named in the message about a robot without contacts


@dataclass(frozen=True)
class Choices:
    """The arguments of `load_urdf`, but for those about meshes; see there."""

    file: str
    fixed_base: bool
    merge: bool
    locked: frozenset[str]
    geared: tuple[str, ...]  # joints that follow another one
    repair: bool
    neutral: Mapping[str, ArrayLike]
    position: tuple[float, ...]
    actuated: tuple[str, ...] | None
    contacts: Sequence[str | Contact] | None
    shared: LoaderChoices


def assemble(robot: Robot, loops: Mapping[str, UrdfLoop], choices: Choices, notes: Notes) -> UrdfMechanism:
    """The mechanism, with its report."""
    choices = replace(choices, neutral=with_leaders("load_urdf(neutral=...)", robot, choices.geared, choices.neutral))
    locked = {name: _neutral(robot, choices, name) for name in choices.locked}
    if locked:
        notes.add("joints that are held where they are", locked)
    if loose := loose_leaders(robot, locked):
        notes.add("joints that are held do not hold those that they follow", loose)
    robot, root, order = _rooted(robot, choices, locked, notes)
    groups, places = group(robot, root, order, choices.fixed_base, choices.merge, locked)
    inertias = _inertias(groups, choices, notes)
    coms = {name: part.com for name, part in inertias.items()}
    joints = _joints(groups, places, coms, choices, root)
    still, away = _part_of_world(places, coms), -np.asarray(choices.position)
    closing = _closing(loops, places, coms, zero_poses(root, order), choices, notes)
    given = {**robot.joints, **{name: loop.joint for name, loop in loops.items()}}
    mech = UrdfMechanism(
        [_body(body, inertias[body.name]) for body in groups],
        [*joints, *closing],
        find_contacts(places, coms, choices.contacts, choices.shared, notes),
        _inputs(joints, closing, given, choices),
        gravity=choices.shared.gravity,
        name=robot.name,
        neutral=_neutral_state(robot, joints, choices),
        scenery=body_visuals(still, away),
        gears=mimic_gears(robot, choices.geared, {j.name: j.nv for j in joints}),
    )
    bases = [j.name for j in joints if j.kind == "floating" and j.parent == WORLD]
    if len(bases) == 1 and bases[0] not in choices.neutral:
        mech = replace(mech, neutral=lifted(mech, bases[0]))
    _ground_notes(mech, choices, _ends(mech, places) if bases else None, notes)
    _friction_notes([body.joint for body in groups if body.joint and not body.fixed], loops, choices, notes)
    if choices.shared.itself:
        mech = with_self_collisions(mech, choices.shared, notes, collision_shapes(still, away))
    report = _report(given, mech, places, coms, away, choices.file, notes)
    for note in report.notes:
        if note.warn:
            warnings.warn(f"load_urdf: {choices.file}: {note}", UrdfWarning, stacklevel=3)
    return replace(mech, report=report)


def _rooted(
    robot: Robot, choices: Choices, locked: Mapping[str, float], notes: Notes
) -> tuple[Robot, str, list[UrdfJoint]]:
    """The robot, its root, and its joints from there on; a base that is to float is let go if nothing could move."""
    root, order = ordered(robot, choices.file)
    if WORLD in robot.links and root != WORLD:
        raise robot.links[WORLD].element.error("a link of this name must be the root")
    if root != WORLD or choices.fixed_base:
        return robot, root, order
    if all(held_pose(joint, locked) is not None for joint in order):
        robot, root, order = _let_go(robot, order, notes)
    if root == WORLD:
        notes.add("the root is called 'world', so it is fixed there although floating=True", [root])
    return robot, root, order


def _let_go(robot: Robot, order: list[UrdfJoint], notes: Notes) -> tuple[Robot, str, list[UrdfJoint]]:
    """The robot, root and joints without the world, where one fixed joint on it keeps all links from moving."""
    on_world = [joint for joint in order if joint.parent == WORLD]
    if len(on_world) != 1:
        return robot, WORLD, order
    held = on_world[0]
    notes.add(
        "all links are fixed to the world; as floating=True, they float without this joint", [held.name], warn=True
    )
    links = {name: link for name, link in robot.links.items() if name != WORLD}
    joints = {name: joint for name, joint in robot.joints.items() if joint is not held}
    return replace(robot, links=links, joints=joints), held.child, [joint for joint in order if joint is not held]


def _neutral(robot: Robot, choices: Choices, name: str, depth: int = 0) -> float:
    """Neutral coordinate of a joint with one degree of freedom; of one with more, which is to be locked, zero."""
    if name not in choices.neutral:
        # a circle of followers ends; one without a leader is refused later
        follows = name in choices.geared or (name in choices.locked and name in robot.mimics)
        if follows and depth < len(robot.mimics) and leader_of(robot, name) in robot.joints:
            return follower_value(robot, name, lambda leader: _neutral(robot, choices, leader, depth + 1))
        return resting(robot.joints[name].limits)
    if robot.joints[name].kind not in ("revolute", "prismatic"):
        raise ValueError(f"load_urdf(neutral=...): joint {name!r} is fixed, or locked at zero")
    return checks.number(f"load_urdf(neutral=...): joint {name!r}", choices.neutral[name])


def _neutral_state(robot: Robot, joints: list[Joint], choices: Choices) -> dict[str, ArrayLike]:
    """Neutral coordinates by joint."""
    known = dict.fromkeys([*robot.joints, *(j.name for j in joints)])
    for name in choices.neutral:
        checks.one_of("load_urdf(neutral=...): joint", name, known)
    out: dict[str, ArrayLike] = {j.name: _neutral(robot, choices, j.name) for j in joints if j.nv == 1}
    return out | {j.name: choices.neutral[j.name] for j in joints if j.nv > 1 and j.name in choices.neutral}


def _inertias(groups: list[MergedLinks], choices: Choices, notes: Notes) -> dict[str, RigidInertia]:
    """Inertia of every body in its own frame; impossible inertias are repaired or refused."""
    out = {body.name: combined(body.inertias) for body in groups}
    if groups and not any(part.mass for part in out.values()):
        shaped = any(collision_shapes(body, out[body.name].com) for body in groups)
        if not (shaped and choices.repair):
            how = "; repair=True takes masses from the collision shapes" if shaped else ""
            raise UrdfError(f"load_urdf: {choices.file}: no moving link has a mass{how}")
    bad: list[str] = []
    for body in groups:
        why = fault(out[body.name])
        if not why:
            continue
        on = f"on joint {body.joint.name!r}" if body.joint else "as the root"
        if choices.repair:
            out[body.name], how = _repaired(body, out[body.name])
            notes.add(f"inertias that no rigid body has were repaired{how}", [f"{body.name} {why}"], warn=True)
        else:
            bad.append(f"  line {body.links[0][0].element.line}, link {body.name!r}, which moves {on}, {why}")
    if bad:
        root = ", floating=False fixes the root" if not groups[0].joint and fault(out[groups[0].name]) else ""
        raise UrdfError(
            f"load_urdf: {choices.file}: no rigid body has the inertia of these moving links:\n"
            + "\n".join(bad)
            + f"\nlocked=[...] holds their joints{root}, repair=True replaces the inertias by the nearest possible ones"
        )
    return out


def _repaired(body: MergedLinks, part: RigidInertia) -> tuple[RigidInertia, str]:
    """A possible inertia in place of an impossible one, and whence it is.

    Where the file has none at all it is that of the collision shapes, with the mass of the file, or without one with
    the density of water; otherwise the nearest possible one.
    """
    shapes = collision_shapes(body, part.com)
    if not shapes or np.abs(part.inertia).max() > _NOTHING * part.mass:  # more than the rounding of a shifted zero
        return repaired(part), ""
    mass = part.mass or DENSITY * sum(shape.volume() for shape in shapes)
    center, inertia = composite(shapes, mass)
    whole = RigidInertia(mass, part.com if part.mass else part.com + center, inertia)
    whole = repaired(whole) if fault(whole) else whole
    return whole, f", from the collision shapes, with {DENSITY:g} kg/m^3 where there is no mass"


def _joints(
    groups: list[MergedLinks], places: Mapping[str, Place], coms: Mapping[str, Floats], choices: Choices, root: str
) -> list[Joint]:
    """The Joints that the bodies hang on."""
    base = ROOT_JOINT[choices.fixed_base]
    if base in {body.joint.name for body in groups if body.joint}:
        base = f"{root}_{base}"
    joints = [_joint(body, places, coms, choices, base) for body in groups]
    if not any(joint.nv for joint in joints):
        raise UrdfError(f"load_urdf: {choices.file}: no joint is free to move")
    return joints


def _joint(
    body: MergedLinks, places: Mapping[str, Place], coms: Mapping[str, Floats], choices: Choices, base: str
) -> Joint:
    """The Joint that a body hangs on; `base` is the name of that of the root."""
    com = coms[body.name]
    if body.joint is None:
        if choices.fixed_base:
            return Joint("fixed", None, body.name, base, choices.position, child_point=-com)
        return Joint("floating", None, body.name, base, child_point=-com)
    joint, at = body.joint, places[body.joint.parent]
    frame = at.pose.then(joint.pose)
    if at.group.name in coms:
        parent, point = at.group.name, frame.point - coms[at.group.name]
    else:
        parent, point = WORLD, frame.point + np.asarray(choices.position)
    return Joint(
        "fixed" if body.fixed else joint.kind,
        parent,
        body.name,
        joint.name,
        parent_point=point,
        child_point=-com,
        axis=joint.axis,
        orientation=frame.quaternion,
        damper=0.0 if body.fixed else joint.damping,
        friction=joint.friction if choices.shared.joint_friction and not body.fixed and _may_rub(joint) else 0.0,
        limits=None if body.fixed else joint.limits,
    )


def _may_rub(joint: UrdfJoint) -> bool:
    """Whether a joint has coordinates that dry friction can hold."""
    return KINDS[joint.kind][1] < 3


def _body(body: MergedLinks, part: RigidInertia) -> Body:
    return Body(body.name, part.mass, part.inertia, body_shapes(body, part.com), visuals=body_visuals(body, part.com))


def _part_of_world(places: Mapping[str, Place], coms: Mapping[str, Floats]) -> MergedLinks:
    """The links that are part of the world."""
    return MergedLinks(None, None, links=[(p.link, p.pose) for p in places.values() if p.group.name not in coms])


def _closing(
    loops: Mapping[str, UrdfLoop],
    places: Mapping[str, Place],
    coms: Mapping[str, Floats],
    zero: Mapping[str, Pose],
    choices: Choices,
    notes: Notes,
) -> list[Joint]:
    """The joints that close loops."""
    found = {name: closing_joint(loop, places, coms, zero, choices.position, notes) for name, loop in loops.items()}
    kept = {name: joint for name, joint in found.items() if joint is not None}
    if choices.shared.joint_friction:
        forces = {name: loops[name].joint.friction for name in kept if _may_rub(loops[name].joint)}
        kept |= {name: replace(kept[name], friction=force) for name, force in forces.items()}
    return list(kept.values())


def _inputs(joints: list[Joint], closing: list[Joint], given: Mapping[str, UrdfJoint], choices: Choices) -> list[Input]:
    """One per degree of freedom of the actuated joints; those that close loops or follow another only if requested."""
    by_name = {j.name: j for j in (*joints, *closing)}
    if choices.actuated is None:
        chosen = [j for j in joints if j.kind != "floating" and j.name not in choices.geared]
    else:
        moving = {j.name: j for j in by_name.values() if j.nv}
        for name in choices.actuated:
            checks.one_of("load_urdf(actuated=...): joint that moves", name, moving)
        chosen = [by_name[name] for name in choices.actuated]
    return [
        Input(j.name, dof=d, limits=(-given[j.name].effort, given[j.name].effort), speed=given[j.name].velocity)
        for j in chosen
        for d in range(j.nv)
    ]


def _ends(mech: UrdfMechanism, places: Mapping[str, Place]) -> list[str]:
    """Of each body at the end of the tree, the link whose origin is farthest from the joint that the body hangs on."""
    carrying = {joint.parent for joint in mech.joints}
    farthest: dict[str, tuple[float, str]] = {}
    for name, place in places.items():
        away = float(np.linalg.norm(place.pose.point))
        if away > farthest.get(place.group.name, (-1.0, ""))[0]:
            farthest[place.group.name] = away, name
    return [farthest[body][1] for body in mech.body_names if body not in carrying]


def _ground_notes(mech: UrdfMechanism, choices: Choices, ends: list[str] | None, notes: Notes) -> None:
    """Notes on the ground for the user, before the first step; ends: last links of a robot that floats."""
    wanted = choices.contacts is None or len(choices.contacts) > 0
    if ends is not None and wanted and not mech.contacts:
        balls = ", ".join(f"dojo.Contact({name!r}, radius=0.02)" for name in ends[:_ENDS_SHOWN])
        more = f", ... for all {len(ends)} of them" if len(ends) > _ENDS_SHOWN else ""
        notes.add(
            f"nothing of the robot makes contact with the ground: it falls through; contacts=[{balls}{more}] puts "
            "balls at the origins of its last links",
            warn=True,
        )
    low = penetrations(mech)
    if low:
        notes.add("contacts that are below the ground in the neutral state; see position, neutral", low, warn=True)


def _friction_notes(joints: list[UrdfJoint], loops: Mapping[str, UrdfLoop], choices: Choices, notes: Notes) -> None:
    """A note on the dry friction of the file that the joints do not have."""
    rough = [
        joint.name
        for joint in (*joints, *(loop.joint for loop in loops.values()))
        if joint.friction and not (choices.shared.joint_friction and _may_rub(joint))
    ]
    if rough:
        notes.add("joints move without the dry friction of the file, which joint_friction=True adds to hinges", rough)


def _report(
    joints: Mapping[str, UrdfJoint],
    mech: UrdfMechanism,
    places: Mapping[str, Place],
    coms: Mapping[str, Floats],
    away: Floats,
    file: str,
    notes: Notes,
) -> UrdfReport:
    """Where the links are, and the bounds of the inputs; away: (3,) origin of the world, from that of its links."""
    links = {}
    for name, place in places.items():
        body = place.group.name if place.group.name in coms else None
        pose = Pose(place.pose.rotation, place.pose.point - (coms[body] if body else away))
        links[name] = LinkFrame(body, tuple(float(x) for x in pose.point), pose.quaternion)
    driven = [joints[part.joint or ""] for part in mech.inputs or ()]
    return UrdfReport(
        file,
        notes.close(),
        links,
        np.array([joint.effort for joint in driven], dtype=np.float64),
        np.array([joint.velocity for joint in driven], dtype=np.float64),
    )
