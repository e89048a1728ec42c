"""The energy balance of a solved step, which distinguishes the solution that continues the motion from others.

A solution is refused if it gains more than a tenth of the kinetic energy, as a part of a divided step a thousandth:

    K23 - K12 - W > max(0.09 K, 0.001 |G|) + |D| + slack
    slack = sum over contacts and limits of gamma max(0, gap3 - gap2)/h + kappa/h

K12, K23: kinetic energies at configurations 2 and 3; K: that of the node at 2; W: work of gravity, springs and inputs
at 2; |G|, |D|: sizes of the work of gravity and of each drive. The energies are computed if constraints did work,

    work = sum over bodies of b.(V + V')/2 - sum over dofs of S2^T (subtree sums of w) (v + v')/2 > 0.009 K12 + noise

b, w: wrenches that the momenta of a body leave over without and with those of contacts; or if bodies turn far.
Derivation: docs/theory/energy_balance.md.
"""

from __future__ import annotations

from sim.contact.pairs.pair_energy import pair_slack
from sim.dynamics.elimination import add_children, dot_six
from sim.dynamics.energy import (
    Arrival,
    arriving_momentum,
    gravity_energy,
    momentum_velocity,
    spatial_inertia,
    unjoined_energy,
)
from sim.dynamics.joints.damper import damper_impulse, node_damping
from sim.dynamics.joints.dry_friction import apply_friction
from sim.dynamics.joints.joint_forces import add_limit_impulse
from sim.dynamics.loops.loop_work import loop_slack
from sim.dynamics.mass_matrix import eliminate_mass, mass_velocities
from sim.dynamics.momentum_balance import world_inertia
from sim.model.data import Data
from sim.model.model import InputKind, Model
from sim.model.options import StepOptions
from sim.model.record_columns import Bound, BoundRow, Cone, Kin
from sim.model.slots import Slot
from sim.solve.residual import residual_scale
from solvers.compiler import kernel, optional
from solvers.dense import clear
from solvers.rotation import cross, rotate
from solvers.types import Vector

# largest gain of an accepted step, of the energies that change in it: with the slack of contacts less than a tenth
LARGEST_GAIN = 0.09
_OF_FALL = 1e-3  # largest gain, of the work of gravity, where there is less kinetic energy
# cosines of half the turns below which there is no such work, without contacts and with them, and above which it tells
# nothing
_NEAR, _NEAR_GROUND, _FAR, _FAR_IN_PART = 0.99719, 0.99999, 0.98877, 0.99875
_TELLING = 0.1  # work, as a share of the largest gain, from which on the energies are computed


@kernel
def least_cosine(data: Data) -> float:
    """Cosine of half the largest turn of a body over the intervals 1-2 and 2-3."""
    c = 1.0
    for i in range(data.turn.shape[0]):
        c = min(c, data.turn_in[i, 0], data.turn[i, 0])
    return c


@kernel
def constraint_work(model: Model, data: Data, h: float, v: Vector) -> float:
    """Work of joints, loops and contacts in the solved step [J]."""
    total = 0.0
    o = data.origin
    for i in range(model.body_parent.shape[0]):
        b, x = data.balance[i], data.pos2[i]
        m = cross(x[0] - o[0], x[1] - o[1], x[2] - o[2], b[0], b[1], b[2])
        for k in range(3):
            total += b[k] * (data.move_in[i, k] + data.move[i, k])
            total += (b[3 + k] - m[k]) * 2.0 * (data.turn_in[i, 1 + k] + data.turn[i, 1 + k])
    total /= h
    for d in range(v.shape[0]):
        total -= dot_six(data.S2[d], data.subtree[model.dof_body[d]]) * (v[d] + data.nu[d])
    return 0.5 * total


@kernel
def least_energy(model: Model, data: Data, h: float, v: Vector) -> float:
    """Kinetic energy of the interval 1-2 without that of rotations: a bound from below, at a fraction of its cost."""
    total = 0.0
    for i in range(model.body_parent.shape[0]):
        x = data.move_in[i]
        total += model.body_mass[i] * (x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    total /= h * h
    for d in range(v.shape[0]):
        total += model.dof_armature[d] * v[d] * v[d]
    return 0.5 * total


@kernel
def smoothing_energy(model: Model, options: StepOptions) -> float:
    """kappa/h of each contact and limit [J]: gamma gap of all on the central path."""
    count = model.contact_body.shape[0] + model.limit_dof.shape[0] + 2 * model.dry_dof.shape[0]
    return options.kappa * count / options.h


@kernel
def noise(model: Model, data: Data, options: StepOptions, v: Vector) -> float:
    """Energy of kappa/h of each contact and limit, and of residuals within the tolerance [J]."""
    speed = 0.0
    for d in range(v.shape[0]):
        speed += 0.5 * abs(v[d] + data.nu[d])
    return smoothing_energy(model, options) + options.tolerance * residual_scale(data) * speed


@kernel
def arriving_energy(model: Model, data: Data, h: float, v: Vector, third: bool, fall: float) -> float:
    """Kinetic energy at configuration 2, or 3, of the bodies that arrive there with mean velocities v [J].

    fall: time for which gravity acts at the node [s]. That of energy.py for h/2, without the impulses of springs there;
    0 where M is singular.
    """
    S = data.S3 if third else data.S2
    o = (data.origin[0], data.origin[1], data.origin[2])
    end = Arrival(data.pos2, data.move_in, data.turn_in, data.node_inertia)
    if third:
        end = Arrival(data.pos3, data.move, data.turn, data.node_inertia)
    world_inertia(model, data.rot3 if third else data.rot2, data.node_inertia)
    arriving_momentum(model, h, end, o, fall, data.node_momentum)
    add_children(model, data.node_momentum)
    for d in range(v.shape[0]):
        data.node_p[d] = dot_six(S[d], data.node_momentum[model.dof_body[d]]) + model.dof_armature[d] * v[d]
        data.node_share[d] = node_damping(model, h, d)
    spatial_inertia(model, data.origin, end.pos, data.node_inertia, data.A1)
    clear(data.node_momentum)
    if not eliminate_mass(model, S, data.A1, data.node_momentum, data.F, data.z, data.node_share, data.node_p):
        return 0.0
    mass_velocities(model, S, data.F, data.z, data.node_share, data.twist, data.z)
    energy = 0.0
    for d in range(v.shape[0]):
        energy += 0.5 * (data.node_p[d] - node_damping(model, h, d) * data.z[d]) * data.z[d]
    return energy


@kernel
def input_work(model: Model, data: Data, j: int, u: float) -> float:
    """Work of the WORLD or BODY input j at configuration 2 [J]."""
    i, w = model.input_index[j], model.input_wrench[j]
    f, t = (w[0], w[1], w[2]), (w[3], w[4], w[5])
    if model.input_kind[j] == InputKind.BODY:
        f, t = rotate(data.rot2, i, f[0], f[1], f[2]), rotate(data.rot2, i, t[0], t[1], t[2])
    total = 0.0
    for k in range(3):
        total += 0.5 * u * f[k] * (data.move_in[i, k] + data.move[i, k])
        total += u * t[k] * (data.turn_in[i, 1 + k] + data.turn[i, 1 + k])
    return total


@kernel
def work_at_node(model: Model, data: Data, h: float, v: Vector, u: Vector) -> tuple[float, float]:
    """Work of gravity, springs, inputs and external wrenches at configuration 2, and its size without gravity [J].

    S2^T (subtree sums of w) is the rest of -I (v' - v) beside springs, inputs, dampers and limits of a coordinate.
    """
    total = -0.5 * (gravity_energy(model, data.move_in) + gravity_energy(model, data.move))
    size = 0.0
    f = data.node_p
    for d in range(v.shape[0]):
        f[d] = dot_six(data.S2[d], data.subtree[model.dof_body[d]]) + model.dof_armature[d] * (data.nu[d] - v[d])
        f[d] += damper_impulse(model, h, d, data.nu[d], v[d])
    for k in range(model.limit_dof.shape[0]):
        add_limit_impulse(model, data, k, -data.bound[k, Bound.IMPULSE], f)
    apply_friction(model, data, f)
    for d in range(v.shape[0]):
        part = 0.5 * f[d] * (v[d] + data.nu[d])
        total, size = total + part, size + abs(part)
    for j in range(u.shape[0]):
        if model.input_kind[j] != InputKind.JOINT:
            part = input_work(model, data, j, u[j])
            total, size = total + part, size + abs(part)
    for i in range(model.body_parent.shape[0]):
        part, f = 0.0, data.carry.external[i]
        for k in range(3):
            part += 0.5 * f[k] * (data.move_in[i, k] + data.move[i, k])
            part += f[3 + k] * (data.turn_in[i, 1 + k] + data.turn[i, 1 + k])
        total, size = total + part, size + abs(part)
    return total, size


@kernel
def contact_slack(model: Model, data: Data, options: StepOptions) -> float:
    """Work that contacts and limits may do on the overlap at the beginning of the step [J], and kappa/h each."""
    total = pair_slack(model, data)
    for m in range(data.active_ground_count[0]):
        c = data.active[m]
        i, k, n = model.contact_body[c], data.contact_kin[c], data.contact_frame[c]
        p = model.contact_point[c]
        x, y, z = rotate(data.rot2, i, p[0], p[1], p[2])
        rise = n[0] * (data.move[i, 0] + k[Kin.POINT] - x)
        rise += n[1] * (data.move[i, 1] + k[Kin.POINT + 1] - y) + n[2] * (data.move[i, 2] + k[Kin.POINT + 2] - z)
        total += data.cone[c, Cone.IMPULSE] * max(0.0, rise)
    for k in range(model.limit_dof.shape[0]):
        d, b = model.limit_dof[k], data.bound_row[k]
        rise = model.limit_sign[k] * options.h * data.nu[d]
        if model.limit_cone[k]:
            rise = (
                b[BoundRow.RATE] * data.nu[d]
                + b[BoundRow.RATE + 1] * data.nu[d + 1]
                + b[BoundRow.RATE + 2] * data.nu[d + 2]
            )
        total += data.bound[k, Bound.IMPULSE] * max(0.0, rise)
    return total / options.h + smoothing_energy(model, options)


@kernel
def damping_loss(model: Model, data: Data, h: float, v: Vector) -> float:
    """Energy that dampers take in the step [J]."""
    total = 0.0
    for d in range(v.shape[0]):
        total += 0.5 * damper_impulse(model, h, d, data.nu[d], v[d]) * (v[d] + data.nu[d])
    return total


@kernel
def step_gained(model: Model, data: Data, options: StepOptions, inputs: tuple[Vector, Vector, Vector]) -> bool:
    """Whether the solved step gained too much energy, or lost it where nothing dissipates.   inputs: (q, v, u)."""
    _, v, u = inputs
    smooth = model.contact_body.shape[0] + model.limit_dof.shape[0] + model.dry_dof.shape[0] == 0
    both = smooth and options.loss < 1e300
    turned = least_cosine(data)
    near = _NEAR if model.contact_body.shape[0] == 0 else _NEAR_GROUND
    if turned > near and model.terrain_size.shape[0] == 0:
        return False
    if turned > (_FAR_IN_PART if options.gain < LARGEST_GAIN else _FAR):
        work = constraint_work(model, data, options.h, v)
        work = abs(work) if both else work
        telling = _TELLING * options.gain
        if not work > telling * least_energy(model, data, options.h, v):
            return False
        before = 0.5 * momentum_velocity(model, data, options.h, data.move_in, data.turn_in, v)
        if not work > telling * before + noise(model, data, options, v):
            return False
    return energies_gained(model, data, options, v, u, both, noise(model, data, options, v))


@optional(Slot.ENERGIES_GAINED, default=True, seldom=True)
def energies_gained(
    model: Model, data: Data, options: StepOptions, v: Vector, u: Vector, both: bool, least: float
) -> bool:
    """The answer of `step_gained` by the energies.

    both: of losses, too;  least: a gain that is noise [J].
    """
    h = options.h
    given, driven = work_at_node(model, data, h, v, u)
    most = unjoined_energy(model, data, h, data.nu) - given
    if not (both or most > driven):
        return False
    falling = 0.5 * abs(gravity_energy(model, data.move_in) + gravity_energy(model, data.move))
    before = arriving_energy(model, data, h, v, False, 0.0)
    if not (both or most - before > _OF_FALL * falling + driven + least):
        return False
    gain = arriving_energy(model, data, h, data.nu, True, 0.0) - before - given
    if both and -gain - damping_loss(model, data, h, v) > options.loss * max(before, falling) + driven + least:
        return not loop_slack(model, data, options) > 0.0
    if not gain > _OF_FALL * falling + driven + least:
        return False
    allowed = options.gain * arriving_energy(model, data, h, v, False, 0.5 * h) + driven
    if not gain > allowed + least:
        return False
    return gain > allowed + loop_slack(model, data, options) + contact_slack(model, data, options)
