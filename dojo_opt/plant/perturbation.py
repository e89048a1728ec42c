"""Perturbation: the differences between a plant and the model that MPC plans with."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.mechanism import checks
from sim.mechanism.checks import whole_number
from sim.mechanism.input import Input
from sim.mechanism.joint import WORLD, require_floating_base
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.moved_scene import moved_coordinates, moved_obstacle, moved_visual, turned_velocities
from sim.mechanism.shapes import rotation_matrix
from sim.mechanism.short_repr import short_repr
from sim.mechanism.terrain import Terrain
from sim.simulator.contact_settings import with_contacts
from solvers.types import Vector

_TOGETHER = [  # fields that say one thing
    ("payload", "payload_body", "payload_inertia"),
    ("slope", "slope_heading", "ground_height", "terrain"),
]

__all__ = ["Perturbation", "Push"]


@dataclass(frozen=True)
class Push:
    """A constant force at the centre of mass of a body for a short time.

    Attributes:
        time: begin of the push [s].
        impulse: (3,) force times duration, world axes [N s].
        body: name of the body (default None: the first one).
        duration: length of the push [s] (default 0.02).
    """

    time: float
    impulse: ArrayLike
    body: str | None = None
    duration: float = 0.02

    def __post_init__(self) -> None:
        object.__setattr__(self, "time", checks.number("Push(time=...)", self.time, at_least=0.0))
        object.__setattr__(self, "impulse", checks.vector("Push(impulse=...)", self.impulse, 3))
        if self.body is not None:
            checks.name("Push(body=...)", self.body)
        object.__setattr__(self, "duration", checks.number("Push(duration=...)", self.duration, above=0.0))


@dataclass(frozen=True)
class Perturbation:
    """Differences between a plant and the model that MPC plans with. The fields are independent; by default there are
    no differences.

    Attributes:
        offset: (ndx,) change of the initial state [m, rad, m/s, rad/s] (default (): none); loops and gears are closed
            after it.
        pushes: one `Push`, or several (default (): none).
        payload: mass added to `payload_body` at its centre of mass [kg] (default 0).
        payload_body: name of that body (default None: the first one).
        payload_inertia: added to the inertia of that body: a number, or (3,) principal moments [kg m^2] (default 0).
        friction: coefficient of friction of all contacts (default None: that of the model).
        damping: factor of the dampers of all joints (default 1).
        slope: angle of the ground, and of the obstacles that stand on it [rad] (default 0).
        slope_heading: direction in which the ground rises, from x to y [rad] (default 0).
        ground_height: height of the ground [m] (default 0).
        terrain: ground under all contacts (default None: that of the model).
        delay: time from a command to the moment it acts [s] (default 0).
        noise: standard deviation of the measured state: a number, or (ndx,) [m, rad, m/s, rad/s] (default 0).
        control_limits: (lower, upper) limits of the actuators, numbers or (nu,) [N, N m] (default None: those of the
            inputs of the mechanism).
        seed: seed of the noise (default 0).
    """

    offset: ArrayLike = ()
    pushes: Sequence[Push] = ()
    payload: float = 0.0
    payload_body: str | None = None
    payload_inertia: ArrayLike = 0.0
    friction: float | None = None
    damping: float = 1.0
    slope: float = 0.0
    slope_heading: float = 0.0
    ground_height: float = 0.0
    terrain: Terrain | None = None
    delay: float = 0.0
    noise: ArrayLike = 0.0
    control_limits: tuple[ArrayLike, ArrayLike] | None = None
    seed: int = 0

    __repr__ = short_repr

    def __post_init__(self) -> None:
        call = "Perturbation"
        for name in ("payload", "damping", "delay"):
            checks.number(f"{call}({name}=...)", getattr(self, name), at_least=0.0)
        for name in ("slope_heading", "ground_height"):
            checks.number(f"{call}({name}=...)", getattr(self, name))
        for name in ("noise", "payload_inertia"):
            if np.any(_array(f"{call}({name}=...)", getattr(self, name)) < 0.0):
                raise ValueError(f"{call}({name}=...): expected numbers >= 0, got {getattr(self, name)!r}")
        if (shape := np.shape(self.payload_inertia)) not in ((), (1,), (3,)):
            raise ValueError(f"{call}(payload_inertia=...): expected a number, or three, got shape {shape}")
        _array(f"{call}(offset=...)", self.offset)
        if self.control_limits is not None:
            _check_limits(f"{call}(control_limits=...)", self.control_limits)
        whole_number(f"{call}(seed=...)", self.seed, 0)
        if self.friction is not None:
            checks.number(f"{call}(friction=...)", self.friction, at_least=0.0)
        if not abs(checks.number(f"{call}(slope=...)", self.slope)) < 0.5 * np.pi:
            raise ValueError(f"{call}(slope=...): expected less than a right angle, got {self.slope:g} rad")
        if self.terrain is not None and not isinstance(self.terrain, Terrain):
            raise TypeError(f"{call}(terrain=...): expected a Terrain, got {self.terrain!r}")
        if self.terrain is not None and (self.slope or self.ground_height):
            raise ValueError(f"{call}(terrain=...): give either a terrain, or a slope and a ground_height")
        if self.payload_body is not None:
            checks.name(f"{call}(payload_body=...)", self.payload_body)
        given = (self.pushes,) if isinstance(self.pushes, Push) else self.pushes
        pushes = checks.items(f"{call}(pushes=...)", given, Push)
        object.__setattr__(self, "pushes", pushes)

    def over(self, other: Perturbation) -> Perturbation:
        """This perturbation of a plant that is perturbed already.

        What this one leaves at its default is that of the other. Payload with its body and inertia, and the ground with
        its slope, heading, height and terrain, are taken as a whole. The seed is that of this one.

        Args:
            other: the perturbation of the plant.

        Returns:
            Both together.
        """
        given = {f.name for f in fields(self) if _differs(getattr(self, f.name), f.default)}
        alone = {f.name for f in fields(self)}.difference(*_TOGETHER, ["seed"])
        kept = [group for group in (*_TOGETHER, *((name,) for name in alone)) if given.isdisjoint(group)]
        return replace(self, **{name: getattr(other, name) for group in kept for name in group})

    @property
    def normal(self) -> Vector:
        """(3,) outward normal of the ground."""
        sine = np.sin(self.slope)
        level = np.array([np.cos(self.slope_heading), np.sin(self.slope_heading), 0.0])
        return np.cos(self.slope) * np.array([0.0, 0.0, 1.0]) - sine * level

    def pushed(self, mechanism: Mechanism) -> tuple[str, ...]:
        """Names of the bodies that are pushed.

        Args:
            mechanism: mechanism of the plant.

        Returns:
            The names, each once, in the order of the pushes.

        Raises:
            ValueError: the mechanism has no body of that name.
        """
        names = (
            checks.one_of("Push(body=...)", p.body or mechanism.body_names[0], mechanism.body_names)
            for p in self.pushes
        )
        return tuple(dict.fromkeys(names))

    def mechanism(self, mechanism: Mechanism) -> Mechanism:
        """The mechanism of the plant.

        Args:
            mechanism: mechanism of the model.

        Returns:
            The perturbed mechanism. It has three more inputs for every body that is pushed, forces along x, y, z.

        Raises:
            ValueError: the mechanism has no body of that name, or a slope meets terrain.
        """
        bodies = list(mechanism.bodies)
        name = self.payload_body or bodies[0].name
        checks.one_of("Perturbation(payload_body=...)", name, mechanism.body_names)
        if self.payload > 0.0 or np.any(self.payload_inertia):
            i = mechanism.body_names.index(name)
            added = np.diag(np.broadcast_to(np.asarray(self.payload_inertia, dtype=float), (3,)))
            inertia = np.asarray(bodies[i].inertia) + added
            bodies[i] = replace(bodies[i], mass=bodies[i].mass + self.payload, inertia=inertia)
        joints = [replace(j, damper=self.damping * np.asarray(j.damper)) for j in mechanism.joints]
        contacts: Any = mechanism.contacts
        if self.slope and any(c.terrain is not None for c in contacts):
            raise ValueError("Perturbation(slope=...): expected contacts with half-spaces, got contacts on terrain")
        collisions, scenery = mechanism.collisions, mechanism.scenery
        if self.slope or self.ground_height:
            point, quat = self._place
            turn = rotation_matrix(quat)
            turn[:, 2] = self.normal  # to the last bit, for ground that is turned in place
            turned = [turn @ np.asarray(c.normal) for c in contacts]
            contacts = [
                replace(c, normal=n, height=c.height + float(n @ point)) for c, n in zip(contacts, turned, strict=True)
            ]
            collisions = [moved_obstacle(c, point, quat) for c in collisions]
            scenery = [moved_visual(v, point, quat) for v in scenery]
        inputs = list(mechanism.inputs or ())
        for name in self.pushed(mechanism):
            for axis, force in zip("xyz", np.eye(3), strict=True):
                inputs.append(Input(body=name, force=force, name=f"push {name} {axis}"))
        parts: dict[str, Any] = {"bodies": bodies, "joints": joints, "contacts": contacts, "inputs": inputs}
        changed = replace(mechanism, **parts, collisions=collisions, scenery=scenery)
        changed = changed if self.terrain is None else changed.with_terrain(self.terrain)
        return changed if self.friction is None else with_contacts(changed, "friction", self.friction)

    def push_forces(self, mechanism: Mechanism, begin: float, end: float) -> Vector:
        """Mean forces of the pushes over an interval, for the inputs that `mechanism` adds.

        Args:
            mechanism: mechanism of the model.
            begin: begin of the interval [s].
            end: end of the interval [s].

        Returns:
            (3 pushed bodies,) forces along x, y, z of one body after the other [N].

        Raises:
            ValueError: the mechanism has no body of that name.
        """
        names = self.pushed(mechanism)
        out = np.zeros((len(names), 3))
        for push in self.pushes:
            overlap = min(end, push.time + push.duration) - max(begin, push.time)
            if overlap > 0.0:
                share = overlap / (push.duration * (end - begin))
                out[names.index(push.body or mechanism.body_names[0])] += share * np.asarray(push.impulse)
        return out.ravel()

    def on_ground(self, mechanism: Mechanism, x: Vector) -> Vector:
        """The state of a robot on level ground, moved and turned with the ground: the same feet touch it.

        Args:
            mechanism: mechanism of the robot, and of objects around it.
            x: (nx,) state on level ground.

        Returns:
            (nx,) state; x itself on level ground at height zero.

        Raises:
            ValueError: the ground is moved, and a body hangs on the world by a joint that is not floating.
        """
        changed = [name for name in ("slope", "ground_height", "terrain") if getattr(self, name)]
        for joint in (*mechanism.joints, *mechanism.loops):
            if changed and joint.parent == WORLD:
                require_floating_base(f"Perturbation({changed[0]}=...)", joint)
        if not (self.slope or self.ground_height):
            return x
        point, quat = self._place
        q, v = x[: mechanism.nq], x[mechanism.nq :]
        moved = moved_coordinates(mechanism.joints, q, point, quat)
        return np.concatenate([moved, turned_velocities(mechanism.joints, v, quat)])

    @property
    def _place(self) -> tuple[Vector, Vector]:
        """Where the ground is: (3,) point [m] that was the origin, (4,) quaternion that turns level ground."""
        half = 0.5 * self.slope
        axis = np.array([np.sin(self.slope_heading), -np.cos(self.slope_heading), 0.0])
        return self.ground_height * self.normal, np.concatenate([[np.cos(half)], np.sin(half) * axis])


def _differs(value: Any, default: Any) -> bool:
    """Whether the value of a field is not its default, or its default written out."""
    if default is None:
        return value is not None
    return bool(np.any(np.asarray(value, dtype=object)) if default == () else np.any(np.asarray(value) != default))


def _array(call: str, value: ArrayLike) -> NDArray[np.float64]:
    """A finite array of whatever shape."""
    return checks.array(call, value, (None,) * checks.ndim(call, value))


def _check_limits(call: str, limits: Any) -> None:
    """Refuse anything but (lower, upper) with lower <= upper; infinity is allowed."""
    try:
        if isinstance(limits, Set):
            raise TypeError
        lo, hi = (checks.floats(call, b) for b in limits)
    except (TypeError, ValueError):
        raise ValueError(f"{call}: expected (lower, upper), got {limits!r}") from None
    if not np.all(lo <= hi):
        raise ValueError(f"{call}: expected lower <= upper, got {limits!r}")
