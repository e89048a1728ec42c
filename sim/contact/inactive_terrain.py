"""The impulse of an inactive contact on terrain, and the bound of its change (see inactive_impulses.py)."""

from __future__ import annotations

from math import sqrt

from sim.contact.contact_law import contact_impulse, start_contact
from sim.contact.ground_contact import contact_kinematics
from sim.contact.inactive_bounds import NEARER, bound_changes, keep_motion
from sim.contact.moments.inactive_moments import evaluate_moments
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import Cluster, Grid, Inactive, Kin
from sim.model.slots import Slot
from solvers.compiler import optional
from solvers.rotation import cross, put_three, three


@optional(Slot.EVALUATE_ON_TERRAIN)
def evaluate_on_terrain(model: Model, data: Data, h: float, c: int) -> None:
    """The row of `inactive` and the cone variables of an inactive contact at configuration 3.

    Within 0.2 of the lower bound b of its distance: gaps above 0.8 b, |m| <= 1 + 1.2 (1 + slope^2) b H, and frame
    and slip change with the second derivatives H of the ground.
    """
    i = model.contact_body[c]
    p = model.terrain_place[model.contact_terrain[c] - 1]
    row = data.inactive[c]
    keep_motion(data, h, i, row)
    contact_kinematics(model, data, h, c)
    start_contact(model, data, c, data.carry.inactive_kappa[0], row[Inactive.ACTIVATION])
    fn, f1, f2 = contact_impulse(model, data, c)
    k = data.contact_kin[c]
    F = data.contact_frame[c]
    for e in range(3):
        row[Inactive.FORCE + e] = F[e] * fn + F[3 + e] * f1 + F[6 + e] * f2
    put_three(cross(*three(k, Kin.ARM), *three(row, Inactive.FORCE)), Inactive.MOMENT, row)
    row[Inactive.LEAST_GAP] = max(k[Kin.GAP] / p[Grid.SLOPE], row[Inactive.ACTIVATION])
    least = (1.0 - NEARER) * row[Inactive.LEAST_GAP]
    bound_changes(model, data, c, least)
    evaluate_moments(model, data, h, c, least)
    mu = model.contact_friction[c]
    force = data.carry.inactive_kappa[0] / least * (1.0 + mu)
    speed = sqrt(k[Kin.SLIP1] * k[Kin.SLIP1] + k[Kin.SLIP2] * k[Kin.SLIP2])
    x, y, z = three(row, Inactive.ANGULAR)
    turning = sqrt(x * x + y * y + z * z)
    slope, curvature = p[Grid.SLOPE], p[Grid.CURVATURE]
    row[Inactive.BY_GAP] *= 1.0 + (1.0 + NEARER) * slope * slope * row[Inactive.LEAST_GAP] * curvature
    row[Inactive.BY_GAP] += curvature * (row[Inactive.BY_SLIP] * (2.0 * speed + model.contact_radius[c] * turning))
    arm = 1.0 + abs(data.pos2[i, 0] - data.origin[0]) + abs(data.pos2[i, 1] - data.origin[1])
    arm += abs(data.pos2[i, 2] - data.origin[2]) + model.cluster[c, Cluster.ARM] + model.contact_radius[c]
    row[Inactive.BY_GAP] += 2.0 * curvature * arm * force
    moment = model.cluster[c, Cluster.LENGTH] * data.carry.inactive_kappa[0] / least
    row[Inactive.BY_GAP] += 2.0 * curvature * (moment + row[Inactive.BY_RATE] * turning)
    row[Inactive.BY_TURN] = 2.0 * model.cluster[c, Cluster.ARM] * force
