"""Draft: a mechanism whose parts are being given other values of their parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from sim.derivatives.parameters.contact_parameters import shape_of
from sim.derivatives.parameters.terrain_parameters import terrains
from sim.mechanism.loop_joints import parts_of
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.polytope import Polytope
from sim.mechanism.pose import quat_product
from sim.mechanism.shapes import SURFACE_FIELDS, String
from solvers.types import Floats

Entries = Mapping[str, float]  # by component, "" of a single number


class Draft:
    """A mechanism whose parts are being changed."""

    def __init__(self, mech: Mechanism) -> None:
        self.mech = mech
        self.bodies = {b.name: b for b in mech.bodies}
        self.joints = {j.name: j for j in (*mech.joints, *mech.loops)}
        self.contacts = {c.name: c for c in mech.contacts}
        self.collisions = {c.name: c for c in mech.collisions}
        self.gears = {g.name: g for g in mech.gears}
        self.inputs = {i.name: i for i in mech.inputs or ()}
        self.gravity = np.array(mech.gravity, dtype=np.float64)
        self.report: Any = getattr(mech, "report", None)  # of the file, with frames of its parts

    def change(self, kind: str, part: str, entries: Entries) -> None:
        """Give one number, or some components of a vector, their values."""
        if kind == "gravity":
            self.gravity = _entries(self.gravity, entries)
        elif kind == "com":
            for name in parts_of(self.mech.loops, part):
                self._move_center(name, _entries(np.zeros(3), entries))
        elif kind in ("mass", "inertia"):
            self._change_body(kind, part, entries)
        elif kind in ("shape_a", "shape_b", "size_a", "size_b"):
            self._change_shape(part, kind, entries)
        elif kind == "terrain":
            self._raise_terrain(part, entries)
        elif kind.startswith(("gear_", "input_")):
            owner, field = kind.split("_")
            owners: dict[str, Any] = self.gears if owner == "gear" else self.inputs
            owners[part] = replace(owners[part], **{field: _entries(getattr(owners[part], field), entries)})
        elif kind in SURFACE_FIELDS or kind.startswith("contact_"):
            field = kind.removeprefix("contact_")
            parts: dict[str, Any] = self.contacts if part in self.contacts else self.collisions
            parts[part] = replace(parts[part], **{field: _entries(getattr(parts[part], field), entries)})
        else:
            self._change_joint(kind, part, entries)

    def _change_body(self, kind: str, name: str, entries: Entries) -> None:
        parts = parts_of(self.mech.loops, name)
        for part in parts:
            body = self.bodies[part]
            if kind == "mass":
                self.bodies[part] = replace(body, mass=entries[""] / len(parts))
                continue
            J = np.array(body.inertia)
            for label, value in entries.items():
                a, b = ("xyz".index(letter) for letter in label)
                J[a, b] = J[b, a] = value / len(parts)
            self.bodies[part] = replace(body, inertia=J)

    def _change_joint(self, kind: str, name: str, entries: Entries) -> None:
        joint = self.joints[name]
        if kind in ("lower", "upper"):
            limits = [list(pair) for pair in joint.limits or ()]
            for component, value in entries.items():
                limits[int(component or 0)][kind == "upper"] = value
            changed = replace(joint, limits=limits)
        elif kind == "orientation":
            changed = replace(joint, orientation=_turned(np.asarray(joint.orientation), _entries(np.zeros(3), entries)))
        elif kind == "spring" and joint.nrot == 3:
            springs = _entries(joint.spring, entries)
            springs[joint.ntrans :] = springs[joint.ntrans]
            changed = replace(joint, spring=springs)
        else:
            changed = replace(joint, **{kind: _entries(getattr(joint, kind), entries)})
        self.joints[name] = changed

    def _move_center(self, name: str, d: Floats) -> None:
        """The centre of mass moves by d, body axes; elements of the body stay in place."""
        body = self.bodies[name]
        if body.shapes or body.visuals:
            seen = [_moved(v, -d) if v.shape is None else replace(v, shape=_moved(v.shape, -d)) for v in body.visuals]
            self.bodies[name] = replace(body, shape=[_moved(shape, -d) for shape in body.shapes], visuals=seen)
        for label, joint in self.joints.items():
            for side, field in ((joint.parent, "parent_point"), (joint.child, "child_point")):
                if side == name:
                    self.joints[label] = _moved(self.joints[label], -d, field)
        for label, contact in self.contacts.items():
            if contact.body == name:
                self.contacts[label] = _moved(contact, -d, "point")
        for label, collision in self.collisions.items():
            for side, field in ((collision.a, "shape_a"), (collision.b, "shape_b")):
                shape = getattr(collision, field)
                if side == name and shape is not None:
                    self.collisions[label] = replace(self.collisions[label], **{field: _moved(shape, -d)})
        if self.report is not None:
            self.report = _with_moved_frames(self.report, name, -d)

    def _change_shape(self, name: str, kind: str, entries: Entries) -> None:
        """The shape of a collision sits elsewhere in its body, or has another size; other collisions keep theirs."""
        part, letter = kind.split("_")
        shape: Any = shape_of(self.mech, self.collisions[name], letter)
        if part == "shape":
            changed: Any = replace(shape, center=_entries(shape.center, entries))
        elif isinstance(shape, Polytope):
            changed = replace(shape, vertices=entries["scale"] * np.asarray(shape.vertices))
        else:
            changed = replace(shape, **entries)
        fields = {f"shape_{letter}": changed}
        if part == "size" and isinstance(shape, String):  # one length, written on both ends
            fields = {f: replace(getattr(self.collisions[name], f), **entries) for f in ("shape_a", "shape_b")}
        self.collisions[name] = replace(self.collisions[name], **fields)

    def _raise_terrain(self, name: str, entries: Entries) -> None:
        """The ground has other heights, for all contacts that stand on it."""
        terrain = terrains(self.mech)[name]
        heights = np.array(terrain.heights)
        for component, value in entries.items():
            i, _, j = component.partition(",")
            heights[int(i), int(j or 0)] = value
        raised = replace(terrain, heights=heights)
        for label, contact in self.contacts.items():
            if contact.terrain is terrain:
                self.contacts[label] = replace(contact, terrain=raised)

    def finish(self) -> Mechanism:
        """The changed mechanism."""
        mech = self.mech
        report = {} if self.report is None else {"report": self.report}
        return replace(
            mech,
            **report,
            bodies=tuple(self.bodies.values()),
            joints=tuple(self.joints[j.name] for j in mech.joints),
            loops=tuple(self.joints[j.name] for j in mech.loops),
            contacts=tuple(self.contacts.values()),
            collisions=tuple(self.collisions.values()),
            gears=tuple(self.gears.values()),
            inputs=tuple(self.inputs.values()),
            gravity=self.gravity,
        )


def _entries(values: Any, entries: Entries) -> Any:
    """The number, or the vector with some of its components, replaced."""
    if np.ndim(values) == 0:
        return entries[""]
    out = np.array(values, dtype=np.float64)
    for component, value in entries.items():
        out[int(component or 0)] = value
    return out


def _moved(part: Any, d: Floats, field: str = "center") -> Any:
    """The part with its point moved by d."""
    return replace(part, **{field: np.asarray(getattr(part, field)) + d})


def _with_moved_frames(report: Any, body: str, d: Floats) -> Any:
    """The report of a URDF or MJCF file with the frames on a body moved by d."""
    field = "links" if hasattr(report, "links") else "bodies"
    frames = dict(getattr(report, field))
    for name, at in frames.items():
        if at.body == body:
            frames[name] = replace(at, point=tuple((np.asarray(at.point) + d).tolist()))
    return replace(report, **{field: frames})


def _turned(quat: Floats, turn: Floats) -> Floats:
    """quat exp(turn)"""
    angle = float(np.linalg.norm(turn))
    return quat_product(quat, (np.cos(0.5 * angle), *(0.5 * np.sinc(0.5 * angle / np.pi) * turn)))
