"""The active set of contacts with the ground: the contacts that the interior point solves for.

The impulses of inactive contacts are given (inactive_impulses.py). A cluster, the contacts of a body against one
direction, is inactive if its stiffness, relative to the inertia behind it, is below the tolerance of the step:

    e = n kappa ((mu^2 + h (1 + mu)) M/a^2 + h (1 + mu) T/a) <= 1000 tolerance
    M = 1/m + W^2 (+ 2 spread W/sqrt(J0)),     T = |J^-1/2 (p x f)|/sqrt(J0)

n: contacts of the mechanism with the ground, a: half the gap that is ahead, W: largest |J^-1/2 (r x f)| of a unit
impulse f, J0: least moment of inertia, p: mean point. Contacts of a near cluster are inactive up to e = 1e-2, in
derivatives active (stiff_contacts.py); of a cluster of many points up to 300, with their stiffness in the matrix
(corner_laws.py).
Derivation: docs/theory/inactive_contacts.md.

Columns of `inactive` and `cluster`: Inactive and Cluster of sim/model/record_columns.py.
"""

from __future__ import annotations

from math import sqrt

from sim.contact.corners import gather_corners, least_corner_gap, write_cones
from sim.contact.far_contacts import choose_far, far_gap, has_far_activated
from sim.contact.pairs.inactive_pairs import COUPLED
from sim.contact.terrain_contact import terrain_gap
from sim.mechanism.immovable_contacts import SUNK
from sim.mechanism.pack_clusters import STIFFNESS
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import StepOptions
from sim.model.record_columns import Cluster, Corner, Inactive, Kin
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.dense import clear
from solvers.rotation import rotate, three
from solvers.types import Matrix, Vector

_UNSTEADY = 0.03  # share of the motion in the step before by which the motion of corners in this one may differ
_STIFFEST = 300.0  # largest e of the inactive corners of a cluster, whose stiffness the matrix does not omit


@kernel
def highest(model: Model, c: int) -> float:
    """Largest height of the planes of the cluster that begins at contact c: they may rise while a ground is learnt."""
    height = model.contact_height[c]
    for k in range(c + 1, model.cluster_end[c]):
        height = max(height, model.contact_height[k])
    return height


@kernel
def cluster_gap(model: Model, data: Data, c: int, height: float, third: bool) -> float:
    """Lower bound of the gaps of the cluster that begins at contact c, at configuration 3 or 2.   height: `highest`."""
    if model.contact_terrain[c] > 0:
        return terrain_gap(model, data, c, third)
    i = model.contact_body[c]
    pos = data.pos3 if third else data.pos2
    rot = data.rot3 if third else data.rot2
    n = model.contact_frame[c]
    p = model.cluster[c]
    x, y, z = rotate(rot, i, *three(p, Cluster.CENTER))
    return n[0] * (pos[i, 0] + x) + n[1] * (pos[i, 1] + y) + n[2] * (pos[i, 2] + z) - height - p[Cluster.RADIUS]


@optional(Slot.SUNK_CONTACT, default=-1)
def sunk_contact(model: Model) -> int:
    """A contact that no motion lifts out of the ground (immovable_contacts.py), or -1."""
    for c in range(model.contact_hold.shape[0]):
        if model.contact_hold[c] == SUNK:
            return c
    return -1


@optional(Slot.HAS_CORNERS, default=False, seldom=True)
def has_corners(model: Model) -> bool:
    """Whether a cluster of contacts has so many points that they are summed, as the corners of a mesh."""
    for c in range(model.cluster.shape[0]):
        if model.cluster[c, Cluster.CORNERS] > 0.0:
            return True
    return False


@optional(Slot.CHOOSE_ACTIVE)
def choose_active(model: Model, data: Data, options: StepOptions) -> None:
    """Sort contacts with the ground into active and inactive ones, from configuration 2 and the motion that led there.

    Impulses of the step before stand until the motion changes them; a motion that begins forgets them (rollout.py).
    """
    known = data.carry.inactive_kappa[0] == options.kappa
    count = model.contact_height.shape[0]
    least = STIFFNESS * options.tolerance / (max(1, count) * options.kappa)
    data.active_ground_count[0] = 0
    data.inactive_count[0] = 0
    if options.cutoff > 0.0:
        clear(data.far_wrench)
    c = 0
    while c < count:
        i = model.contact_body[c]
        n = model.contact_frame[c]
        most = n[0] * data.pos2[i, 0] + n[1] * data.pos2[i, 1] + n[2] * data.pos2[i, 2] - model.contact_height[c]
        most = 0.5 * (most + model.cluster[c, Cluster.ARM])  # no contact has more: a quick no, for most
        if model.contact_terrain[c] > 0:
            most = 1e9
        a = 0.0
        if most > 0.0 and _stiffness(model, options.h, c, most) <= least * most * most:
            a = _half_gap_ahead(model, data, c)
            if not (a > 0.0 and _stiffness(model, options.h, c, a) <= least * a * a):
                a = 0.0
        data.inactive[c, Inactive.ACTIVATION] = _sort(model, data, options, c, a)
        if data.inactive[c, Inactive.ACTIVATION] == 0.0 or not known:
            data.inactive[c, Inactive.LEAST_GAP] = 0.0
        _enlist(model, data, c)
        c = model.cluster_end[c]
    data.active_count[0] = data.active_ground_count[0]
    data.inactive_tolerance[0] = options.tolerance / max(1, data.inactive_count[0])


@kernel
def _sort(model: Model, data: Data, options: StepOptions, c: int, a: float) -> float:
    """Activation gap of a cluster, 0 where all its contacts are active.   a: that of the cluster as a whole, or 0."""
    row = data.inactive[c]
    stiff, corners = row[Inactive.STIFF], row[Inactive.CORNERS]
    row[Inactive.STIFF] = row[Inactive.CORNERS] = 0.0
    if a == 0.0 and model.cluster[c, Cluster.CORNERS] > 0.0:
        a = _radius(model, options, c, float(model.cluster_end[c] - c), _STIFFEST)
        row[Inactive.STIFF] = row[Inactive.CORNERS] = 1.0
        if gather_corners(model, data, c, 2.0 * a, _UNSTEADY * _travel(model, data, c)) or corners == 0.0:
            row[Inactive.LEAST_GAP] = 0.0
        row[Inactive.SHARE] = -1.0  # that of a step before may be of another length
        return a
    for k in range(c, model.cluster_end[c]):
        data.contact_out[k] = 1 if a > 0.0 else 0
    if a == 0.0 and model.contact_terrain[c] == 0:
        if options.cutoff > 0.0 and _farther(model, options, c):
            choose_far(model, data, options, c)
        else:
            a = _leave_out(model, data, options, c)
    if stiff > 0.0 or row[Inactive.STIFF] > 0.0:  # others than before
        row[Inactive.LEAST_GAP] = 0.0
    return a


@kernel
def _farther(model: Model, options: StepOptions, c: int) -> bool:
    """Whether more contacts of a cluster at rest are far than `_leave_out` finds, as at all but tiny cutoffs."""
    least = far_gap(model, options, c)
    if options.cutoff >= COUPLED:
        return least < 1e300
    return least < 2.0 * _radius(model, options, c, model.cluster[c, Cluster.CONTACTS], COUPLED)


@kernel
def _leave_out(model: Model, data: Data, options: StepOptions, c: int) -> float:
    """contact_out of the contacts of a cluster that hardly slow Newton's method down; half their least gap, or 0."""
    travel, found = _travel(model, data, c), False
    for k in range(c, model.cluster_end[c]):
        data.contact_kin[k, Kin.GAP] = 0.5 * (contact_gap(model, data.pos2, data.rot2, k) - travel)
    a = _radius(model, options, c, model.cluster[c, Cluster.CONTACTS], COUPLED)
    for k in range(c, model.cluster_end[c]):
        if data.contact_kin[k, Kin.GAP] > a:
            data.contact_out[k] = 1
            found = True
    if not found or not a < 1e300:
        return 0.0
    data.inactive[c, Inactive.STIFF] = 1.0
    return a


@kernel
def _radius(model: Model, options: StepOptions, c: int, count: float, e: float) -> float:
    """Half gap a at which so many contacts of a cluster, all as near, have this e."""
    p, h = model.cluster[c], options.h
    n = count * options.kappa / e
    b = 0.5 * n * h * (1.0 + p[Cluster.FRICTION]) * p[Cluster.TURNING]
    return b + sqrt(b * b + n * _mobility(p, h))


@kernel
def contact_gap(model: Model, pos: Matrix, rot: Matrix, c: int) -> float:
    """Gap of contact c, not on terrain, at the poses pos (nbody, 3), rot (nbody, 9)."""
    i, n = model.contact_body[c], model.contact_frame[c]
    x, y, z = rotate(rot, i, *three(model.contact_point[c], 0))
    gap = n[0] * (pos[i, 0] + x) + n[1] * (pos[i, 1] + y) + n[2] * (pos[i, 2] + z)
    return gap - model.contact_height[c] - model.contact_radius[c]


@kernel
def _enlist(model: Model, data: Data, c: int) -> None:
    """Append a cluster to inactive_first, and its active contacts to `active`; contacts that cannot move are in
    neither.
    """
    if model.contact_hold[c] != 0:
        return
    if data.inactive[c, Inactive.ACTIVATION] > 0.0:
        data.inactive_first[data.inactive_count[0]] = c
        data.inactive_count[0] += 1
    n = data.active_ground_count[0]
    for k in range(c, model.cluster_end[c]):
        if data.contact_out[k] == 0:
            data.active[n] = k
            n += 1
    data.active_ground_count[0] = n


@kernel
def _travel(model: Model, data: Data, c: int) -> float:
    """How far the contacts of a cluster moved in the step before, at most."""
    i = model.contact_body[c]
    travel = 0.0
    for k in range(3):
        travel += abs(data.move_in[i, k]) + 2.0 * model.cluster[c, Cluster.ARM] * abs(data.turn_in[i, 1 + k])
    return travel


@kernel
def _half_gap_ahead(model: Model, data: Data, c: int) -> float:
    """Half the gap that a cluster has after one more step like the last one, or less."""
    height = highest(model, c)
    data.inactive[c, Inactive.HEIGHT] = height
    return 0.5 * (cluster_gap(model, data, c, height, False) - _travel(model, data, c))


@kernel
def _mobility(p: Vector, h: float) -> float:
    """(mu^2 + h (1 + mu)) M of a row of `cluster`, and the same of moments (moments/inactive_moments.py)."""
    mu = p[Cluster.FRICTION]
    return (mu * mu + h * (1.0 + mu)) * p[Cluster.MOBILITY] + p[Cluster.SPIN] + h * p[Cluster.SPIN_GROWTH]


@kernel
def _stiffness(model: Model, h: float, c: int, a: float) -> float:
    """e a^2/(n kappa) of a cluster at the gap a, see above."""
    p = model.cluster[c]
    return _mobility(p, h) + h * (1.0 + p[Cluster.FRICTION]) * p[Cluster.TURNING] * a


@optional(Slot.HAS_ACTIVATED, default=False)
def has_activated(model: Model, data: Data, options: StepOptions) -> bool:
    """Whether an inactive cluster, or a far contact, has become active at configuration 3; it is active from now on."""
    found = options.cutoff > 0.0 and has_far_activated(model, data, options)
    for m in range(data.inactive_count[0]):
        if _came_near(model, data, data.inactive_first[m]):
            found = True
    if found:
        enlist_all(model, data)
    return found


@kernel
def _came_near(model: Model, data: Data, c: int) -> bool:
    """Whether contacts of the inactive cluster c have become active at configuration 3; they are from now on."""
    row = data.inactive[c]
    found = False
    if model.cluster[c, Cluster.CORNERS] > 0.0:
        write_cones(model, data, c)
    if row[Inactive.CORNERS] > 0.0 and least_corner_gap(model, data, c) >= row[Inactive.ACTIVATION]:
        return False
    if row[Inactive.STIFF] == 0.0:
        found = cluster_gap(model, data, c, row[Inactive.HEIGHT], True) < row[Inactive.ACTIVATION]
    for k in range(c, model.cluster_end[c]):
        if row[Inactive.STIFF] > 0.0 and data.contact_out[k] == 1:
            if not contact_gap(model, data.pos3, data.rot3, k) < row[Inactive.ACTIVATION]:
                continue
            found = True
            data.contact_out[k] = 0
            data.corners[Corner.OUT, k] = 0.0
        elif found:
            data.contact_out[k] = 0
    if found:
        row[Inactive.LEAST_GAP] = 0.0
        if row[Inactive.STIFF] == 0.0:
            row[Inactive.ACTIVATION] = 0.0
    return found


@kernel
def enlist_all(model: Model, data: Data) -> None:
    """Rebuild `active` and inactive_first."""
    data.active_ground_count[0] = 0
    data.inactive_count[0] = 0
    for c in range(model.contact_height.shape[0]):
        if model.cluster_end[c] > 0:
            _enlist(model, data, c)
    data.active_count[0] = data.active_ground_count[0]
