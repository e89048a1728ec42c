"""describe: the parts of a scene, the work of a step, and its omitted terms."""

from __future__ import annotations

from collections import Counter

import numpy as np

from sim.mechanism.collision import Collision
from sim.mechanism.contact import Contact
from sim.mechanism.contact_candidates import ContactCandidate
from sim.mechanism.joint import WORLD, Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.pack import mechanism_sizes
from sim.mechanism.shapes import Solid
from sim.model.model import Model
from sim.simulator.omitted_contacts import far_reach, reach
from sim.simulator.settings import Settings
from solvers.types import Floats


def describe(mech: Mechanism, model: Model, settings: Settings, rank: str, second_order_reason: str = "") -> str:
    """A page of text.

    rank: of the loop constraints, if there are any; second_order_reason: why all steps are of order 2, if they are.
    """
    lines = [
        f"{mech.name}: {_count(mech.nbody, 'body', 'bodies')}, {_count(mech.nv, 'degree', 'degrees')} of freedom, "
        f"{_total_mass(mech):.4g} kg",
        f"  state x ({mech.nq + mech.nv},) = q ({mech.nq},), v ({mech.nv},);  perturbation dx ({2 * mech.nv},);  "
        f"input u ({len(mech.input_names)},)",
        f"  time step {settings.time_step:g} s, kappa {settings.kappa:g} N s m, tolerance {settings.tolerance:g}, "
        f"order {settings.order}",
        "joints",
        *(_joint_line(mech, j) for j in mech.joints),
        *_loop_lines(mech, rank),
        *_titled("inputs", [f"  u[{k}]  {name}" for k, name in enumerate(mech.input_names)]),
        *_contact_lines(mech),
        *_collision_lines(mech),
        "a step",
        *(f"  {part:<18}{state}" for part, state in _parts(mech, settings.order, second_order_reason)),
        *_inactive_lines(mech, model, settings),
        *_far_lines(mech, model, settings),
    ]
    return "\n".join(lines)


def _total_mass(mech: Mechanism) -> float:
    return sum(b.mass for b in mech.bodies)


def _span(s: slice) -> str:
    """Indices as a user would write them."""
    return "-" if s.start == s.stop else str(s.start) if s.stop == s.start + 1 else f"{s.start}:{s.stop}"


def _joint_line(mech: Mechanism, joint: Joint) -> str:
    """Name, kind, place in the tree, coordinates, and further elements of the joint."""
    extra = [
        word
        for word, there in (
            ("spring", any(np.atleast_1d(np.asarray(joint.spring)))),
            ("damper", any(np.atleast_1d(np.asarray(joint.damper)))),
            ("limits", any(np.isfinite(b) for pair in joint.limits or () for b in pair)),
            ("cone", joint.cone is not None),
            ("armature", any(np.atleast_1d(np.asarray(joint.armature)))),
        )
        if there
    ]
    at = f"q[{_span(mech.q_slice(joint.name))}], v[{_span(mech.v_slice(joint.name))}]"
    tail = f"  with {', '.join(extra)}" if extra else ""
    return f"  {joint.name:<18}{joint.kind:<16}{joint.parent} -> {joint.child}:  {at}{tail}"


def _loop_lines(mech: Mechanism, rank: str) -> list[str]:
    """Loop joints and gears, and the number of their independent constraints."""
    loops, gears = mech.loops, mech.gears
    if not loops and not gears:
        return []
    lines = [f"  {j.name:<18}{j.kind:<16}{j.parent} -> {j.child}:  {6 - j.nv} constraints" for j in loops]
    lines += [f"  {g.name:<18}{'gear':<16}{g.joint} = {g.ratio:g} {g.other} + {g.offset:g}" for g in gears]
    return ["loops", *lines, f"  {rank}"]


def _further_settings(part: Contact | Collision) -> str:
    """Settings of a contact or collision that few have."""
    fields = ("restitution", "torsional_friction", "rolling_friction")
    return "".join(f", {field.replace('_', ' ')} {getattr(part, field):g}" for field in fields if getattr(part, field))


def _contact_lines(mech: Mechanism) -> list[str]:
    """One line per body that has contacts with the ground; those that are alike are counted."""
    lines = []
    for body in dict.fromkeys(c.body for c in mech.contacts):
        kinds = Counter(_contact(c) for c in mech.contacts if c.body == body)
        own = [c.name for c in mech.contacts if c.body == body]
        name = own[0] if len(own) == 1 else body
        parts = [kind if count == 1 else f"{count} x {kind}" for kind, count in kinds.items()]
        lines.append(f"  {name:<18}{'; '.join(parts)}{f' on {body}' if name != body else ''}")
    return _titled("contacts", lines)


def _contact(c: Contact) -> str:
    """Shape and law of a contact."""
    law = c.law if c.friction > 0 else "impact"
    shape = f"ball of {c.radius:.4g} m" if c.radius else "point"
    more = _further_settings(c)
    more += ", on terrain" if c.terrain is not None else ""
    return f"{shape}, law {law}, friction {c.friction:g}{more}"


def _collision_lines(mech: Mechanism) -> list[str]:
    """The shapes of each collision, and the number of their contact points."""
    lines = []
    for c in mech.collisions:
        points = sum(candidate.collision == c.name for candidate in mech.contact_candidates)
        met = _count(points, "point", "points") if points else "fixed to one another, omitted"
        kinds = [_solid(mech, *end) for end in ((c.a, c.shape_a), (c.b or WORLD, c.shape_b))]
        more = _further_settings(c)
        law = c.law if c.friction else "impact"
        lines.append(
            f"  {c.name:<18}{kinds[0]} on {c.a}, {kinds[1]} {'of the' if c.b == WORLD else 'on'} {c.b}: "
            f"{met}, law {law}, friction {c.friction:g}{more}"
        )
    return _titled("collisions", lines)


def _solid(mech: Mechanism, body: str, shape: Solid | None) -> str:
    """The kind of shape that a collision has on a body."""
    own = shape if shape is not None or body == WORLD else mech.bodies[mech.body_names.index(body)].shapes[0]
    return type(own).__name__.lower()


def _titled(title: str, lines: list[str]) -> list[str]:
    """The lines below their title, and no title without lines."""
    return [title, *lines] if lines else []


def _count(number: int, one: str, many: str) -> str:
    return f"{number} {one if number == 1 else many}"


def _inactive_lines(mech: Mechanism, model: Model, settings: Settings) -> list[str]:
    """The gap beyond which contacts are inactive at this kappa and tolerance."""
    distances = reach(model, settings.time_step, settings.kappa, settings.tolerance)
    return _beyond(mech, "inactive contacts", distances, "they still push with an impulse of kappa/gap")


def _far_lines(mech: Mechanism, model: Model, settings: Settings) -> list[str]:
    """The gap beyond which contacts with the ground are far at this kappa and cutoff."""
    if not settings.cutoff:
        return []
    distances = far_reach(model, settings.time_step, settings.kappa, settings.cutoff)
    rest = "their impulses are given for the whole step, and derivatives omit them"
    return _beyond(mech, "far contacts", distances, rest)


def _beyond(mech: Mechanism, title: str, distances: Floats, rest: str) -> list[str]:
    """The line of contacts that are omitted beyond these gaps: the least one, and the largest with its contact."""
    if not np.isfinite(distances).any():
        return []
    last = int(np.argmax(np.where(np.isfinite(distances), distances, -np.inf)))
    nearest, farthest = f"{distances.min():.2g}", f"{distances[last]:.2g}"
    span = f"{nearest} m" if nearest == farthest else f"{nearest} m ({mech.contact_names[last]}: {farthest} m)"
    return [f"  {title:<18}omitted from the solver beyond a gap of {span}; {rest}"]


def _parts(mech: Mechanism, order: int, second_order_reason: str) -> list[tuple[str, str]]:
    """The parts of a step, and the omitted ones."""
    nlimit = mechanism_sizes(mech).nlimit
    points: list[Contact | ContactCandidate] = [*mech.contacts, *mech.contact_candidates]
    cones = sum(c.friction > 0 and c.law == "nonlinear" for c in points)
    pyramids = sum(c.friction > 0 and c.law == "linear" for c in points)
    impacts = len(points) - cones - pyramids
    springs = sum(bool(np.any(np.asarray(j.spring))) for j in mech.joints)
    dampers = sum(bool(np.any(np.asarray(j.damper))) for j in mech.joints)
    solver = "interior point" if points or nlimit else "Newton's method; interior point omitted"
    if second_order_reason:
        solver = f"{solver}; all steps are of order 2: {second_order_reason}"
    elif order > 2:
        from sim.integrators.tableau import tableau

        far = f"{len(tableau(order)[1])} evaluations of the equations of motion"
        solver = f"{solver}; none while contacts and limits are inactive: {far}" if points or nlimit else f"none: {far}"
    counts = (
        ("contacts", len(points), f"{cones} cones, {pyramids} pyramids, {impacts} without friction"),
        ("joint limits", nlimit, _count(nlimit, "bound", "bounds")),
        ("springs", springs, _count(springs, "joint", "joints")),
        ("dampers", dampers, _count(dampers, "joint", "joints")),
    )
    return [("solver", solver), *((part, text if n else "omitted") for part, n, text in counts)]
