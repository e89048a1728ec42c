"""UrdfReport: supported and unsupported elements of a loaded file; UrdfMechanism carries it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from sim.mechanism.mechanism import Mechanism
from sim.mechanism.short_repr import short_repr
from solvers.types import Floats


class UrdfWarning(UserWarning):
    """The motion of the mechanism differs from that of the robot in the file."""


@dataclass(frozen=True)
class Note:
    """One difference between the mechanism and its file.

    Attributes:
        text: the difference.
        names: links or joints concerned.
        warn: whether `load_urdf` also issues a UrdfWarning.
    """

    text: str
    names: tuple[str, ...]
    warn: bool = False

    def __str__(self) -> str:
        shown = ", ".join(self.names[:6]) + (f" and {len(self.names) - 6} more" if len(self.names) > 6 else "")
        return f"{self.text}: {shown}" if shown else self.text


@dataclass(frozen=True)
class LinkFrame:
    """The pose of the frame of a link.

    Attributes:
        body: name of the body that the link is part of; None for the world.
        point: (3,) origin of the link, from the centre of mass of the body, body axes [m].
        orientation: (4,) unit quaternion (w, x, y, z) from the link to the body.
    """

    body: str | None
    point: tuple[float, ...]
    orientation: tuple[float, ...]


@dataclass(frozen=True)
class UrdfReport:
    """The translation of a URDF file. `str(report)` is a page of text.

    Attributes:
        file: name of the file.
        notes: unsupported elements, and other differences.
        links: pose of every link of the file.
        effort: (nu,) largest force or torque of every input, infinite if the file has none; control limits are
            (-effort, effort) [N, N m].
        velocity: (nu,) largest speed of every input's joint; nothing enforces it [m/s, rad/s].
    """

    file: str
    notes: tuple[Note, ...]
    links: dict[str, LinkFrame]
    effort: Floats
    velocity: Floats

    __repr__ = short_repr

    def __str__(self) -> str:
        merged = len(self.links) - len({f.body for f in self.links.values()})
        lines = [f"{self.file}: {len(self.links)} links, {merged} of them part of another body or of the world"]
        return "\n".join([*lines, *(f"  {note}" for note in self.notes)])


@dataclass(frozen=True, repr=False)
class UrdfMechanism(Mechanism):
    """A Mechanism that `load_urdf` made; `report` describes the translation of the file.

    Read: inertias, joint limits and damping (revolute, continuous, prismatic, planar, floating, fixed; spherical as in
    PyBullet; planaraxis, planarfree, cylindrical, cylindricalfree, fixedorientation, orbital as in Dojo; and every kind
    of Joint by its own name, but for "planar", which turns in URDF and whose kind without is "planarfixed"), and
    <loop_joint>, a joint that closes a loop, as Dojo and Isaac Sim write it (loops.py). A body's frame has the axes of
    its first link and its origin at the centre of mass.

    Attributes:
        report: `links` has the pose of every link in its body, `effort` and `velocity` the bounds of the inputs and
            their joints, `notes` unsupported elements (meshes, mimics).
    """

    report: UrdfReport | None = field(default=None, compare=False, repr=False)


class Notes:
    """Notes on the way, gathered by text."""

    def __init__(self) -> None:
        self._names: dict[str, list[str]] = {}
        self._warn: set[str] = set()

    def add(self, text: str, names: Iterable[str] = (), *, warn: bool = False) -> None:
        """Note something about some links or joints."""
        self._names.setdefault(text, []).extend(names)
        if warn:
            self._warn.add(text)

    def close(self) -> tuple[Note, ...]:
        """All of them, those with a warning first."""
        notes = [Note(text, tuple(names), text in self._warn) for text, names in self._names.items()]
        return tuple(sorted(notes, key=lambda note: not note.warn))
