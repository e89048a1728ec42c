"""Robot: links and joints as the file has them, every number read and checked; nothing is interpreted yet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from sim.io.urdf.report import Notes
from sim.io.urdf.unread import unread
from sim.io.urdf.xml import Element
from sim.mechanism import checks
from sim.mechanism.joint import KINDS as JOINT_KINDS
from sim.mechanism.pose import HERE, Pose, roll_pitch_yaw
from sim.mechanism.short_repr import short_repr
from solvers.types import Floats

T = TypeVar("T", "UrdfLink", "UrdfJoint")
Palette = dict[str, tuple[float, ...]]  # red, green, blue, alpha of materials by name

# URDF's joint types, and the further ones that PyBullet (spherical) and Dojo read, as kinds of Joint; then those kinds
# of Joint without a standard word. A kind's own name is read, too, except for "planar", which may turn in URDF, and
# for "screw", whose pitch URDF has no attribute for.
KINDS = {
    "fixed": "fixed",
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
    "planar": "planar_axis",
    "floating": "floating",
    "spherical": "spherical",
    "ball": "spherical",
    "planaraxis": "planar_axis",
    "planarfree": "planar_free",
    "cylindrical": "cylindrical",
    "cylindricalfree": "cylindrical_free",
    "fixedorientation": "fixed_orientation",
    "orbital": "orbital",
    "planarfixed": "planar",
    "freerevolute": "free_revolute",
    "prismaticorbital": "prismatic_orbital",
    "planarorbital": "planar_orbital",
    "freeorbital": "free_orbital",
}
KINDS |= {kind: kind for kind in JOINT_KINDS if kind not in (*KINDS, "screw")}
SIZES = {"sphere": ("radius",), "cylinder": ("radius", "length"), "capsule": ("radius", "length")}


@dataclass(frozen=True)
class Geometry:
    """A shape of a link. sizes: radius; x, y, z; or radius, length [m]. Empty for a kind that has no meaning here.

    file, scale: of a mesh. points: (n, 3) corners of a hull, which stands for a mesh (collision_meshes.py) [m].
    color: red, green, blue, alpha from 0 to 1 of a <visual>; None where the file has none.
    """

    kind: str
    sizes: tuple[float, ...]
    pose: Pose  # in the link
    file: str = ""
    scale: tuple[float, ...] = (1.0, 1.0, 1.0)
    color: tuple[float, ...] | None = None
    points: Floats | None = None

    __repr__ = short_repr


@dataclass(frozen=True)
class UrdfLink:
    """A link. com and inertia are in the axes of the link; without an <inertial> the mass is zero."""

    name: str
    mass: float  # [kg]
    com: Floats  # (3,) [m]
    inertia: Floats  # (3, 3) about the centre of mass [kg m^2]
    collisions: tuple[Geometry, ...]
    visuals: tuple[Geometry, ...]
    friction: float | None  # <contact><lateral_friction>, as PyBullet reads it
    restitution: float | None  # <contact><restitution>, likewise
    torsional_friction: float | None  # <contact><spinning_friction>, likewise, on a ground of friction 1 [m]
    rolling_friction: float | None  # <contact><rolling_friction> [m]
    element: Element

    @property
    def empty(self) -> bool:
        """Whether there is neither mass nor inertia."""
        return self.mass == 0.0 and not self.inertia.any()


@dataclass(frozen=True)
class UrdfJoint:
    """A joint."""

    name: str
    kind: str  # one of sim.mechanism.joint.KINDS
    parent: str
    child: str
    pose: Pose  # of the joint frame, and so of the child's frame at coordinate zero, in the parent
    axis: Floats  # (3,) in the joint frame, unit
    limits: tuple[float, float] | None  # [m, rad]
    damping: float  # [N s/m, N m s/rad]
    friction: float  # dry [N, N m]
    effort: float  # [N, N m], infinite where there is none
    velocity: float  # [m/s, rad/s], infinite where there is none
    element: Element


@dataclass(frozen=True)
class Robot:
    """The contents of the file."""

    name: str
    links: dict[str, UrdfLink]
    joints: dict[str, UrdfJoint]
    mimics: tuple[str, ...]  # joints that follow another one


def read_robot(root: Element, notes: Notes) -> Robot:
    """The robot of a <robot> element; its unsupported elements go into the notes."""
    if root.tag != "robot":
        raise root.error("expected a <robot> as the outermost element")
    for element in root.children:
        if element.tag.startswith("xacro:"):
            raise element.error("this is a xacro file; run xacro on it first")
    palette = _palette(root)
    links = _by_name(root.all("link"), lambda e: _link(e, palette))
    joints = _by_name(root.all("joint"), lambda e: _joint(e, notes))
    if not links:
        raise root.error("expected at least one <link>")
    if others := unread(root):
        notes.add("not read", (f"{place} ({count})" for place, count in others.items()))
    mimics = tuple(name for name, joint in joints.items() if joint.element.one("mimic"))
    return Robot(root.attributes.get("name") or "robot", links, joints, mimics)


def _by_name(elements: list[Element], read: Callable[[Element], T]) -> dict[str, T]:
    """The parts by name; a name that is given twice is refused."""
    out: dict[str, T] = {}
    for element in elements:
        name = element.text("name")
        if name in out:
            raise element.error(f"the name is taken by the <{element.tag}> of line {out[name].element.line}")
        out[name] = read(element)
    return out


def _pose(element: Element) -> Pose:
    """The <origin> of an element: zero by default."""
    origin = element.one("origin")
    if origin is None:
        return HERE
    zero = (0.0, 0.0, 0.0)
    return Pose(roll_pitch_yaw(origin.vector("rpy", 3, zero)), origin.vector("xyz", 3, zero))


_INFINITE = float("inf")
# by element of a <contact> the largest value, in the order of UrdfLink
_SURFACE = {
    "lateral_friction": _INFINITE,
    "restitution": 1.0,
    "spinning_friction": _INFINITE,
    "rolling_friction": _INFINITE,
}


def _link(element: Element, palette: Palette) -> UrdfLink:
    mass, com, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
    inertial = element.one("inertial")
    if inertial is not None:
        pose = _pose(inertial)
        mass = inertial.need("mass").number("value")
        if mass < 0.0:
            raise inertial.need("mass").error(f"expected a mass >= 0, got {mass:g}")
        xx, xy, xz, yy, yz, zz = (
            inertial.need("inertia").number(f"i{ab}") for ab in ("xx", "xy", "xz", "yy", "yz", "zz")
        )
        given = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        com, inertia = pose.point, pose.rotation @ given @ pose.rotation.T
    shapes = [tuple(_geometry(e, palette) for e in element.all(tag)) for tag in ("collision", "visual")]
    mu, e, spin, roll = (_of_surface(element, tag, largest) for tag, largest in _SURFACE.items())
    return UrdfLink(element.text("name"), mass, com, inertia, shapes[0], shapes[1], mu, e, spin, roll, element)


def _of_surface(element: Element, tag: str, largest: float) -> float | None:
    """The number of an element of the <contact> of a link, if it has it."""
    contact = element.one("contact")
    given = contact.one(tag) if contact else None
    value = given.number("value") if given else None
    if given and value is not None and not 0.0 <= value <= largest:
        expected = "a coefficient of restitution between 0 and 1" if largest == 1.0 else "a coefficient >= 0"
        raise given.error(f"expected {expected}, got {value:g}")
    return value


def _geometry(element: Element, palette: Palette) -> Geometry:
    """The shape of a <collision> or <visual>."""
    kinds = [e for e in element.need("geometry").children if e.tag != "material"]
    if len(kinds) != 1:
        raise element.need("geometry").error(f"expected one shape, got {len(kinds)}")
    shape, materials = kinds[0], element.all("material")
    color = _color(materials[0] if materials else None, palette)
    if shape.tag == "box":
        sizes = tuple(float(x) for x in shape.vector("size", 3))
    else:
        sizes = tuple(shape.number(field) for field in SIZES.get(shape.tag, ()))
    if any(size < 0.0 for size in sizes):
        raise shape.error(f"expected sizes >= 0, got {', '.join(f'{s:g}' for s in sizes)}")
    if shape.tag != "mesh":
        return Geometry(shape.tag, sizes, _pose(element), color=color)
    scale, name = _scale(shape), shape.attributes.get("filename", "").strip()
    return Geometry("mesh", (), _pose(element), name, scale, color)


def _scale(mesh: Element) -> tuple[float, ...]:
    """Factors of a mesh: three numbers, or one for all; a fourth, as some files have it, means nothing."""
    count = len(mesh.attributes.get("scale", "1 1 1").split())
    given = [float(x) for x in mesh.vector("scale", count if count in (1, 4) else 3, (1.0, 1.0, 1.0))]
    if not all(given):
        raise mesh.error(f"scale={mesh.attributes['scale']!r}: expected numbers other than zero")
    return tuple(given * 3) if len(given) == 1 else tuple(given[:3])


def _palette(root: Element) -> Palette:
    """Colours of the materials that links refer to by name: those of the file, and of the links that define one."""
    own = [m for link in root.all("link") for visual in link.all("visual") for m in visual.all("material")]
    given = [*(m for m in own if m.all("color")), *root.all("material")]
    found = {e.attributes.get("name", ""): _color(e, {}) for e in given}
    return {name: color for name, color in found.items() if color is not None}


def _color(material: Element | None, palette: Palette) -> tuple[float, ...] | None:
    """Colour of a <material>, or of that of the file with its name; a robot is not refused for a bad one."""
    for color in material.all("color") if material else ():
        try:
            rgba = [float(word) for word in color.attributes.get("rgba", "").split()]
        except ValueError:
            return None
        return tuple(min(max(c, 0.0), 1.0) for c in rgba) if len(rgba) == 4 and np.isfinite(rgba).all() else None
    return palette.get(material.attributes.get("name", "")) if material else None


def _joint(element: Element, notes: Notes) -> UrdfJoint:
    return read_joint(element, ("parent", "child"), _pose(element), notes)


def read_joint(element: Element, ends: tuple[str, str], pose: Pose, notes: Notes) -> UrdfJoint:
    """A joint between the links that the two elements `ends` name, with its frame at `pose` in the first."""
    name, given = element.text("name"), element.text("type")
    if given not in KINDS:
        raise element.error(f"type {given!r} is not one of: {', '.join(KINDS)}{checks.nearest(given, KINDS)}")
    kind = KINDS[given]
    axis = np.array([1.0, 0.0, 0.0])
    if (line := element.one("axis")) is not None and kind not in ("fixed", "floating", "spherical"):
        axis = line.vector("xyz", 3)
        if np.linalg.norm(axis) < 1e-9:
            raise line.error("expected a direction, got the zero vector")
        axis = axis / np.linalg.norm(axis)
    dynamics, limit = element.one("dynamics"), element.one("limit")
    damping = dynamics.number("damping", 0.0) if dynamics else 0.0
    if dynamics and damping < 0.0:
        raise dynamics.error(f"expected damping >= 0, got {damping:g}")
    friction = dynamics.number("friction", 0.0) if dynamics else 0.0
    if friction < 0.0:
        notes.add("joints whose dry friction is negative in the file have none", [name], warn=True)
    bounds = [
        limit.number(field, np.inf) if limit and field in limit.attributes else np.inf
        for field in ("effort", "velocity")
    ]
    for k, field in enumerate(("effort", "velocity")):
        if bounds[k] <= 0.0:
            bounds[k] = np.inf
            if kind != "fixed":
                notes.add(f"joints without a largest {field}, because the file gives zero or less", [name])
    return UrdfJoint(
        name,
        kind,
        element.need(ends[0]).text("link"),
        element.need(ends[1]).text("link"),
        pose,
        axis,
        _limits(name, given, limit, notes),
        damping,
        max(friction, 0.0),
        bounds[0],
        bounds[1],
        element,
    )


def _limits(name: str, given: str, limit: Element | None, notes: Notes) -> tuple[float, float] | None:
    """(lower, upper) of a joint that can have them.

    An empty range (lower > upper is PyBullet's sign for it) or one of zero length is none; so is a range left out,
    which URDF demands of revolute and prismatic joints, and files in the wild leave out.
    """
    if given not in ("revolute", "prismatic"):
        if limit and given not in ("continuous", "fixed") and {"lower", "upper"} & limit.attributes.keys():
            notes.add("limits of joints with several degrees of freedom are not represented", [name], warn=True)
        return None
    if limit is None or not {"lower", "upper"} & limit.attributes.keys():
        notes.add("joints without limits, because the file gives no range", [name])
        return None
    lower, upper = limit.number("lower", 0.0), limit.number("upper", 0.0)
    if lower >= upper:
        notes.add("joints without limits, because the range in the file is empty", [f"{name} [{lower:g}, {upper:g}]"])
        return None
    return lower, upper
