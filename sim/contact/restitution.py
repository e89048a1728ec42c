"""Restitution: Moreau's impact law on the velocity of the gap, joined to the condition on the gap itself.

    phi2 < phi1,   2 phi2 - phi1 < 0        then   phi3 - phi2 >= -e (phi2 - phi1),   complementary to its impulse

as a floor that such impacts raise, unless they are slower than max(2 g h, sqrt(kappa / (m h))):

    s = phi3 - floor,   s gamma = kappa,      floor = (1 - e) phi2 + e phi1 of an impact, 0 otherwise

Restitutions are lowered by the same part as long as the impulses f of the step do work in all,

    sum of 1/2 f.(u + u') > 0,     u, u' the relative velocities of the two bodies where f acts, after and before;

moments of torsional and rolling friction likewise, with angular velocities.

Derivation: docs/theory/restitution.md; derivatives: restitution_gradient.py.

Scenes without restitution do not compile these kernels.
"""

from __future__ import annotations

from math import sqrt

from sim.contact.contact_law import contact_impulse
from sim.contact.ground_contact import contact_jacobian, contact_kinematics
from sim.contact.moments.contact_moments import moment_work
from sim.contact.pairs.pair_contact import gap_normal, is_absent, pair_arm, pair_force, pair_kinematics
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import FeatureChoice
from sim.model.record_columns import Bounce, Kin, PairFrame
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.rotation import Vec3, cross, transposed_times

_NOISE = 1e-6  # of the work of all impulses: threshold for zero
_FINEST = 2.0**-12  # part by which restitutions are lowered at least, where they are
_NEVER = 1e9  # [m]


@kernel
def look_back(model: Model, data: Data, h: float, configuration: int) -> None:
    """Gaps of the active contacts at an earlier configuration, and their rows; configuration 3 is used up."""
    first = configuration == 1
    pos = data.pos1 if first else data.pos2
    rot = data.rot1 if first else data.rot2
    for i in range(pos.shape[0]):
        for k in range(3):
            data.pos3[i, k] = pos[i, k]
        for k in range(9):
            data.rot3[i, k] = rot[i, k]
    for m in range(data.active_ground_count[0]):
        contact_kinematics(model, data, h, data.active[m])
    data.feature_choice[0] = FeatureChoice.EVERY_POSE  # features that touched there, active now or not
    pair_kinematics(model, data, h)
    data.feature_choice[0] = FeatureChoice.ONCE
    for m in range(data.active_count[0]):
        c = data.active[m]
        b = data.bounce[c]
        k = data.contact_kin[c]
        b[Bounce.GAP1 if first else Bounce.GAP2] = k[Kin.GAP]
        row = b[Bounce.ROW1 : Bounce.ROW2] if first else b[Bounce.ROW2 : Bounce.GAP1]
        if c < model.contact_height.shape[0]:
            contact_jacobian(model, data, h, c)
            for r in range(3):
                row[r], row[3 + r] = k[Kin.BY_TRANSLATION + r], k[Kin.BY_ROTATION + r]
            continue
        F = data.pair_frame[c - model.contact_height.shape[0]]
        o = data.origin
        n = gap_normal(model, data, c - model.contact_height.shape[0])
        row[0], row[1], row[2] = n
        row[3], row[4], row[5] = cross(
            F[PairFrame.POINT] - o[0], F[PairFrame.POINT + 1] - o[1], F[PairFrame.POINT + 2] - o[2], n[0], n[1], n[2]
        )
        for r in range(3):
            b[(Bounce.POINT1 if first else Bounce.POINT2) + r] = F[PairFrame.POINT + r]
        if is_absent(data, c - model.contact_height.shape[0]):  # absent contacts have no impact
            b[Bounce.GAP1 if first else Bounce.GAP2] = -_NEVER if first else _NEVER


@kernel
def least_closing(model: Model, data: Data, h: float, c: int) -> float:
    """How much a gap closes in a step, at least, in an impact [m]."""
    g = model.gravity
    fall = 4.0 * h * h * (g[0] * g[0] + g[1] * g[1] + g[2] * g[2])
    m = model.body_mass[model.contact_body[c]]
    return h * sqrt(max(fall, data.carry.inactive_kappa[0] / (h * m) if m > 0.0 else 0.0))


@kernel
def raise_floors(model: Model, data: Data, h: float, remaining: float) -> None:
    """Floors of the impacts of this step, with a fraction of the restitution."""
    for m in range(data.active_count[0]):
        c = data.active[m]
        b = data.bounce[c]
        e = remaining * model.contact_restitution[c]
        floor = (1.0 - e) * b[Bounce.GAP2] + e * b[Bounce.GAP1]
        fast = b[Bounce.GAP1] - b[Bounce.GAP2] > least_closing(model, data, h, c)
        impact = e > 0.0 and fast and 2.0 * b[Bounce.GAP2] < b[Bounce.GAP1] and floor > 0.0
        b[Bounce.FLOOR] = floor if impact else 0.0
        b[Bounce.RESTITUTION] = e if impact else 0.0


@optional(Slot.FIND_IMPACTS)
def find_impacts(model: Model, data: Data, h: float) -> None:
    """Which active contacts are impacts in this step, and their floors."""
    for c in range(data.bounce.shape[0]):
        data.bounce[c, Bounce.FLOOR] = 0.0
        data.bounce[c, Bounce.RESTITUTION] = 0.0
    data.rebound_part[0] = 1.0
    look_back(model, data, h, 1)
    look_back(model, data, h, 2)
    raise_floors(model, data, h, 1.0)


@optional(Slot.SUBTRACT_FLOORS)
def subtract_floors(model: Model, data: Data) -> None:
    """contact_kin: gaps above the floors."""
    for m in range(data.active_count[0]):
        c = data.active[m]
        data.contact_kin[c, Kin.GAP] -= data.bounce[c, Bounce.FLOOR]


@kernel
def velocity_sum(data: Data, h: float, i: int, x: float, y: float, z: float) -> Vec3:
    """Velocity of the point (x, y, z) of body i at configuration 2 over the interval 1-2, plus that over 2-3; 0 for the
    world.
    """
    if i < 0:
        return 0.0, 0.0, 0.0
    before, after = data.turn_in[i], data.turn[i]
    m, n, o = data.move_in[i], data.move[i], data.pos2[i]
    wx, wy, wz = before[1] + after[1], before[2] + after[2], before[3] + after[3]
    vx, vy, vz = cross(wx, wy, wz, x - o[0], y - o[1], z - o[2])
    return (m[0] + n[0] + 2.0 * vx) / h, (m[1] + n[1] + 2.0 * vy) / h, (m[2] + n[2] + 2.0 * vz) / h


@kernel
def impulse_work(model: Model, data: Data, h: float, c: int) -> float:
    """1/2 f.(u + u') of contact c at the point P where its impulse f acts, at configuration 2."""
    ground = model.contact_height.shape[0]
    a = model.contact_body[c]
    fn, f1, f2 = contact_impulse(model, data, c)
    if c < ground:
        k = data.contact_kin[c]
        p = data.pos2[a]
        x, y, z = velocity_sum(data, h, a, p[0] + k[Kin.ARM], p[1] + k[Kin.ARM + 1], p[2] + k[Kin.ARM + 2])
        fx, fy, fz = transposed_times(data.contact_frame[c], fn, f1, f2)
        return 0.5 * (fx * x + fy * y + fz * z)
    if is_absent(data, c - ground):
        return 0.0
    o = data.origin
    rx, ry, rz = pair_arm(model, data, c - ground)
    x, y, z = velocity_sum(data, h, a, o[0] + rx, o[1] + ry, o[2] + rz)
    b = model.coupling_body[model.pair_coupling[c - ground], 1]
    u, v, w = velocity_sum(data, h, b, o[0] + rx, o[1] + ry, o[2] + rz)
    fx, fy, fz = pair_force(data, c - ground, fn, f1, f2)
    return 0.5 * (fx * (x - u) + fy * (y - v) + fz * (z - w))


@optional(Slot.IMPACTS_GAINED, default=False)
def impacts_gained(model: Model, data: Data, h: float) -> bool:
    """Whether there were impacts, and the impulses of the solved step did work; floors are lower then.

    Lowering all rebounds by a part r takes some r/2 sum of gamma e |v_n'|. Parts are powers of 1/2: between them the
    step stays a smooth function of its start, with the derivatives of restitution_gradient.py.
    """
    gain = 0.0
    size = 0.0
    rebound = 0.0
    for m in range(data.active_count[0]):
        c = data.active[m]
        b = data.bounce[c]
        fn, _, _ = contact_impulse(model, data, c)
        gain += impulse_work(model, data, h, c) + moment_work(model, data, h, c)
        gap = data.contact_kin[c, Kin.GAP] + b[Bounce.FLOOR]
        size += 0.5 * fn * (abs(gap - b[Bounce.GAP2]) + abs(b[Bounce.GAP2] - b[Bounce.GAP1])) / h
        rebound += 0.5 * fn * b[Bounce.RESTITUTION] * abs(b[Bounce.GAP2] - b[Bounce.GAP1]) / h
    if not rebound > 0.0 or not gain > _NOISE * size:
        return False
    least = max(gain / rebound, 2.0 * (1.0 - data.rebound_part[0]))
    lost = _FINEST
    while lost < least:
        lost *= 2.0
    remaining = max(1.0 - lost, 0.0)
    data.rebound_part[0] = remaining
    raise_floors(model, data, h, remaining)
    return True
