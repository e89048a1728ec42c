"""Moments of inactive contacts (contact/inactive.py, pairs/inactive_pairs.py): their law, evaluated with the impulses.

Beside those of its impulse, an inactive contact has the stiffness of its moment m. With M, the velocity per impulse,
and N = 1/J0, the angular velocity per moment, of the bodies, l = mu_t + mu_r, and a lower bound a of the gap,

    |dm| <= l kappa/a^2 d(gap) + max(mu_t, mu_r)^2 kappa/a^2 d(omega),     |m| <= l kappa/a

so that e has, per contact,

    kappa (max(mu_t, mu_r)^2 N + h l sqrt(M N))/a^2

Those of pairs turn with the normal, too: by the rotation of both bodies, and by their displacement over the gap.
"""

from __future__ import annotations

from sim.contact.moments.moment_law import has_moment, moment_of, start_moment
from sim.contact.moments.moment_rates import add_moment, put_rates, world_moment
from sim.contact.pairs.limited_reach import STEEPEST
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import Cluster, Inactive, PairBound
from sim.model.slots import Slot
from solvers.compiler import optional
from solvers.types import Matrix


@optional(Slot.PLACE_MOMENT)
def place_moment(model: Model, data: Data, h: float, c: int, kappa: float) -> None:
    """Rates of contact c, and its moment on the central path at its impulse."""
    if has_moment(model, c):
        put_rates(model, data, h, c)
        start_moment(model, data, c, kappa)


@optional(Slot.ADD_INACTIVE_MOMENT)
def add_inactive_moment(model: Model, data: Data, c: int, out: Matrix) -> None:
    """out[a] -= moment of the inactive contact c, out[b] += it."""
    if has_moment(model, c):
        add_moment(model, data, c, moment_of(data, c), out)


@optional(Slot.MOMENT_SLOPE, default=0.0)
def moment_slope(model: Model, data: Data, h: float, j: int, a: float) -> float:
    """Bound of the change of the moments of an inactive collision per displacement d, over POINTS kappa/a.

    Bodies turn by d over their reach, and the normal by d/a, too; angular velocities change by twice the turn over h.
    """
    f = model.pair_bound[j]
    if f[PairBound.LENGTH] == 0.0:
        return 0.0
    turn, omega = 0.0, 0.0
    for side in range(2):
        i = model.coupling_body[model.pair_coupling[j], side]
        if i >= 0:
            turn += 1.0 / model.body_reach[i] if model.body_reach[i] > 0.0 else 1e300
            for k in range(3):
                omega += 2.0 / h * abs(data.turn_in[i, 1 + k])
    slope = f[PairBound.LENGTH] / a
    by_gap = 2.0 / a + 2.0 * STEEPEST / f[PairBound.REACH]
    return f[PairBound.LENGTH] * (by_gap + 2.0 * slope * turn / h + (1.0 + slope * omega) * (turn + 2.0 / a))


@optional(Slot.EVALUATE_MOMENTS)
def evaluate_moments(model: Model, data: Data, h: float, c: int, gap: float) -> None:
    """Inactive.TURNING of a cluster, the sum of its moments; BY_RATE, and the part of BY_GAP, beyond this gap."""
    row, kappa = data.inactive[c], data.carry.inactive_kappa[0]
    for k in range(3):
        row[Inactive.TURNING + k] = 0.0
    for k in range(c, model.cluster_end[c]):
        if data.contact_out[k] == 1 and has_moment(model, k):
            place_moment(model, data, h, k, kappa)
            m = world_moment(model, data, k, moment_of(data, k))
            for r in range(3):
                row[Inactive.TURNING + r] += m[r]
    length = model.cluster[c, Cluster.LENGTH]
    push = (model.cluster_end[c] - c) * kappa / gap
    row[Inactive.BY_GAP] += push * length / gap
    row[Inactive.BY_RATE] = push * length * length / gap
