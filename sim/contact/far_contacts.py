"""Far contacts with the ground, beyond the `cutoff` of a simulator: their impulses are given for the whole step.

On the central path every contact pushes with kappa/gap, however far away it is. A contact is far if its stiffness,
relative to the mass m of its body, is at most the cutoff at the gap that the motion of the step before leads to:

    e = n kappa (mu^2 + h (1 + mu))/(m gap^2) <= cutoff,      n: contacts of the body

Its impulse is that of its law at the pose and velocity to which this motion leads, and derivatives omit it: the matrix
of the step lacks at most e (1 + m W^2) of the inertia, W as in inactive.py. A far contact that ends the step nearer
than half the gap of e = cutoff takes part after all. Contacts on terrain, those of meshes, and those with torsional or
rolling friction are never far.
Derivation: docs/theory/inactive_contacts.md.
"""

from __future__ import annotations

from math import sqrt

from sim.contact.contact_law import contact_impulse, start_contact
from sim.contact.ground_contact import add_contact_wrench
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import StepOptions
from sim.model.record_columns import Cluster, Kin
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.rotation import Mat3, Vec3, cross, quat_matrix, rotate, three, times

FAR = 2  # contact_out of a far contact
_NEAR = 0.5  # share of the gap of e = cutoff below which a far contact takes part


@kernel
def far_gap(model: Model, options: StepOptions, c: int) -> float:
    """Gap at which the contacts of cluster c have e = cutoff, infinite for bodies without mass and for contacts with
    torsional or rolling friction.
    """
    i, mu = model.contact_body[c], model.cluster[c, Cluster.FRICTION]
    if not model.body_mass[i] > 0.0 or model.cluster[c, Cluster.LENGTH] > 0.0:
        return 1e300
    stiffness = model.cluster[c, Cluster.CONTACTS] * options.kappa * (mu * mu + options.h * (1.0 + mu))
    return sqrt(stiffness / (options.cutoff * model.body_mass[i]))


@kernel
def _look_ahead(model: Model, data: Data, c: int, turn: Mat3, move: Vec3, rates: tuple[Vec3, Vec3]) -> None:
    """Gap, slip and arm of contact c after one more step like the one before.

    turn, move: of its body in that step;  rates: move/h, and 2/h times the vector of the quaternion of that turn.
    """
    i, k, f = model.contact_body[c], data.contact_kin[c], data.contact_frame[c]
    rho = model.contact_radius[c]
    px, py, pz = times(turn, *rotate(data.rot2, i, *three(model.contact_point[c], 0)))
    x, y, z = px - rho * f[0], py - rho * f[1], pz - rho * f[2]
    (mx, my, mz), (ox, oy, oz) = rates
    vx, vy, vz = cross(ox, oy, oz, x, y, z)
    vx, vy, vz = vx + mx, vy + my, vz + mz
    X, Y, Z = data.pos2[i, 0] + move[0] + x, data.pos2[i, 1] + move[1] + y, data.pos2[i, 2] + move[2] + z
    k[Kin.GAP] = f[0] * X + f[1] * Y + f[2] * Z - model.contact_height[c]
    k[Kin.SLIP1] = f[3] * vx + f[4] * vy + f[5] * vz
    k[Kin.SLIP2] = f[6] * vx + f[7] * vy + f[8] * vz
    k[Kin.ARM], k[Kin.ARM + 1], k[Kin.ARM + 2] = x, y, z


@optional(Slot.CHOOSE_FAR)
def choose_far(model: Model, data: Data, options: StepOptions, c: int) -> None:
    """contact_out, cone variables and wrenches of the far contacts of cluster c, which is not on terrain."""
    if model.contact_hold[c] != 0:
        return
    i, h, least = model.contact_body[c], options.h, far_gap(model, options, c)
    w, x, y, z = data.turn_in[i, 0], data.turn_in[i, 1], data.turn_in[i, 2], data.turn_in[i, 3]
    turn, move = quat_matrix(w, x, y, z), three(data.move_in[i], 0)
    rates = (move[0] / h, move[1] / h, move[2] / h), (2.0 / h * x, 2.0 / h * y, 2.0 / h * z)
    for k in range(c, model.cluster_end[c]):
        _look_ahead(model, data, k, turn, move, rates)
        if data.contact_kin[k, Kin.GAP] > least:
            data.contact_out[k] = FAR
            start_contact(model, data, k, options.kappa, least)
            fn, f1, f2 = contact_impulse(model, data, k)
            add_contact_wrench(model, data, k, fn, f1, f2, data.far_wrench)


@optional(Slot.ADD_FAR_WRENCHES)
def add_far_wrenches(model: Model, data: Data) -> None:
    """wrench += far_wrench, which has the impulses of the far contacts about O, with a minus sign."""
    for i in range(data.wrench.shape[0]):
        for k in range(6):
            data.wrench[i, k] += data.far_wrench[i, k]


@optional(Slot.HAS_FAR_ACTIVATED, default=False)
def has_far_activated(model: Model, data: Data, options: StepOptions) -> bool:
    """Whether a far contact has come near at configuration 3; it is active from now on."""
    found, n = False, 0.0
    for c in range(model.contact_height.shape[0]):
        if model.cluster_end[c] > 0:
            n = _NEAR * far_gap(model, options, c)
        if data.contact_out[c] != FAR:
            continue
        i, f = model.contact_body[c], model.contact_frame[c]
        x, y, z = rotate(data.rot3, i, *three(model.contact_point[c], 0))
        gap = f[0] * (data.pos3[i, 0] + x) + f[1] * (data.pos3[i, 1] + y) + f[2] * (data.pos3[i, 2] + z)
        if not gap - model.contact_height[c] - model.contact_radius[c] > n:
            found = True
            data.contact_out[c] = 0
            fn, f1, f2 = contact_impulse(model, data, c)
            add_contact_wrench(model, data, c, -fn, -f1, -f2, data.far_wrench)
    return found
