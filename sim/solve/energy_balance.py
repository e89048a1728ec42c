"""The energy balance of a solved step, which tells the solution that goes on with the motion from others.

The equations of a step have several solutions. One is reached as the step grows from zero; in others, bodies turn far,
and constraints that do no work along the motion do work along arcs: joints and impulses of contacts wind one another
up, to any energy. No solution is accepted that gains more than a tenth of the kinetic energy,

    K23 - K12 - W > 0.1 max(K12, |G|) + |D| + slack

K12, K23: p.M^-1 p/2 of the momentum p with which the bodies arrive at configurations 2 and 3. W: work of gravity,
springs and inputs at 2, at the mean of the velocities of both intervals. |G|: that of gravity, |D|: that of what drives
the bodies, the sum of its parts, each input and spring; where contacts make velocities jump against them, as a foot
does that is set down, their work is known to its size only. Dampers and friction lose. Contacts and limits may give

    slack = sum over contacts and limits of gamma max(0, gap3 - gap2)/h + kappa/h

that of those that throw out what overlapped where the step began; others have gap2 >= 0 and gamma gap3 = kappa. Loops
may give what closes them, where they were open.

These energies cost a factorisation of the mass matrix each. They are asked for where constraints did work,

    work = sum over bodies of b.(V + V')/2  -  sum over dofs of S2^T (subtree sums of w) (v + v')/2  >  0.1 K12 + noise

b, w the wrenches that the momenta of a body leave over without and with those of contacts: what is left when springs,
dampers, inputs and limits are taken away is the work of joints, loops and contacts, and none of third order in a motion
that time steps can follow. It is that of mean velocities, so they are asked for in every step, too, in which a body
turns so far that its sine says little. Nothing is asked for where the ground is flat and no body turns by .15 rad, with
contacts by .05 rad: of the motions of benchmarks/attacks.py, none that is accepted in this way gains a tenth.
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
)
from sim.dynamics.joints.terms import add_limit_impulse
from sim.dynamics.loops.loop_work import loop_slack
from sim.dynamics.mass import eliminate_mass
from sim.dynamics.momentum_balance import world_inertia
from sim.model.columns import Bound, BoundRow, Cone, Kin
from sim.model.data import Work
from sim.model.model import InputKind, Model
from sim.model.options import Options
from sim.solve.residual import residual_scale
from solvers.compiler import kernel
from solvers.dense import clear
from solvers.rotation import cross, rotate
from solvers.types import Vector

LARGEST_GAIN = 0.1  # of the energies that change in a step: largest gain of an accepted step
# cosines of half the turns below which there is no such work, without contacts and with them, and above which it says
# nothing
_NEAR, _NEAR_GROUND, _FAR = 0.99719, 0.99969, 0.825


@kernel
def least_cosine(work: Work) -> float:
    """Cosine of half the largest turn of a body over the intervals 1-2 and 2-3."""
    c = 1.0
    for i in range(work.turn.shape[0]):
        c = min(c, work.turn_in[i, 0], work.turn[i, 0])
    return c


@kernel
def constraint_work(model: Model, work: Work, h: float, v: Vector) -> float:
    """Work of joints, loops and contacts in the solved step [J]."""
    total = 0.0
    o = work.origin
    for i in range(model.body_parent.shape[0]):
        b, x = work.balance[i], work.pos2[i]
        m = cross(x[0] - o[0], x[1] - o[1], x[2] - o[2], b[0], b[1], b[2])
        for k in range(3):
            total += b[k] * (work.move_in[i, k] + work.move[i, k])
            total += (b[3 + k] - m[k]) * 2.0 * (work.turn_in[i, 1 + k] + work.turn[i, 1 + k])
    total /= h
    for d in range(v.shape[0]):
        total -= dot_six(work.S2[d], work.subtree[model.dof_body[d]]) * (v[d] + work.nu[d])
    return 0.5 * total


@kernel
def smoothing_energy(model: Model, options: Options) -> float:
    """kappa/h of each contact and limit [J]: gamma gap of all on the central path."""
    return options.kappa * (model.contact_body.shape[0] + model.limit_dof.shape[0]) / options.h


@kernel
def noise(model: Model, work: Work, options: Options, v: Vector) -> float:
    """Energy of kappa/h of each contact and limit, and of residuals within the tolerance [J]."""
    speed = 0.0
    for d in range(v.shape[0]):
        speed += 0.5 * abs(v[d] + work.nu[d])
    return smoothing_energy(model, options) + options.tolerance * residual_scale(work) * speed


@kernel
def arriving_energy(model: Model, work: Work, h: float, v: Vector, third: bool) -> float:
    """p.M^-1 p/2 of the bodies that arrive at configuration 2, or 3, with mean velocities v; 0 where M is singular."""
    S = work.S3 if third else work.S2
    o = (work.origin[0], work.origin[1], work.origin[2])
    end = Arrival(work.pos2, work.move_in, work.turn_in, work.node_inertia)
    if third:
        end = Arrival(work.pos3, work.move, work.turn, work.node_inertia)
    world_inertia(model, work.rot3 if third else work.rot2, work.node_inertia)
    arriving_momentum(model, h, end, o, 0.0, work.node_momentum)
    add_children(model, work.node_momentum)
    for d in range(v.shape[0]):
        work.node_p[d] = dot_six(S[d], work.node_momentum[model.dof_body[d]]) + model.dof_armature[d] * v[d]
    spatial_inertia(model, work.origin, end.pos, work.node_inertia, work.A1)
    clear(work.node_momentum)
    if not eliminate_mass(model, S, work.A1, work.node_momentum, work.F, work.z, work.node_share, work.node_p):
        return 0.0
    energy = 0.0
    for d in range(v.shape[0]):
        energy += 0.5 * work.z[d] * work.z[d] / work.node_share[d]
    return energy


@kernel
def input_work(model: Model, work: Work, j: int, u: float) -> float:
    """Work of the WORLD or BODY input j at configuration 2 [J]."""
    i, w = model.input_index[j], model.input_wrench[j]
    f, t = (w[0], w[1], w[2]), (w[3], w[4], w[5])
    if model.input_kind[j] == InputKind.BODY:
        f, t = rotate(work.rot2, i, f[0], f[1], f[2]), rotate(work.rot2, i, t[0], t[1], t[2])
    total = 0.0
    for k in range(3):
        total += 0.5 * u * f[k] * (work.move_in[i, k] + work.move[i, k])
        total += u * t[k] * (work.turn_in[i, 1 + k] + work.turn[i, 1 + k])
    return total


@kernel
def work_at_node(model: Model, work: Work, h: float, v: Vector, u: Vector) -> tuple[float, float]:
    """Work of gravity, springs, inputs and external wrenches at configuration 2, and its size without gravity [J].

    S2^T (subtree sums of w) is what springs, inputs, dampers and limits of a coordinate leave of -I (v' - v).
    """
    total = -0.5 * (gravity_energy(model, work.move_in) + gravity_energy(model, work.move))
    size = 0.0
    f = work.node_p
    for d in range(v.shape[0]):
        f[d] = dot_six(work.S2[d], work.subtree[model.dof_body[d]]) + model.dof_armature[d] * (work.nu[d] - v[d])
        f[d] += h * model.dof_damper[d] * work.nu[d]
    for k in range(model.limit_dof.shape[0]):
        add_limit_impulse(model, work, k, -work.bound[k, Bound.IMPULSE], f)
    for d in range(v.shape[0]):
        part = 0.5 * f[d] * (v[d] + work.nu[d])
        total, size = total + part, size + abs(part)
    for j in range(u.shape[0]):
        if model.input_kind[j] != InputKind.JOINT:
            part = input_work(model, work, j, u[j])
            total, size = total + part, size + abs(part)
    for i in range(model.body_parent.shape[0]):
        part, f = 0.0, work.external[i]
        for k in range(3):
            part += 0.5 * f[k] * (work.move_in[i, k] + work.move[i, k])
            part += f[3 + k] * (work.turn_in[i, 1 + k] + work.turn[i, 1 + k])
        total, size = total + part, size + abs(part)
    return total, size


@kernel
def contact_slack(model: Model, work: Work, options: Options) -> float:
    """What contacts and limits may give to what overlapped where the step began [J], and kappa/h each."""
    total = pair_slack(model, work)
    for m in range(work.active_ground_count[0]):
        c = work.active[m]
        i, k, n = model.contact_body[c], work.contact_kin[c], work.contact_frame[c]
        p = model.contact_point[c]
        x, y, z = rotate(work.rot2, i, p[0], p[1], p[2])
        rise = n[0] * (work.move[i, 0] + k[Kin.POINT] - x)
        rise += n[1] * (work.move[i, 1] + k[Kin.POINT + 1] - y) + n[2] * (work.move[i, 2] + k[Kin.POINT + 2] - z)
        total += work.cone[c, Cone.IMPULSE] * max(0.0, rise)
    for k in range(model.limit_dof.shape[0]):
        d, b = model.limit_dof[k], work.bound_row[k]
        rise = model.limit_sign[k] * options.h * work.nu[d]
        if model.limit_cone[k]:
            rise = (
                b[BoundRow.RATE] * work.nu[d]
                + b[BoundRow.RATE + 1] * work.nu[d + 1]
                + b[BoundRow.RATE + 2] * work.nu[d + 2]
            )
        total += work.bound[k, Bound.IMPULSE] * max(0.0, rise)
    return total / options.h + smoothing_energy(model, options)


@kernel
def step_gained(model: Model, work: Work, options: Options, inputs: tuple[Vector, Vector, Vector]) -> bool:
    """Whether the solved step gained energy.   inputs: (q, v, u)."""
    _, v, u = inputs
    turned = least_cosine(work)
    near = _NEAR if model.contact_body.shape[0] == 0 else _NEAR_GROUND
    if turned > near and model.terrain_size.shape[0] == 0:
        return False
    h, least = options.h, noise(model, work, options, v)
    if turned > _FAR:
        before = 0.5 * momentum_velocity(model, work, h, work.move_in, work.turn_in, v)
        if not constraint_work(model, work, h, v) > LARGEST_GAIN * before + least:
            return False
    given, driven = work_at_node(model, work, h, v, u)
    falling = 0.5 * abs(gravity_energy(model, work.move_in) + gravity_energy(model, work.move))
    before = arriving_energy(model, work, h, v, False)
    gain = arriving_energy(model, work, h, work.nu, True) - before - given
    allowed = LARGEST_GAIN * max(before, falling) + driven
    if not gain > allowed + least:
        return False
    return gain > allowed + loop_slack(model, work, options) + contact_slack(model, work, options)
