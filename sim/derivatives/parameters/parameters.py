"""Parameters of a mechanism by name: their meaning, their values, and their effects on a step.

    kind:part[component]     mass:trunk   com:trunk[0]   spring:knee   friction:foot   gravity[2]   time_step

A name without a component stands for all of them, one without a part for all parts, in this order. `kind:*` is one
parameter that adds the same to all parts: the height of the ground is `contact_height:*`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sim.derivatives.parameters.contact_parameters import collision_parameters, contact_parameters
from sim.derivatives.parameters.directions import Effect
from sim.derivatives.parameters.parameter import KINDS, Parameter
from sim.derivatives.parameters.terrain_parameters import terrain_parameters
from sim.derivatives.parameters.tree_parameters import (
    body_parameters,
    gear_parameters,
    geometry_parameters,
    input_parameters,
    joint_parameters,
    limit_parameters,
)
from sim.mechanism.loop_joints import is_weld
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.short_repr import short_repr
from solvers.types import Floats, IntegerMatrix, Vector

_FEW_NAMES = 6  # of a kind in a printed list

__all__ = ["KINDS", "Parameter", "Parameters", "ParameterPlan", "all_parameters"]


@dataclass(frozen=True, eq=False, repr=False)
class Parameters:
    """The parameters of a selection, in order; `parameters[name]` has the values of one name.

        kind:part[component]    mass:trunk   com:trunk[0]   spring:knee   friction:foot   gravity[2]   time_step

    A name without a component stands for all of them, one without a part for all parts. `kind:*` is a single parameter
    that adds the same to all parts, at the mean of their values. Kinds:

        mass [kg], inertia [kg m^2]        of bodies; a mass changes alone
        com [m]                            displacement of a centre of mass; joints, contacts, shapes and frames of a
                                           file stay where they are on the body, forces of inputs go with its centre
        parent_point, child_point [m]      of joints, also of those that close loops
        orientation [rad], axis            rotation vector of the joint frame, from where it is; direction
        spring [N/m, N m/rad], damper [N s/m, N m s/rad], rest [m, rad], armature [kg, kg m^2], lower, upper [m, rad],
        cone [rad], pitch [m/rev]          of joints
        gear_ratio [rad/rad, m/rad], gear_offset [m, rad]
        input_force, input_torque [m]      of a unit of an input on a body
        friction, restitution              of contacts and collisions
        torsional_friction, rolling_friction [m]
                                           of those that have them
        contact_point, contact_radius, contact_height [m], contact_normal
        terrain [m]                        heights of its grid
        shape_a, shape_b [m]               centres of the shapes of collisions in their bodies
        size_a, size_b [m]                 their [radius], [length], [x], [y], [z]; of a polytope its [scale], 1 at
                                           first; a body's inertia is that of its own shape, and stays
        gravity [m/s^2], time_step [s]

    Attributes:
        names: names with part and component.
        values: (n,) values.
        rows: {requested name: slice of its values}.
    """

    names: tuple[str, ...]
    values: Floats  # (n,)
    rows: dict[str, slice]

    __repr__ = short_repr

    def __str__(self) -> str:
        """Kinds, how many there are of each, and the names of some."""
        parts: dict[str, dict[str, int]] = {}
        for name in self.names:
            part = name.partition("[")[0]
            of_kind = parts.setdefault(part.partition(":")[0], {})
            of_kind[part] = of_kind.get(part, 0) + 1
        lines = [f"{len(self.names)} parameters; kind, number, names (with [0], [1], ... one component)"]
        for kind, found in parts.items():
            rest = f", ... ({len(found)} parts)" if len(found) > _FEW_NAMES else ""
            lines.append(f"  {kind:<15}{sum(found.values()):>6}  {', '.join(list(found)[:_FEW_NAMES])}{rest}")
        return "\n".join(lines)

    def __getitem__(self, name: str) -> Floats:
        """Values of one name of the selection."""
        return self.values[self.rows[name]]

    def __iter__(self) -> Iterator[str]:
        """Names of the selection, the keys of the values."""
        return iter(self.rows)


class ParameterPlan(NamedTuple):
    """Parameters as kernels need them, see residual_columns.py; heights of terrain apart, see terrain_parameters.py."""

    terms: IntegerMatrix  # (m, 4)
    weights: Vector  # (m,)
    size: int
    heights: IntegerMatrix  # (k, 2) height, column
    height_weights: Vector  # (k,)


def all_parameters(mech: Mechanism, time_step: float) -> list[Parameter]:
    """Every parameter of the mechanism, kind by kind in the order of KINDS."""
    found: list[Parameter] = []
    shares = {joint.child for joint in mech.loops if is_weld(joint)}
    for body in mech.bodies:
        if body.mass > 0.0 and body.name not in shares:
            found += body_parameters(mech, body)
    driven = {part.joint for part in mech.inputs or () if part.servo == "position"}
    first = 0
    limit = 0
    for index, joint in enumerate(mech.joints):
        found += geometry_parameters(joint, index, False) + joint_parameters(joint, first, driven)
        bounds = list(limit_parameters(joint, limit))
        found += bounds
        first += joint.nv
        limit += len(bounds)
    for index, joint in enumerate(mech.loops):
        if not is_weld(joint):
            found += geometry_parameters(joint, index, True)
    found += [*gear_parameters(mech), *input_parameters(mech)]
    for index, contact in enumerate(mech.contacts):
        found += contact_parameters(contact, index)
    found += [*terrain_parameters(mech), *collision_parameters(mech)]
    for k in range(3):
        value = float(np.asarray(mech.gravity)[k])
        found.append(Parameter("gravity", "", str(k), value, ((Effect.GRAVITY, 0, k, 1.0),)))
    found.append(Parameter("time_step", "", "", time_step, ((Effect.TIME_STEP, 0, 0, 1.0),)))
    return sorted(found, key=lambda p: KINDS.index(p.kind))
