"""The impulse of a far contact on terrain, and how much it may change: inactive_impulses.py where frames turn."""

from __future__ import annotations

from math import sqrt

from sim.contact.contact_law import contact_impulse, start_contact
from sim.contact.ground_contact import contact_kinematics
from sim.contact.inactive_bounds import NEARER, bound_changes, keep_motion
from sim.model.data import Work
from sim.model.model import Model
from sim.model.slots import Slot
from solvers.compiler import optional
from solvers.rotation import cross


@optional(Slot.EVALUATE_ON_TERRAIN)
def evaluate_on_terrain(model: Model, work: Work, h: float, c: int) -> None:
    """far[c, 1:4], far[c, 4:24] and the cone variables of a far contact at configuration 3.

    Within 0.2 of the lower bound b of its distance: gaps above 0.8 b, |m| <= 1 + 1.2 (1 + slope^2) b H, and frame
    and slip change with the second derivatives H of the ground.
    """
    i = model.contact_body[c]
    p = model.terrain_place[model.contact_terrain[c] - 1]
    row = work.far[c]
    keep_motion(work, h, i, row)
    contact_kinematics(model, work, h, c, c + 1)
    start_contact(model, work, c, work.far_law[0], row[0])
    fn, f1, f2 = contact_impulse(model, work, c)
    k = work.contact_kin[c]
    F = work.contact_frame[c]
    for e in range(3):
        row[17 + e] = F[e] * fn + F[3 + e] * f1 + F[6 + e] * f2
    row[20], row[21], row[22] = cross(k[3], k[4], k[5], row[17], row[18], row[19])
    row[23] = max(k[0] / p[6], row[0])
    least = (1.0 - NEARER) * row[23]
    bound_changes(model, work, c, least)
    mu = model.contact_friction[c]
    force = work.far_law[0] / least * (1.0 + mu)
    speed = sqrt(k[1] * k[1] + k[2] * k[2])
    turning = sqrt(row[14] * row[14] + row[15] * row[15] + row[16] * row[16])
    row[1] *= 1.0 + (1.0 + NEARER) * p[6] * p[6] * row[23] * p[7]
    row[1] += p[7] * (row[2] * (2.0 * speed + model.contact_radius[c] * turning))
    arm = 1.0 + abs(work.pos2[i, 0] - work.origin[0]) + abs(work.pos2[i, 1] - work.origin[1])
    arm += abs(work.pos2[i, 2] - work.origin[2]) + model.cluster[c, 4] + model.contact_radius[c]
    row[1] += 2.0 * p[7] * arm * force
    row[3] = 2.0 * model.cluster[c, 4] * force
