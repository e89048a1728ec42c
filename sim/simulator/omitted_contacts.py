"""Inactive contacts of a step, and the gap beyond which a contact is inactive (see contact/inactive.py)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.contact.pairs.inactive_pairs import COUPLED, STEEPEST
from sim.mechanism.pack_clusters import STIFFNESS
from sim.model.model import Model
from sim.model.record_columns import PairBound


def reach(model: Model, time_step: float, kappa: float, tolerance: float) -> NDArray[np.float64]:
    """Gap beyond which each contact of a body at rest is inactive, (ncontact,) [m]; infinite if it never is.

    Twice the positive root a of the bound in inactive.py, and of that in pairs/inactive_pairs.py for collisions:

    1000 tolerance a^2 = n kappa ((mu^2 + h (1 + mu)) M + h (1 + mu) T a)
    """
    out = np.zeros(len(model.contact_body))
    for first in np.flatnonzero(model.cluster_end):
        _, _, _, _, _, mobility, mu, turn, _, _ = model.cluster[first]
        scale = len(out) * kappa / (STIFFNESS * tolerance)
        b, c = scale * time_step * (1.0 + mu) * turn, scale * (mu * mu + time_step * (1.0 + mu)) * mobility
        out[first : model.cluster_end[first]] = b + np.sqrt(b * b + 4.0 * c)
    ground = len(model.contact_height)
    for j in np.flatnonzero(model.pair_feature == 0):
        bound = model.pair_bound[j]
        points, limit = int(bound[PairBound.POINTS]), bound[PairBound.REACH]
        if not np.isfinite(bound[PairBound.MOBILITY]):  # a string, whose gap has no ball around it: always active
            out[ground + j : ground + j + points] = limit
            continue
        mu, scale = model.contact_friction[ground + j], points * bound[PairBound.COLLISIONS] * kappa / COUPLED
        b = scale * time_step * (1.0 + mu) * (bound[PairBound.TURNING] + bound[PairBound.MOBILITY] * STEEPEST / limit)
        c = scale * (mu * mu + time_step * (1.0 + mu)) * bound[PairBound.MOBILITY]
        out[ground + j : ground + j + points] = min(b + np.sqrt(b * b + 4.0 * c), limit)
    return out
