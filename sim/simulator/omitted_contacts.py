"""Gaps beyond which contacts are inactive (contact/inactive.py), or far (contact/far_contacts.py)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.contact.pairs.inactive_pairs import COUPLED
from sim.contact.pairs.limited_reach import STEEPEST
from sim.mechanism.pack_clusters import STIFFNESS
from sim.model.model import Model
from sim.model.record_columns import Cluster, PairBound


def reach(model: Model, time_step: float, kappa: float, tolerance: float) -> NDArray[np.float64]:
    """Gap beyond which each contact of a body at rest is inactive, (ncontact,) [m]; infinite if it never is.

    Twice the positive root a of the bound in inactive.py, and of that in pairs/inactive_pairs.py for collisions:

    1000 tolerance a^2 = n kappa ((mu^2 + h (1 + mu)) M + h (1 + mu) T a)

    and the terms of moments/inactive_moments.py.
    """
    out, ground = np.zeros(len(model.contact_body)), len(model.contact_height)
    for first in np.flatnonzero(model.cluster_end):
        mobility, mu, turn = model.cluster[first, [Cluster.MOBILITY, Cluster.FRICTION, Cluster.TURNING]]
        spin, growth = model.cluster[first, [Cluster.SPIN, Cluster.SPIN_GROWTH]]
        scale = ground * kappa / (STIFFNESS * tolerance)
        b = scale * time_step * (1.0 + mu) * turn
        c = scale * ((mu * mu + time_step * (1.0 + mu)) * mobility + spin + time_step * growth)
        out[first : model.cluster_end[first]] = b + np.sqrt(b * b + 4.0 * c)
    for j in np.flatnonzero(model.pair_feature == 0):
        bound = model.pair_bound[j]
        points, limit = int(bound[PairBound.POINTS]), bound[PairBound.REACH]
        if not np.isfinite(bound[PairBound.MOBILITY]):  # a string, whose gap has no ball around it: always active
            out[ground + j : ground + j + points] = limit
            continue
        mu, scale = model.contact_friction[ground + j], points * bound[PairBound.COLLISIONS] * kappa / COUPLED
        b = scale * time_step * (1.0 + mu) * (bound[PairBound.TURNING] + bound[PairBound.MOBILITY] * STEEPEST / limit)
        b += scale * time_step * (bound[PairBound.SPIN_TURNING] + bound[PairBound.SPIN_GROWTH] * STEEPEST / limit)
        c = scale * (mu * mu + time_step * (1.0 + mu)) * bound[PairBound.MOBILITY]
        c += scale * (bound[PairBound.SPIN] + 2.0 * time_step * bound[PairBound.SPIN_GROWTH])
        out[ground + j : ground + j + points] = min(b + np.sqrt(b * b + 4.0 * c), limit)
    return out


def far_reach(model: Model, time_step: float, kappa: float, cutoff: float) -> NDArray[np.float64]:
    """Gap beyond which each contact with the ground is far, (nground,) [m]; infinite if it never is.

    The gap of e = cutoff in far_contacts.py:    cutoff m gap^2 = n kappa (mu^2 + h (1 + mu))
    """
    out = np.full(len(model.contact_height), np.inf)
    for first in np.flatnonzero(model.cluster_end):
        mass = model.body_mass[model.contact_body[first]]
        mu, count = model.cluster[first, [Cluster.FRICTION, Cluster.CONTACTS]]
        plain = model.contact_terrain[first] == 0 and model.cluster[first, Cluster.LENGTH] == 0.0
        if plain and model.contact_hold[first] == 0 and mass > 0.0:
            stiffness = count * kappa * (mu * mu + time_step * (1.0 + mu))
            out[first : model.cluster_end[first]] = np.sqrt(stiffness / (cutoff * mass))
    return out
