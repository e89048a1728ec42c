"""load_mjcf: a Mechanism from an MJCF file."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sim.io.loader_choices import LoaderChoices, loader_choices
from sim.io.mjcf.actuators import find_inputs, reflect_actuators, with_friction
from sim.io.mjcf.collisions import find_collisions, find_on_planes
from sim.io.mjcf.contacts import find_contacts
from sim.io.mjcf.equalities import find_gears, find_loops
from sim.io.mjcf.flags import heed_flags
from sim.io.mjcf.joints import BALL, FREE, carry, range_of
from sim.io.mjcf.omitted import note_omitted
from sim.io.mjcf.report import MjcfMechanism, MjcfReport, MjcfWarning
from sim.io.mjcf.welded_bodies import GeomGroup, body_shapes, find_groups
from sim.io.self_collisions import with_self_collisions
from sim.io.urdf.report import LinkFrame, Notes
from sim.mechanism import checks
from sim.mechanism.body import Body
from sim.mechanism.joint import Joint
from sim.mechanism.pose import Pose
from sim.mechanism.stance import gaps, lifted, penetrations


def load_mjcf(
    source: str | Path,
    *,
    ground: bool = True,
    friction: float | None = None,
    law: str = "nonlinear",
    merge: bool = True,
    keyframe: int | None = None,
    rim_points: int = 4,
    collisions: bool | str = False,
    gravity: ArrayLike | None = None,
    joint_friction: bool = False,
    turning_friction: bool = False,
) -> MjcfMechanism:
    """Load the model of an MJCF file, with MuJoCo's own parser (`pip install "dojo-opt[mjcf]"`).

    Args:
        source: path of the file, or its text, which begins with "<".
        ground: whether geoms cannot enter the planes of the file.
        friction: coefficient of friction of all contacts and collisions; None: that of the geoms.
        law: law of contacts and collisions with friction, see `dojo.Contact`; geoms with condim 1 are without.
        merge: whether slides and a hinge in a row become one joint if there is a kind for it, with the same
            coordinates. All other joints in a row are a chain with massless bodies between them.
        keyframe: number of the keyframe whose qpos is the neutral state; None: the default one, with joints outside
            their range in its middle, and a floating base high enough that nothing penetrates.
        rim_points: number of points per rim of a cylinder.
        collisions: whether bodies collide with one another, and with fixed geoms other than planes, where MuJoCo lets
            them: its spheres, capsules, boxes, cylinders, ellipsoids and meshes, each the convex hull of 32
            corners at most (sim/io/mjcf/collisions.py). "self" lets all bodies collide with one another but those that
            a joint connects; `report` lists pairs of shapes that overlap in the neutral state, which do not.
        gravity: (3,) acceleration of gravity [m/s^2]; None: that of the file, none where a <flag> disables it.
        joint_friction: whether hinges and slides have the dry friction (frictionloss) of the file, see
            `Joint.friction`. Steps of a higher order or of a given accuracy are for joints without it.
        turning_friction: whether contacts and collisions have the torsional and rolling friction of condim 4 and 6,
            see `dojo.Contact`.

    Returns:
        MjcfMechanism, whose `report` lists unsupported elements. An unexpected change of the motion
        is also an MjcfWarning.

    Raises:
        ImportError: MuJoCo is not installed.
        ValueError: MuJoCo cannot read the file, or no rigid body has the inertia of the named body.
        OSError: the file does not exist.
    """
    model, file = _compile(source)
    with _named(file):
        notes = Notes()
        reflect_actuators(model, notes)
        heed_flags(model, notes)
        choices = loader_choices(
            "load_mjcf",
            ground=ground,
            friction=friction,
            law=law,
            rim_points=rim_points,
            joint_friction=joint_friction,
            gravity=model.opt.gravity if gravity is None else gravity,
            collisions=None if isinstance(collisions, bool) else collisions,
            turning_friction=turning_friction,
        )
        mech = _mechanism(model, file, merge, collisions, keyframe, choices, notes)
        mech = _without_constant_gaps(mech, notes)
        mech = _clear(mech) if keyframe is None else mech
        _note_penetrations(mech, keyframe, notes)
        mech = with_self_collisions(mech, choices, notes, slippery=True) if choices.itself else mech
        assert mech.report is not None
        report = replace(mech.report, notes=notes.close())
        _warn(report)
        return replace(mech, report=report)


def _mechanism(
    model: Any,
    file: str,
    merge: bool,
    collisions: bool | str,
    keyframe: int | None,
    choices: LoaderChoices,
    notes: Notes,
) -> MjcfMechanism:
    """The mechanism with all its parts, and a report without notes."""
    groups, where = find_groups(model)
    bodies, joints, homes = _tree(model, groups, merge, choices, notes)
    if not joints:
        raise ValueError(f"load_mjcf: {file}: no joint is free to move")
    inputs, gear, low, high = find_inputs(model, homes, where, notes)
    note_omitted(model, collisions, choices, notes)
    known = {model.joint(j).name or f"joint_{j}": home for j, home in homes.items()}
    return MjcfMechanism(
        bodies,
        [*with_friction(model, joints, homes, choices.joint_friction, notes), *find_loops(model, where, notes)],
        find_contacts(model, where, choices, collisions is True, notes) if choices.ground else [],
        inputs,
        gravity=choices.gravity,
        name=Path(file).stem,
        neutral=_neutral(model, keyframe, notes),
        collisions=[
            *(find_on_planes(model, where, choices) if choices.ground else []),
            *(find_collisions(model, where, choices, notes) if collisions is True else []),
        ],
        gears=find_gears(model, homes, notes),
        report=MjcfReport(file, (), _frames(model, where), known, gear, low, high),
    )


def _warn(report: MjcfReport) -> None:
    """Warnings of changes of the motion, at the line that called load_mjcf."""
    for note in report.notes:
        if note.warn:
            warnings.warn(f"load_mjcf: {report.file}: {note}", MjcfWarning, stacklevel=3)


def _tree(
    model: Any, groups: list[GeomGroup], merge: bool, choices: LoaderChoices, notes: Notes
) -> tuple[list[Body], list[Joint], dict[int, tuple[str, int]]]:
    """Bodies, the joints they hang on, and where every joint of the file went."""
    bodies: list[Body] = []
    joints: list[Joint] = []
    homes: dict[int, tuple[str, int]] = {}
    for group in groups:
        carried = carry(model, group, merge, notes)
        inertia = group.inertia
        if inertia.mass:
            floats = _compensation(model, group, notes)
            shapes = body_shapes(model, group, choices.turning_friction)
            solid = Body(group.name, inertia.mass, inertia.inertia, shapes, gravity_compensation=floats)
        else:
            solid = Body(group.name, 0.0)
        bodies += [*carried.bodies, solid]
        joints += carried.joints
        homes |= carried.homes
    return bodies, joints, homes


def _compensation(model: Any, group: GeomGroup, notes: Notes) -> float:
    """The gravity compensation of the bodies that are one here: their mean by mass, with a note where they differ."""
    members = list(group.members)
    shares = np.array([float(model.body_gravcomp[b]) for b in members])
    masses = np.array([float(model.body_mass[b]) for b in members])
    if np.ptp(shares[masses > 0.0]) > 0.0:
        notes.add(
            "gravity compensation acts at the centre of mass of bodies that are one here", [group.name], warn=True
        )
    return float(shares @ masses / masses.sum())


@contextmanager
def _named(file: str) -> Iterator[None]:
    """Parts of the mechanism name themselves where they refuse a number; the error names the file, too."""
    try:
        yield
    except ValueError as error:
        if str(error).startswith("load_mjcf"):
            raise
        raise ValueError(f"load_mjcf: {file}: {error}") from error


def _compile(source: str | Path) -> tuple[Any, str]:
    """MuJoCo's model of a file or a text, and a name for messages."""
    try:
        import mujoco
    except ImportError as error:
        raise ImportError('load_mjcf needs MuJoCo: pip install "dojo-opt[mjcf]"') from error
    text = isinstance(source, str) and source.lstrip().startswith("<")
    if not text and not checks.path("load_mjcf(source)", source).is_file():
        raise FileNotFoundError(f"load_mjcf: no file {str(source)!r}")
    try:
        if text:
            return mujoco.MjModel.from_xml_string(str(source)), "model"
        return mujoco.MjModel.from_xml_path(str(source)), Path(source).name
    except ValueError as error:
        raise ValueError(f"load_mjcf: {'the text' if text else source}: {error}") from None


def _neutral(model: Any, keyframe: int | None, notes: Notes) -> Any:
    """qpos of a keyframe, or the default one within the ranges of its joints."""
    if keyframe is not None:
        if not isinstance(keyframe, int | np.integer) or not 0 <= keyframe < model.nkey:
            raise ValueError(f"load_mjcf(keyframe=...): the file has {model.nkey} keyframes, got {keyframe!r}")
        q = np.array(model.key_qpos[keyframe], dtype=np.float64)
    else:
        q = np.array(model.qpos0, dtype=np.float64)
    for j in range(model.njnt):
        a = int(model.jnt_qposadr[j])
        kind = int(model.jnt_type[j])
        if kind in (FREE, BALL):
            a += 3 if kind == FREE else 0
            q[a : a + 4] /= np.linalg.norm(q[a : a + 4])
        elif keyframe is None and model.jnt_limited[j]:
            low, high = range_of(model, j)
            if not low <= q[a] <= high:
                q[a] = 0.5 * (low + high)
                notes.add("neutral coordinates that were outside their range are in its middle", [model.joint(j).name])
    return q


def _without_constant_gaps(mech: MjcfMechanism, notes: Notes) -> MjcfMechanism:
    """Without the contacts that no joint can open or close, as of a disc that slides in the plane it lies on."""
    rng = np.random.default_rng(0)
    seen = []
    for _ in range(4):
        q = rng.uniform(-1.0, 1.0, mech.nq)
        for joint in mech.joints:
            if joint.nrot == 3:
                stop = mech.q_slice(joint.name).stop
                q[stop - 4 : stop] /= np.linalg.norm(q[stop - 4 : stop])
        seen.append(gaps(mech, q))
    moving = np.ptp(seen, axis=0) > 1e-9 if mech.contacts else np.zeros(0, dtype=bool)
    if moving.all():
        return mech
    notes.add(
        "contacts that no joint can open or close are omitted",
        [c.name for c, moves in zip(mech.contacts, moving, strict=True) if not moves],
        warn=True,
    )
    return replace(mech, contacts=[c for c, moves in zip(mech.contacts, moving, strict=True) if moves])


def _clear(mech: MjcfMechanism) -> MjcfMechanism:
    """The mechanism with its floating base, if it has one, lifted out of the ground."""
    bases = [j.name for j in mech.joints if j.kind == "floating"]
    return replace(mech, neutral=lifted(mech, bases[0], down=False)) if len(bases) == 1 else mech


def _note_penetrations(mech: MjcfMechanism, keyframe: int | None, notes: Notes) -> None:
    """A note on the contacts that begin inside of the ground: hard contact parts them in the first step."""
    low = penetrations(mech)
    if low:
        notes.add("contacts that are inside of the ground in the neutral state", low, warn=keyframe is None)


def _frames(model: Any, where: dict[int, tuple[GeomGroup | None, Pose]]) -> dict[str, LinkFrame]:
    """Where the bodies of the file are."""
    out = {}
    for b, (group, pose) in where.items():
        point = pose.point - (group.com if group else 0.0)
        name = model.body(b).name or f"body_{b}"
        out[name] = LinkFrame(group.name if group else None, tuple(float(x) for x in point), pose.quaternion)
    return out
