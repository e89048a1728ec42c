"""Restitution: Moreau's impact law on the velocity of the gap, joined to the condition on the gap itself.

A contact whose gap closes, and would be closed at the next configuration if it went on like that, is an impact:

    phi2 < phi1,   2 phi2 - phi1 < 0        then   phi3 - phi2 >= -e (phi2 - phi1),   complementary to its impulse

The mean velocities of the gap over the two intervals stand for those before and after, so the body turns back at most
the way of one step above the ground. It is the usual law, with a floor that impacts raise,

    s = phi3 - floor,   s gamma = kappa,      floor = (1 - e) phi2 + e phi1 of an impact, 0 otherwise

so everything else stays what it is, friction too, and so does a body at rest: it does not come nearer. What comes
slower than max(2 g h, sqrt(kappa / (m h))) is no impact: it would be back within a few steps, or the forces of the
central path would keep it off the ground. With friction and several contacts Newton's law may feed energy in (Kane's
example). Where the impulses of a step did work in all,

    sum of 1/2 (gamma (v_n + v_n') + beta (v_t + v_t')) > 0,     ' before,

its restitutions are halved, all of them, and it is solved again: without restitution they never do.

Columns of bounce:  0 floor, 1 e in this step (0: no impact), 2:8 d(phi1)/d(twist of configuration 1), 8:14 the same
of 2, 14 phi1, 15 phi2, of pairs 16:19 the contact point at 1, 19:22 at 2. Derivatives: restitution_gradient.py.

Scenes without restitution do not compile these kernels.
"""

from __future__ import annotations

from math import sqrt

from sim.contact import contact_jacobian, contact_kinematics
from sim.friction import contact_impulse
from sim.model import Late, Model, Work
from sim.pairs import is_absent, pair_kinematics
from sim.rotation import Vec3, cross
from solvers.jit import kernel
from solvers.late import late

_NOISE = 1e-6  # of the work of all impulses: what counts as none
_LEAST = 0.1  # of the restitution; below, there is none
_NEVER = 1e9  # [m]


@kernel
def look_back(model: Model, work: Work, h: float, configuration: int) -> None:
    """Gaps of the near contacts at an earlier configuration, and their rows; configuration 3 is used up."""
    first = configuration == 1
    pos = work.pos1 if first else work.pos2
    rot = work.rot1 if first else work.rot2
    for i in range(pos.shape[0]):
        for k in range(3):
            work.pos3[i, k] = pos[i, k]
        for k in range(9):
            work.rot3[i, k] = rot[i, k]
    for m in range(work.counts[0]):
        contact_kinematics(model, work, h, work.near[m, 0], work.near[m, 1])
    work.pair_free[0] = 1  # what touched there, whatever it is now
    pair_kinematics(model, work, h)
    work.pair_free[0] = 0
    for m in range(work.counts[2]):
        for c in range(work.near[m, 0], work.near[m, 1]):
            b = work.bounce[c]
            k = work.contact_kin[c]
            b[14 if first else 15] = k[0]
            row = b[2:8] if first else b[8:14]
            if c < model.contact_height.shape[0]:
                contact_jacobian(model, work, h, c)
                for r in range(3):
                    row[r], row[3 + r] = k[18 + r], k[9 + r]
                continue
            F = work.pair_frame[c - model.contact_height.shape[0]]
            o = work.origin
            row[0], row[1], row[2] = F[0], F[1], F[2]
            row[3], row[4], row[5] = cross(F[9] - o[0], F[10] - o[1], F[11] - o[2], F[0], F[1], F[2])
            for r in range(3):
                b[16 + r if first else 19 + r] = F[9 + r]
            if is_absent(work, c - model.contact_height.shape[0]):  # no impact of what was not there
                b[14 if first else 15] = -_NEVER if first else _NEVER


@kernel
def least_closing(model: Model, work: Work, h: float, c: int) -> float:
    """How much a gap closes in a step, at least, in an impact [m]."""
    g = model.gravity
    fall = 4.0 * h * h * (g[0] * g[0] + g[1] * g[1] + g[2] * g[2])
    m = model.body_mass[model.contact_body[c]]
    return h * sqrt(max(fall, work.far_law[0] / (h * m) if m > 0.0 else 0.0))


@kernel
def raise_floors(model: Model, work: Work, h: float, share: float) -> None:
    """Floors of the impacts of this step, with a share of the restitution."""
    for m in range(work.counts[2]):
        for c in range(work.near[m, 0], work.near[m, 1]):
            b = work.bounce[c]
            e = share * model.contact_restitution[c]
            floor = (1.0 - e) * b[15] + e * b[14]
            fast = b[14] - b[15] > least_closing(model, work, h, c)
            impact = e > 0.0 and fast and 2.0 * b[15] < b[14] and floor > 0.0
            b[0] = floor if impact else 0.0
            b[1] = e if impact else 0.0


@late(Late.FIND_IMPACTS)
def find_impacts(model: Model, work: Work, h: float) -> None:
    """Which near contacts are impacts in this step, and their floors."""
    for c in range(work.bounce.shape[0]):
        work.bounce[c, 0] = 0.0
        work.bounce[c, 1] = 0.0
    work.bounce_share[0] = 1.0
    look_back(model, work, h, 1)
    look_back(model, work, h, 2)
    raise_floors(model, work, h, 1.0)


@late(Late.SUBTRACT_FLOORS)
def subtract_floors(model: Model, work: Work) -> None:
    """contact_kin: gaps above the floors."""
    for m in range(work.counts[2]):
        for c in range(work.near[m, 0], work.near[m, 1]):
            work.contact_kin[c, 0] -= work.bounce[c, 0]


@kernel
def earlier_velocity(work: Work, h: float, i: int, x: float, y: float, z: float) -> Vec3:
    """Velocity over the interval 1-2 of the point of body i at (x, y, z) from its centre of mass; 0 for the world."""
    if i < 0:
        return 0.0, 0.0, 0.0
    w = work.turn_in[i]
    q = 2.0 / h
    vx, vy, vz = cross(q * w[1], q * w[2], q * w[3], x, y, z)
    m = work.move_in[i]
    return m[0] / h + vx, m[1] / h + vy, m[2] / h + vz


@kernel
def tangential_work(model: Model, work: Work, h: float, c: int, f1: float, f2: float) -> float:
    """1/2 beta (v_t + v_t')"""
    ground = model.contact_height.shape[0]
    k = work.contact_kin[c]
    a = model.contact_body[c]
    F = work.contact_frame[c] if c < ground else work.pair_frame[c - ground]
    x, y, z = earlier_velocity(work, h, a, k[3], k[4], k[5])
    if c >= ground:
        b = model.coupling_body[model.pair_coupling[c - ground], 1]
        if b >= 0:
            p = work.pos3
            r0, r1, r2 = k[3] + p[a, 0] - p[b, 0], k[4] + p[a, 1] - p[b, 1], k[5] + p[a, 2] - p[b, 2]
            u, v, w = earlier_velocity(work, h, b, r0, r1, r2)
            x, y, z = x - u, y - v, z - w
    t1 = k[1] + F[3] * x + F[4] * y + F[5] * z
    t2 = k[2] + F[6] * x + F[7] * y + F[8] * z
    return 0.5 * (f1 * t1 + f2 * t2)


@late(Late.GAINED_ENERGY, False)
def gained_energy(model: Model, work: Work, h: float) -> bool:
    """Whether there were impacts, and the impulses of the solved step did work; floors are lower then."""
    gain = 0.0
    size = 0.0
    impacts = False
    for m in range(work.counts[2]):
        for c in range(work.near[m, 0], work.near[m, 1]):
            b = work.bounce[c]
            impacts = impacts or b[1] > 0.0
            fn, f1, f2 = contact_impulse(model, work, c)
            gap = work.contact_kin[c, 0] + b[0]
            gain += 0.5 * fn * (gap - b[14]) / h + tangential_work(model, work, h, c, f1, f2)
            size += 0.5 * fn * (abs(gap - b[15]) + abs(b[15] - b[14])) / h
    if not impacts or not gain > _NOISE * size:
        return False
    share = 0.5 * work.bounce_share[0]
    if share < _LEAST:
        share = 0.0
    work.bounce_share[0] = share
    raise_floors(model, work, h, share)
    return True
