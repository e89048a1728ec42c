"""Costs and constraints on contacts with the ground, on the distances of bodies, and on changes of inputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.planning.component_names import chosen_inputs, input_weight
from dojo_opt.planning.task_space.body_tasks import needs_order_two
from dojo_opt.planning.task_space.input_changes import InputChanges
from dojo_opt.planning.task_space.quantity import (
    ContactForces,
    ContactGaps,
    Distances,
    FrictionReserves,
    Quantity,
    Slips,
)
from dojo_opt.planning.task_space.task_spec import TaskSpec, bounds
from dojo_opt.planning.task_space.task_term import Entries
from dojo_opt.planning.term import Spec, Term, knot_list, table
from sim.mechanism import checks
from sim.mechanism.collision import Collision
from sim.mechanism.joint import WORLD
from sim.mechanism.shapes import Solid
from sim.mechanism.short_repr import short_repr
from sim.model.shape_kinds import SWAPPED, Pair
from sim.simulator.kinematics import Kinematics
from sim.simulator.simulator import Simulator
from solvers.types import Integers

__all__ = ["Clearance", "ContactForce", "FrictionUse", "Slip", "TorqueRate"]


def ground_contacts(call: str, sim: Simulator, given: Any) -> Integers:
    """Numbers of contacts with the ground, by their names or those of bodies or links; None means all."""
    contacts = sim.mechanism.contacts
    names = {c.name: [i] for i, c in enumerate(contacts)}
    kin = Kinematics(sim)
    for frame in kin.frames:
        body = sim.mechanism.body_names[kin.place(frame)[0]]
        own = [i for i, c in enumerate(contacts) if c.body == body]
        if own and kin.place(frame)[0] >= 0:
            names.setdefault(frame, own)
    if not names:
        raise ValueError(f"{call}: {sim.mechanism.name!r} has no contact with the ground (see dojo.Contact)")
    if given is None:
        return np.arange(len(contacts))
    wanted = [given] if isinstance(given, str) else list(given)
    return np.array([i for name in wanted for i in names[checks.one_of(call, name, names)]], dtype=np.int64)


def _without_restitution(call: str, sim: Simulator, chosen: Integers) -> None:
    """Refuse contacts whose forces have no derivative here."""
    for i in chosen:
        contact = sim.mechanism.contacts[i]
        if contact.restitution > 0.0:
            raise ValueError(f"{call}: forces of {contact.name!r}, which has a restitution, are not supported")


@dataclass(frozen=True)
class ContactForce(TaskSpec):
    """Forces of contacts with the ground in the first time step from a knot.

    Entries are "foot normal", "foot first" and "foot second" by the name of the contact, along the normal and the two
    tangents of the ground, x and y on a floor; groups are "foot", "normal", "first" and "second". While the planner
    smooths contacts, the forces are the smoothed ones. Each evaluation solves a step per knot again.

    Attributes:
        contacts: names of contacts, or of bodies or links that have some (default None: all).
        target: (3 n,) forces, or one row per knot [N] (default zero).
    """

    contacts: str | Sequence[str] | None = None
    target: ArrayLike = 0.0

    __repr__ = TaskSpec.__repr__
    _LAST = False

    def _bound(self, sim: Simulator, knots: Integers) -> tuple[Quantity, Integers, ArrayLike]:
        needs_order_two("ContactForce", sim)
        chosen = ground_contacts("ContactForce(contacts)", sim, self.contacts)
        _without_restitution("ContactForce(contacts)", sim, chosen)
        return ContactForces(sim, knots, chosen), np.arange(3 * chosen.size), self.target


@dataclass(frozen=True)
class FrictionUse(TaskSpec):
    """Contacts with the ground use at most a share of their friction: |f_t| <= share mu f_n [N].

    One entry per contact, called by its name: |f_t| - share mu f_n, whose upper bound is zero. In costs, the square of
    the excess counts.

    Attributes:
        contacts: names of contacts, or of bodies or links that have some (default None: all).
        share: largest share of the friction (default 0.8).
    """

    contacts: str | Sequence[str] | None = None
    share: float = 0.8

    __repr__ = TaskSpec.__repr__
    _LAST = False

    def bind(self, sim: Simulator, horizon: int, layout: Integers) -> Term:
        if self.lower is not None or self.upper is not None:
            raise ValueError("FrictionUse(...): expected share=... instead of bounds")
        return TaskSpec.bind(replace(self, upper=0.0), sim, horizon, layout)

    def _bound(self, sim: Simulator, knots: Integers) -> tuple[Quantity, Integers, ArrayLike]:
        needs_order_two("FrictionUse", sim)
        chosen = ground_contacts("FrictionUse(contacts)", sim, self.contacts)
        _without_restitution("FrictionUse(contacts)", sim, chosen)
        share = checks.number("FrictionUse(share=...)", self.share, above=0.0)
        return FrictionReserves(sim, knots, chosen, share), np.arange(chosen.size), 0.0


@dataclass(frozen=True)
class Slip(TaskSpec):
    """Slip of contacts over the ground, in the time step before a state [m/s].

    Entries are "foot first" and "foot second" by the name of the contact, along the tangents of the ground, x and y on
    a floor; groups are "foot". Choose knots or weights for the times at which a foot is on the ground, or use `near`.

    Attributes:
        contacts: names of contacts, or of bodies or links that have some (default None: all).
        target: (2 n,) slips, or one row per knot [m/s] (default zero).
        near: gap at which only half of the slip counts, 1/(1 + (gap/near)^2) [m] (default infinite: all counts).
    """

    contacts: str | Sequence[str] | None = None
    target: ArrayLike = 0.0
    near: float = np.inf

    __repr__ = TaskSpec.__repr__

    def _bound(self, sim: Simulator, knots: Integers) -> tuple[Quantity, Integers, ArrayLike]:
        needs_order_two("Slip", sim)
        chosen = ground_contacts("Slip(contacts)", sim, self.contacts)
        if not self.near > 0.0:
            raise ValueError(f"Slip(near=...): expected a number > 0, got {self.near!r}")
        return Slips(sim, knots, chosen, float(self.near)), np.arange(2 * chosen.size), self.target


@dataclass(frozen=True)
class Clearance(TaskSpec):
    """Distance of a body from the ground, another body or an obstacle [m]; at least `lower`, 0 by default.

    Entries are the contacts of the body with the ground, or the contact points of the shapes of both: each is at least
    as far as `lower`. With target=... the distances are tracked instead.

    Attributes:
        a: name of a body, of one of its links, or, against the ground, of a contact.
        b: name of another body, or a shape placed in world axes (default None: the ground, for the contacts of a).
        target: distance, a number, one per entry, or one row per knot [m] (default None: only bounds).
        shape_a: shape of a (default None: its own).
        shape_b: shape of b (default None: its own).
    """

    a: str
    b: str | Solid | None = None
    target: ArrayLike | None = None
    shape_a: Solid | None = None
    shape_b: Solid | None = None

    __repr__ = TaskSpec.__repr__

    def bind(self, sim: Simulator, horizon: int, layout: Integers) -> Term:
        free = self.target is None and self.lower is None and self.upper is None and not self.periodic
        return TaskSpec.bind(replace(self, lower=0.0) if free else self, sim, horizon, layout)

    def _bound(self, sim: Simulator, knots: Integers) -> tuple[Quantity, Integers, ArrayLike]:
        target = 0.0 if self.target is None else self.target
        if self.b is None:
            chosen = ground_contacts("Clearance(a)", sim, self.a)
            return ContactGaps(sim, knots, chosen), 3 * np.arange(chosen.size), target
        kin = Kinematics(sim)
        known = sim.mechanism.body_names
        sides = [
            WORLD
            if isinstance(side, Solid)
            else known[kin.place(checks.one_of("Clearance(a, b)", side, kin.frames))[0]]
            for side in (self.a, self.b)
        ]
        shape_b = self.b if isinstance(self.b, Solid) else self.shape_b
        pair = Collision(sides[0], sides[1], self.shape_a, shape_b)
        other = sim.replace(mechanism=replace(sim.mechanism, collisions=[pair]))
        if np.any(other.model.pair_kind % SWAPPED >= Pair.POLYTOPE_CYLINDER):
            raise ValueError(
                f"Clearance({self.a!r}, ...): cylinders against cylinders, boxes or polytopes have no distance here; "
                "give shape_a=... or shape_b=..., a capsule for one"
            )
        names = other.mechanism.contact_names[len(other.mechanism.contacts) :]
        return Distances(sim, other, knots, names), np.arange(len(names)), target


@dataclass(frozen=True)
class TorqueRate(Spec):
    """Change of inputs from one knot to the next, u_t - u_t-1 [N, N m]: as a cost, or bounded by `limit`.

    For weights of rates, divide by the square of the knot's length. The term couples neighbouring knots; the planner
    uses exact gradients and a bound of the curvature.

    Attributes:
        weight: a number, (nu,), one row per knot, or a dict keyed by names of inputs [1/N^2, 1/(N m)^2] (default 1).
        limit: largest change, a number or (nu,) [N, N m] (default None: no limit, but a cost on every change).
        before: (nu,) input before the first knot [N, N m] (default None: the first input is free).
        components: numbers or names of inputs (default None: all).
        knots: numbers of the knots (default None: all, from the second on without `before`).
        scale: factor of the whole cost (default 1).
    """

    weight: ArrayLike | Mapping[str, float] = 1.0
    limit: ArrayLike | None = None
    before: ArrayLike | None = None
    components: Any = None
    knots: Any = None
    scale: float = 1.0

    __repr__ = short_repr

    def bind(self, sim: Simulator, horizon: int, layout: Integers) -> Term:
        del layout
        knots = knot_list("TorqueRate(knots=...)", self.knots, horizon, last=False)
        knots = knots if self.before is not None else knots[knots > 0]
        chosen = chosen_inputs("TorqueRate(components=...)", self.components, sim)
        before = np.zeros(sim.nu)
        if self.before is not None:
            before = checks.array("TorqueRate(before=...)", self.before, (sim.nu,))
        named = input_weight("TorqueRate(weight=...)", self.weight, sim)
        weight = table("TorqueRate(weight=...)", named, knots.size, sim.nu)[:, chosen]
        if np.any(weight < 0.0):
            raise ValueError(f"TorqueRate(weight=...): expected no negative weight, got {weight.min():g}")
        weight = checks.number("TorqueRate(scale=...)", self.scale, at_least=0.0) * weight
        if self.limit is None:
            entries = Entries(chosen, np.ones(chosen.size), np.zeros(weight.shape))
            return InputChanges(knots, weight, entries, before, one_sided=False)
        limit = np.broadcast_to(table("TorqueRate(limit=...)", self.limit, 1, sim.nu)[0], (sim.nu,))[chosen]
        entry, sign, reference = bounds("TorqueRate", -limit, limit, knots.size, chosen.size)
        entries = Entries(chosen[entry], sign, reference)
        return InputChanges(knots, np.ascontiguousarray(weight[:, entry]), entries, before, one_sided=True)
