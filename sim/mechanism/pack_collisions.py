"""The numbers of collisions in a Model: contact points, the balls around shapes, tables of polytopes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from sim.mechanism.contact_candidates import ContactCandidate, couples
from sim.mechanism.mechanism import Mechanism
from sim.model import shape_kinds
from sim.model.model import Law, Model
from solvers.types import Floats


def pack_collisions(mech: Mechanism, model: Model) -> None:
    """The numbers of the pairs, and of the couplings that they make."""
    found = mech.contact_candidates
    bodies = couples(found)
    ground = len(mech.contacts)
    for j, candidate in enumerate(found):
        c = ground + j
        model.contact_body[c] = candidate.bodies[0]
        model.contact_law[c] = Law[candidate.law.upper()] if candidate.friction > 0.0 else Law.IMPACT
        model.contact_friction[c] = candidate.friction
        model.contact_restitution[c] = candidate.restitution
        if len(model.moment_friction):
            model.moment_friction[c] = candidate.moment_friction
        model.pair_coupling[j] = bodies.index(candidate.bodies)
        model.pair_kind[j], model.pair_feature[j] = candidate.kind, candidate.feature
        model.pair_sizes[j] = candidate.sizes
        model.pair_least[j] = candidate.sizes[candidate.sizes > 0.0].min(initial=1e300)
        model.pair_place[2 * j : 2 * j + 2] = candidate.places
    _pack_far(found, model)
    _pack_hulls(found, model)
    for k, (a, b) in enumerate(bodies):
        model.coupling_body[k] = a, b
        model.coupling_row[k + 1] = model.coupling_row[k] + 6


def _pack_far(found: Sequence[ContactCandidate], model: Model) -> None:
    """pair_bound and body_reach."""
    firsts = [j for j, candidate in enumerate(found) if candidate.feature == 0]
    if not firsts:
        return
    degree = Counter(i for j in firsts for i in found[j].bodies)
    for j, end in zip(firsts, [*firsts[1:], len(found)], strict=True):
        candidate = found[j]
        arms, mobility, turning, spinning = [0.0, 0.0], 0.0, 0.0, 0.0
        for side, i in enumerate(candidate.bodies):
            if i < 0:
                continue
            arm = float(np.linalg.norm(candidate.places[side, :3])) + candidate.radii[side]
            least = float(np.linalg.eigvalsh(model.body_inertia[i].reshape(3, 3))[0])
            free = model.body_mass[i] > 0.0 and arm < np.inf
            arms[side] = arm
            mobility += 1.0 / model.body_mass[i] + arm**2 / least if free else np.inf
            turning += arm / least if free else np.inf
            spinning += 1.0 / least if free else np.inf
            model.body_reach[i] = max(model.body_reach[i], arm)
        most: float = max(degree[i] for i in candidate.bodies if i >= 0)
        lengths, moments = candidate.moment_friction, (0.0, 0.0, 0.0, 0.0)
        if any(lengths):
            growth = sum(lengths) * (mobility * spinning) ** 0.5
            moments = sum(lengths), max(lengths) ** 2 * spinning, growth, sum(lengths) * spinning
        near = sum(candidate.radii), *arms, mobility, turning, most, end - j, candidate.reach
        model.pair_bound[j] = *near, *moments


def tables_of(found: Sequence[ContactCandidate]) -> list[Floats]:
    """The tables of shapes, each once, though many shapes may share it."""
    return list({id(table): table for candidate in found for table in candidate.hulls}.values())


def _pack_hulls(found: Sequence[ContactCandidate], model: Model) -> None:
    """Fill the table of hulls, and the row at which the hulls of each point begin."""
    end, rows, starts = 0, [0, 0], {}
    for table in tables_of(found):
        starts[id(table)] = end
        model.hull[end : end + len(table)] = table
        end += len(table)
    for j, candidate in enumerate(found):
        for k, table in enumerate(candidate.hulls):
            rows[k] = starts[id(table)]
        sides = [side for side, given in enumerate(shape_kinds.tables(candidate.kind)) if given]
        for side, row in zip(sides, rows, strict=False):
            model.pair_sizes[j, 4 * side] = row
