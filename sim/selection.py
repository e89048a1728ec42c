"""Selection of parameters by name, and the mechanism with other values of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim import checks
from sim.closing import parts_of
from sim.effects import Effect
from sim.mechanism import Mechanism
from sim.parameters import KINDS, Parameter, Parameters, Plan, all_parameters
from sim.polytope import Polytope
from sim.terrain_heights import terrains
from sim.touch_parameters import shape_of

Floats = NDArray[np.float64]
COMMON = "*"
Entries = Mapping[str, float]  # by component, "" of a single number


def chosen(call: str, known: Sequence[Parameter], name: str) -> list[Parameter]:
    """The parameters that a name stands for; `kind:*` is one for all parts, of the mean of their values."""
    kind = name.split(":")[0].split("[")[0] if isinstance(name, str) else name
    checks.one_of(f"{call}: parameter", kind, KINDS)
    of_kind = [p for p in known if p.kind == kind]
    if name.startswith(f"{kind}:{COMMON}"):
        found = [p for p in _common(of_kind) if name in (f"{kind}:{COMMON}", p.name)]
    else:
        found = [p for p in of_kind if name in (kind, f"{kind}:{p.part}", p.name)]
    if not found:
        parts = ", ".join(dict.fromkeys(f"{p.kind}:{p.part}" if p.part else p.name for p in of_kind))
        raise ValueError(f"{call}: no parameter {name!r}; of this kind there are: {parts or 'none'}")
    return found


def _common(parameters: Sequence[Parameter]) -> list[Parameter]:
    """One parameter per component, for all parts that have it."""
    found = []
    for component in dict.fromkeys(p.component for p in parameters):
        same = [p for p in parameters if p.component == component]
        value = float(np.mean([p.value for p in same]))
        terms = tuple(term for p in same for term in p.terms)
        found.append(Parameter(same[0].kind, COMMON, component, value, terms))
    return found


def select(call: str, known: Sequence[Parameter], names: Sequence[str]) -> tuple[Parameters, Plan]:
    """The parameters of the names, in their order, and the terms of their columns."""
    found: list[Parameter] = []
    rows: dict[str, slice] = {}
    for name in (names,) if isinstance(names, str) else names:
        some = chosen(call, known, name)
        rows[name] = slice(len(found), len(found) + len(some))
        found += some
    terms = [(int(e), i, k, column) for column, p in enumerate(found) for e, i, k, _ in p.terms]
    table = np.array(terms, dtype=np.int64).reshape(-1, 4)
    weights = np.array([term[3] for p in found for term in p.terms], dtype=np.float64)
    of_terrain = table[:, 0] == Effect.TERRAIN
    heights = np.ascontiguousarray(table[of_terrain][:, [1, 3]])
    plan = Plan(table[~of_terrain], weights[~of_terrain], len(found), heights, weights[of_terrain])
    values = np.array([p.value for p in found])
    values.flags.writeable = False  # kept by the simulator
    return Parameters(tuple(p.name for p in found), values, rows), plan


def with_values(
    call: str, mech: Mechanism, time_step: float, values: Mapping[str, ArrayLike]
) -> tuple[Mechanism, float]:
    """The mechanism and the time step with other values of the named parameters."""
    known = all_parameters(mech, time_step)
    by_place = {(p.kind, p.part, p.component): p for p in known}
    changes: dict[tuple[str, str, str], float] = {}
    for name, given in values.items():
        found = chosen(call, known, name)
        numbers = np.atleast_1d(checks.array(f"{call}: {name!r}", np.atleast_1d(given), (len(found),)))
        for p, value in zip(found, numbers, strict=True):
            if p.part != COMMON:
                changes[p.kind, p.part, p.component] = float(value)
                continue
            for place, q in by_place.items():
                if q.kind == p.kind and q.component == p.component:
                    changes[place] = q.value + float(value) - p.value
    together: dict[tuple[str, str], dict[str, float]] = {}
    for (kind, part, component), value in changes.items():
        together.setdefault((kind, part), {})[component] = value
    draft = _Draft(mech)
    # the centre of mass last: it moves the points that the others put in their places
    for (kind, part), entries in sorted(together.items(), key=lambda item: item[0][0] == "com"):
        if kind == "time_step":
            time_step = entries[""]
        else:
            draft.change(kind, part, entries)
    return draft.finish(), time_step


class _Draft:
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

    def change(self, kind: str, part: str, entries: Entries) -> None:
        """Give one number, or some components of a vector, their values."""
        if kind == "gravity":
            self.gravity = _entries(self.gravity, entries)
        elif kind == "com":
            for name in parts_of(self.mech.loops, part):
                self._move_centre(name, _entries(np.zeros(3), entries))
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
        elif kind in ("friction", "restitution") or kind.startswith("contact_"):
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

    def _move_centre(self, name: str, d: Floats) -> None:
        """The centre of mass moves by d, body axes; what is on the body stays where it is."""
        body = self.bodies[name]
        if body.shape is not None:
            self.bodies[name] = replace(body, shape=_moved(body.shape, -d))
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

    def _change_shape(self, name: str, kind: str, entries: Entries) -> None:
        """The shape of a collision sits elsewhere in its body, or has another size; other collisions keep theirs."""
        what, letter = kind.split("_")
        shape: Any = shape_of(self.mech, self.collisions[name], letter)
        if what == "shape":
            changed: Any = replace(shape, center=_entries(shape.center, entries))
        elif isinstance(shape, Polytope):
            changed = replace(shape, vertices=entries["scale"] * np.asarray(shape.vertices))
        else:
            changed = replace(shape, **entries)
        self.collisions[name] = replace(self.collisions[name], **{f"shape_{letter}": changed})

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
        return replace(
            mech,
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


def _turned(quat: Floats, turn: Floats) -> Floats:
    """quat exp(turn)"""
    angle = float(np.linalg.norm(turn))
    w, v = np.cos(0.5 * angle), 0.5 * np.sinc(0.5 * angle / np.pi) * turn
    scalar = quat[0] * w - quat[1:] @ v
    return np.concatenate([[scalar], quat[0] * v + w * quat[1:] + np.cross(quat[1:], v)])
