"""Body, Joint, Contact, Input: the parts a user puts together into a Mechanism. Each checks its own numbers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.mechanism import checks
from sim.mechanism.composite import composite
from sim.mechanism.shapes import Solid
from sim.mechanism.terrain import Terrain
from sim.mechanism.visual import Visual

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
LAWS = ("impact", "linear", "nonlinear")


@dataclass(frozen=True)
class Body:
    """A rigid body. Its frame has its origin at the centre of mass.

    A body of mass 0, without inertia and shape, connects the parts of a compound joint, such as a chain of hinges. A
    body with a mass has to hang on it.

    Attributes:
        name: name of the body.
        mass: mass [kg] (default 1).
        inertia: (3,) principal moments or (3, 3) matrix, about the centre of mass, body axes [kg m^2] (default None:
            that of `shape`).
        shape: shape for inertia, collisions and drawings, or several (default None: no shape). All of them can touch
            the ground (`Mechanism.on`), obstacles and other bodies, each with its own friction and restitution. Several
            shapes share the mass in proportion to their volumes; `shapes` has them as a tuple.
        visuals: picture of the body, if it differs from the shapes (default none).
        gravity_compensation: compensated share of its weight: 1 for a body that floats, such as the link of an arm
            whose drives carry it, 0 for none (default 0).

    Raises:
        ValueError: for a value out of range, or an inertia that no rigid body has; the message names the body.
    """

    name: str
    mass: float = 1.0  # [kg]
    inertia: ArrayLike | None = None
    shape: Solid | Sequence[Solid] | None = None
    visuals: Sequence[Visual] = ()
    gravity_compensation: float = 0.0

    def __post_init__(self) -> None:
        checks.name("Body(name=...)", self.name)
        call = f"Body({self.name!r}"
        object.__setattr__(self, "shape", shape_of(f"{call}, shape=...)", self.shape))
        if self.mass != 0 or self.inertia is not None or self.shape is not None:
            object.__setattr__(self, "mass", checks.number(f"{call}, mass=...)", self.mass, above=0.0))
        object.__setattr__(self, "inertia", inertia_of(call, self))
        compensation = checks.number(f"{call}, gravity_compensation=...)", self.gravity_compensation)
        object.__setattr__(self, "gravity_compensation", compensation)
        object.__setattr__(self, "visuals", tuple(self.visuals))
        for visual in self.visuals:
            if not isinstance(visual, Visual):
                raise ValueError(f"{call}, visuals=...): expected a list of Visual, got {visual!r}")

    @property
    def shapes(self) -> tuple[Solid, ...]:
        """All of its shapes."""
        if self.shape is None:
            return ()
        return (self.shape,) if isinstance(self.shape, Solid) else tuple(self.shape)


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
            joint and is welded to the first (sim/mechanism/closing.py).
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
        checks.name("Joint(child=...)", self.child)
        object.__setattr__(self, "name", checks.name("Joint(name=...)", self.name or self.child))
        call = f"Joint({self.name!r}"
        checks.one_of(f"{call}, kind=...)", self.kind, KINDS)
        object.__setattr__(self, "parent", checks.name(f"{call}, parent=...)", self.parent or WORLD))
        for field in ("parent_point", "child_point"):
            object.__setattr__(self, field, checks.vector(f"{call}, {field}=...)", getattr(self, field), 3))
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
    def nq(self) -> int:
        """Number of coordinates: one per degree of freedom, four for three rotations."""
        return self.nv + (self.nrot == 3)


@dataclass(frozen=True)
class Contact:
    """A ball on a body that cannot enter the ground, the half-space normal . x < height.

    Attributes:
        body: name of the body.
        point: (3,) centre of the ball, from the centre of mass, body axes [m] (default the centre of mass).
        radius: radius of the ball; 0 is a point [m] (default 0).
        friction: coefficient of friction (default 0.5).
        law: "nonlinear", the friction cone; "linear", a four-sided pyramid inside it; or "impact", no friction (default
            "nonlinear").
        normal: (3,) outward normal of the ground, world axes (default z).
        height: height of the ground along its normal; of terrain, its rise [m] (default 0).
        name: name of the contact (default that of the body, numbered if the body has several).
        terrain: ground that is not a half-space, see `dojo.Terrain`, and `Mechanism.on` for all contacts at once
            (default None: the half-space).
        restitution: share of the normal velocity that an impact gives back, 0 to 1, see sim/contact/restitution.py
            (default 0).

    Raises:
        ValueError: for a value of the wrong shape or out of range; the message names the contact.
    """

    body: str
    point: ArrayLike = (0.0, 0.0, 0.0)  # from the centre of mass, body axes [m]
    radius: float = 0.0  # [m]
    friction: float = 0.5
    law: str = "nonlinear"
    normal: ArrayLike = (0.0, 0.0, 1.0)
    height: float = 0.0  # [m]
    name: str = ""  # default: that of the body, numbered when it has several
    terrain: Terrain | None = None
    restitution: float = 0.0

    def __post_init__(self) -> None:
        checks.name("Contact(body=...)", self.body)
        call = f"Contact({self.name or self.body!r}"
        object.__setattr__(self, "point", checks.vector(f"{call}, point=...)", self.point, 3))
        for field in ("radius", "friction"):
            value = checks.number(f"{call}, {field}=...)", getattr(self, field), at_least=0.0)
            object.__setattr__(self, field, value)
        checks.one_of(f"{call}, law=...)", self.law, LAWS)
        object.__setattr__(self, "normal", checks.direction(f"{call}, normal=...)", self.normal))
        object.__setattr__(self, "height", checks.number(f"{call}, height=...)", self.height))
        object.__setattr__(self, "restitution", checks.share(f"{call}, restitution=...)", self.restitution))
        if self.terrain is not None:
            self._put_on(f"{call}, terrain=...)", self.terrain)

    def _put_on(self, call: str, terrain: Terrain) -> None:
        """A slope is a half-space; other terrain lies above and below the level plane."""
        if not isinstance(terrain, Terrain):
            raise ValueError(f"{call}: expected a Terrain, got {terrain!r}")
        if self.normal != (0.0, 0.0, 1.0):
            raise ValueError(f"{call}: a contact with terrain has no normal of its own, got normal={self.normal}")
        if terrain.plane is not None:
            normal, height = terrain.plane
            object.__setattr__(self, "normal", normal)
            object.__setattr__(self, "height", height + self.height * normal[2])
            object.__setattr__(self, "terrain", None)

    def gap(self, centres: ArrayLike) -> NDArray[np.float64]:
        """Distance of the ball from the ground.

        Above terrain it is the height over the surface times the vertical part of the normal, right to first order.

        Args:
            centres: (..., 3) centres of the ball, world axes [m].

        Returns:
            (...,) distances [m], negative below the ground.
        """
        at = np.asarray(centres, dtype=np.float64)
        if self.terrain is None:
            return np.asarray(at @ np.asarray(self.normal) - self.radius - self.height)
        surface = self.terrain.surface(float(self.radius))
        return (at[..., 2] - surface.height(at[..., 0], at[..., 1]) - self.height) * self.normal_at(at)[..., 2]

    def normal_at(self, centres: ArrayLike) -> NDArray[np.float64]:
        """Outward normal of the ground at the ball.

        Args:
            centres: (..., 3) centres of the ball, world axes [m].

        Returns:
            (..., 3) unit normals, world axes.
        """
        at = np.asarray(centres, dtype=np.float64)
        if self.terrain is None:
            return np.array(np.broadcast_to(np.asarray(self.normal), at.shape))
        return self.terrain.surface(float(self.radius)).normal(at[..., 0], at[..., 1])


@dataclass(frozen=True)
class Input:
    """One entry of u: a force or torque on a joint coordinate, or a wrench on a body at its centre of mass.

        Input("knee")                                 the torque of a joint with one degree of freedom [N m]
        Input("base", dof=3)                          its fourth degree of freedom [N or N m]
        Input(body="block", force=(1, 0, 0))          u newtons along x, world axes
        Input(body="drone", force=(0, 0, 1), torque=(0, 0, 0.02), frame="body")
        Input("knee", servo="position", stiffness=80, damping=2)    u is the angle it turns to [rad]
        Input("wheel", servo="velocity", damping=5)                 u is the rate it turns at [rad/s]

    The force of a servo is kp (u - q) - kd v, or kd (u - v). Like all springs and dampers of a step it is implicit, so
    it is stable for every gain. In energies it is a spring with its rest at zero. `force_limits` hold as exactly as
    contacts; the force is then that of a drive in energies, and the damper is of first order in the time step.

    Attributes:
        joint: name of the joint (default None: the input acts on a body).
        dof: number of the degree of freedom of the joint (default 0).
        body: name of the body (default None: the input acts on a joint).
        force: (3,) force on the body per unit of the input (default zero).
        torque: (3,) torque on the body per unit of the input [m] (default zero).
        frame: axes of force and torque, "world" or "body" (default "world").
        name: name of the input (default that of the joint or the body; with several degrees of freedom, numbered).
        limits: (lo, hi) of the force or torque, or of the target of a servo, as a file gives them: default control
            limits of problems and plants; a simulator does not clip [N, N m; m, rad; m/s, rad/s] (default inf).
        speed: largest speed of the joint's coordinate, used by `dojo.constraint.SpeedLimits` only [m/s, rad/s] (default
            inf).
        servo: "position" or "velocity": the input is the target of its joint (default None: a force or torque).
        stiffness: kp of a position servo [N/m, N m/rad] (default 0).
        damping: kd of a servo [N s/m, N m s/rad] (default 0).
        force_limits: (lo, hi) of the force of a servo, both finite [N, N m] (default inf: no limits).

    Raises:
        ValueError: for both a joint and a body or neither, a servo without its gain, or a value out of range.
    """

    joint: str | None = None
    dof: int = 0
    body: str | None = None
    force: ArrayLike = (0.0, 0.0, 0.0)
    torque: ArrayLike = (0.0, 0.0, 0.0)
    frame: str = "world"
    name: str = ""
    limits: tuple[float, float] = (-np.inf, np.inf)
    speed: float = np.inf
    servo: str | None = None
    stiffness: float = 0.0
    damping: float = 0.0
    force_limits: tuple[float, float] = (-np.inf, np.inf)

    def __post_init__(self) -> None:
        if (self.joint is None) == (self.body is None):
            raise ValueError("Input(...): give either a joint or body=...")
        call = f"Input({(self.name or self.joint or self.body)!r}"
        for field in ("force", "torque"):
            object.__setattr__(self, field, checks.vector(f"{call}, {field}=...)", getattr(self, field), 3))
        checks.one_of(f"{call}, frame=...)", self.frame, ("world", "body"))
        wrench = np.array([self.force, self.torque], dtype=np.float64)
        if self.body is not None and not wrench.any():
            raise ValueError(f"{call}): give a force=... or a torque=... per unit of the input")
        if self.joint is not None and wrench.any():
            raise ValueError(f"{call}): force and torque are for an input on a body")
        object.__setattr__(self, "limits", bounds(f"{call}, limits=...)", self.limits))
        if not (isinstance(self.speed, int | float) and self.speed > 0.0):
            raise ValueError(f"{call}, speed=...): expected a number > 0, got {self.speed!r}")
        check_servo(call, self)

    @property
    def gain(self) -> float:
        """Force or torque on the joint per unit of u: 1, or kp or kd of a servo."""
        return {None: 1.0, "position": self.stiffness, "velocity": self.damping}[self.servo]


# -- checks of arguments, per part -------------------------------------------------------------------------------------


def check_servo(call: str, part: Input) -> None:
    """Gains of servos on joints, and of nothing else."""
    for field in ("stiffness", "damping"):
        value = checks.number(f"{call}, {field}=...)", getattr(part, field), at_least=0.0)
        object.__setattr__(part, field, value)
    limits = bounds(f"{call}, force_limits=...)", part.force_limits)
    object.__setattr__(part, "force_limits", limits)
    if np.isfinite(limits[0]) != np.isfinite(limits[1]):
        raise ValueError(f"{call}, force_limits=...): expected two finite numbers, got {part.force_limits!r}")
    if part.servo is None:
        if np.isfinite(limits[0]):
            raise ValueError(f"{call}, force_limits=...): for servos only; use limits=... for a force")
        if part.stiffness or part.damping:
            raise ValueError(f'{call}): stiffness and damping are for servos; add servo="position"')
        return
    checks.one_of(f"{call}, servo=...)", part.servo, ("position", "velocity"))
    if part.joint is None:
        raise ValueError(f"{call}, servo=...): a servo drives a joint")
    if part.servo == "velocity" and part.stiffness:
        raise ValueError(f"{call}, stiffness=...): a velocity servo has none; give its damping=...")
    if part.gain == 0.0:
        missing = "stiffness" if part.servo == "position" else "damping"
        raise ValueError(f"{call}, servo={part.servo!r}): expected {missing}=... above 0")


def shape_of(call: str, given: Any) -> Any:
    """One shape, a tuple of several, or None; shapes of a body that have names have different ones."""
    if given is None or isinstance(given, Solid):
        return given
    found = tuple(given) if isinstance(given, Iterable) else (given,)
    for shape in found:
        if not isinstance(shape, Solid):
            raise ValueError(f"{call}: expected a shape, as Sphere(0.1), or several, got {given!r}")
    checks.distinct(f"{call}: shapes", (shape.name for shape in found if shape.name))
    return found if len(found) > 1 else found[0] if found else None


def inertia_of(call: str, body: Body) -> tuple[tuple[float, ...], ...]:
    """The inertia as rows, after the tests that every rigid body passes."""
    if body.mass == 0.0:
        return ((0.0, 0.0, 0.0),) * 3
    if body.inertia is None:
        matrix = inertia_of_shapes(call, body)
    else:
        flat = checks.ndim(f"{call}, inertia=...)", body.inertia) == 1
        matrix = checks.array(f"{call}, inertia=...)", body.inertia, (3,) if flat else (3, 3))
        matrix = np.diag(matrix) if matrix.ndim == 1 else matrix
    if np.abs(matrix - matrix.T).max() > 1e-9 * np.abs(matrix).max():
        raise ValueError(f"{call}, inertia=...): expected a symmetric matrix, got {matrix.tolist()}")
    matrix = 0.5 * (matrix + matrix.T)
    a, b, c = np.linalg.eigvalsh(matrix)
    if a <= 0.0:
        raise ValueError(f"{call}, inertia=...): not positive definite, its principal moments are {a:g}, {b:g}, {c:g}")
    if c > (a + b) * (1 + 1e-6):
        raise ValueError(
            f"{call}, inertia=...): no rigid body has principal moments {a:g}, {b:g}, {c:g}: "
            "the largest exceeds the sum of the others"
        )
    return tuple(tuple(float(x) for x in row) for row in matrix)


def inertia_of_shapes(call: str, body: Body) -> NDArray[np.float64]:
    """The inertia of one shape at the centre of mass, or of several that have theirs there."""
    if not body.shapes:
        raise ValueError(f"{call}): give inertia=..., or shape=... to compute it from")
    if len(body.shapes) == 1:
        if np.any(np.asarray(body.shapes[0].center)):
            raise ValueError(f"{call}): give inertia=...; the shape is not centred at the centre of mass")
        return body.shapes[0].inertia(body.mass)
    centre, matrix = composite(body.shapes, body.mass)
    size = max(float(np.linalg.norm(shape.center)) + shape.bounding_radius() for shape in body.shapes)
    if not np.abs(centre).max() <= 1e-9 * size:
        at = np.round(centre, 9).tolist()
        raise ValueError(
            f"{call}): the centre of mass of its shapes is at {at}; a body has its origin there: move the centers of "
            "the shapes by the negative of that, or give inertia=..."
        )
    return matrix


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
        lo, hi = bounds(call, free if pair is None else pair)
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


def bounds(call: str, pair: Any) -> tuple[float, float]:
    """(lo, hi) with lo < hi; None stands for no bound."""
    try:
        lo, hi = (float(x) if x is not None else s * np.inf for x, s in zip(pair, (-1, 1), strict=True))
    except (TypeError, ValueError):
        raise ValueError(f"{call}: expected a pair (lo, hi), got {pair!r}") from None
    if not lo < hi or lo == np.inf or hi == -np.inf:
        raise ValueError(f"{call}: expected lo < hi, got ({lo:g}, {hi:g})")
    return lo, hi
