"""load_urdf: a Mechanism from a URDF file."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from numpy.typing import ArrayLike

from sim.io.loader_choices import loader_choices
from sim.io.meshes.reduced_hull import CORNERS
from sim.io.urdf.assemble import Choices, assemble
from sim.io.urdf.collision_meshes import mesh_choices, with_shapes
from sim.io.urdf.contacts import ALL, as_list
from sim.io.urdf.loops import read_loops
from sim.io.urdf.mimic import can_follow
from sim.io.urdf.report import Notes, UrdfMechanism
from sim.io.urdf.robot import Robot, read_robot
from sim.io.urdf.xml import parse
from sim.mechanism import checks
from sim.mechanism.checks import whole_number
from sim.mechanism.contact import Contact

MIMIC = ("auto", "free", "locked", "gear")


def load_urdf(
    path: str | Path,
    floating: bool = True,
    ground: bool = True,
    friction: float | None = None,
    contacts: Sequence[str | Contact] | None = None,
    merge_fixed: bool = True,
    *,
    position: ArrayLike = (0.0, 0.0, 0.0),
    neutral: Mapping[str, ArrayLike] | None = None,
    locked: Collection[str] = (),
    mimic: str = "auto",
    actuated: Sequence[str] | None = None,
    joint_friction: bool = False,
    restitution: float | None = 0.0,
    turning_friction: bool = False,
    law: str = "nonlinear",
    rim_points: int = 4,
    collisions: str | None = None,
    meshes: str | Mapping[str, str] = "hull",
    mesh_corners: int = CORNERS,
    mesh_dirs: Sequence[str | Path] = (),
    repair: bool = False,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> UrdfMechanism:
    """Load the robot of a URDF file.

    Args:
        path: path of the file.
        floating: whether the root moves freely or is fixed to the world; a root link called "world" is the world in
            either case, unless nothing could move then: the rest floats without it. The joint is called
            "floating_base": its coordinates are the position of the root's frame and its quaternion, its speeds that of
            the frame's origin (world) and of rotation (body).
        ground: whether collision shapes cannot enter the half-space z < 0. Plans of an arm that stays away from it are
            better without: they begin with smooth contacts, which push from afar.
        friction: coefficient of friction of all contacts, but for a dojo.Contact of the caller, and of self-collisions;
            None: <lateral_friction> of the link if the file has it, else 0.8; of self-collisions the larger one of both
            links, 0.5 where neither has one.
        contacts: names of the links that touch the ground, or dojo.Contact(link, point, radius), with the point in the
            frame of the link, in place of the link's shapes; "*" among them: all other links, by their shapes. None:
            all that have a sphere, box (8 corners), capsule (2 balls), cylinder (points on both rims; 2 balls for a
            wheel, a cylinder that turns about its own axis) or mesh. A dojo.Contact keeps its own friction,
            restitution and law.
        merge_fixed: whether links on fixed joints become one body; a link without mass always does.
        position: (3,) place of the root's frame, if it is fixed [m].
        neutral: coordinates of the neutral state by joint [rad, m]; others are at zero, or in the middle of their range
            if that excludes zero. The base then stands so high that the lowest contact touches.
        locked: names of the joints that are held at their neutral coordinate, as if they were fixed.
        mimic: treatment of joints that follow another one: "gear" couples them (see Gear) and refuses those that it
            cannot, "auto" couples them and lets those go free, with a warning; "free" and "locked" ignore it. A coupled
            joint has no input of its own.
        actuated: names of the joints with an input, in the order of u; None: all that move, but for floating ones.
        joint_friction: whether joints have the dry friction that the file gives them, see `Joint.friction`. Steps of a
            higher order or of a given accuracy are for joints without it.
        restitution: coefficient of restitution of all shapes and their contacts; None: <restitution> of the link if
            the file has it, else 0.
        turning_friction: whether contacts of shapes and self-collisions have the torsional and rolling friction of
            <spinning_friction> and <rolling_friction> of the link [m]. Bullet multiplies them by the friction of the
            other body, which is 1 for its plane; here self-collisions have the larger one of both links.
        law: law of contacts of shapes and of self-collisions, see `dojo.Contact`.
        rim_points: number of points per rim of a cylinder.
        collisions: "self" lets all links collide but those that a joint connects, with links that are part of the
            world, too; `report` lists pairs of shapes that overlap in the neutral state, which do not. None: the robot
            does not touch itself.
        meshes: replacement of a collision mesh: "hull", its convex hull reduced to `mesh_corners`; "decompose", several
            such hulls, by CoACD; "sphere", "box" or "capsule", fitted ones, for feet and for speed; "none"; or a dict
            of these by link, with "*" for all others. `report` has the largest distances from the meshes. Needs trimesh
            (`pip install "dojo-opt[meshes]"`).
        mesh_corners: largest number of corners of a convex hull. Each is a contact point with the ground, and costs
            time. With 8 a hull takes the time of a box.
        mesh_dirs: folders with meshes, before those of ROS_PACKAGE_PATH and the ones around the file.
        repair: whether an inertia that no rigid body has is replaced by the nearest one of a ball's extent or more. One
            that is missing becomes that of the collision shapes, which also give a link without mass one, with 1000
            kg/m^3; without shapes it is a ball of 1 g and 1 cm. False refuses them.
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        UrdfMechanism, whose `report` lists unsupported elements. An unexpected change of the motion
        is also a UrdfWarning.

    Raises:
        UrdfError: a ValueError, with the file, line and element if the file cannot be read, or with the names of links
            and joints if the robot cannot be simulated.
        OSError: the file does not exist.
    """
    file, notes = checks.path("load_urdf(path)", path), Notes()
    root = parse(file)
    robot = read_robot(root, notes)
    folders = [
        Path(folder).expanduser() for folder in ([mesh_dirs] if isinstance(mesh_dirs, str | Path) else mesh_dirs)
    ]
    choice = mesh_choices(meshes, robot.links), whole_number("load_urdf(mesh_corners=...)", mesh_corners, 4)
    robot = _bouncing(robot, restitution, notes)
    shared = loader_choices(
        "load_urdf",
        ground=ground,
        friction=friction,
        law=law,
        rim_points=rim_points,
        joint_friction=joint_friction,
        gravity=gravity,
        collisions=collisions,
        turning_friction=turning_friction,
    )
    robot = robot if shared.turning_friction else _sliding(robot, notes)
    every = contacts is None or ALL in as_list(contacts)
    robot = with_shapes(robot, file, choice, folders, ground and every, notes)
    loops = read_loops(root, robot, notes)
    held, geared = _held(robot, locked, mimic, notes)
    choices = Choices(
        file=file.name,
        fixed_base=not floating,
        merge=merge_fixed,
        locked=held,
        geared=geared,
        repair=repair,
        neutral=dict(neutral or {}),
        position=checks.vector("load_urdf(position=...)", position, 3),
        actuated=None if actuated is None else tuple(actuated),
        contacts=contacts if ground else (),
        shared=shared,
    )
    return assemble(robot, loops, choices, notes)


def _bouncing(robot: Robot, restitution: float | None, notes: Notes) -> Robot:
    """The robot with the restitution of the caller, unless that of the file is asked for."""
    if restitution is None:
        return robot
    value = checks.fraction("load_urdf(restitution=...)", restitution)
    given = [name for name, link in robot.links.items() if link.restitution]
    if given:
        notes.add("contacts without the restitution of the file, which restitution=None uses", given)
    links = {name: replace(link, restitution=value or None) for name, link in robot.links.items()}
    return replace(robot, links=links)


def _sliding(robot: Robot, notes: Notes) -> Robot:
    """The robot without torsional and rolling friction."""
    given = [name for name, link in robot.links.items() if link.torsional_friction or link.rolling_friction]
    if given:
        notes.add(
            "torsional and rolling friction is omitted (<spinning_friction>, <rolling_friction>; "
            "turning_friction=True has it)",
            given,
            warn=True,
        )
    links = {name: replace(link, torsional_friction=None, rolling_friction=None) for name, link in robot.links.items()}
    return replace(robot, links=links)


def _held(robot: Robot, locked: Collection[str], mimic: str, notes: Notes) -> tuple[frozenset[str], tuple[str, ...]]:
    """Joints that do not move, and joints that a gear ties to another one."""
    checks.one_of("load_urdf(mimic=...)", mimic, MIMIC)
    held = [locked] if isinstance(locked, str) else list(locked)
    for name in held:
        checks.one_of("load_urdf(locked=...): joint", name, robot.joints)
    following = [name for name in robot.mimics if name not in held]
    geared = [name for name in following if mimic == "gear" or (mimic == "auto" and can_follow(robot, name, held))]
    following = [name for name in following if name not in geared]
    if geared:
        notes.add("joints that follow another one, by a gear", geared)
    if following and mimic == "auto":
        notes.add("mimic joints that follow none with a coordinate; each moves freely", following, warn=True)
    elif following:
        fate = "no longer follow another one: each moves freely" if mimic == "free" else "are held where they are"
        notes.add(f"mimic joints are not modelled; these {fate}", following, warn=True)
    return (
        frozenset([*held, *following] if mimic == "locked" else held),
        tuple(geared),
    )
