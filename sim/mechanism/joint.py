"""Joint: a connection of two bodies, of one of the kinds in KINDS."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sim.mechanism import checks
from sim.mechanism.positional import few_positional

WORLD = "world"
# free translations and free rotations of each kind of joint
KINDS: dict[str, tuple[int, int]] = {
    "fixed": (0, 0),
    "prismatic": (1, 0),  # along the axis
    "planar": (2, 0),  # across the axis
    "fixed_orientation": (3, 0),
    "revolute": (0, 1),  # about the axis
    "cylindrical": (1, 1),
    "planar_axis": (2, 1),  # across and about the axis: the base of a planar robot
    "free_revolute": (3, 1),
    "orbital": (0, 2),  # in any direction across the axis, never about it
    "prismatic_orbital": (1, 2),
    "planar_orbital": (2, 2),
    "free_orbital": (3, 2),
    "spherical": (0, 3),
    "cylindrical_free": (1, 3),
    "planar_free": (2, 3),
    "floating": (3, 3),
    "screw": (0, 1),  # about the axis, which it moves along by its pitch in every turn
}
# names of kinds in URDF, MJCF and other libraries
_ELSEWHERE = {
    "hinge": "revolute", "continuous": "revolute", "rotational": "revolute",
    "slide": "prismatic", "slider": "prismatic", "linear": "prismatic",
    "ball": "spherical", "socket": "spherical", "free": "floating", "freejoint": "floating",
    "weld": "fixed", "welded": "fixed", "rigid": "fixed", "helical": "screw", "universal": "orbital",
}  # fmt: skip


@few_positional
@dataclass(frozen=True)
class Joint:
    """A joint: the relative motion of `child` and `parent`.

        joint frame   at `parent_point` in the parent, turned by `orientation` (quaternion, joint to parent)
        coordinates   translations first, then rotations; at zero the child's axes are those of the joint frame
                      one rotation: its angle; two, of the orbital kinds: the rotation vector along the two directions
                      of the plane across the axis (sim/dynamics/joints/swing.py); three: a quaternion
        `axis`        in the joint frame; a plane across it has its coordinates along x, y, z in this order, without
                      the one nearest to the axis (axis y: x then z)

    The plane of the planar kinds is across the axis. Orbital kinds turn about all directions but the axis, those from
    spherical to floating about all, a screw about the axis that it moves along. Springs, dampers, rests and armatures
    are one number, or one per degree of freedom. A quaternion joint has one spring constant for its rotations, its rest
    is a rotation vector, and its rotations have no armature.

    Attributes:
        kind: fixed, prismatic, planar, fixed_orientation, revolute, cylindrical, planar_axis, free_revolute, orbital,
            prismatic_orbital, planar_orbital, free_orbital, spherical, cylindrical_free, planar_free, floating or
            screw.
        parent: name of the parent body; None or "world" for the world.
        child: name of the child body.
        name: name of the joint (default that of the child).
        parent_point: (3,) joint point, from the centre of mass of the parent, or in the world [m] (default the origin).
        child_point: (3,) joint point, from the centre of mass of the child [m] (default the origin).
        axis: (3,) direction of the axis in the joint frame (default z).
        orientation: (4,) unit quaternion (w, x, y, z) from the joint frame to the parent (default none).
        spring: spring constant [N/m, N m/rad] (default 0).
        damper: damper constant [N s/m, N m s/rad] (default 0).
        rest: coordinate at which the spring is at rest [m, rad] (default 0).
        limits: (lo, hi), or one (lo, hi) or None per degree of freedom, infinite where free [m, rad] (default None: no
            limits).
        cone: largest angle of the child's axis from the parent's, for kinds with three rotations [rad] (default None:
            no limit).
        armature: inertia of a coordinate alone, such as that of a geared rotor [kg, kg m^2] (default 0).
        friction: dry friction: the largest force or torque that holds a coordinate at rest, and that brakes its motion;
            a number, or one per degree of freedom, not for quaternions [N, N m] (default 0). A joint at rest creeps
            with kappa, as contacts do: by kappa/(h f) (1/(1 - s) - 1/(1 + s)) in a step h under a share s of f.
        close: whether the child already hangs on another joint, so that this joint closes a loop (default False). With
            a spring, a damper, friction, limits, armature, an input, a pitch or two rotations, the joint has
            coordinates of its own, and the child is cut in two: the second part, the body "child.name", hangs on this
            joint and is welded to the first (sim/mechanism/loop_joints.py).
        pitch: displacement of a screw along its axis per turn, positive for a right-handed thread, negative for a
            left-handed one [m/rev] (default 0). Its coordinate is the angle.

    Raises:
        ValueError: for a value of the wrong shape or out of range; the message names the joint.
    """

    kind: str
    parent: str | None
    child: str
    name: str = ""  # default: that of the child
    parent_point: ArrayLike = (0.0, 0.0, 0.0)
    child_point: ArrayLike = (0.0, 0.0, 0.0)
    _: KW_ONLY
    axis: ArrayLike = (0.0, 0.0, 1.0)
    orientation: ArrayLike = (1.0, 0.0, 0.0, 0.0)
    spring: ArrayLike = 0.0
    damper: ArrayLike = 0.0
    rest: ArrayLike = 0.0
    limits: Sequence[Any] | None = None
    cone: float | None = None
    armature: ArrayLike = 0.0
    friction: ArrayLike = 0.0
    close: bool = False
    pitch: float = 0.0  # [m/rev]

    def __post_init__(self) -> None:
        swapped = [kind for kind in KINDS if any(isinstance(n, str) and n == kind for n in (self.parent, self.child))]
        if swapped and self.kind not in list(KINDS):
            raise ValueError(f"Joint: expected Joint({swapped[0]!r}, parent, child, name), got the kind {self.kind!r}")
        checks.name("Joint(child=...)", self.child)
        object.__setattr__(self, "name", checks.name_or("Joint(name=...)", self.name, self.child))
        call = f"Joint({self.name!r}"
        checks.one_of(f"{call}, kind=...)", self.kind, KINDS, _ELSEWHERE)
        object.__setattr__(self, "parent", checks.name_or(f"{call}, parent=...)", self.parent, WORLD))
        for field in ("parent_point", "child_point"):
            object.__setattr__(self, field, checks.vector(f"{call}, {field}=...)", getattr(self, field), 3))
        checks.flag(f"{call}, close=...)", self.close)
        object.__setattr__(self, "axis", checks.direction(f"{call}, axis=...)", self.axis))
        object.__setattr__(self, "orientation", checks.quaternion(f"{call}, orientation=...)", self.orientation))
        for field in ("spring", "damper", "rest", "armature", "friction"):
            object.__setattr__(self, field, per_dof(call, self, field))
        object.__setattr__(self, "limits", limits_of(f"{call}, limits=...)", self))
        object.__setattr__(self, "cone", cone_of(f"{call}, cone=...)", self))
        object.__setattr__(self, "pitch", pitch_of(f"{call}, pitch=...)", self))

    @property
    def ntrans(self) -> int:
        """Number of free translations."""
        return KINDS[self.kind][0]

    @property
    def nrot(self) -> int:
        """Number of free rotations."""
        return KINDS[self.kind][1]

    @property
    def lead(self) -> float:
        """Displacement along the axis per radian of the rotation about it [m/rad]; 0 for a hinge."""
        return self.pitch / (2.0 * np.pi)

    @property
    def nv(self) -> int:
        """Number of degrees of freedom."""
        return self.ntrans + self.nrot

    @property
    def scalar_count(self) -> int:
        """Number of its coordinates that are numbers of their own, the first ones: all but those of three rotations."""
        return self.ntrans if self.nrot == 3 else self.nv

    @property
    def nq(self) -> int:
        """Number of coordinates: one per degree of freedom, four for three rotations."""
        return self.nv + (self.nrot == 3)


def per_dof(call: str, joint: Joint, field: str) -> tuple[float, ...]:
    """One value per degree of freedom."""
    call, value = f"{call}, {field}=...)", getattr(joint, field)
    if checks.ndim(call, value) == 0:
        values = (checks.number(call, value),) * joint.nv
        if field == "rest" and joint.nrot == 3 and any(values):
            raise ValueError(f"{call}: expected {joint.nv} numbers, the last three a rotation vector, got {value!r}")
    else:
        values = checks.vector(call, value, joint.nv)
    if field != "rest" and any(x < 0.0 for x in values):
        raise ValueError(f"{call}: expected numbers >= 0, got {value!r}")
    if field in ("armature", "friction") and joint.nrot == 3 and any(values[-3:]):
        raise ValueError(f"{call}: the rotations of a quaternion joint have none, got {value!r}")
    if field == "spring" and joint.nrot == 3 and len(set(values[-3:])) > 1:
        raise ValueError(f"{call}: a quaternion joint has one spring constant for its three rotations, got {value!r}")
    return values


def limits_of(call: str, joint: Joint) -> tuple[tuple[float, float], ...]:
    """One (lo, hi) per degree of freedom, infinite where there is none."""
    free = (-np.inf, np.inf)
    given = joint.limits
    if given is None:
        return (free,) * joint.nv
    if not hasattr(given, "__len__"):
        raise ValueError(f"{call}: expected (lo, hi), or one such pair per degree of freedom, got {given!r}")
    if (
        len(given) == 2
        and all(checks.ndim(call, x) == 0 for x in given)
        and (joint.nv == 1 or any(x is not None for x in given))
    ):
        given = (given,)
    if len(given) != joint.nv:
        raise ValueError(f"{call}: expected {joint.nv} pairs (lo, hi), one per degree of freedom, got {len(given)}")
    out = []
    for dof, pair in enumerate(given):
        lo, hi = checks.bounds(call, free if pair is None else pair)
        if joint.nrot == 3 and dof >= joint.ntrans and (lo, hi) != free:
            raise ValueError(
                f"{call}: the three rotations of a {joint.kind} joint have no bounds; cone=... limits them"
            )
        out.append((lo, hi))
    return tuple(out)


def cone_of(call: str, joint: Joint) -> float | None:
    """The largest angle of a cone, between 0 and pi, on kinds with three rotations."""
    if joint.cone is None:
        return None
    if joint.nrot != 3:
        raise ValueError(f"{call}: a {joint.kind} joint has no three rotations to limit; see limits=...")
    angle = checks.number(call, joint.cone, above=0.0)
    if angle > 3.1:
        raise ValueError(f"{call}: expected an angle below 3.1 rad, got {angle:g}")
    return angle


def pitch_of(call: str, joint: Joint) -> float:
    """The pitch, other than zero, of a screw; zero of other kinds."""
    pitch = checks.number(call, joint.pitch)
    if joint.kind == "screw" and pitch == 0.0:
        raise ValueError(
            f"{call}: a screw needs its displacement per turn [m/rev]; without a pitch it is a revolute joint"
        )
    if joint.kind != "screw" and pitch != 0.0:
        raise ValueError(f"{call}: a {joint.kind} joint has none, got {pitch:g}")
    return pitch


def require_floating_base(call: str, first: Joint) -> None:
    """Refuse a robot whose first joint is not floating, for what moves a whole robot.

    Args:
        call: place of the robot in the message.
        first: first joint of the robot.

    Raises:
        ValueError: the joint is of another kind.
    """
    if first.kind != "floating":
        raise ValueError(f"{call}: expected a robot on a floating base, but joint {first.name!r} is {first.kind}")
