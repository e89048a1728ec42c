"""MjcfReport: supported and unsupported elements of a loaded MJCF file; MjcfMechanism carries it."""

from __future__ import annotations

from dataclasses import dataclass, field

from sim.io.urdf.report import LinkFrame, Note
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.short_repr import short_repr
from solvers.types import Floats


class MjcfWarning(UserWarning):
    """The motion of the mechanism differs from that of the model in the file."""


@dataclass(frozen=True)
class MjcfReport:
    """The translation of an MJCF file. `str(report)` is a page of text.

    Attributes:
        file: name of the file.
        notes: unsupported elements, and other differences.
        bodies: pose of the frame of every body of the file.
        joints: for every joint of the file, the joint of the mechanism with its coordinates, and the number of the
            first one.
        gear: (nu,) force or torque of every input, or target of a servo, per unit of MuJoCo's control, u = gear * ctrl.
        low: (nu,) lower bounds of u from the control and force ranges of the actuators, infinite without any [N, N m].
        high: (nu,) upper bounds likewise [N, N m].
    """

    file: str
    notes: tuple[Note, ...]
    bodies: dict[str, LinkFrame]
    joints: dict[str, tuple[str, int]]
    gear: Floats
    low: Floats
    high: Floats

    __repr__ = short_repr

    def __str__(self) -> str:
        lines = [f"{self.file}: {len(self.bodies)} bodies, {len(self.joints)} joints, {len(self.gear)} actuators"]
        return "\n".join([*lines, *(f"  {note}" for note in self.notes)])


@dataclass(frozen=True, repr=False)
class MjcfMechanism(Mechanism):
    """A Mechanism that `load_mjcf` made; `report` describes the translation of the file.

    The coordinates q and velocities v are MuJoCo's qpos and qvel. Represented: bodies (welded ones as one), free, ball,
    slide and hinge joints with damping, armature (an inertia of its coordinate alone: exact; not on balls), springs and
    ranges within their margins (not on balls); spheres, capsules, boxes, cylinders, ellipsoids against planes that do
    not move, and with `collisions=True` against one another and fixed geoms, with their margins if one of them is round
    or a plane; actuators on hinges and slides as inputs in N and N m, or as servos with targets in units of the joint,
    u = report.gear * ctrl, with their armature and damping, and on sites as wrenches that move with the body; connect
    and weld as joints that close loops, and linear couplings of two joints as gears, all of them rigid (equalities.py).

    Not represented, and listed in `report.notes`: other equality constraints, tendons, flexes, fluids, meshes, height
    fields, plugins, actuators with dynamics, delays or several controls, torsional and rolling friction, adhesion,
    moving surfaces, bouncing contacts, springs that are not linear or yield; see sim/io/mjcf/omitted.py.

    Attributes:
        report: poses of the bodies, coordinates of the joints, gears and bounds of the inputs, unsupported elements.
    """

    report: MjcfReport | None = field(default=None, compare=False, repr=False)
